//! The staircase of position setpoints: delays and derivatives.

use crate::config::{DelaysConfig, FeedforwardConfig};
use crate::units::Nanoseconds;

/// Delays of the setpoint in ticks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Delays {
    /// α, before the position comparator.
    pub position: u64,
    /// β, behind the velocity feedforward.
    pub velocity: u64,
    /// γ, behind the torque feedforward.
    pub torque: u64,
    /// Shift of the friction compensation.
    pub friction: u64,
}

impl Delays {
    /// Delays rounded to the nearest tick of `tick` ns.
    pub fn new(config: &DelaysConfig, tick: Nanoseconds) -> Self {
        let ticks = |delay: Nanoseconds| ((delay.max(0) + tick / 2) / tick) as u64;
        Delays {
            position: ticks(config.alpha),
            velocity: ticks(config.beta),
            torque: ticks(config.gamma),
            friction: ticks(config.friction),
        }
    }

    /// The longest of them, ticks.
    pub fn longest(&self) -> u64 {
        self.position.max(self.velocity).max(self.torque).max(self.friction)
    }
}

/// A delay on the grid of position periods: whole ones, and ticks of another.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shift {
    periods: i64,
    ticks: u64,
}

impl Shift {
    /// A delay of `ticks` where a position period has `ticks_per_setpoint`.
    pub fn new(ticks: u64, ticks_per_setpoint: u64) -> Self {
        Shift { periods: (ticks / ticks_per_setpoint) as i64, ticks: ticks % ticks_per_setpoint }
    }

    /// The tick of a position period at which the staircase behind the delay moves on.
    #[inline]
    pub fn step(self) -> u64 {
        self.ticks
    }

    /// Index of the setpoint that it shows in position period k from [`step`](Self::step) on; before, it
    /// is the one before.
    #[inline]
    pub fn index(self, k: i64) -> i64 {
        k - self.periods
    }

    /// Index of the setpoint that it shows at the first tick of position period k.
    #[inline]
    pub fn index_at_instant(self, k: i64) -> i64 {
        self.index(k) - i64::from(self.ticks > 0)
    }
}

/// How far from the present one setpoints are read.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Reach {
    /// The longest delay, ticks.
    pub delay: u64,
    /// Setpoints behind the delay.
    pub lookback: usize,
    /// Setpoints ahead of the present one.
    pub ahead: usize,
}

/// PSEC as the staircase that the drive sees: value k holds on [k·Tsp, (k+1)·Tsp).
///
/// Before the first setpoint PSEC has its first value; what is not known of the future yet is its last.
#[derive(Debug, Clone, PartialEq)]
pub struct SetpointHistory {
    /// Setpoint k stands at k modulo half its length, and half its length behind that: setpoints that
    /// follow each other can be read as they stand, wherever they begin.
    ring: Box<[f64]>,
    ticks_per_setpoint: u64,
    /// How many setpoints have been pushed.
    count: u64,
    /// Setpoints that stand in the ring behind those.
    ahead: usize,
}

impl SetpointHistory {
    /// A history in which setpoints within `reach` can be read, and two more for the second derivative.
    pub fn new(initial: f64, ticks_per_setpoint: u64, reach: Reach) -> Self {
        SetpointHistory {
            ring: vec![initial; 2 * Self::length(ticks_per_setpoint, reach)].into_boxed_slice(),
            ticks_per_setpoint,
            count: 0,
            ahead: reach.ahead,
        }
    }

    /// Setpoints to hold: those that the delay spans, the present one, and two for the derivatives; a
    /// power of two, so that no division finds a place.
    fn length(ticks_per_setpoint: u64, reach: Reach) -> usize {
        let needed = reach.delay.div_ceil(ticks_per_setpoint) as usize + 3 + reach.lookback + reach.ahead;
        needed.next_power_of_two()
    }

    fn place(&self, k: i64) -> usize {
        k as usize & (self.ring.len() / 2 - 1)
    }

    /// Makes room for another reach; setpoints that are no longer known read as the oldest known one,
    /// those ahead are known from the next period on.
    pub fn adopt(&mut self, reach: Reach) {
        let (length, old) = (Self::length(self.ticks_per_setpoint, reach), self.ring.len() / 2);
        let ahead = std::mem::replace(&mut self.ahead, reach.ahead);
        if length == old && ahead == reach.ahead {
            return;
        }
        let count = self.count as i64;
        // Before the first setpoint stands its value.
        let oldest = count + ahead as i64 - old as i64;
        let mut grown = SetpointHistory {
            ring: vec![0.0; 2 * length].into_boxed_slice(),
            ticks_per_setpoint: self.ticks_per_setpoint,
            count: self.count,
            ahead: reach.ahead,
        };
        for k in count - length as i64..count {
            grown.put(k, self.at(k.max(oldest)));
        }
        *self = grown;
    }

    /// Adds the setpoint of the next position instant.
    #[inline]
    pub fn push(&mut self, psec: f64) {
        if self.count == 0 {
            self.ring.fill(psec);
        }
        self.put(self.count as i64, psec);
        self.count += 1;
    }

    /// The setpoints behind the last one that was pushed, as they are known now.
    #[inline]
    pub fn foresee(&mut self, ahead: &[f64]) {
        let mut last = self.at(self.present());
        for j in 0..self.ahead {
            last = ahead.get(j).copied().unwrap_or(last);
            self.put((self.count + j as u64) as i64, last);
        }
    }

    #[inline]
    fn put(&mut self, k: i64, psec: f64) {
        let place = self.place(k);
        self.ring[place] = psec;
        self.ring[place + self.ring.len() / 2] = psec;
    }

    /// Index of the setpoint of this position period; -1 before the first.
    #[inline]
    pub fn present(&self) -> i64 {
        self.count as i64 - 1
    }

    /// PSEC_k; the first value for k before the first setpoint.
    #[inline]
    pub fn at(&self, k: i64) -> f64 {
        self.ring[self.place(k)]
    }

    /// `count` setpoints from PSEC_k on, at most as many as the reach spans.
    #[inline]
    pub fn from(&self, k: i64, count: usize) -> &[f64] {
        &self.ring[self.place(k)..][..count]
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

    /// VFFWS of setpoint k, rad/s of the motor.
    #[inline]
    pub fn velocity(&self, psec: &SetpointHistory, k: i64) -> f64 {
        self.velocity * (psec.at(k) - psec.at(k - 1))
    }

    /// TFFWS of setpoint k, N·m at the motor.
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
        let shift = Shift::new(72, 48);
        assert_eq!(shift.index_at_instant(9), 7);
        // In mid-period the staircase behind the delay moves on.
        assert_eq!((shift.step(), shift.index(9)), (24, 8));
        let whole = Shift::new(96, 48);
        assert_eq!((whole.index_at_instant(9), whole.step(), whole.index(9)), (7, 0, 7));
    }

    #[test]
    fn set_points_in_a_row_are_read_as_they_stand() {
        let mut h = SetpointHistory::new(0.0, 48, Reach { delay: 96, lookback: 1, ahead: 3 });
        for k in 0..40 {
            h.push(f64::from(k));
            h.foresee(&[1, 2, 3].map(|j| f64::from(k + j)));
            let first = (k - 4).max(0);
            let wanted: Vec<f64> = (first..=k + 3).map(f64::from).collect();
            assert_eq!(h.from(i64::from(first), wanted.len()), wanted);
        }
    }

    #[test]
    fn before_the_first_set_point_psec_has_its_first_value() {
        let mut h = SetpointHistory::new(0.0, 48, Reach { delay: 72, ..Reach::default() });
        h.push(5.0);
        assert_eq!(h.at(-1), 5.0);
        let f = Feedforward { velocity: 1.0, torque: 1.0 };
        assert_eq!((f.velocity(&h, 0), f.torque(&h, 0)), (0.0, 0.0));
    }

    #[test]
    fn a_longer_delay_finds_the_set_points_that_are_known() {
        let mut h = SetpointHistory::new(0.0, 48, Reach { delay: 48, ..Reach::default() });
        for k in 0..10 {
            h.push(f64::from(k));
        }
        h.adopt(Reach { delay: 6 * 48, ..Reach::default() });
        assert_eq!((h.at(9), h.at(6), h.at(5), h.at(1)), (9.0, 6.0, 6.0, 6.0));
        h.push(10.0);
        assert_eq!(h.at(10), 10.0);
    }

    #[test]
    fn set_points_ahead_are_read_and_what_is_not_known_is_the_last_one() {
        let mut h = SetpointHistory::new(0.0, 48, Reach { delay: 72, lookback: 1, ahead: 3 });
        for k in 0..10 {
            h.push(f64::from(k));
            h.foresee(&[f64::from(k) + 1.0, f64::from(k) + 2.0]);
        }
        assert_eq!([9, 10, 11, 12].map(|k| h.at(k)), [9.0, 10.0, 11.0, 11.0]);
        assert_eq!([6, 7, 8].map(|k| h.at(k)), [6.0, 7.0, 8.0]);
        h.adopt(Reach { delay: 72, lookback: 1, ahead: 5 });
        assert_eq!([6, 7, 8, 9].map(|k| h.at(k)), [6.0, 7.0, 8.0, 9.0]);
        h.push(10.0);
        h.foresee(&[]);
        assert_eq!([10, 11, 15].map(|k| h.at(k)), [10.0; 3]);
    }

    #[test]
    fn delays_are_rounded_to_the_nearest_tick() {
        let config = DelaysConfig { alpha: 9 * MILLISECOND_NS, beta: 187_499, gamma: 187_500, friction: 0 };
        let d = Delays::new(&config, 125 * MICROSECOND_NS);
        assert_eq!((d.position, d.velocity, d.torque), (72, 1, 2));
    }
}
