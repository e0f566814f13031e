//! Physics of one feed drive: motor, friction, gravity, load. Knows no controller.
//!
//! (Prévost eq. 1)
//!
//! ```text
//! L di/dt = u − R i − Ke ω
//! J dω/dt = Kt i − C_friction − C_gravity + r F_load
//!   dθ/dt = ω
//! ```

mod elementary;
mod expansion;
mod friction;
mod gravity;
mod motor;
mod plant;

pub(crate) use expansion::Expansion;
pub use friction::Friction;
pub use gravity::Gravity;
pub use motor::{Motor, MotorState};
pub use plant::{Plant, Torques};

/// Why a plant cannot be built from its parameters.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum DriveError {
    /// The zero-order-hold discretisation is not finite or has lost its sense of direction.
    #[error(
        "the motor cannot be stepped over {period_s} s: the response of its speed to a torque over one \
         period is {speed_per_torque} (rad/s)/(N·m), which must be positive and finite; shorten the \
         current period or mend inertia, resistance and inductance"
    )]
    Discretisation {
        /// Current-loop period, s.
        period_s: f64,
        /// Change of ω over one period per torque, (rad/s)/(N·m).
        speed_per_torque: f64,
    },
}
