//! Errors of generating production traces.

use virtual_axes_core::config::ConfigError;
use virtual_axes_core::machine::MachineError;
use virtual_axes_core::path::PlanError;
use virtual_axes_core::units::Rounded;

/// Error of generating or writing a production trace.
#[derive(Debug, thiserror::Error)]
pub enum TraceError {
    /// Option outside its range.
    #[error("{name} is {}, must be {allowed}", Rounded(*found))]
    Option {
        /// Name of the option, with its unit.
        name: &'static str,
        /// Value found.
        found: f64,
        /// Allowed values.
        allowed: &'static str,
    },
    /// Program that cannot be planned.
    #[error("program: {0}")]
    Plan(#[from] PlanError),
    /// Axis that cannot be simulated.
    #[error(transparent)]
    Machine(#[from] MachineError),
    /// Parameters outside the ranges of the schema.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// File or folder that cannot be written.
    #[error("{path}: {source}")]
    Io {
        /// Path of the file or folder.
        path: String,
        /// Error of the operating system.
        source: std::io::Error,
    },
}

impl TraceError {
    /// Returns an error if `found` is not in the closed range `low` … `high`.
    pub(super) fn check_range(
        name: &'static str,
        found: f64,
        [low, high]: [f64; 2],
        allowed: &'static str,
    ) -> Result<(), TraceError> {
        if (low..=high).contains(&found) { Ok(()) } else { Err(TraceError::Option { name, found, allowed }) }
    }
}
