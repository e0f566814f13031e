//! Position controllers: set-point and position in, velocity set-point out.

use crate::config::PositionControllerConfig;

/// A position controller; works in motor units (rad, rad/s).
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PositionController {
    /// `Ω* = Kp (θ* − θ)`.
    Proportional {
        /// Kp, s⁻¹.
        gain: f64,
    },
}

impl PositionController {
    /// Controller as configured.
    pub fn new(config: &PositionControllerConfig) -> Self {
        match *config {
            PositionControllerConfig::Cascade { gain } => PositionController::Proportional { gain },
        }
    }

    /// Name as in `position_loop.controller`.
    pub fn name(&self) -> &'static str {
        match self {
            PositionController::Proportional { .. } => "cascade",
        }
    }

    /// Ω* for the set-point θ* and the angle θ, before the limit of the motor's speed.
    #[inline]
    pub fn update(&self, setpoint: f64, angle: f64) -> f64 {
        match self {
            PositionController::Proportional { gain } => gain * (setpoint - angle),
        }
    }
}
