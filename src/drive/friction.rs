//! Friction as a function of velocity, and how it acts over one tick.

use crate::config::{AxisKind, FrictionConfig};
use crate::units::{METRE_PER_MINUTE, RPM};

/// Velocity up to which the law was fitted, m/min or rev/min (Prévost eq. 3).
const FITTED_RANGE: f64 = 20.0;

/// Double-exponential friction law of one axis, seen from its motor.
///
/// (Prévost eq. 3) `i_f(V) = a e^{bV} + c e^{dV}` for V > 0, odd in V; at standstill any value within
/// ±i0. V is in m/min (linear axis) or rev/min (rotary axis). The torque is `Kt i_f`.
#[derive(Debug, Clone, PartialEq)]
pub struct Friction {
    law: FrictionConfig,
    torque_constant: f64,
    /// V per ω of the motor, (m/min)/(rad/s) or (rev/min)/(rad/s).
    velocity_per_speed: f64,
}

impl Friction {
    /// Friction of an axis of `kind` behind a transmission of ratio r (m or rad per rad of the motor),
    /// whose motor has `torque_constant` Kt in N·m/A.
    pub fn new(law: FrictionConfig, kind: AxisKind, transmission_ratio: f64, torque_constant: f64) -> Self {
        let unit = match kind {
            AxisKind::Linear => METRE_PER_MINUTE,
            AxisKind::Rotary => RPM,
        };
        Friction { law, torque_constant, velocity_per_speed: transmission_ratio / unit }
    }

    /// Largest friction torque at motor speed ω (rad/s), N·m; never negative.
    #[inline]
    pub fn bound(&self, speed: f64) -> f64 {
        let current = if speed == 0.0 {
            self.law.i0
        } else {
            let v = speed.abs() * self.velocity_per_speed;
            self.law.a * (self.law.b * v).exp() + self.law.c * (self.law.d * v).exp()
        };
        // `max` also turns the NaN of an extrapolated ∞ − ∞ into zero.
        (self.torque_constant * current).max(0.0)
    }

    /// Friction torque over one tick, N·m, positive against motion towards plus.
    ///
    /// `free_speed` is the ω that the tick would end with if there were no friction, `speed` the ω
    /// that it starts with, `speed_per_torque` the change of ω per torque. The result is the torque
    /// that would end the tick at standstill, limited to the law's bound; the flag says whether it
    /// does end at standstill.
    #[inline]
    pub fn over_tick(&self, speed: f64, free_speed: f64, speed_per_torque: f64) -> (f64, bool) {
        let bound = self.bound(speed);
        let stopping = free_speed / speed_per_torque;
        if stopping.abs() <= bound { (stopping, true) } else { (bound.copysign(stopping), false) }
    }

    /// Whether the law is extrapolated at motor speed ω (rad/s).
    #[inline]
    pub fn is_extrapolated(&self, speed: f64) -> bool {
        speed.abs() * self.velocity_per_speed > FITTED_RANGE
    }
}
