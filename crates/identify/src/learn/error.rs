//! Error of iterative learning.

use virtual_axes_core::design::DesignError;
use virtual_axes_core::machine::MachineError;
use virtual_axes_core::trial::TrialError;
use virtual_axes_core::units::Rounded;

use super::setpoint_limits::SetpointExcess;

/// Error of iterative learning.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LearningError {
    /// Run that failed.
    #[error(transparent)]
    Trial(#[from] TrialError),
    /// Axis whose closed loop cannot be computed.
    #[error(transparent)]
    Machine(#[from] MachineError),
    /// Axis whose filters cannot be designed.
    #[error("axis {axis}: {source}")]
    Design {
        /// Name of the axis.
        axis: String,
        /// Error of the design.
        source: DesignError,
    },
    /// Machine with cross-coupled control, which the closed loops of single axes do not contain.
    #[error(
        "contour_control.gain must be 0 to learn: the convergence is computed for axes without cross-coupled control"
    )]
    ContourControl,
    /// Machine with axes that are coupled mechanically, which the closed loops of single axes do not contain.
    #[error(
        "workpiece.mass_kg must be 0 and gantry.axes absent to learn: the convergence is computed for independent axes"
    )]
    CoupledAxes,
    /// Path without motion of any axis.
    #[error("no axis moves: there is nothing to learn")]
    NothingMoves,
    /// Encoder step out of range.
    #[error("the encoder step is {} m or rad; it must be finite and not negative", Rounded(*step))]
    EncoderStep {
        /// Encoder step, m or rad.
        step: f64,
    },
    /// Number of iterations out of range.
    #[error("{iterations} iterations; 1 … {most} are allowed")]
    Iterations {
        /// Number of iterations.
        iterations: usize,
        /// Largest number of iterations.
        most: usize,
    },
    /// First compensated setpoints beyond a limit of their axis.
    #[error("iteration 1: {0}; reduce the feed or the bandwidth, or allow a larger acceleration excess")]
    Excess(SetpointExcess),
}
