//! Zero-order-held position setpoints: history, preview, delays α, β, γ, and feedforward of their derivatives.

use crate::config::{DelaysConfig, FeedforwardConfig};
use crate::state_codec::StateCodec;
use crate::units::Nanoseconds;

/// Largest number of setpoints of a stored state, so that no tick overflows.
const MAX_COUNT: u64 = 1 << 40;

/// Delays of the setpoint, ticks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Delays {
    /// α, in front of the position comparator.
    pub position: u64,
    /// β, after the velocity feedforward.
    pub velocity: u64,
    /// γ, after the torque feedforward.
    pub torque: u64,
    /// Delay of the friction compensation.
    pub friction: u64,
}

impl Delays {
    /// Creates delays, rounded to the nearest tick of `tick` ns.
    pub fn new(config: &DelaysConfig, tick: Nanoseconds) -> Self {
        let ticks = |delay: Nanoseconds| ((delay.max(0) + tick / 2) / tick) as u64;
        Delays {
            position: ticks(config.alpha),
            velocity: ticks(config.beta),
            torque: ticks(config.gamma),
            friction: ticks(config.friction),
        }
    }

    /// Returns the longest delay, ticks.
    pub fn longest(&self) -> u64 {
        self.position.max(self.velocity).max(self.torque).max(self.friction)
    }
}

/// Delay of a zero-order-held setpoint, divided into whole position cycles and ticks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TickDelay {
    cycles: i64,
    ticks: u64,
}

impl TickDelay {
    /// Creates a delay of `ticks`; a position cycle has `ticks_per_setpoint` ticks.
    pub fn new(ticks: u64, ticks_per_setpoint: u64) -> Self {
        TickDelay { cycles: (ticks / ticks_per_setpoint) as i64, ticks: ticks % ticks_per_setpoint }
    }

    /// Returns the tick of a position cycle at which the delayed setpoint switches.
    #[inline]
    pub fn switch_tick(self) -> u64 {
        self.ticks
    }

    /// Returns the index of the delayed setpoint in position cycle k from [`switch_tick`](Self::switch_tick) on; before
    /// that tick the index is one less.
    #[inline]
    pub fn index_after_switch(self, k: i64) -> i64 {
        k - self.cycles
    }

    /// Returns the index of the delayed setpoint at the first tick of position cycle k.
    #[inline]
    pub fn index_at_cycle_start(self, k: i64) -> i64 {
        self.index_after_switch(k) - i64::from(self.ticks > 0)
    }
}

/// Setpoint range that the controllers access, relative to the present index.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct SetpointWindow {
    /// Longest delay, ticks.
    pub delay: u64,
    /// Setpoints read behind the delayed one.
    pub lookback: usize,
    /// Preview: setpoints read ahead of the present one.
    pub preview: usize,
}

/// Zero-order-held position setpoints PSEC, past and preview: value k holds on [k·Tsp, (k+1)·Tsp).
///
/// Before the first setpoint PSEC has its first value. Unknown future setpoints have the value of the last known one.
#[derive(Debug, Clone, PartialEq)]
pub struct SetpointHistory {
    /// Ring buffer that contains setpoint k twice, at k modulo half its length and half its length further, so that
    /// consecutive setpoints are always a contiguous slice.
    ring: Box<[f64]>,
    ticks_per_setpoint: u64,
    /// Number of setpoints that have been pushed.
    count: u64,
    /// Number of previewed setpoints after those.
    preview: usize,
}

impl SetpointHistory {
    /// Creates a history for setpoints within `window`, and two more for the second difference.
    pub fn new(initial: f64, ticks_per_setpoint: u64, window: SetpointWindow) -> Self {
        SetpointHistory {
            ring: vec![initial; 2 * Self::length(ticks_per_setpoint, window)].into_boxed_slice(),
            ticks_per_setpoint,
            count: 0,
            preview: window.preview,
        }
    }

    /// Returns the number of setpoints to store: delay, lookback and preview, the present one, and two for the second
    /// difference, rounded up to a power of two, so that a mask gives the ring index.
    fn length(ticks_per_setpoint: u64, window: SetpointWindow) -> usize {
        let needed =
            window.delay.div_ceil(ticks_per_setpoint) as usize + 3 + window.lookback + window.preview;
        needed.next_power_of_two()
    }

    fn ring_index(&self, k: i64) -> usize {
        k as usize & (self.ring.len() / 2 - 1)
    }

    /// Changes the window. Setpoints older than the stored ones read as the oldest stored one; a longer preview is
    /// known from the next position cycle on.
    pub fn set_window(&mut self, window: SetpointWindow) {
        let (length, old) = (Self::length(self.ticks_per_setpoint, window), self.ring.len() / 2);
        let preview = std::mem::replace(&mut self.preview, window.preview);
        if length == old && preview == window.preview {
            return;
        }
        let count = self.count as i64;
        // Setpoints before the first one have its value.
        let oldest = count + preview as i64 - old as i64;
        let mut resized = SetpointHistory {
            ring: vec![0.0; 2 * length].into_boxed_slice(),
            ticks_per_setpoint: self.ticks_per_setpoint,
            count: self.count,
            preview: window.preview,
        };
        for k in count - length as i64..count {
            resized.store(k, self.at(k.max(oldest)));
        }
        *self = resized;
    }

    /// Writes or replaces the stored setpoints.
    pub(crate) fn code(&mut self, codec: &mut StateCodec<'_>) {
        self.count = codec.integer(self.count, MAX_COUNT);
        let (first, second) = self.ring.split_at_mut(self.ring.len() / 2);
        codec.numbers(first.iter_mut());
        second.copy_from_slice(first);
    }

    /// Appends the setpoint of the next position cycle.
    #[inline]
    pub fn push(&mut self, psec: f64) {
        if self.count == 0 {
            self.ring.fill(psec);
        }
        self.store(self.count as i64, psec);
        self.count += 1;
    }

    /// Sets the preview: known setpoints after the last pushed one.
    #[inline]
    pub fn set_preview(&mut self, preview: &[f64]) {
        let mut last = self.at(self.present_index());
        for j in 0..self.preview {
            last = preview.get(j).copied().unwrap_or(last);
            self.store((self.count + j as u64) as i64, last);
        }
    }

    #[inline]
    fn store(&mut self, k: i64, psec: f64) {
        let index = self.ring_index(k);
        self.ring[index] = psec;
        self.ring[index + self.ring.len() / 2] = psec;
    }

    /// Returns the index of the setpoint of the present position cycle; -1 before the first setpoint.
    #[inline]
    pub fn present_index(&self) -> i64 {
        self.count as i64 - 1
    }

    /// Returns PSEC_k; the first setpoint for negative k.
    #[inline]
    pub fn at(&self, k: i64) -> f64 {
        self.ring[self.ring_index(k)]
    }

    /// Returns the setpoints up to PSEC_k, N of them.
    #[inline]
    fn last<const N: usize>(&self, k: i64) -> [f64; N] {
        let mut setpoints = [0.0; N];
        setpoints.copy_from_slice(self.slice(k - (N as i64 - 1), N));
        setpoints
    }

    /// Returns `count` consecutive setpoints from PSEC_k on, at most as many as the window contains.
    #[inline]
    pub fn slice(&self, k: i64, count: usize) -> &[f64] {
        &self.ring[self.ring_index(k)..][..count]
    }
}

/// Velocity and torque feedforward in motor units (Prévost eqs. 6 to 8).
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
    /// Creates a feedforward for position cycle `period` (s) and transmission ratio r.
    pub fn new(config: &FeedforwardConfig, period: f64, transmission_ratio: f64) -> Self {
        Feedforward {
            velocity: config.velocity / period / transmission_ratio,
            torque: config.torque / (period * period) / transmission_ratio,
        }
    }

    /// Returns VFFWS of setpoints k − 1 and k, rad/s of the motor.
    #[inline]
    pub fn velocities(&self, psec: &SetpointHistory, k: i64) -> [f64; 2] {
        let [a, b, c] = psec.last(k);
        [b - a, c - b].map(|change| self.velocity * change)
    }

    /// Returns TFFWS of setpoints k − 1 and k, N·m at the motor.
    #[inline]
    pub fn torques(&self, psec: &SetpointHistory, k: i64) -> [f64; 2] {
        let [a, b, c, d] = psec.last(k);
        [(c - b) - (b - a), (d - c) - (c - b)].map(|difference| self.torque * difference)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::{MICROSECOND_NS, MILLISECOND_NS};

    #[test]
    fn a_delay_of_1_5_cycles_reads_two_setpoints_back_at_the_start_of_a_cycle() {
        let delay = TickDelay::new(72, 48);
        assert_eq!(delay.index_at_cycle_start(9), 7);
        // The delayed setpoint switches in the middle of the position cycle.
        assert_eq!((delay.switch_tick(), delay.index_after_switch(9)), (24, 8));
        let whole = TickDelay::new(96, 48);
        assert_eq!(
            (whole.index_at_cycle_start(9), whole.switch_tick(), whole.index_after_switch(9)),
            (7, 0, 7)
        );
    }

    #[test]
    fn consecutive_setpoints_are_a_slice() {
        let mut h = SetpointHistory::new(0.0, 48, SetpointWindow { delay: 96, lookback: 1, preview: 3 });
        for k in 0..40 {
            h.push(f64::from(k));
            h.set_preview(&[1, 2, 3].map(|j| f64::from(k + j)));
            let first = (k - 4).max(0);
            let wanted: Vec<f64> = (first..=k + 3).map(f64::from).collect();
            assert_eq!(h.slice(i64::from(first), wanted.len()), wanted);
        }
    }

    #[test]
    fn psec_before_the_first_setpoint_is_the_first_setpoint() {
        let mut h = SetpointHistory::new(0.0, 48, SetpointWindow { delay: 72, ..SetpointWindow::default() });
        h.push(5.0);
        assert_eq!(h.at(-1), 5.0);
        let f = Feedforward { velocity: 1.0, torque: 1.0 };
        assert_eq!((f.velocities(&h, 0), f.torques(&h, 0)), ([0.0; 2], [0.0; 2]));
    }

    #[test]
    fn a_longer_delay_reads_the_stored_setpoints() {
        let mut h = SetpointHistory::new(0.0, 48, SetpointWindow { delay: 48, ..SetpointWindow::default() });
        for k in 0..10 {
            h.push(f64::from(k));
        }
        h.set_window(SetpointWindow { delay: 6 * 48, ..SetpointWindow::default() });
        assert_eq!((h.at(9), h.at(6), h.at(5), h.at(1)), (9.0, 6.0, 6.0, 6.0));
        h.push(10.0);
        assert_eq!(h.at(10), 10.0);
    }

    #[test]
    fn unknown_preview_is_the_last_known_setpoint() {
        let mut h = SetpointHistory::new(0.0, 48, SetpointWindow { delay: 72, lookback: 1, preview: 3 });
        for k in 0..10 {
            h.push(f64::from(k));
            h.set_preview(&[f64::from(k) + 1.0, f64::from(k) + 2.0]);
        }
        assert_eq!([9, 10, 11, 12].map(|k| h.at(k)), [9.0, 10.0, 11.0, 11.0]);
        assert_eq!([6, 7, 8].map(|k| h.at(k)), [6.0, 7.0, 8.0]);
        h.set_window(SetpointWindow { delay: 72, lookback: 1, preview: 5 });
        assert_eq!([6, 7, 8, 9].map(|k| h.at(k)), [6.0, 7.0, 8.0, 9.0]);
        h.push(10.0);
        h.set_preview(&[]);
        assert_eq!([10, 11, 15].map(|k| h.at(k)), [10.0; 3]);
    }

    #[test]
    fn delays_are_rounded_to_the_nearest_tick() {
        let config = DelaysConfig { alpha: 9 * MILLISECOND_NS, beta: 187_499, gamma: 187_500, friction: 0 };
        let d = Delays::new(&config, 125 * MICROSECOND_NS);
        assert_eq!((d.position, d.velocity, d.torque), (72, 1, 2));
    }
}
