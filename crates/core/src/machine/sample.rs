//! What can be seen of an axis at an instant.

/// Signals of one axis at one tick (Prévost fig. 3).
///
/// Axis quantities are in m or rad, motor quantities in rad and N·m (m and N for a linear motor).
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct AxisSample {
    /// PSEC, the setpoint of this position period, m or rad.
    pub psec: f64,
    /// The setpoint that the position controller was asked to follow, `PSEC_floor(k − α/Tsp)`, m or rad.
    pub delayed_psec: f64,
    /// SP, m or rad.
    pub position: f64,
    /// SV, m/s or rad/s.
    pub velocity: f64,
    /// SMC, A.
    pub current: f64,
    /// Setpoint of the current loop after its limit, A.
    pub current_setpoint: f64,
    /// Voltage after its limit, V.
    pub voltage: f64,
    /// Ω* after its limit, rad/s of the motor.
    pub velocity_setpoint: f64,
    /// VFFWS behind its delay, rad/s of the motor.
    pub velocity_feedforward: f64,
    /// TFFWS behind its delay, N·m at the motor.
    pub torque_feedforward: f64,
    /// Friction over the tick before, as motor current, A.
    pub friction_current: f64,
    /// Gravity over the tick before, as motor current, A.
    pub gravity_current: f64,
    /// What the load over the tick before asks of the motor, A: like friction and gravity positive
    /// when it opposes motion towards plus.
    pub load_current: f64,
    /// What the motor exerts at the axis, `Kt i / r`, N or N·m.
    pub effort: f64,
    /// Name of the position controller that is active.
    pub controller: &'static str,
    /// Whether speed, current or voltage setpoint is at its limit.
    pub saturated: bool,
    /// Whether the friction law is used beyond the range that it was fitted for.
    pub friction_extrapolated: bool,
}

impl AxisSample {
    /// `PSEC_k − SP`, m or rad; contains the pure delay.
    pub fn tracking_error(&self) -> f64 {
        self.psec - self.position
    }

    /// `PSEC_floor(k − α/Tsp) − SP`, m or rad: what the controller is asked to follow.
    pub fn synchronized_tracking_error(&self) -> f64 {
        self.delayed_psec - self.position
    }
}
