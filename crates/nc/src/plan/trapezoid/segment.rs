//! Parts of the path with constant limits, and the motion along them.

use std::sync::Arc;

use super::super::interval_motion::PathState;
use super::super::piece::Piece;

/// Shortest part of a motion that is executed, m.
pub(super) const LEAST_LENGTH: f64 = 1e-9;

/// End of a segment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum SegmentEnd {
    /// Continues with at most this speed, m/s.
    Through(f64),
    Stop,
    /// The next motion starts at the latest when this speed is left, m/s.
    Overlap(f64),
}

/// Part of the path with constant limits.
#[derive(Debug)]
pub(super) struct SpeedSegment {
    pub piece: Arc<Piece>,
    pub scale: f64,
    /// Start, from the start of the piece, in the path parameter.
    pub from: f64,
    /// Length, m.
    pub length: f64,
    pub speed: f64,
    pub entry_speed: f64,
    pub acceleration: f64,
    pub jerk: f64,
    pub end: SegmentEnd,
}

/// JerkPhase of constant jerk, which is 0 without a jerk limit.
#[derive(Debug, Clone, Copy)]
pub(super) struct JerkPhase {
    pub duration: f64,
    /// Distance from the start of the segment, m, speed and acceleration at the start of the phase.
    pub at: f64,
    pub speed: f64,
    pub acceleration: f64,
    pub jerk: f64,
}

impl JerkPhase {
    /// Returns the state in the path parameter of the piece, `time` after the start of the phase.
    pub fn state(&self, time: f64, segment: &SpeedSegment) -> PathState {
        PathState {
            u: segment.from + (self.at + self.distance(time)) / segment.scale,
            rate: (self.speed + time * (self.acceleration + 0.5 * time * self.jerk)).max(0.0) / segment.scale,
            acceleration: (self.acceleration + time * self.jerk) / segment.scale,
        }
    }

    /// Returns the distance covered `time` after the start of the phase, m.
    pub fn distance(&self, time: f64) -> f64 {
        time * (self.speed + time * (0.5 * self.acceleration + time * self.jerk / 6.0))
    }
}

impl SpeedSegment {
    /// Returns the times of a change of speed: of each of the two parts of constant jerk, and of constant acceleration.
    pub fn change(&self, speeds: [f64; 2]) -> [f64; 2] {
        let change = (speeds[1] - speeds[0]).abs();
        let jerk_time = (self.acceleration / self.jerk).min((change / self.jerk).sqrt());
        [jerk_time, (change / self.acceleration - jerk_time).max(0.0)]
    }

    /// Returns the distance of a change of speed, m.
    pub fn change_length(&self, speeds: [f64; 2]) -> f64 {
        let [jerk_time, constant] = self.change(speeds);
        0.5 * (speeds[0] + speeds[1]) * (2.0 * jerk_time + constant)
    }

    /// Returns the speed at the end of the segment after slowing down from another one all along it, m/s.
    pub fn slowed(&self, speed: f64) -> f64 {
        (speed * speed - 2.0 * self.acceleration * self.length).max(0.0).sqrt()
    }

    /// Returns the speed that is reached from another one along the segment, m/s.
    pub fn reachable(&self, speed: f64) -> f64 {
        let most = (speed * speed + 2.0 * self.acceleration * self.length).sqrt();
        if self.jerk.is_infinite() {
            return most;
        }
        largest([speed, most], |end| self.change_length([speed, end]) <= self.length)
    }
}

/// Number of halvings that find a speed.
const HALVINGS: usize = 60;

/// Returns the largest number in a range that fits; the first one does.
fn largest([mut fitting, mut most]: [f64; 2], fits: impl Fn(f64) -> bool) -> f64 {
    if fits(most) {
        return most;
    }
    for _ in 0..HALVINGS {
        let middle = f64::midpoint(fitting, most);
        if fits(middle) { fitting = middle } else { most = middle }
    }
    fitting
}

/// Returns the motion along a segment between two speeds.
pub(super) fn phases(segment: &SpeedSegment, [start, end]: [f64; 2]) -> Vec<JerkPhase> {
    let &SpeedSegment { length, speed, acceleration: a, .. } = segment;
    if length < LEAST_LENGTH {
        return Vec::new();
    }
    if segment.jerk.is_finite() {
        return jerk_limited_phases(segment, [start, end]);
    }
    let reachable = (0.5 * (start * start + end * end) + a * length).sqrt();
    let peak = speed.max(end).min(reachable);
    let mut phases = Vec::with_capacity(3);
    let mut at = 0.0;
    let mut push = |duration: f64, speed: f64, acceleration: f64| {
        if duration > 0.0 {
            phases.push(JerkPhase { duration, at, speed, acceleration, jerk: 0.0 });
            at += duration * (speed + 0.5 * duration * acceleration);
        }
    };
    if reachable <= start.max(end) {
        push(2.0 * length / (start + end), start, (end * end - start * start) / (2.0 * length));
        return phases;
    }
    // The start can be faster than the feed.
    let ramps = ((peak * peak - start * start).abs() + peak * peak - end * end) / (2.0 * a);
    push((peak - start).abs() / a, start, a * (peak - start).signum());
    push((length - ramps).max(0.0) / peak, peak, 0.0);
    push((peak - end) / a, peak, -a);
    phases
}

/// Returns the motion along a segment between two speeds within its jerk limit.
fn jerk_limited_phases(segment: &SpeedSegment, [start, end]: [f64; 2]) -> Vec<JerkPhase> {
    let ramps = |peak: f64| segment.change_length([start, peak]) + segment.change_length([peak, end]);
    let least = start.max(end);
    let peak = largest([least, segment.speed.max(least)], |peak| ramps(peak) <= segment.length);
    let cruise = (segment.length - ramps(peak)).max(0.0) / peak;
    let mut phases: Vec<JerkPhase> = Vec::with_capacity(7);
    let mut at = 0.0;
    let mut push = |duration: f64, speed: f64, acceleration: f64, jerk: f64| {
        if duration > 0.0 {
            let phase = JerkPhase { duration, at, speed, acceleration, jerk };
            at += phase.distance(duration);
            phases.push(phase);
        }
    };
    for (speeds, sign, cruise) in [([start, peak], 1.0, cruise), ([peak, end], -1.0, 0.0)] {
        let [jerk_time, constant] = segment.change(speeds);
        let (jerk, acceleration) = (sign * segment.jerk, sign * segment.jerk * jerk_time);
        push(jerk_time, speeds[0], 0.0, jerk);
        push(constant, speeds[0] + 0.5 * acceleration * jerk_time, acceleration, 0.0);
        push(jerk_time, speeds[1] - 0.5 * acceleration * jerk_time, acceleration, -jerk);
        push(cruise, peak, 0.0, 0.0);
    }
    phases
}
