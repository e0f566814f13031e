//! Errors of machine files and parameters, with position, key, value found and allowed range.

use std::fmt;
use std::sync::Arc;

use thiserror::Error;

use crate::text::nearest_hint;

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

/// Rejection of a machine file or a parameter. The text is one line.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum ConfigError {
    /// Unreadable file, or a file that is not UTF-8 text.
    #[error("{path}: cannot be read: {reason}")]
    Unreadable {
        /// Path as given by the user.
        path: String,
        /// Error of the operating system.
        reason: String,
    },
    /// Name of no built-in machine.
    #[error("unknown machine {name}{}; built-in machines: {known}", nearest_hint(.nearest))]
    UnknownMachine {
        /// Requested name.
        name: String,
        /// Most similar built-in machine.
        nearest: Option<String>,
        /// Names of the built-in machines, separated by commas.
        known: String,
    },
    /// Invalid YAML, or a duplicate key in a mapping.
    #[error("{at}: invalid YAML: {reason}")]
    Syntax {
        /// Position.
        at: ValueSource,
        /// Error of the YAML reader.
        reason: String,
    },
    /// Valid YAML, but not a ROS 2 parameter file.
    #[error("{at}: not a ROS 2 parameter file: {reason}")]
    NotAParameterFile {
        /// Position.
        at: ValueSource,
        /// Reason.
        reason: String,
    },
    /// Assignment without `=`.
    #[error("{at}: expected KEY=VALUE, found {text}{}", part_hint(.text))]
    NotAnAssignment {
        /// Position.
        at: ValueSource,
        /// Text found.
        text: String,
    },
    /// Parameter that a section sets twice, nested and flat.
    #[error("{at}: duplicate parameter {key}, first set at {first}")]
    Duplicate {
        /// Position of the second value.
        at: ValueSource,
        /// Full key.
        key: String,
        /// Position of the first value.
        first: ValueSource,
    },
    /// Unknown parameter.
    #[error("{at}: unknown parameter {key}{}", nearest_hint(.nearest))]
    UnknownKey {
        /// Position.
        at: ValueSource,
        /// Key found.
        key: String,
        /// Most similar known key.
        nearest: Option<String>,
    },
    /// Parameter that this joint does not have.
    #[error("{at}: {key} does not apply: {reason}")]
    NotApplicable {
        /// Position.
        at: ValueSource,
        /// Full key.
        key: String,
        /// Reason, with the values that decide it.
        reason: String,
    },
    /// Missing required parameter.
    #[error("{at}: {key} is missing: {wanted}")]
    Missing {
        /// Origin of the parameters.
        at: ValueSource,
        /// Full key.
        key: String,
        /// Description and range.
        wanted: String,
    },
    /// Value of the wrong type.
    #[error("{at}: {key}: found {found}, expected {wanted}{}", number_hint(.found, .wanted, .at))]
    WrongType {
        /// Position.
        at: ValueSource,
        /// Full key.
        key: String,
        /// Type and value found.
        found: String,
        /// Expected type.
        wanted: String,
    },
    /// Value out of range, not among the choices, or inconsistent with another parameter.
    #[error("{at}: {key} = {value}: must {allowed}")]
    NotAllowed {
        /// Position.
        at: ValueSource,
        /// Full key.
        key: String,
        /// Value.
        value: String,
        /// Requirement, a verb phrase after "must".
        allowed: String,
    },
}

/// Returns the remedy for a text in place of a number: several parameters in one option, or a decimal comma.
fn number_hint(found: &str, wanted: &str, at: &ValueSource) -> String {
    let text = found.trim_start_matches("text ").trim_matches('"');
    match text.split_once(',') {
        Some((_, rest)) if wanted == "number" && rest.contains('=') => {
            format!("; repeat {at} for each parameter")
        }
        Some((whole, decimals)) if wanted == "number" && is_number(whole) && is_number(decimals) => {
            "; the decimal separator is a point".to_owned()
        }
        _ => String::new(),
    }
}

/// Returns the remedy for a number in place of an assignment: the decimals after a comma.
fn part_hint(text: &str) -> &'static str {
    if is_number(text) { "; the decimal separator is a point" } else { "" }
}

fn is_number(text: &str) -> bool {
    text.trim().parse::<f64>().is_ok()
}
