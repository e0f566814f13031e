//! Speed profile of a span, from an entry speed to an exit speed, with zero acceleration at both ends: jerk-limited, or
//! with cosine ramps from rest to rest.

use std::f64::consts::PI;

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

/// Ramp from a lower to a higher speed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Ramp {
    low: f64,
    high: f64,
    shape: RampShape,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum RampShape {
    /// Constant jerk, constant acceleration, opposite jerk; durations of a phase of constant jerk and of the constant
    /// acceleration, s.
    Jerk { jerk: f64, jerk_time: f64, acceleration_time: f64 },
    /// Speed high/2 (1 − cos(π t/duration)) from rest.
    Cosine { duration: f64 },
}

impl Ramp {
    /// Creates the fastest ramp within `limits`.
    pub fn new(low: f64, high: f64, limits: &FeedLimits) -> Self {
        let FeedLimits { acceleration, jerk, .. } = *limits;
        let gain = (high - low).max(0.0);
        let jerk_time = acceleration / jerk;
        let (jerk_time, acceleration_time) = if gain >= acceleration * jerk_time {
            (jerk_time, gain / acceleration - jerk_time)
        } else {
            ((gain / jerk).sqrt(), 0.0)
        };
        Self { low, high, shape: RampShape::Jerk { jerk, jerk_time, acceleration_time } }
    }

    /// Returns the duration, s.
    pub fn duration(&self) -> f64 {
        match self.shape {
            RampShape::Jerk { jerk_time, acceleration_time, .. } => 2.0 * jerk_time + acceleration_time,
            RampShape::Cosine { duration } => duration,
        }
    }

    /// Returns the length of the ramp. It is symmetric, so its mean speed is the mean of both speeds.
    pub fn length(&self) -> f64 {
        0.5 * (self.low + self.high) * self.duration()
    }

    /// Returns the distance `t` seconds after the start at the lower speed.
    fn at(&self, t: f64) -> f64 {
        let (jerk, jerk_time, acceleration_time) = match self.shape {
            RampShape::Jerk { jerk, jerk_time, acceleration_time } => (jerk, jerk_time, acceleration_time),
            RampShape::Cosine { duration } => {
                return 0.5 * self.high * duration / PI * minus_sine(PI * t / duration);
            }
        };
        let first = t.min(jerk_time);
        let mut s = first * (self.low + jerk * first * first / 6.0);
        if t <= jerk_time {
            return s;
        }
        let (mut v, a) = (self.low + jerk * first * first / 2.0, jerk * first);
        let second = (t - jerk_time).min(acceleration_time);
        s += second * (v + a * second / 2.0);
        v += a * second;
        let third = (t - jerk_time - acceleration_time).clamp(0.0, jerk_time);
        s + third * (v + third * (a / 2.0 - jerk * third / 6.0))
    }
}

/// Angle below which x − sin x is computed by its series, because the difference would cancel, rad.
const SERIES_BELOW: f64 = 0.5;

/// Returns x − sin x for x ≥ 0.
fn minus_sine(x: f64) -> f64 {
    if x >= SERIES_BELOW {
        return x - x.sin();
    }
    let y = x * x;
    // The next term, x¹⁵/15!, is below 10⁻¹⁴ of the first one.
    x * y / 6.0
        * (1.0 - y / 20.0 * (1.0 - y / 42.0 * (1.0 - y / 72.0 * (1.0 - y / 110.0 * (1.0 - y / 156.0)))))
}

/// Returns the length that both cosine ramps need together.
pub(super) fn both_ramps_length(feed: f64, ramp: f64) -> f64 {
    feed * ramp
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
    /// Returns the fastest profile of `length` from speed `entry` to speed `exit`. Both are within the
    /// limits, and each is reachable from the other on that length.
    pub fn new(length: f64, entry: f64, exit: f64, limits: &FeedLimits) -> Self {
        let ramps = |peak: f64| (Ramp::new(entry, peak, limits), Ramp::new(exit, peak, limits));
        let ramps_length = |peak: f64| {
            let (up, down) = ramps(peak);
            up.length() + down.length()
        };
        let peak = if ramps_length(limits.velocity) <= length {
            limits.velocity
        } else {
            largest_fitting(entry.max(exit), limits.velocity, |peak| ramps_length(peak) <= length)
        };
        let (up, down) = ramps(peak);
        let left = (length - up.length() - down.length()).max(0.0);
        let cruise_time = if left > 0.0 { left / peak } else { 0.0 };
        Self { length, peak, up, down, cruise_time }
    }

    /// Returns a profile with cosine ramps of the duration `ramp`; `length` must be at least that of both ramps.
    pub fn cosine(length: f64, feed: f64, ramp: f64) -> Self {
        let cruise_time = ((length - both_ramps_length(feed, ramp)) / feed).max(0.0);
        let ramp = Ramp { low: 0.0, high: feed, shape: RampShape::Cosine { duration: ramp } };
        Self { length, peak: feed, up: ramp, down: ramp, cruise_time }
    }

    /// Returns the duration, s.
    pub fn duration(&self) -> f64 {
        match self.up.shape {
            RampShape::Cosine { duration } => 2.0 * duration + self.cruise_time,
            RampShape::Jerk { .. } => self.up.duration() + self.cruise_time + self.down.duration(),
        }
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

/// Returns the largest speed up to `cap` that is reachable from `entry` within `length`.
pub(super) fn max_reachable_speed(length: f64, entry: f64, cap: f64, limits: &FeedLimits) -> f64 {
    let fits = |speed: f64| Ramp::new(entry, speed, limits).length() <= length;
    if cap <= entry || fits(cap) { cap } else { largest_fitting(entry, cap, fits) }
}

/// Bisection steps that determine a speed to the last bit: ten for its exponent, 52 for its mantissa, and a reserve.
const MAX_STEPS: usize = 80;

/// Returns the largest number between `low`, which satisfies `fits`, and `high`, which does not, that
/// satisfies `fits`, by bisection.
fn largest_fitting(mut low: f64, mut high: f64, fits: impl Fn(f64) -> bool) -> f64 {
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
    use rsruckig::prelude::{DataArrayOrVec, InputParameter, Ruckig, ThrowErrorHandler, Trajectory};

    const LIMITS: FeedLimits = FeedLimits { velocity: 0.5, acceleration: 2.5, jerk: 50.0 };

    proptest! {
        #[test]
        fn a_profile_is_as_fast_as_that_of_rsruckig(
            length in 1e-3..0.3f64, entry in 0.0..0.5f64, exit in 0.0..0.5f64,
        ) {
            let (low, high) = (entry.min(exit), entry.max(exit));
            // The duration is not smooth at the reachable limit: its error is of the order of the square
            // root of the rounding error.
            let exit = low + 0.999 * (max_reachable_speed(length, low, high, &LIMITS) - low);
            let profile = SpeedProfile::new(length, low, exit, &LIMITS);
            // rsruckig's tolerances are absolute, so that its units are those of the limits.
            let time = LIMITS.velocity / LIMITS.acceleration;
            let one = |value: f64| DataArrayOrVec::Stack([value]);
            let mut input = InputParameter::<1>::new(None);
            input.target_position = one(length / (LIMITS.velocity * time));
            input.current_velocity = one(low / LIMITS.velocity);
            input.target_velocity = one(exit / LIMITS.velocity);
            (input.max_velocity, input.max_acceleration) = (one(1.0), one(1.0));
            input.max_jerk = one(LIMITS.jerk * time / LIMITS.acceleration);
            let mut output = Trajectory::new(None);
            let mut ruckig = Ruckig::<1, ThrowErrorHandler>::new(None, 1.0);
            if ruckig.calculate(&input, &mut output).is_ok() {
                prop_assert!((output.get_duration() * time - profile.duration()).abs() < 1e-9);
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
            let profile = SpeedProfile::new(length, entry, exit, &LIMITS);
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
