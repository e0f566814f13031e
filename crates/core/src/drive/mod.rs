//! Plant of one feed drive: motor, friction, gravity and load, independent of the controllers.
//!
//! Equations of motion (Prévost eq. 1):
//!
//! ```text
//! L di/dt = u − R i − Ke ω
//! J dω/dt = Kt i − C_friction − C_gravity + r F_load
//!   dθ/dt = ω
//! ```

mod elementary;
mod error;
mod event_driven;
mod friction;
mod friction_expansion;
mod gravity;
mod maxwell_slip;
mod motor;
mod motor_energy;
mod plant;
mod presliding;
mod response;
mod transmission;
mod workpiece_dynamics;

pub use error::DriveError;
pub use event_driven::{ContactState, EventDrivenTransmission};
pub use friction::Friction;
pub(crate) use friction_expansion::FrictionExpansion;
pub use gravity::Gravity;
pub(crate) use gravity::GravityExpansion;
pub use maxwell_slip::{MAX_ELEMENTS, MaxwellSlip, MaxwellSlipElement, MaxwellSlipState};
pub use motor::{Motor, MotorState};
pub use motor_energy::{MotorEnergy, TickEnergy};
pub use plant::{Plant, Torques};
pub use presliding::Presliding;
pub use transmission::{LoadState, Transmission};
pub use workpiece_dynamics::{STANDARD_GRAVITY, WorkpieceDynamics};
