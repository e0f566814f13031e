//! Range of the inputs of an axis.

use crate::units::Rounded;

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
