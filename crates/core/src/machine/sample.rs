//! Signals of an axis at one tick.

use crate::state_codec::StateCodec;

/// Signals of one axis at one tick (Prévost fig. 3).
///
/// Axis quantities are in m or rad, motor quantities in rad and N·m (m and N for a linear motor).
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct AxisSample {
    /// PSEC, position setpoint at the entrance of the controller in this position cycle, m or rad.
    pub psec: f64,
    /// Setpoint at the input of the position controller, delayed by α: `PSEC_floor(k − α/Tsp)`, m or rad.
    pub delayed_psec: f64,
    /// SP, simulated position, m or rad; that of the load with an elastic transmission.
    pub position: f64,
    /// Wind-up of an elastic transmission: position of the motor at the axis minus that of the load, m or rad; 0 for a
    /// rigid axis.
    pub wind_up: f64,
    /// SV, simulated velocity, m/s or rad/s; that of the load with an elastic transmission.
    pub velocity: f64,
    /// SMC, simulated motor current i, A.
    pub current: f64,
    /// i*, setpoint of the current loop after its limit, A.
    pub current_setpoint: f64,
    /// u, voltage after its limit, V.
    pub voltage: f64,
    /// Ω* after its limit, rad/s of the motor.
    pub velocity_setpoint: f64,
    /// VFFWS, velocity feedforward after its delay β, rad/s of the motor.
    pub velocity_feedforward: f64,
    /// TFFWS, torque feedforward after its delay γ, and friction compensation, N·m at the motor.
    pub torque_feedforward: f64,
    /// Friction over the previous tick, as motor current, A.
    pub friction_current: f64,
    /// Gravity over the previous tick, as motor current, A.
    pub gravity_current: f64,
    /// External load and force of a coupling over the previous tick, as motor current, A; positive against motion towards plus, like
    /// friction and gravity.
    pub load_current: f64,
    /// Motor force or torque at the axis, `Kt i / r`, N or N·m.
    pub effort: f64,
    /// Name of the active position controller.
    pub controller: &'static str,
    /// True if speed, current or voltage setpoint is at its limit.
    pub saturated: bool,
    /// True if the friction law is extrapolated beyond its fitted range.
    pub friction_extrapolated: bool,
}

impl AxisSample {
    /// Writes or replaces the signals; the name of the controller is that of the parameters.
    pub(super) fn code(&mut self, codec: &mut StateCodec<'_>) {
        codec.numbers([
            &mut self.psec,
            &mut self.delayed_psec,
            &mut self.position,
            &mut self.wind_up,
            &mut self.velocity,
            &mut self.current,
            &mut self.current_setpoint,
            &mut self.voltage,
            &mut self.velocity_setpoint,
            &mut self.velocity_feedforward,
            &mut self.torque_feedforward,
            &mut self.friction_current,
            &mut self.gravity_current,
            &mut self.load_current,
            &mut self.effort,
        ]);
        codec.flag(&mut self.saturated);
        codec.flag(&mut self.friction_extrapolated);
    }

    /// Returns the following error `PSEC_k − SP`, m or rad; it contains the pure delay α.
    pub fn following_error(&self) -> f64 {
        self.psec - self.position
    }

    /// Returns the delay-compensated following error `PSEC_floor(k − α/Tsp) − SP`, m or rad.
    pub fn delay_compensated_following_error(&self) -> f64 {
        self.delayed_psec - self.position
    }
}
