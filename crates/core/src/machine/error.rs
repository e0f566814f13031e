//! Errors of building a machine or changing its parameters, and range of the inputs of an axis.

use crate::design::DesignError;
use crate::drive::DriveError;
use crate::units::{POSITION_GAIN, Rounded};

/// Error of building a machine or changing its parameters.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MachineError {
    /// Invalid parameters of an axis.
    #[error("axis {axis}: {source}")]
    Axis {
        /// Name of the axis.
        axis: String,
        /// Error of the axis.
        source: AxisError,
    },
    /// Different number of joints or different periods, which a running machine cannot change.
    #[error(
        "the new parameters have a different number of joints or different periods; restart to change them"
    )]
    AnotherMachine,
}

/// Error of building an axis.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum AxisError {
    /// Motor that cannot be discretized over the current cycle.
    #[error(transparent)]
    Drive(#[from] DriveError),
    /// Position controller that cannot be designed.
    #[error("position_loop: {0}")]
    Design(#[from] DesignError),
    /// Position loop that is unstable with cross-coupled control.
    #[error(
        "contour_control.gain = {} (m/min)/mm, added to the position loop: {source}",
        Rounded(gain / POSITION_GAIN)
    )]
    ContourControl {
        /// Gain, 1/s.
        gain: f64,
        /// Error of the design.
        source: DesignError,
    },
}

/// Largest position (m or rad), load (N or N·m) or velocity offset (rad/s or m/s) of an axis.
///
/// It is above that of any machine tool, and small enough for a finite drive state.
pub const MAX_INPUT: f64 = 1e6;

/// Input of an axis that is no number or beyond ±[`MAX_INPUT`].
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("{}; it must lie in ±{MAX_INPUT}", Rounded(*.0))]
pub struct InputOutOfRange(pub f64);

/// Checks a position, a load or a velocity offset of an axis.
///
/// # Errors
/// [`InputOutOfRange`] if it is NaN or beyond ±[`MAX_INPUT`].
pub fn check_input(value: f64) -> Result<(), InputOutOfRange> {
    if value.abs() <= MAX_INPUT { Ok(()) } else { Err(InputOutOfRange(value)) }
}
