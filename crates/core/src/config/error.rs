//! Errors of machine files and parameters, with position, key, value found and allowed range.

use std::fmt;
use std::sync::Arc;

use thiserror::Error;

use crate::text::shortened;

/// Origin of a value; error messages begin with it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ValueSource {
    /// Parameter file.
    File {
        /// Path as given by the user.
        name: Arc<str>,
        /// Line, from 1.
        line: Option<u64>,
    },
    /// Any other origin, such as a command line option or a service call.
    Named(Arc<str>),
}

impl ValueSource {
    /// Returns the source for a whole file.
    pub fn file(name: &str) -> Self {
        Self::File { name: name.into(), line: None }
    }

    /// Returns the source for a command line option or a service, by its name.
    pub fn named(name: &str) -> Self {
        Self::Named(name.into())
    }

    /// Returns the source with its line set to `line`, or to none if `line` is 0. Only files have lines.
    pub fn at_line(&self, line: u64) -> Self {
        match self {
            Self::File { name, .. } => {
                Self::File { name: Arc::clone(name), line: (line > 0).then_some(line) }
            }
            Self::Named(_) => self.clone(),
        }
    }

    /// Returns the source without its line.
    pub(super) fn whole(&self) -> Self {
        self.at_line(0)
    }
}

impl fmt::Display for ValueSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File { name, line: Some(line) } => write!(f, "{name}:{line}"),
            Self::File { name, line: None } => f.write_str(name),
            Self::Named(name) => f.write_str(name),
        }
    }
}

/// Rejection of a machine file or a parameter: position, key, value found and allowed values, in one line.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{text}")]
pub struct ConfigError {
    text: String,
    /// True for a missing parameter.
    pub(super) is_missing: bool,
}

impl ConfigError {
    pub(super) fn new(text: impl fmt::Display) -> Self {
        ConfigError { text: text.to_string(), is_missing: false }
    }

    /// Returns an error at a position.
    pub(super) fn at(at: &ValueSource, reason: impl fmt::Display) -> Self {
        Self::new(format_args!("{at}: {reason}"))
    }

    /// Returns the error about a value out of range, not among the choices, or inconsistent with another parameter;
    /// `allowed` follows "must".
    pub(super) fn not_allowed(at: &ValueSource, key: &str, value: &str, allowed: &str) -> Self {
        Self::at(at, format_args!("{} = {value}: must {allowed}", shortened(key)))
    }

    /// Returns the error about a value of another type.
    pub(super) fn wrong_type(at: &ValueSource, key: &str, found: &str, wanted: &str) -> Self {
        let hint = number_hint(found, wanted, at);
        Self::at(at, format_args!("{}: found {found}, expected {wanted}{hint}", shortened(key)))
    }

    /// Returns the error about a parameter that a joint does not have.
    pub(super) fn not_applicable(at: &ValueSource, key: &str, reason: &str) -> Self {
        Self::at(at, format_args!("{} does not apply: {reason}", shortened(key)))
    }

    /// Returns the error about a missing parameter.
    pub(super) fn missing(at: &ValueSource, key: &str, wanted: &str) -> Self {
        ConfigError { is_missing: true, ..Self::at(at, format_args!("{key} is missing: {wanted}")) }
    }

    /// Returns the error about an assignment without `=`.
    pub(super) fn not_an_assignment(at: &ValueSource, text: &str) -> Self {
        let hint = if is_number(text) { DECIMAL_POINT } else { "" };
        Self::at(at, format_args!("expected KEY=VALUE, found {}{hint}", shortened(text)))
    }

    /// Returns the error with `hint` at its end.
    pub(super) fn with_hint(self, hint: &str) -> Self {
        ConfigError { text: self.text + hint, ..self }
    }
}

/// Remedy for decimals after a comma.
const DECIMAL_POINT: &str = "; the decimal separator is a point";

/// Returns the remedy for a text in place of a number: several parameters in one option, or a decimal comma.
fn number_hint(found: &str, wanted: &str, at: &ValueSource) -> String {
    let text = found.trim_start_matches("text ").trim_matches('"');
    match text.split_once(',') {
        Some((_, rest)) if wanted == "number" && rest.contains('=') => {
            format!("; repeat {at} for each parameter")
        }
        Some((whole, decimals)) if wanted == "number" && is_number(whole) && is_number(decimals) => {
            DECIMAL_POINT.to_owned()
        }
        _ => String::new(),
    }
}

fn is_number(text: &str) -> bool {
    text.trim().parse::<f64>().is_ok()
}
