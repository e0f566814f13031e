//! Jerk-limited speed profile of a span, from an entry speed to an exit speed, with zero acceleration at
//! both ends.

use rsruckig::prelude::{DataArrayOrVec, InputParameter, Ruckig, ThrowErrorHandler, Trajectory};

/// Limits along a path for speed, acceleration and jerk, in m or rad per power of second.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct FeedLimits {
    pub velocity: f64,
    pub acceleration: f64,
    pub jerk: f64,
}

impl FeedLimits {
    /// Returns the limits for a motion slower by the factor `scale`: each derivative order is scaled once
    /// more.
    pub fn slowed(self, scale: f64) -> Self {
        Self {
            velocity: self.velocity * scale,
            acceleration: self.acceleration * scale * scale,
            jerk: self.jerk * scale * scale * scale,
        }
    }
}

/// Jerk-limited ramp from a lower to a higher speed: jerk, constant acceleration, opposite jerk.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Ramp {
    low: f64,
    high: f64,
    jerk: f64,
    /// Duration of each phase of constant jerk, s.
    jerk_time: f64,
    /// Duration of the phase of constant acceleration, s.
    acceleration_time: f64,
}

impl Ramp {
    /// Creates the fastest ramp within `limits`.
    pub fn new(low: f64, high: f64, limits: &FeedLimits) -> Self {
        let FeedLimits { acceleration, jerk, .. } = *limits;
        let gain = (high - low).max(0.0);
        let jerk_time = acceleration / jerk;
        if gain >= acceleration * jerk_time {
            return Self { low, high, jerk, jerk_time, acceleration_time: gain / acceleration - jerk_time };
        }
        Self { low, high, jerk, jerk_time: (gain / jerk).sqrt(), acceleration_time: 0.0 }
    }

    /// Returns the duration, s.
    pub fn duration(&self) -> f64 {
        2.0 * self.jerk_time + self.acceleration_time
    }

    /// Returns the length of the ramp. It is symmetric, so its mean speed is the mean of both speeds.
    pub fn length(&self) -> f64 {
        0.5 * (self.low + self.high) * self.duration()
    }

    /// Returns the distance `t` seconds after the start at the lower speed.
    fn at(&self, t: f64) -> f64 {
        let j = self.jerk;
        let first = t.min(self.jerk_time);
        let mut s = first * (self.low + j * first * first / 6.0);
        if t <= self.jerk_time {
            return s;
        }
        let (mut v, a) = (self.low + j * first * first / 2.0, j * first);
        let second = (t - self.jerk_time).min(self.acceleration_time);
        s += second * (v + a * second / 2.0);
        v += a * second;
        let third = (t - self.jerk_time - self.acceleration_time).clamp(0.0, self.jerk_time);
        s + third * (v + third * (a / 2.0 - j * third / 6.0))
    }
}

/// Speed profile: ramp up, constant speed, ramp down.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct SpeedProfile {
    length: f64,
    peak: f64,
    up: Ramp,
    down: Ramp,
    /// Duration of the phase of constant speed, s.
    cruise_time: f64,
}

impl SpeedProfile {
    /// Returns the duration, s.
    pub fn duration(&self) -> f64 {
        self.up.duration() + self.cruise_time + self.down.duration()
    }

    /// Returns the highest speed.
    pub fn highest_speed(&self) -> f64 {
        self.peak
    }

    /// Returns a time at the highest speed, s.
    pub fn time_of_highest_speed(&self) -> f64 {
        self.up.duration() + 0.5 * self.cruise_time
    }

    /// Returns the distance after `t` seconds, monotonic. The second half is computed backward from the
    /// end, so that terms of equal sign are added wherever the speed is small.
    pub fn at(&self, t: f64) -> f64 {
        let left = self.duration() - t;
        if t <= 0.0 {
            return 0.0;
        }
        if left <= 0.0 {
            return self.length;
        }
        let slowing = (self.length - self.down.length()).max(0.0);
        if left < self.down.duration() {
            return (self.length - self.down.at(left)).clamp(slowing, self.length);
        }
        let up = self.up.duration();
        if t < up {
            return self.up.at(t).min(slowing);
        }
        (self.up.length() + self.peak * (t - up)).min(slowing)
    }
}

/// Planner of speed profiles, with the working memory of rsruckig.
#[derive(Debug)]
pub(super) struct SpeedProfilePlanner {
    ruckig: Ruckig<1, ThrowErrorHandler>,
    input: InputParameter<1>,
    output: Trajectory<1>,
}

/// Range of normalized inputs for rsruckig, whose tolerances are absolute, 10⁻⁸ of its units.
const PLANNER_RANGE: std::ops::RangeInclusive<f64> = 1e-3..=1e3;
/// Bisection steps that determine a speed to the last bit without an initial guess: ten for its exponent,
/// 52 for its mantissa, and a reserve.
const MAX_STEPS: usize = 80;

impl Default for SpeedProfilePlanner {
    fn default() -> Self {
        Self {
            // The cycle time is used by rsruckig's online mode only.
            ruckig: Ruckig::new(None, 1.0),
            input: InputParameter::new(None),
            output: Trajectory::new(None),
        }
    }
}

impl SpeedProfilePlanner {
    /// Returns the fastest profile of `length` from speed `entry` to speed `exit`. Both are within the
    /// limits, and each is reachable from the other on that length.
    pub fn plan(&mut self, length: f64, entry: f64, exit: f64, limits: &FeedLimits) -> SpeedProfile {
        let ramps = |peak: f64| (Ramp::new(entry, peak, limits), Ramp::new(exit, peak, limits));
        let ramps_length = |peak: f64| {
            let (up, down) = ramps(peak);
            up.length() + down.length()
        };
        let floor = entry.max(exit);
        let peak = if ramps_length(limits.velocity) <= length {
            limits.velocity
        } else {
            let guess = self.peak(length, entry, exit, limits);
            largest_fitting(floor, limits.velocity, guess, |peak| ramps_length(peak) <= length)
        };
        let (up, down) = ramps(peak);
        let left = (length - up.length() - down.length()).max(0.0);
        let cruise_time = if left > 0.0 { left / peak } else { 0.0 };
        SpeedProfile { length, peak, up, down, cruise_time }
    }

    /// Returns rsruckig's peak speed, in units of the limits: an initial guess, exact to the 10⁻⁸ that
    /// rsruckig guarantees.
    fn peak(&mut self, length: f64, entry: f64, exit: f64, limits: &FeedLimits) -> Option<f64> {
        let time = limits.velocity / limits.acceleration;
        let unit = limits.velocity * time;
        let (length, jerk) = (length / unit, limits.jerk * time / limits.acceleration);
        if !PLANNER_RANGE.contains(&length) || !PLANNER_RANGE.contains(&jerk) {
            return None;
        }
        let one = |value: f64| DataArrayOrVec::Stack([value]);
        self.input.target_position = one(length);
        self.input.current_velocity = one(entry / limits.velocity);
        self.input.target_velocity = one(exit / limits.velocity);
        self.input.max_velocity = one(1.0);
        self.input.max_acceleration = one(1.0);
        self.input.max_jerk = one(jerk);
        self.ruckig.calculate(&self.input, &mut self.output).ok()?;
        let profile = &self.output.profiles.first()?[0];
        // Within a phase the speed is highest where the acceleration crosses 0.
        let highest = |i: usize| {
            let (speed, acceleration, jerk) = (profile.v[i], profile.a[i], profile.j[i]);
            let passes = acceleration > 0.0 && profile.a[i + 1] < 0.0;
            if passes { speed - 0.5 * acceleration * acceleration / jerk } else { speed }
        };
        let peak = (0..profile.j.len()).map(highest).fold(profile.vf, f64::max);
        Some(peak * limits.velocity).filter(|peak| peak.is_finite())
    }
}

/// Returns the largest speed up to `cap` that is reachable from `entry` within `length`.
pub(super) fn max_reachable_speed(length: f64, entry: f64, cap: f64, limits: &FeedLimits) -> f64 {
    let fits = |speed: f64| Ramp::new(entry, speed, limits).length() <= length;
    if cap <= entry || fits(cap) { cap } else { largest_fitting(entry, cap, None, fits) }
}

/// Relative width of the bracket around an initial guess.
const GUESS_WIDTH: f64 = 1e-7;

/// Returns the largest number between `low`, which satisfies `fits`, and `high`, which does not, that
/// satisfies `fits`, by bisection.
fn largest_fitting(mut low: f64, mut high: f64, guess: Option<f64>, fits: impl Fn(f64) -> bool) -> f64 {
    if let Some(guess) = guess {
        for trial in [guess * (1.0 - GUESS_WIDTH), guess * (1.0 + GUESS_WIDTH)] {
            if trial > low && trial < high {
                if fits(trial) { low = trial } else { high = trial }
            }
        }
    }
    for _ in 0..MAX_STEPS {
        // Bisect the exponents while the bounds are far apart, then the numbers.
        let least = low.max(f64::MIN_POSITIVE);
        let middle = if high / least > 4.0 { least.sqrt() * high.sqrt() } else { low + 0.5 * (high - low) };
        if middle <= low || middle >= high {
            break;
        }
        if fits(middle) { low = middle } else { high = middle }
    }
    low
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const LIMITS: FeedLimits = FeedLimits { velocity: 0.5, acceleration: 2.5, jerk: 50.0 };

    proptest! {
        #[test]
        fn peak_speed_agrees_with_rsruckig(
            length in 1e-3..0.3f64, entry in 0.0..0.5f64, exit in 0.0..0.5f64,
        ) {
            let (low, high) = (entry.min(exit), entry.max(exit));
            // The duration is not smooth at the reachable limit: its error is of the order of the square
            // root of the rounding error.
            let exit_up = low + 0.999 * (max_reachable_speed(length, low, high, &LIMITS) - low);
            let mut planner = SpeedProfilePlanner::default();
            let profile = planner.plan(length, low, exit_up, &LIMITS);
            if let Some(guess) = planner.peak(length, low, exit_up, &LIMITS) {
                let highest = profile.peak;
                prop_assert!((guess - highest).abs() < 1e-6, "{guess} {highest}");
                let duration = planner.output.get_duration() * LIMITS.velocity / LIMITS.acceleration;
                prop_assert!((duration - profile.duration()).abs() < 1e-9, "as fast as rsruckig");
            }
            prop_assert!((profile.up.length() + profile.down.length() + profile.cruise_time * profile.peak
                - length).abs() < 1e-14);
        }

        #[test]
        fn distance_is_continuous_and_monotonic(
            length in 1e-6..0.3f64, entry in 0.0..0.5f64, exit in 0.0..0.5f64,
        ) {
            let exit = max_reachable_speed(length, entry, exit, &LIMITS);
            let entry = max_reachable_speed(length, exit, entry, &LIMITS);
            let profile = SpeedProfilePlanner::default().plan(length, entry, exit, &LIMITS);
            let steps = 1000;
            let step = profile.duration() / f64::from(steps);
            let mut before = 0.0;
            for i in 0..=steps {
                let s = profile.at(f64::from(i) * step);
                prop_assert!(s >= before && s - before <= LIMITS.velocity * step * (1.0 + 1e-9));
                before = s;
            }
            prop_assert_eq!(profile.at(profile.duration()), length);
        }
    }
}
