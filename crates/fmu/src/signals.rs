//! Outputs of an axis.

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

const fn real(
    name: &'static str,
    quantity: SignalQuantity,
    read: fn(&AxisSample) -> f64,
    description: &'static str,
) -> FmuSignal {
    FmuSignal { name, description, reader: SignalReader::Real(quantity, read) }
}

const fn boolean(name: &'static str, read: fn(&AxisSample) -> bool, description: &'static str) -> FmuSignal {
    FmuSignal { name, description, reader: SignalReader::Boolean(read) }
}

/// Outputs of each axis, in the order of the variables.
pub const SIGNALS: &[FmuSignal] = &[
    real("position", SignalQuantity::Position, |s| s.position, "Simulated position."),
    real("velocity", SignalQuantity::Velocity, |s| s.velocity, "Simulated velocity."),
    real("current", SignalQuantity::Current, |s| s.current, "Simulated motor current."),
    real(
        "following_error",
        SignalQuantity::Position,
        AxisSample::following_error,
        "Following error: setpoint − position; it contains the delay α.",
    ),
    real(
        "delay_compensated_following_error",
        SignalQuantity::Position,
        AxisSample::delay_compensated_following_error,
        "Following error against the setpoint delayed by α.",
    ),
    real("effort", SignalQuantity::Force, |s| s.effort, "Force or torque of the motor at the axis."),
    real(
        "current_setpoint",
        SignalQuantity::Current,
        |s| s.current_setpoint,
        "Setpoint of the current loop after its limit.",
    ),
    real("voltage", SignalQuantity::Voltage, |s| s.voltage, "Motor voltage after its limit."),
    real(
        "velocity_setpoint",
        SignalQuantity::MotorSpeed,
        |s| s.velocity_setpoint,
        "Ω*, output of the position controller after its limit, at the motor.",
    ),
    real(
        "velocity_feedforward",
        SignalQuantity::MotorSpeed,
        |s| s.velocity_feedforward,
        "Velocity feedforward after its delay β, at the motor.",
    ),
    real(
        "torque_feedforward",
        SignalQuantity::MotorTorque,
        |s| s.torque_feedforward,
        "Torque feedforward after its delay γ, and friction compensation, at the motor.",
    ),
    real("friction_current", SignalQuantity::Current, |s| s.friction_current, "Friction as motor current."),
    real("gravity_current", SignalQuantity::Current, |s| s.gravity_current, "Gravity as motor current."),
    real(
        "load_current",
        SignalQuantity::Current,
        |s| s.load_current,
        "External load as motor current, positive against motion towards plus.",
    ),
    real(
        "wind_up",
        SignalQuantity::Position,
        |s| s.wind_up,
        "Wind-up of an elastic transmission: position of the motor at the axis minus position of the load.",
    ),
    boolean("is_saturated", |s| s.saturated, "True if speed, current or voltage setpoint is at its limit."),
    boolean(
        "is_friction_extrapolated",
        |s| s.friction_extrapolated,
        "True if the friction law is extrapolated beyond its fitted range.",
    ),
];
