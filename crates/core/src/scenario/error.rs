//! Errors of scenarios.

use crate::path::{PathError, PlanError};
use crate::text::nearest_hint;
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
    /// Invalid YAML, an unknown key, or a value of the wrong type.
    #[error("{at}: {reason}")]
    Syntax {
        /// File and line.
        at: String,
        /// Error of the YAML reader.
        reason: String,
    },
    /// Value out of range.
    #[error("{at}: {key} = {}: must {allowed}", Rounded(*value))]
    Value {
        /// File and line.
        at: String,
        /// Key.
        key: String,
        /// Value.
        value: f64,
        /// Requirement, a verb phrase after "must".
        allowed: String,
    },
    /// Key that is invalid for the machine or the move.
    #[error("{at}: {key}: {reason}")]
    Key {
        /// File and line.
        at: String,
        /// Key.
        key: String,
        /// Reason and allowed keys.
        reason: String,
    },
    /// Incomplete or contradictory move.
    #[error("{at}: {reason}")]
    Move {
        /// File and line.
        at: String,
        /// Reason.
        reason: String,
    },
    /// Invalid geometry of a move.
    #[error("{at}: {error}")]
    Path {
        /// File and line.
        at: String,
        /// Reason.
        error: PathError,
    },
    /// Duration above the limit.
    #[error("{name}: duration is {} s, at most {limit} s are allowed", Rounded(*duration))]
    TooLong {
        /// Scenario.
        name: String,
        /// Duration, s.
        duration: f64,
        /// Maximum duration, s.
        limit: f64,
    },
    /// Moves that cannot be joined within the limits.
    #[error("{name}: {error}")]
    Plan {
        /// Scenario.
        name: String,
        /// Reason.
        error: PlanError,
    },
}

/// Returns the list of built-in scenarios for a message; empty if `known` is.
fn known_hint(known: &str) -> String {
    if known.is_empty() { String::new() } else { format!("; built-in scenarios: {known}") }
}
