//! Error of the conditioning of a recording.

use std::fmt::Display;

/// Recording that cannot be used: its name, what was found, what is allowed, and the likely cause.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct ConditioningError(String);

impl ConditioningError {
    /// Creates the error of the recording `name`.
    pub(super) fn new(name: &str, reason: impl Display) -> Self {
        ConditioningError(format!("{name}: {reason}"))
    }

    /// Appends the likely cause, if it is known.
    pub(super) fn with_cause(self, cause: &str) -> Self {
        if cause.is_empty() { self } else { ConditioningError(format!("{}; {cause}", self.0)) }
    }
}
