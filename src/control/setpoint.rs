//! The staircase of position set-points: delays and derivatives.

use crate::config::{DelaysConfig, FeedforwardConfig};
use crate::units::Nanoseconds;

/// Delays α, β and γ in ticks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Delays {
    /// α, before the position comparator.
    pub position: u64,
    /// β, behind the velocity feedforward.
    pub velocity: u64,
    /// γ, behind the torque feedforward.
    pub torque: u64,
}

impl Delays {
    /// Delays rounded to the nearest tick of `tick` ns.
    pub fn new(config: &DelaysConfig, tick: Nanoseconds) -> Self {
        let ticks = |delay: Nanoseconds| ((delay.max(0) + tick / 2) / tick) as u64;
        Delays { position: ticks(config.alpha), velocity: ticks(config.beta), torque: ticks(config.gamma) }
    }

    /// The longest of the three, ticks.
    pub fn longest(&self) -> u64 {
        self.position.max(self.velocity).max(self.torque)
    }
}

/// PSEC as the staircase that the drive sees: value k holds on [k·Tsp, (k+1)·Tsp).
///
/// Before the first set-point PSEC has its first value.
#[derive(Debug, Clone, PartialEq)]
pub struct SetpointHistory {
    /// Ring: set-point k stands at k modulo its length.
    ring: Box<[f64]>,
    ticks_per_setpoint: u64,
    /// How many set-points have been pushed.
    count: u64,
    first: f64,
}

impl SetpointHistory {
    /// A history in which delays up to `longest_delay` ticks can be read, and two set-points more for
    /// the second derivative.
    pub fn new(initial: f64, ticks_per_setpoint: u64, longest_delay: u64) -> Self {
        SetpointHistory {
            ring: vec![initial; Self::length(ticks_per_setpoint, longest_delay)].into_boxed_slice(),
            ticks_per_setpoint,
            count: 0,
            first: initial,
        }
    }

    /// Set-points to hold: those that the delay spans, the present one, and two for the derivatives.
    fn length(ticks_per_setpoint: u64, longest_delay: u64) -> usize {
        (longest_delay.div_ceil(ticks_per_setpoint) + 3) as usize
    }

    /// Makes room for a longer delay; set-points that are no longer known read as the oldest known one.
    pub fn lengthen(&mut self, longest_delay: u64) {
        let length = Self::length(self.ticks_per_setpoint, longest_delay);
        if length <= self.ring.len() {
            return;
        }
        let count = self.count as i64;
        let oldest = (count - self.ring.len() as i64).max(0);
        let mut ring = vec![self.first; length].into_boxed_slice();
        for k in (count - length as i64).max(0)..count {
            ring[(k as u64 % length as u64) as usize] = self.at(k.max(oldest));
        }
        self.ring = ring;
    }

    /// Adds the set-point of the next position instant.
    #[inline]
    pub fn push(&mut self, psec: f64) {
        if self.count == 0 {
            self.first = psec;
        }
        let place = (self.count % self.ring.len() as u64) as usize;
        self.ring[place] = psec;
        self.count += 1;
    }

    /// PSEC_k; the first value for k before the first set-point.
    #[inline]
    pub fn at(&self, k: i64) -> f64 {
        if k < 0 {
            return self.first;
        }
        self.ring[(k as u64 % self.ring.len() as u64) as usize]
    }

    /// Index of the set-point that the staircase shows at `tick` behind a delay of `delay` ticks.
    #[inline]
    pub fn index(&self, tick: u64, delay: u64) -> i64 {
        (tick as i64 - delay as i64).div_euclid(self.ticks_per_setpoint as i64)
    }

    /// The staircase at `tick` behind a delay of `delay` ticks.
    #[inline]
    pub fn delayed(&self, tick: u64, delay: u64) -> f64 {
        self.at(self.index(tick, delay))
    }
}

/// Velocity and torque feedforward (Prévost eqs. 6 to 8), motor units.
///
/// ```text
/// VFFWS = VFFW (PSEC_k − PSEC_{k−1}) / Tsp / r
/// TFFWS = TFFW (PSEC_k − 2 PSEC_{k−1} + PSEC_{k−2}) / Tsp² / r
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Feedforward {
    velocity: f64,
    torque: f64,
}

impl Feedforward {
    /// Feedforward with position period `period` (s) behind a transmission of ratio r.
    pub fn new(config: &FeedforwardConfig, period: f64, transmission_ratio: f64) -> Self {
        Feedforward {
            velocity: config.velocity / period / transmission_ratio,
            torque: config.torque / (period * period) / transmission_ratio,
        }
    }

    /// VFFWS of set-point k, rad/s of the motor.
    #[inline]
    pub fn velocity(&self, psec: &SetpointHistory, k: i64) -> f64 {
        self.velocity * (psec.at(k) - psec.at(k - 1))
    }

    /// TFFWS of set-point k, N·m at the motor.
    #[inline]
    pub fn torque(&self, psec: &SetpointHistory, k: i64) -> f64 {
        self.torque * ((psec.at(k) - psec.at(k - 1)) - (psec.at(k - 1) - psec.at(k - 2)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::{MICROSECOND_NS, MILLISECOND_NS};

    #[test]
    fn a_delay_of_one_and_a_half_periods_reads_two_set_points_back_at_position_instants() {
        let mut h = SetpointHistory::new(0.0, 48, 72);
        for k in 0..10 {
            h.push(f64::from(k));
        }
        assert_eq!(h.delayed(9 * 48, 72), 7.0);
        // In mid-period the staircase behind the delay moves on.
        assert_eq!(h.delayed(9 * 48 + 23, 72), 7.0);
        assert_eq!(h.delayed(9 * 48 + 24, 72), 8.0);
    }

    #[test]
    fn before_the_first_set_point_psec_has_its_first_value() {
        let mut h = SetpointHistory::new(0.0, 48, 72);
        h.push(5.0);
        assert_eq!(h.at(-1), 5.0);
        let f = Feedforward { velocity: 1.0, torque: 1.0 };
        assert_eq!((f.velocity(&h, 0), f.torque(&h, 0)), (0.0, 0.0));
    }

    #[test]
    fn a_longer_delay_finds_the_set_points_that_are_known() {
        let mut h = SetpointHistory::new(0.0, 48, 48);
        for k in 0..10 {
            h.push(f64::from(k));
        }
        h.lengthen(6 * 48);
        assert_eq!((h.at(9), h.at(6), h.at(5), h.at(1)), (9.0, 6.0, 6.0, 6.0));
        h.push(10.0);
        assert_eq!(h.at(10), 10.0);
    }

    #[test]
    fn delays_are_rounded_to_the_nearest_tick() {
        let config = DelaysConfig { alpha: 9 * MILLISECOND_NS, beta: 187_499, gamma: 187_500 };
        let d = Delays::new(&config, 125 * MICROSECOND_NS);
        assert_eq!((d.position, d.velocity, d.torque), (72, 1, 2));
    }
}
