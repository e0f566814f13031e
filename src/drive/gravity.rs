//! What weight asks of the motor.

use super::elementary::sine;
use crate::config::GravityConfig;
use crate::lanes::{Number, numbers};

numbers! {
    /// `C_gravity = r (W + k sin(SP + φ))`, N·m at the motor, positive against motion towards plus.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct Gravity {
        /// r W, N·m.
        weight: N,
        /// r k, N·m.
        tilt: N,
        phase: N,
    }
}

impl Gravity {
    /// Gravity of an axis behind a transmission of ratio r (m or rad per rad of the motor).
    pub fn new(gravity: &GravityConfig, transmission_ratio: f64) -> Self {
        Gravity {
            weight: transmission_ratio * gravity.weight,
            tilt: transmission_ratio * gravity.tilt,
            phase: gravity.phase,
        }
    }

    /// Whether the torque depends on where the axis stands.
    pub fn is_tilting(&self) -> bool {
        self.tilt != 0.0
    }
}

impl<N: Number> Gravity<N> {
    /// Torque of an axis that does not tilt, N·m at the motor.
    #[inline(always)]
    pub(super) fn weight(&self) -> N {
        self.weight
    }

    /// Torque at the axis position `position` (m or rad), N·m at the motor.
    #[inline(always)]
    pub fn torque(&self, position: N) -> N {
        self.tilt.mul_add(sine(position + self.phase), self.weight)
    }
}
