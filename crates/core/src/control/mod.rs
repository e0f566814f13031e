//! Controllers of one feed drive. Knows no plant.
//!
//! (Prévost fig. 3) Three nested loops, position → velocity → current, with velocity and torque
//! feedforward of the delayed setpoint; the outer one can be any linear controller that reads
//! setpoints ahead (Prévost eq. 9).

mod pi;
mod position;
mod rst;
mod setpoint;
mod transfer;

pub use pi::{Pi, PiState};
pub use position::{Guard, PositionController, PositionState};
pub(crate) use rst::INTEGRATOR_TOLERANCE;
pub use rst::{MAX_COEFFICIENTS, MAX_PREVIEW, Rst, RstError};
pub use setpoint::{Delays, Feedforward, Reach, SetpointHistory, Shift};
pub use transfer::{Transfer, TransferState};
