//! Compensation of friction at the velocity of the set-point.

use crate::config::AxisConfig;
use crate::control::SetpointHistory;
use crate::drive::Friction;

/// The friction torque that the set-point's velocity will meet, by the drive's own friction law.
///
/// ```text
/// torque = weight · Kt i_f(V_k)      V_k = (PSEC_k − PSEC_{k−1}) / Tsp / r, 0 at standstill
/// ```
///
/// Fed forward where the axis reverses, it takes away the spike that friction leaves there; when that
/// is, behind PSEC, is for the drive's delays to say.
#[derive(Debug, Clone, PartialEq)]
pub struct FrictionCompensation {
    friction: Friction,
    speed_per_step: f64,
    weight: f64,
}

/// The torque of the set-point that was looked at last.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct CompensationState {
    /// Which one, and its torque.
    last: Option<(i64, f64)>,
}

impl FrictionCompensation {
    /// That of `axis` with the position period `period` (s); none where its weight is 0.
    pub fn new(axis: &AxisConfig, period: f64) -> Option<Self> {
        let (r, weight) = (axis.transmission_ratio, axis.feedforward.friction);
        (weight != 0.0).then(|| FrictionCompensation {
            friction: Friction::new(axis.friction, axis.kind, r, axis.motor.torque_constant),
            speed_per_step: 1.0 / period / r,
            weight,
        })
    }

    /// The torque for set-point k, N·m at the motor.
    pub fn torque(&self, s: &mut CompensationState, psec: &SetpointHistory, k: i64) -> f64 {
        match s.last {
            Some((last, torque)) if last == k => torque,
            _ => {
                let speed = (psec.at(k) - psec.at(k - 1)) * self.speed_per_step;
                let torque = if speed == 0.0 {
                    0.0
                } else {
                    (self.weight * self.friction.bound(speed)).copysign(speed)
                };
                s.last = Some((k, torque));
                torque
            }
        }
    }
}
