//! Motion along one interval of the path over time.

use super::window::{Interval, Stations, WindowStart};

/// Distance, rate and acceleration of the path parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PathState {
    pub u: f64,
    pub rate: f64,
    pub acceleration: f64,
}

/// Law of motion of an interval; distances count from its start.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Law {
    /// Constant jerk from the given rate and acceleration.
    Jerk { rate: f64, acceleration: f64, jerk: f64 },
    /// Constant jerk to a standstill at the end.
    Stop { jerk: f64 },
    /// u̇² = rate² + 2 acceleration u + stiffness u².
    Quadratic { rate: f64, acceleration: f64, stiffness: f64 },
    /// Standstill.
    Dwell,
}

/// Motion along one interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct IntervalMotion {
    pub law: Law,
    pub length: f64,
    /// Duration, s.
    pub duration: f64,
}

/// Argument below which hyperbolic functions are computed by their series.
const SERIES: f64 = 0.5;
/// 1 / ((2n + k − 1) (2n + k)) for n = 1, 2, … and k = 0, 1, 2: ratios of the terms x^n / (2n + k)!.
const INVERSES: [[f64; 9]; 3] = {
    let mut inverses = [[0.0; 9]; 3];
    let mut k = 0;
    while k < 3 {
        let mut n = 1;
        while n < 10 {
            inverses[k][n - 1] = 1.0 / ((2 * n + k - 1) * (2 * n + k)) as f64;
            n += 1;
        }
        k += 1;
    }
    inverses
};
/// Newton steps for the duration of an interval.
const NEWTON_STEPS: usize = 8;

/// Returns C = cosh √x, S₁ = sinh √x / √x and S₂ = (cosh √x − 1) / x, for negative x with circular functions.
fn functions(x: f64) -> [f64; 3] {
    if x.abs() < SERIES {
        let series =
            |inverse: &[f64; 9]| inverse.iter().rev().fold(1.0, |sum, inverse| 1.0 + x * inverse * sum);
        return [series(&INVERSES[0]), series(&INVERSES[1]), 0.5 * series(&INVERSES[2])];
    }
    let root = x.abs().sqrt();
    if x > 0.0 {
        return [root.cosh(), root.sinh() / root, (root.cosh() - 1.0) / x];
    }
    [root.cos(), root.sin() / root, (root.cos() - 1.0) / x]
}

fn travel(rate: f64, acceleration: f64, stiffness: f64, t: f64) -> PathState {
    let [c, s1, s2] = functions(stiffness * t * t);
    PathState {
        u: t * (rate * s1 + t * acceleration * s2),
        rate: rate * c + t * acceleration * s1,
        acceleration: acceleration * c + t * stiffness * rate * s1,
    }
}

impl IntervalMotion {
    /// Creates the constant-jerk motion of `length` from a standstill to `b` = u̇².
    pub fn start(length: f64, b: f64) -> Self {
        let jerk = 2.0 / 9.0 * b * b.sqrt() / (length * length);
        let law = Law::Jerk { rate: 0.0, acceleration: 0.0, jerk };
        Self { law, length, duration: 3.0 * length / b.sqrt() }
    }

    /// Creates the constant-jerk motion of `length` from `b` = u̇² to a standstill.
    pub fn stop(length: f64, b: f64) -> Self {
        let jerk = 2.0 / 9.0 * b * b.sqrt() / (length * length);
        Self { law: Law::Stop { jerk }, length, duration: 3.0 * length / b.sqrt() }
    }

    /// Creates the motion between stations with (b, b′), b = u̇².
    pub fn between(length: f64, from: (f64, f64), to: (f64, f64)) -> Self {
        let (rate, acceleration) = (from.0.sqrt(), 0.5 * from.1);
        let stiffness = 0.5 * (to.1 - from.1) / length;
        let mut t = 2.0 * length / (rate + to.0.sqrt());
        for _ in 0..NEWTON_STEPS {
            let state = travel(rate, acceleration, stiffness, t);
            let step = (length - state.u) / state.rate;
            t += step;
            if step.abs() <= 1e-15 * t {
                break;
            }
        }
        Self { law: Law::Quadratic { rate, acceleration, stiffness }, length, duration: t }
    }

    /// Creates a standstill.
    pub fn dwell(duration: f64) -> Self {
        Self { law: Law::Dwell, length: 0.0, duration }
    }

    /// Returns the state `t` seconds after the start of the interval.
    pub fn at(&self, t: f64) -> PathState {
        let state = match self.law {
            Law::Dwell => PathState { u: 0.0, rate: 0.0, acceleration: 0.0 },
            Law::Jerk { rate, acceleration, jerk } => PathState {
                u: t * (rate + t * (0.5 * acceleration + t * jerk / 6.0)),
                rate: rate + t * (acceleration + 0.5 * t * jerk),
                acceleration: acceleration + t * jerk,
            },
            Law::Stop { jerk } => {
                let left = self.duration - t;
                PathState {
                    u: self.length - jerk * left * left * left / 6.0,
                    rate: 0.5 * jerk * left * left,
                    acceleration: -jerk * left,
                }
            }
            Law::Quadratic { rate, acceleration, stiffness } => travel(rate, acceleration, stiffness, t),
        };
        PathState { u: state.u.clamp(0.0, self.length), ..state }
    }

    /// Returns the state and the jerk at the fraction `part` of the length, or next to a standstill of the duration.
    pub fn at_part(&self, part: f64) -> (PathState, f64) {
        let state = match self.law {
            Law::Quadratic { rate, acceleration, stiffness } => {
                let u = part * self.length;
                let b = rate * rate + u * (2.0 * acceleration + u * stiffness);
                PathState { u, rate: b.max(0.0).sqrt(), acceleration: acceleration + u * stiffness }
            }
            _ => self.at(part * self.duration),
        };
        (state, self.jerk_at(&state))
    }

    /// Returns the jerk of the path parameter in `state`.
    pub fn jerk_at(&self, state: &PathState) -> f64 {
        match self.law {
            Law::Jerk { jerk, .. } | Law::Stop { jerk } => jerk,
            Law::Quadratic { stiffness, .. } => stiffness * state.rate,
            Law::Dwell => 0.0,
        }
    }

    /// Returns b = u̇² and b′ at the start.
    pub fn start_state(&self) -> (f64, f64) {
        match self.law {
            Law::Quadratic { rate, acceleration, .. } => (rate * rate, 2.0 * acceleration),
            _ => {
                let state = self.at(0.0);
                (state.rate * state.rate, 2.0 * state.acceleration)
            }
        }
    }
}

/// Returns the motion through `stations`.
pub(super) fn motions(
    intervals: &[Interval],
    start: WindowStart,
    stations: &Stations,
) -> Vec<IntervalMotion> {
    let mut motions = Vec::with_capacity(intervals.len());
    if start == WindowStart::Rest {
        motions.push(IntervalMotion::start(intervals[0].length, stations[0].0));
    }
    let offset = motions.len();
    for (interval, pair) in intervals[offset..].iter().zip(stations.windows(2)) {
        motions.push(IntervalMotion::between(interval.length, pair[0], pair[1]));
    }
    motions.push(IntervalMotion::stop(intervals[intervals.len() - 1].length, stations[stations.len() - 1].0));
    motions
}

/// Returns the peak of the rate in the fastest motion from standstill to standstill over `length` without a part of constant
/// rate.
pub(super) fn peak_rate(length: f64, acceleration: f64, jerk: f64) -> f64 {
    let full = acceleration / jerk;
    let peak = 0.5 * acceleration * ((full * full + 4.0 * length / acceleration).sqrt() - full);
    if peak < acceleration * full { (0.25 * length * length * jerk).cbrt() } else { peak }
}

/// Returns the fastest motion from standstill to standstill along a straight line with limits of rate, acceleration and
/// jerk: up to seven motions of constant jerk.
pub(super) fn straight_line(length: f64, limits: [f64; 3]) -> Vec<IntervalMotion> {
    let [rate, acceleration, jerk] = limits;
    let full = acceleration / jerk;
    let ramp = |peak: f64| {
        let jerk_time = full.min((peak / jerk).sqrt());
        (jerk_time, (peak / (jerk * jerk_time) - jerk_time).max(0.0))
    };
    let ramps_length = |peak: f64| {
        let (jerk_time, constant) = ramp(peak);
        peak * (2.0 * jerk_time + constant)
    };
    let peak = if ramps_length(rate) > length { peak_rate(length, acceleration, jerk) } else { rate };
    let (jerk_time, constant) = ramp(peak);
    let cruise = ((length - ramps_length(peak)) / peak).max(0.0);
    let phases = [
        (jerk_time, jerk),
        (constant, 0.0),
        (jerk_time, -jerk),
        (cruise, 0.0),
        (jerk_time, -jerk),
        (constant, 0.0),
    ];
    let mut motions = Vec::with_capacity(phases.len() + 1);
    let (mut covered, mut rate, mut acceleration) = (0.0, 0.0, 0.0);
    for (i, (duration, jerk)) in phases.into_iter().enumerate() {
        if i == 3 {
            (rate, acceleration) = (peak, 0.0);
        }
        if duration > 0.0 {
            let mut motion = IntervalMotion {
                law: Law::Jerk { rate, acceleration, jerk },
                length: f64::INFINITY,
                duration,
            };
            let end = motion.at(duration);
            motion.length = end.u;
            (rate, acceleration) = (end.rate, end.acceleration);
            covered += end.u;
            motions.push(motion);
        }
    }
    motions.push(IntervalMotion {
        law: Law::Stop { jerk },
        length: (length - covered).max(0.0),
        duration: jerk_time,
    });
    motions
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn segments_meet_both_ends(length in 1e-6..1e-2f64, rate in 0.01..1.0f64, a in -0.9..0.9f64, b in -0.5..0.5f64) {
            let b0 = rate * rate;
            let slope = a * b0 / length;
            let bend = b * b0 * (1.0 - a.abs()) / (length * length);
            let end = (b0 + slope * length + 0.5 * bend * length * length, slope + bend * length);
            prop_assume!(end.0 > 0.01 * b0);
            let motion = IntervalMotion::between(length, (b0, slope), end);
            let state = motion.at(motion.duration);
            prop_assert!((state.u - length).abs() < 1e-14 * length.max(1e-3));
            prop_assert!((state.rate - end.0.sqrt()).abs() < 1e-9 * rate);
            prop_assert!((state.acceleration - 0.5 * end.1).abs() < 1e-9 * (b0 / length));
        }
    }

    #[test]
    fn a_standstill_segment_is_consistent() {
        let motion = IntervalMotion::start(1e-5, 4e-4);
        let end = motion.at(motion.duration);
        assert!((end.u - 1e-5).abs() < 1e-18 && (end.rate - 0.02).abs() < 1e-15);
        let stop = IntervalMotion::stop(1e-5, 4e-4);
        assert!(stop.at(0.0).u < 1e-18 && (stop.at(0.0).rate - 0.02).abs() < 1e-15);
    }
}
