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
mod response;

pub(crate) use expansion::Expansion;
pub use friction::Friction;
pub use gravity::Gravity;
pub(crate) use gravity::Incline;
pub use motor::{Motor, MotorState};
pub use plant::{Plant, Torques};

/// Why a plant cannot be built from its parameters.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum DriveError {
    /// The zero-order-hold discretization is not made of numbers.
    #[error(
        "the motor cannot be stepped over {period_s} s: the response of its speed to a torque over one \
         period is {speed_per_torque} (rad/s)/(N·m), which must be positive and finite; mend inertia, \
         motor.resistance_ohm and motor.inductance_mh"
    )]
    Discretization {
        /// Current-loop period, s.
        period_s: f64,
        /// Change of ω over one period per torque, (rad/s)/(N·m).
        speed_per_torque: f64,
    },
    /// Current and speed swing against each other within one period.
    #[error(
        "the motor cannot be stepped over {period_s} s: without a controller current and speed swing at \
         {frequency_hz:.6e} Hz, so little damped that a torque would turn the motor against its own direction \
         within the period; shorten periods.current_us, or mend inertia, motor.inductance_mh and \
         motor.resistance_ohm"
    )]
    Swings {
        /// Current-loop period, s.
        period_s: f64,
        /// Frequency of the damped swinging, Hz.
        frequency_hz: f64,
    },
}
