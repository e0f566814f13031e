//! Compensation of friction at the velocity of the setpoint.

use crate::config::{AxisConfig, Periods};
use crate::control::SetpointHistory;
use crate::drive::Friction;
use crate::units::seconds;

/// The friction torque that the setpoint's velocity will meet, by the drive's own friction law.
///
/// ```text
/// torque = weight · Kt i_f(V(t − shift))      V((k + ½) Tsp) = (PSEC_{k+1} − PSEC_k) / Tsp, linear between
/// ```
///
/// Nothing at standstill. Fed forward where the axis reverses, it takes away the spike that friction
/// leaves there. The staircase of differences would tell the reversal to a period; the line between them
/// tells it to a tick.
#[derive(Debug, Clone, PartialEq)]
pub struct FrictionCompensation {
    friction: Friction,
    /// Motor speed per setpoint difference, rad/s per m or rad.
    speed_per_step: f64,
    weight: f64,
    /// Behind PSEC, ticks.
    shift: u64,
    ticks_per_setpoint: u64,
}

impl FrictionCompensation {
    /// That of `axis`, `shift` ticks behind PSEC; none where its weight is 0.
    pub fn new(axis: &AxisConfig, periods: &Periods, shift: u64) -> Option<Self> {
        let (r, weight) = (axis.transmission_ratio, axis.feedforward.friction);
        (weight != 0.0).then(|| FrictionCompensation {
            friction: Friction::new(axis.friction, axis.kind, r, axis.motor.torque_constant),
            speed_per_step: 1.0 / seconds(periods.position) / r,
            weight,
            shift,
            ticks_per_setpoint: periods.ticks_per_position(),
        })
    }

    /// Setpoints ahead of the present one that the velocity is taken from.
    pub fn preview(&self) -> i64 {
        let (period, half) = (self.ticks_per_setpoint as i64, self.ticks_per_setpoint as i64 / 2);
        // At the last tick of a period, one and a half periods ahead of what is compensated.
        ((period - 1 - self.shift as i64 - half).div_euclid(period) + 2).max(0)
    }

    /// The torque at `tick`, N·m at the motor.
    #[inline]
    pub fn torque(&self, psec: &SetpointHistory, tick: u64) -> f64 {
        let period = self.ticks_per_setpoint as i64;
        let since_midpoint = tick as i64 - self.shift as i64 - period / 2;
        let k = since_midpoint.div_euclid(period);
        let fraction = since_midpoint.rem_euclid(period) as f64 / period as f64;
        let before = psec.at(k + 1) - psec.at(k);
        let behind = psec.at(k + 2) - psec.at(k + 1);
        let speed = (before + (behind - before) * fraction) * self.speed_per_step;
        if speed == 0.0 { 0.0 } else { (self.weight * self.friction.bound(speed)).copysign(speed) }
    }
}
