//! What weight asks of the motor.

use crate::config::GravityConfig;

/// `C_gravity = r (W + k sin(SP + φ))`, N·m at the motor, positive against motion towards plus.
#[derive(Debug, Clone, PartialEq)]
pub struct Gravity {
    weight: f64,
    tilt: f64,
    phase: f64,
    ratio: f64,
}

impl Gravity {
    /// Gravity of an axis behind a transmission of ratio r (m or rad per rad of the motor).
    pub fn new(gravity: &GravityConfig, transmission_ratio: f64) -> Self {
        Gravity {
            weight: gravity.weight,
            tilt: gravity.tilt,
            phase: gravity.phase,
            ratio: transmission_ratio,
        }
    }

    /// Torque at the axis position `position` (m or rad), N·m at the motor.
    #[inline]
    pub fn torque(&self, position: f64) -> f64 {
        if self.tilt == 0.0 {
            return self.ratio * self.weight;
        }
        self.ratio * (self.weight + self.tilt * (position + self.phase).sin())
    }
}
