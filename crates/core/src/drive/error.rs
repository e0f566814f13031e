//! Errors of building a plant from its parameters.

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
