//! Errors of scenarios.

use crate::text::{nearest_hint, shortened};
use crate::units::Rounded;

/// Rejection of a scenario. The text is one line that begins with the file and, if known, the line.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ScenarioError {
    /// Neither a built-in scenario nor a readable file.
    #[error("{name}: {reason}{}{}", nearest_hint(.nearest), known_hint(.known))]
    Unknown {
        /// Requested name or path.
        name: String,
        /// Error of the operating system.
        reason: String,
        /// Most similar built-in scenario.
        nearest: Option<String>,
        /// Names of the built-in scenarios, separated by commas; empty for the name of a file.
        known: String,
    },
    /// Invalid content: its place is the file and, if known, the line.
    #[error("{at}: {reason}")]
    Invalid {
        /// File and line.
        at: String,
        /// Key and value, if any, and the requirement.
        reason: String,
    },
}

impl ScenarioError {
    pub(super) fn invalid(at: &str, reason: impl ToString) -> Self {
        Self::Invalid { at: at.to_owned(), reason: reason.to_string() }
    }

    /// Creates the error of a key.
    pub(super) fn key(at: &str, key: &str, reason: &str) -> Self {
        Self::invalid(at, format!("{}: {reason}", shortened(key)))
    }

    /// Creates the error of a value; `allowed` is a verb phrase after "must".
    pub(super) fn value(at: &str, key: &str, value: f64, allowed: &str) -> Self {
        Self::invalid(at, format!("{} = {}: must {allowed}", shortened(key), Rounded(value)))
    }
}

/// Returns the list of built-in scenarios for a message; empty if `known` is.
fn known_hint(known: &str) -> String {
    if known.is_empty() { String::new() } else { format!("; built-in scenarios: {known}") }
}
