//! Why a scenario cannot be used.

use crate::path::{PathError, PlanError};

/// A refused scenario; its text is one line that begins with the file, and the line in it if known.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ScenarioError {
    /// Neither a shipped scenario nor a file that can be read.
    #[error("{name}: {reason}; the shipped scenarios are {known}")]
    Unknown {
        /// What was asked for.
        name: String,
        /// What the operating system says.
        reason: String,
        /// Names of the shipped ones, with commas.
        known: String,
    },
    /// Not YAML, an unknown key, or a value of the wrong kind.
    #[error("{at}: {message}")]
    Syntax {
        /// File and line.
        at: String,
        /// What the YAML reader says.
        message: String,
    },
    /// A value that makes no sense here.
    #[error("{at}: {key} = {value}: must {allowed}")]
    Value {
        /// File and line.
        at: String,
        /// Key.
        key: String,
        /// Value found.
        value: f64,
        /// What is allowed, after "must".
        allowed: String,
    },
    /// A key that does not fit the machine or the move.
    #[error("{at}: {key}: {reason}")]
    Key {
        /// File and line.
        at: String,
        /// Key.
        key: String,
        /// Why, and what is allowed.
        reason: String,
    },
    /// A move is not exactly one of line, arc, spline, dwell_s, or lacks something.
    #[error("{at}: {reason}")]
    Move {
        /// File and line.
        at: String,
        /// What is wrong.
        reason: String,
    },
    /// A move that is no geometry.
    #[error("{at}: {error}")]
    Path {
        /// File and line.
        at: String,
        /// What is wrong with it.
        error: PathError,
    },
    /// It would take longer than anybody waits for.
    #[error("{name}: lasts {duration:e} s; a scenario lasts {limit} s at most")]
    TooLong {
        /// Scenario.
        name: String,
        /// s.
        duration: f64,
        /// s.
        limit: f64,
    },
    /// The moves cannot be run one after the other within the limits.
    #[error("{name}: {error}")]
    Plan {
        /// Scenario.
        name: String,
        /// Why.
        error: PlanError,
    },
}
