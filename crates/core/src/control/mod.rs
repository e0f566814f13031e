//! Controllers of one feed drive, independent of the plant.
//!
//! Three nested loops, position → velocity → current, with velocity and torque feedforward of the delayed setpoint
//! (Prévost fig. 3). The position controller is proportional or any linear controller in RST form with preview
//! (Prévost eq. 9). The PI controllers of velocity and current have an output limit and anti-windup; a change of the
//! position controller is a bumpless transfer.

mod backlash_compensation;
mod bumpless_transfer;
mod contour_error;
mod current_filter;
mod pi;
mod position;
mod rst;
mod setpoint;

pub use backlash_compensation::{BacklashCompensation, BacklashOffset};
pub use bumpless_transfer::{BumplessTransfer, BumplessTransferState};
pub use contour_error::{CONTOUR_AXES, CONTOUR_LOOKBACK, ContourVector, contour_error};
pub use current_filter::{BiquadFilter, BiquadState, CurrentFilterState, CurrentFilters};
pub use pi::{Pi, PiState};
pub use position::{FallbackController, PositionController, PositionState};
pub(crate) use rst::INTEGRATOR_TOLERANCE;
pub use rst::{MAX_COEFFICIENTS, MAX_PREVIEW, Rst, RstError};
pub use setpoint::{Delays, Feedforward, SetpointHistory, SetpointWindow, TickDelay};
