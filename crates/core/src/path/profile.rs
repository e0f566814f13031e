//! Speed along one span: jerk-limited, from an entry speed to an exit speed, without acceleration at
//! either end.

use rsruckig::prelude::{DataArrayOrVec, InputParameter, Ruckig, ThrowErrorHandler, Trajectory};

/// Limits along a path: per second, of the unit of its length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Limits {
    pub velocity: f64,
    pub acceleration: f64,
    pub jerk: f64,
}

impl Limits {
    /// What remains at `scale` times the pace: each order of the derivative once more.
    pub fn slowed(self, scale: f64) -> Self {
        Self {
            velocity: self.velocity * scale,
            acceleration: self.acceleration * scale * scale,
            jerk: self.jerk * scale * scale * scale,
        }
    }
}

/// Change from a lower speed to a higher one: jerk, constant acceleration, jerk back.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Ramp {
    low: f64,
    high: f64,
    jerk: f64,
    /// Of each phase of jerk, s.
    jerking: f64,
    /// Of the phase of constant acceleration, s.
    accelerating: f64,
}

impl Ramp {
    /// The fastest one.
    pub fn new(low: f64, high: f64, limits: &Limits) -> Self {
        let Limits { acceleration, jerk, .. } = *limits;
        let gain = (high - low).max(0.0);
        let jerking = acceleration / jerk;
        if gain >= acceleration * jerking {
            return Self { low, high, jerk, jerking, accelerating: gain / acceleration - jerking };
        }
        Self { low, high, jerk, jerking: (gain / jerk).sqrt(), accelerating: 0.0 }
    }

    /// s.
    pub fn duration(&self) -> f64 {
        2.0 * self.jerking + self.accelerating
    }

    /// Way in that time; the ramp is symmetric, so its mean speed is the mean of both.
    pub fn length(&self) -> f64 {
        0.5 * (self.low + self.high) * self.duration()
    }

    /// Way `t` seconds after the lower speed.
    fn at(&self, t: f64) -> f64 {
        let j = self.jerk;
        let first = t.min(self.jerking);
        let mut s = first * (self.low + j * first * first / 6.0);
        if t <= self.jerking {
            return s;
        }
        let (mut v, a) = (self.low + j * first * first / 2.0, j * first);
        let second = (t - self.jerking).min(self.accelerating);
        s += second * (v + a * second / 2.0);
        v += a * second;
        let third = (t - self.jerking - self.accelerating).clamp(0.0, self.jerking);
        s + third * (v + third * (a / 2.0 - j * third / 6.0))
    }
}

/// Ramp up, constant speed, ramp down.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Profile {
    length: f64,
    peak: f64,
    up: Ramp,
    down: Ramp,
    /// Of constant speed, s.
    cruising: f64,
}

impl Profile {
    /// s.
    pub fn duration(&self) -> f64 {
        self.up.duration() + self.cruising + self.down.duration()
    }

    /// Way after `t` seconds, never decreasing: the second half is counted back from the end, so that
    /// terms of one sign are added wherever the speed is small.
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

/// Plans profiles; holds the working memory of the planner.
#[derive(Debug)]
pub(super) struct ProfilePlanner {
    ruckig: Ruckig<1, ThrowErrorHandler>,
    input: InputParameter<1>,
    output: Trajectory<1>,
}

/// The planner's tolerances are absolute, 10⁻⁸ of its units; outside this range of numbers its answer
/// is not asked for.
const PLANNER_RANGE: std::ops::RangeInclusive<f64> = 1e-3..=1e3;
/// Steps that find a speed to the last bit even from no guess at all: ten for its exponent, 52 for its
/// mantissa, and some.
const MAX_STEPS: usize = 80;

impl Default for ProfilePlanner {
    fn default() -> Self {
        Self {
            // The cycle time matters to the planner's online mode only.
            ruckig: Ruckig::new(None, 1.0),
            input: InputParameter::new(None),
            output: Trajectory::new(None),
        }
    }
}

impl ProfilePlanner {
    /// The fastest profile of `length` from speed `entry` to speed `exit`, both within the limits and
    /// such that one can be reached from the other on that length.
    pub fn plan(&mut self, length: f64, entry: f64, exit: f64, limits: &Limits) -> Profile {
        let ramps = |peak: f64| (Ramp::new(entry, peak, limits), Ramp::new(exit, peak, limits));
        let way = |peak: f64| {
            let (up, down) = ramps(peak);
            up.length() + down.length()
        };
        let floor = entry.max(exit);
        let peak = if way(limits.velocity) <= length {
            limits.velocity
        } else {
            let guess = self.peak(length, entry, exit, limits);
            largest(floor, limits.velocity, guess, |peak| way(peak) <= length)
        };
        let (up, down) = ramps(peak);
        let left = (length - up.length() - down.length()).max(0.0);
        let cruising = if left > 0.0 { left / peak } else { 0.0 };
        Profile { length, peak, up, down, cruising }
    }

    /// The highest speed on the way after rsruckig, in units of the ramp's: a first guess, right to
    /// the 10⁻⁸ that it promises.
    fn peak(&mut self, length: f64, entry: f64, exit: f64, limits: &Limits) -> Option<f64> {
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
        // Within a phase the speed is highest where the acceleration passes through 0.
        let highest = |i: usize| {
            let (speed, acceleration, jerk) = (profile.v[i], profile.a[i], profile.j[i]);
            let passes = acceleration > 0.0 && profile.a[i + 1] < 0.0;
            if passes { speed - 0.5 * acceleration * acceleration / jerk } else { speed }
        };
        let peak = (0..profile.j.len()).map(highest).fold(profile.vf, f64::max);
        Some(peak * limits.velocity).filter(|peak| peak.is_finite())
    }
}

/// The largest speed up to `cap` that is reached from `entry` within `length`.
pub(super) fn reachable(length: f64, entry: f64, cap: f64, limits: &Limits) -> f64 {
    let fits = |speed: f64| Ramp::new(entry, speed, limits).length() <= length;
    if cap <= entry || fits(cap) { cap } else { largest(entry, cap, None, fits) }
}

/// Relative width around a guess that is tried first.
const GUESS_WIDTH: f64 = 1e-7;

/// The largest number between `low`, which `fits`, and `high`, which does not, that `fits`.
fn largest(mut low: f64, mut high: f64, guess: Option<f64>, fits: impl Fn(f64) -> bool) -> f64 {
    if let Some(guess) = guess {
        for near in [guess * (1.0 - GUESS_WIDTH), guess * (1.0 + GUESS_WIDTH)] {
            if near > low && near < high {
                if fits(near) { low = near } else { high = near }
            }
        }
    }
    for _ in 0..MAX_STEPS {
        // Far apart, halve the exponents; near, the numbers.
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

    const LIMITS: Limits = Limits { velocity: 0.5, acceleration: 2.5, jerk: 50.0 };

    proptest! {
        #[test]
        fn the_planner_and_the_equation_of_the_way_agree_on_the_peak(
            length in 1e-3..0.3f64, entry in 0.0..0.5f64, exit in 0.0..0.5f64,
        ) {
            let (low, high) = (entry.min(exit), entry.max(exit));
            // Just beyond reach the duration is not smooth: of the order of the root of a rounding.
            let exit_up = low + 0.999 * (reachable(length, low, high, &LIMITS) - low);
            let mut planner = ProfilePlanner::default();
            let profile = planner.plan(length, low, exit_up, &LIMITS);
            if let Some(guess) = planner.peak(length, low, exit_up, &LIMITS) {
                let highest = profile.peak;
                prop_assert!((guess - highest).abs() < 1e-6, "{guess} {highest}");
                let duration = planner.output.get_duration() * LIMITS.velocity / LIMITS.acceleration;
                prop_assert!((duration - profile.duration()).abs() < 1e-9, "as fast as rsruckig");
            }
            prop_assert!((profile.up.length() + profile.down.length() + profile.cruising * profile.peak
                - length).abs() < 1e-14);
        }

        #[test]
        fn the_way_grows_without_jumps(
            length in 1e-6..0.3f64, entry in 0.0..0.5f64, exit in 0.0..0.5f64,
        ) {
            let exit = reachable(length, entry, exit, &LIMITS);
            let entry = reachable(length, exit, entry, &LIMITS);
            let profile = ProfilePlanner::default().plan(length, entry, exit, &LIMITS);
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
