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
mod event_driven;
mod friction;
mod friction_expansion;
mod gravity;
mod maxwell_slip;
mod motor;
mod plant;
mod presliding;
mod response;
mod transmission;
mod workpiece_dynamics;

pub use event_driven::{ContactState, EventDrivenTransmission};
pub use friction::Friction;
pub(crate) use friction_expansion::FrictionExpansion;
pub use gravity::Gravity;
pub(crate) use gravity::GravityExpansion;
pub use maxwell_slip::{MAX_ELEMENTS, MaxwellSlip, MaxwellSlipElement, MaxwellSlipState};
pub use motor::{Motor, MotorState};
pub use plant::{Plant, Torques};
pub use presliding::Presliding;
pub use transmission::{LoadState, Transmission};
pub use workpiece_dynamics::{STANDARD_GRAVITY, WorkpieceDynamics};

use crate::units::Rounded;

/// Error of building a plant from its parameters.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum DriveError {
    /// Zero-order-hold discretization that is not finite.
    #[error(
        "the motor cannot be discretized over {} s: the change of its speed per torque over one current cycle is {} \
         (rad/s)/(N·m); it must be positive and finite; change inertia, motor.resistance_ohm or motor.inductance_mh",
        Rounded(*period_s), Rounded(*speed_per_torque)
    )]
    Discretization {
        /// Period of the current loop, s.
        period_s: f64,
        /// Change of ω over one current cycle per torque, (rad/s)/(N·m).
        speed_per_torque: f64,
    },
    /// Underdamped motor whose speed response to a torque changes its sign within one current cycle.
    #[error(
        "the motor cannot be discretized over {} s: without a controller current and speed oscillate at {} Hz with so \
         little damping that a torque would reverse the motor within one current cycle; shorten periods.current_us, or \
         change inertia, motor.inductance_mh or motor.resistance_ohm",
        Rounded(*period_s), Rounded(*frequency_hz)
    )]
    Oscillates {
        /// Period of the current loop, s.
        period_s: f64,
        /// Frequency of the damped oscillation, Hz.
        frequency_hz: f64,
    },
    /// Backlash, friction at the load or a structure with oscillations that a current cycle does not resolve.
    #[error(
        "the transmission changes within {} s, too fast for the current cycle of {} s with backlash, friction at the load \
         or a structure; reduce stiffness or damping, increase the mass of load or structure, or shorten periods.current_us",
        Rounded(*time_s), Rounded(*period_s)
    )]
    TooFast {
        /// Period of the current loop, s.
        period_s: f64,
        /// Time constant of the fastest change, s.
        time_s: f64,
    },
}
