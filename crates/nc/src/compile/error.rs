//! Error of a compilation.

use virtual_axes_core::trial::TrialError;

/// Error of a compilation.
#[derive(Debug, thiserror::Error)]
pub enum CompileError {
    /// Program that is invalid.
    #[error("{0}")]
    Program(String),
    /// Run that fails.
    #[error(transparent)]
    Trial(TrialError),
    /// No plant to simulate, or a thread that ended early.
    #[error("no plant was simulated")]
    NoPlant,
}
