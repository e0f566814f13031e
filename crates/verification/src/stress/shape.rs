//! Setpoints of one axis at random, within its limits by construction.

use super::random::Random;
use virtual_axes_core::config::LimitsConfig;
use virtual_axes_core::units::{Nanoseconds, seconds};

/// What of a limit is used at most: rounding stays inside.
const WITHIN: f64 = 0.999;
/// Where a joint without stroke may go, m or rad.
const UNLIMITED: f64 = 10.0;
/// Part of a stroke that a trajectory takes at most.
const PART_OF_STROKE: f64 = 0.9;

/// What an axis may be asked for.
#[derive(Debug, Clone, Copy)]
pub struct Reach {
    /// Tsp, s.
    pub period: f64,
    /// m/s or rad/s.
    pub velocity: f64,
    /// m/s² or rad/s².
    pub acceleration: f64,
    /// m/s³ or rad/s³.
    pub jerk: f64,
    low: f64,
    high: f64,
}

impl Reach {
    /// Within `limits`; acceleration and jerk may be `sharper` than these, which only the motor minds.
    pub fn new(limits: &LimitsConfig, period: Nanoseconds, sharper: f64) -> Self {
        Reach {
            period: seconds(period),
            velocity: WITHIN * limits.velocity,
            acceleration: sharper * limits.acceleration,
            jerk: sharper * limits.jerk,
            low: limits.stroke_min.max(-UNLIMITED),
            high: limits.stroke_max.min(UNLIMITED),
        }
    }

    fn span(&self) -> f64 {
        PART_OF_STROKE * (self.high - self.low)
    }

    /// A start from which displacements between `low` and `high` stay inside the stroke.
    pub fn start(&self, random: &mut Random, low: f64, high: f64) -> f64 {
        random.between(self.low - low.min(0.0), self.high - high.max(0.0))
    }

    /// Displacements of a move from rest to rest within `periods` position periods, at these.
    ///
    /// Its velocity is the convolution of three boxes of n₁, n₂ and n₃ periods: it is D/(n₁T) at most, its difference
    /// D/(n₁n₂T²), the difference of that D/(n₁n₂n₃T³), or twice that where no box is as wide as the others together
    /// (Biagiotti and Melchiorri 2012).
    pub fn rest_to_rest(&self, random: &mut Random, periods: usize) -> Vec<f64> {
        let spare = periods.saturating_sub(3).max(1);
        let second = random.below(spare / 2 + 1) + 1;
        let third = random.below((spare - second.min(spare)) / 2 + 1) + 1;
        let first = (periods + 2).saturating_sub(second + third).max(1);
        let t = self.period;
        let counts = [first, second, third].map(|n| n as f64);
        // Two of the edges that lower the acceleration act at once unless the widest box is as wide as the others together.
        let widest = first.max(second).max(third);
        let at_once = if 2 * widest < first + second + third { 2.0 } else { 1.0 };
        let most = [
            self.velocity * counts[0] * t,
            self.acceleration * counts[0] * counts[1] * t * t,
            self.jerk * counts[0] * counts[1] * counts[2] * t * t * t / at_once,
            self.span(),
        ];
        let distance =
            random.sign() * random.between(0.05, 1.0) * most.into_iter().fold(f64::INFINITY, f64::min);
        let mut steps = vec![distance];
        for boxes in [first, second, third] {
            let mut wider = vec![0.0; steps.len() + boxes - 1];
            for (at, step) in steps.iter().enumerate() {
                wider[at..at + boxes].iter_mut().for_each(|value| *value += step / boxes as f64);
            }
            steps = wider;
        }
        summed(steps)
    }

    /// Displacements of a random walk of `periods` position periods that ends at rest.
    pub fn walk(&self, random: &mut Random, periods: usize) -> Vec<f64> {
        let (t, change) = (self.period, self.acceleration * self.period);
        let (mut velocity, mut acceleration) = (0.0, 0.0);
        let steps = (1..=periods).map(|k| {
            if random.chance(0.3) {
                acceleration = random.between(-change, change);
            }
            // What can still be braked.
            let most = f64::min(self.velocity, change * (periods - k) as f64);
            velocity = f64::clamp(velocity + acceleration, -most, most);
            velocity * t
        });
        self.fitting(summed(steps.collect()))
    }

    /// Displacements of a stream whose velocity goes in steps.
    pub fn steps(&self, random: &mut Random, periods: usize) -> Vec<f64> {
        let mut velocity = 0.0;
        let steps = (1..=periods).map(|k| {
            if k == 1 || random.chance(0.15) {
                velocity = random.between(-self.velocity, self.velocity);
            }
            if k == periods { 0.0 } else { velocity * self.period }
        });
        self.fitting(summed(steps.collect()))
    }

    /// The same, smaller where they take too much of the stroke.
    fn fitting(&self, mut displacements: Vec<f64>) -> Vec<f64> {
        let (low, high) = extent(&displacements);
        let scale = (self.span() / (high - low)).min(1.0);
        displacements.iter_mut().for_each(|value| *value *= scale);
        displacements
    }

    /// What of a curve with such largest velocity, acceleration and extent is within all limits.
    pub fn scale(&self, velocity: f64, acceleration: f64, span: f64) -> f64 {
        (self.velocity / velocity).min(self.acceleration / acceleration).min(self.span() / span)
    }
}

/// Lowest and highest, and 0.
pub fn extent(displacements: &[f64]) -> (f64, f64) {
    displacements.iter().fold((0.0, 0.0), |(low, high): (f64, f64), &value| (low.min(value), high.max(value)))
}

/// Their sums, from 0 on.
fn summed(steps: Vec<f64>) -> Vec<f64> {
    let mut sum = 0.0;
    std::iter::once(0.0)
        .chain(steps.into_iter().map(|step| {
            sum += step;
            sum
        }))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: LimitsConfig =
        LimitsConfig { velocity: 0.5, acceleration: 2.5, jerk: 50.0, stroke_min: -0.355, stroke_max: 0.355 };

    fn differences(values: &[f64], period: f64) -> Vec<f64> {
        values.windows(2).map(|w| (w[1] - w[0]) / period).collect()
    }

    #[test]
    fn moves_and_walks_keep_the_limits() {
        let reach = Reach::new(&LIMITS, 6_000_000, 1.0);
        let close = 1.0 + 1e-9;
        for number in 0..2000 {
            let mut random = Random::new(3, number);
            let periods = 4 + random.below(40);
            let padded = |values: Vec<f64>| {
                let last = values[values.len() - 1];
                [&[0.0; 3][..], &values[..], &[last; 3][..]].concat()
            };
            let moved = padded(reach.rest_to_rest(&mut random, periods));
            assert!(moved.len() <= periods + 8, "{} of {periods}", moved.len());
            let walked = padded(reach.walk(&mut random, periods));
            for (values, jerk) in [(moved, 50.0), (walked, f64::INFINITY)] {
                let v = differences(&values, 0.006);
                let a = differences(&v, 0.006);
                let j = differences(&a, 0.006);
                assert!(v.iter().all(|v| v.abs() <= 0.5), "{number}: {v:?}");
                assert!(a.iter().all(|a| a.abs() <= 2.5 * close), "{number}: {a:?}");
                assert!(j.iter().all(|j| j.abs() <= jerk * close), "{number}: {j:?}");
            }
        }
    }
}
