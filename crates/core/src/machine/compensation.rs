//! Friction compensation: feedforward of the friction torque at the setpoint velocity, against reversal spikes.

use crate::config::{AxisConfig, Periods};
use crate::control::SetpointHistory;
use crate::drive::Friction;
use crate::units::seconds;

/// Friction compensation of one axis: friction torque at the setpoint velocity, by the friction law of the axis.
///
/// ```text
/// C_comp(t) = weight · Kt i_f(V(t − delay))      V((k + ½) Tsp) = (PSEC_{k+1} − PSEC_k) / Tsp, linear between
/// ```
///
/// The torque is 0 at standstill. It changes its sign where the setpoint reverses and removes the reversal spike.
/// Linear interpolation of V locates the reversal to a tick; differences held over a position cycle would locate it
/// to a position cycle.
#[derive(Debug, Clone, PartialEq)]
pub struct FrictionCompensation {
    friction: Friction,
    /// Motor speed per setpoint difference, rad/s per m or rad.
    speed_per_step: f64,
    weight: f64,
    /// Delay behind PSEC, ticks.
    delay: u64,
    ticks_per_setpoint: u64,
}

impl FrictionCompensation {
    /// Creates the compensation of `axis`, delayed by `delay` ticks behind PSEC; `None` if its weight is 0.
    pub fn new(axis: &AxisConfig, periods: &Periods, delay: u64) -> Option<Self> {
        let (r, weight) = (axis.transmission_ratio, axis.feedforward.friction);
        (weight != 0.0).then(|| FrictionCompensation {
            friction: Friction::of_axis(axis, axis.motor.torque_constant),
            speed_per_step: 1.0 / seconds(periods.position) / r,
            weight,
            delay,
            ticks_per_setpoint: periods.ticks_per_position(),
        })
    }

    /// Returns the preview: number of future setpoints that the velocity is computed from.
    pub fn preview(&self) -> i64 {
        let (period, half) = (self.ticks_per_setpoint as i64, self.ticks_per_setpoint as i64 / 2);
        // The last tick of a position cycle reads furthest: 1.5 cycles ahead of the compensated instant.
        ((period - 1 - self.delay as i64 - half).div_euclid(period) + 2).max(0)
    }

    /// Returns the torque at `tick`, N·m at the motor.
    #[inline]
    pub fn torque(&self, psec: &SetpointHistory, tick: u64) -> f64 {
        let period = self.ticks_per_setpoint as i64;
        let since_midpoint = tick as i64 - self.delay as i64 - period / 2;
        let k = since_midpoint.div_euclid(period);
        let fraction = since_midpoint.rem_euclid(period) as f64 / period as f64;
        let before = psec.at(k + 1) - psec.at(k);
        let after = psec.at(k + 2) - psec.at(k + 1);
        let speed = (before + (after - before) * fraction) * self.speed_per_step;
        if speed == 0.0 { 0.0 } else { (self.weight * self.friction.bound(speed)).copysign(speed) }
    }
}
