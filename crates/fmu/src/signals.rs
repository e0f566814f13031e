//! Outputs of an axis.

use SignalQuantity::{Current, Force, MotorSpeed, MotorTorque, Position, Velocity, Voltage};
use virtual_axes_core::machine::AxisSample;

/// Quantity of a signal, which has a unit by type of axis or motor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum SignalQuantity {
    Position,
    Velocity,
    Force,
    MotorSpeed,
    MotorTorque,
    Current,
    Voltage,
}

/// Value of a signal.
#[derive(Debug, Clone, Copy)]
pub(crate) enum SignalReader {
    Real(SignalQuantity, fn(&AxisSample) -> f64),
    Boolean(fn(&AxisSample) -> bool),
}

/// Output of an axis at the end of a step.
#[derive(Debug, Clone, Copy)]
pub struct FmuSignal {
    /// Name, without the axis.
    pub name: &'static str,
    /// Description, one sentence.
    pub description: &'static str,
    pub(crate) reader: SignalReader,
}

/// Defines the list of outputs: name, reader and description of each.
macro_rules! signals {
    ($($name:literal: $kind:ident($($reader:tt)*), $description:literal;)*) => {
        /// Outputs of each axis, in the order of the variables.
        pub const SIGNALS: &[FmuSignal] = &[$(FmuSignal {
            name: $name,
            description: $description,
            reader: SignalReader::$kind($($reader)*),
        }),*];
    };
}

signals! {
    "position": Real(Position, |s| s.position), "Simulated position.";
    "velocity": Real(Velocity, |s| s.velocity), "Simulated velocity.";
    "current": Real(Current, |s| s.current), "Simulated motor current.";
    "following_error": Real(Position, AxisSample::following_error),
        "Following error: setpoint − position; it contains the delay α.";
    "delay_compensated_following_error": Real(Position, AxisSample::delay_compensated_following_error),
        "Following error against the setpoint delayed by α.";
    "effort": Real(Force, |s| s.effort), "Force or torque of the motor at the axis.";
    "current_setpoint": Real(Current, |s| s.current_setpoint), "Setpoint of the current loop after its limit.";
    "voltage": Real(Voltage, |s| s.voltage), "Motor voltage after its limit.";
    "velocity_setpoint": Real(MotorSpeed, |s| s.velocity_setpoint),
        "Ω*, output of the position controller after its limit, at the motor.";
    "velocity_feedforward": Real(MotorSpeed, |s| s.velocity_feedforward),
        "Velocity feedforward after its delay β, at the motor.";
    "torque_feedforward": Real(MotorTorque, |s| s.torque_feedforward),
        "Torque feedforward after its delay γ, and friction compensation, at the motor.";
    "friction_current": Real(Current, |s| s.friction_current), "Friction as motor current.";
    "gravity_current": Real(Current, |s| s.gravity_current), "Gravity as motor current.";
    "load_current": Real(Current, |s| s.load_current),
        "External load as motor current, positive against motion towards plus.";
    "wind_up": Real(Position, |s| s.wind_up),
        "Wind-up of an elastic transmission: position of the motor at the axis minus position of the load.";
    "is_saturated": Boolean(|s| s.saturated), "True if speed, current or voltage setpoint is at its limit.";
    "is_friction_extrapolated": Boolean(|s| s.friction_extrapolated),
        "True if the friction law is extrapolated beyond its fitted range.";
}
