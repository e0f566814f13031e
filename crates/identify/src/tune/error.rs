//! Error of a tuning search.

use virtual_axes_core::config::ConfigError;
use virtual_axes_core::machine::MachineError;
use virtual_axes_core::trial::TrialError;
use virtual_axes_core::units::Rounded;

use super::margin_limits::MarginLimits;

/// Error of a tuning search.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TuneError {
    /// Simulation run that failed.
    #[error(transparent)]
    Trial(#[from] TrialError),
    /// Parameter value that the schema rejects.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// Axis without prediction model.
    #[error(transparent)]
    Machine(#[from] MachineError),
    /// Path without motion of any axis.
    #[error("no axis moves: there is nothing to tune")]
    NothingMoves,
    /// Less than two linear axes move.
    #[error("contour_control.gain has no effect: less than two linear axes move on the path")]
    NoContour,
    /// No design within the margin limits.
    #[error(
        "none of {designs} designs has a modulus margin of {} and a delay margin of {} ms on its worst axis; \
         the largest modulus margin is {modulus:.3}, with a delay margin of {:.2} ms",
        Rounded(limits.modulus), Rounded(limits.delay * 1e3), delay * 1e3
    )]
    NoMargins {
        /// Number of designs.
        designs: usize,
        /// Margin limits.
        limits: MarginLimits,
        /// Largest modulus margin of a design.
        modulus: f64,
        /// Delay margin of that design, s.
        delay: f64,
    },
    /// No stable design.
    #[error("none of {designs} designs is stable on every moving axis")]
    NoneStable {
        /// Number of designs.
        designs: usize,
    },
    /// Saturation of every design within the margin limits.
    #[error("each of the {runs} tunings within the margins saturates an axis on this path; reduce the feed")]
    Saturated {
        /// Number of runs.
        runs: usize,
    },
}
