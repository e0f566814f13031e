//! YAML reader with common options and one-line error messages, for machine files, scenarios, trajectories and column
//! mappings.

use std::fmt;

use serde::de::{Deserialize, DeserializeOwned, Deserializer, Visitor};
use serde_saphyr::options::DuplicateKeyPolicy;
use serde_saphyr::{Budget, Error, NonFiniteFloatPolicy, Options};

use crate::text::{nearest_hint, nearest_name, shortened};

/// Minimum of the budget for nodes: a stream and a document count as nodes.
const MIN_NODES: usize = 1 << 10;

/// Error of a YAML text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct YamlError {
    /// Line, from 1; 0 if unknown.
    pub line: u64,
    /// Reason, on one line.
    pub reason: String,
}

impl YamlError {
    fn new(error: &Error, text: &str) -> Self {
        let line = error.location().map_or(0, |location| location.line());
        let (error, alias) = match error.without_snippet() {
            Error::AliasError { error, locations, .. } => (&**error, locations.defined_location.line()),
            error => (error, line),
        };
        let mut reason = reason(error);
        // These messages do not contain the value that was found.
        if reason.starts_with("expected ")
            && let Some(text) = (line as usize).checked_sub(1).and_then(|row| text.lines().nth(row))
        {
            reason += &format!(": {}", shortened(text.trim()));
        }
        if alias != line {
            reason += &format!(" (the alias is defined in line {alias})");
        }
        Self { line, reason }
    }

    /// Returns `FILE:LINE`, or the file alone if the line is unknown.
    pub fn position(&self, file: &str) -> String {
        position(file, self.line)
    }
}

/// Returns `FILE:LINE`, or the file alone if `line` is 0.
pub fn position(file: &str, line: u64) -> String {
    match line {
        0 => file.to_owned(),
        line => format!("{file}:{line}"),
    }
}

/// Reads a text with exactly one document.
///
/// # Errors
/// [`YamlError`] for invalid YAML, duplicate keys, and values that do not fit `T`.
pub fn document<T: DeserializeOwned>(text: &str) -> Result<T, YamlError> {
    let options = options(Budget::default());
    serde_saphyr::from_str_with_options(text, options).map_err(|error| YamlError::new(&error, text))
}

/// Reads a text with exactly one document, whose mappings may repeat keys: `T` receives each of them.
///
/// # Errors
/// [`YamlError`] for invalid YAML, and values that do not fit `T`.
pub fn document_with_repeated_keys<T: DeserializeOwned>(text: &str) -> Result<T, YamlError> {
    let mut options = options(Budget::default());
    options.duplicate_keys = DuplicateKeyPolicy::LastWins;
    serde_saphyr::from_str_with_options(text, options).map_err(|error| YamlError::new(&error, text))
}

/// Reads all documents of a text, whose mappings may repeat keys: `T` receives each of them. Empty documents are omitted.
///
/// # Errors
/// [`YamlError`] for invalid YAML, and values that do not fit `T`.
pub fn documents_with_repeated_keys<T: DeserializeOwned>(text: &str) -> Result<Vec<T>, YamlError> {
    let mut options = options(Budget::default());
    options.duplicate_keys = DuplicateKeyPolicy::LastWins;
    serde_saphyr::from_multiple_with_options(text, options).map_err(|error| YamlError::new(&error, text))
}

/// Reads all documents of a text; empty documents are omitted. The length of the text bounds the number of nodes.
///
/// # Errors
/// [`YamlError`] for invalid YAML, duplicate keys, and values that do not fit `T`.
pub fn documents<T: DeserializeOwned>(text: &str) -> Result<Vec<T>, YamlError> {
    // Each node takes at least one byte.
    let length = text.len().max(MIN_NODES);
    let mut budget = Budget::default();
    budget.max_events = length.saturating_mul(2);
    budget.max_nodes = length;
    budget.max_total_scalar_bytes = length;
    budget.max_documents = length;
    serde_saphyr::from_multiple_with_options(text, options(budget))
        .map_err(|error| YamlError::new(&error, text))
}

fn options(budget: Budget) -> Options {
    serde_saphyr::options! {
        // In YAML 1.1 `y` is true; here it is the name of an axis.
        strict_booleans: true,
        // NaN and infinity are accepted here and rejected later, with key or point in the message.
        non_finite_float_policy: NonFiniteFloatPolicy::PassThrough,
        with_snippet: false,
        budget: Some(budget),
    }
}

/// Returns the message of the reader without its position.
fn reason(error: &Error) -> String {
    match error {
        Error::SerdeUnknownField { field, expected, .. } => format!(
            "unknown field {}; there are {}{}",
            shortened(field),
            expected.join(", "),
            nearest_hint(&nearest_name(field, expected))
        ),
        Error::DuplicateMappingKey { key, .. } => {
            format!("duplicate key {}", key.as_deref().map_or(String::new(), shortened))
        }
        Error::MultipleDocuments { .. } => "more than one YAML document, expected one".to_owned(),
        error => {
            let text = error.to_string();
            let message = text.rsplit_once(" at line ").map_or(text.as_str(), |(message, _)| message);
            let message = message.trim_start_matches("error: ");
            match message {
                "expected sequence start" => "expected a list".to_owned(),
                "expected mapping start" => "expected a mapping".to_owned(),
                message => shortened(message),
            }
        }
    }
}

/// Number in a YAML text, integer or floating point; the error for any other value reads "expected a number".
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct YamlNumber(pub f64);

impl<'de> Deserialize<'de> for YamlNumber {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(NumberVisitor)
    }
}

struct NumberVisitor;

impl Visitor<'_> for NumberVisitor {
    type Value = YamlNumber;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a number")
    }

    fn visit_i64<E>(self, value: i64) -> Result<YamlNumber, E> {
        Ok(YamlNumber(value as f64))
    }

    fn visit_u64<E>(self, value: u64) -> Result<YamlNumber, E> {
        Ok(YamlNumber(value as f64))
    }

    fn visit_f64<E>(self, value: f64) -> Result<YamlNumber, E> {
        Ok(YamlNumber(value))
    }
}
