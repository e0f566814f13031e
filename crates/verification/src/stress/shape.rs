//! RandomSource setpoints of one axis, within its limits by construction.

use crate::random::RandomSource;
use virtual_axes_core::config::LimitsConfig;
use virtual_axes_core::units::{Nanoseconds, seconds};

/// Largest used fraction of the velocity limit: leaves a margin for rounding.
const WITHIN: f64 = 0.999;
/// Travel limit of a joint without travel limits, m or rad.
const UNLIMITED: f64 = 10.0;
/// Largest fraction of the travel range used by a trajectory.
const TRAVEL_FRACTION: f64 = 0.9;

/// Motion limits of an axis for random setpoints.
#[derive(Debug, Clone, Copy)]
pub struct MotionLimits {
    /// Tsp, s.
    pub period: f64,
    /// Velocity limit, m/s or rad/s.
    pub velocity: f64,
    /// Acceleration limit, m/s² or rad/s².
    pub acceleration: f64,
    /// Jerk limit, m/s³ or rad/s³.
    pub jerk: f64,
    low: f64,
    high: f64,
}

impl MotionLimits {
    /// Creates motion limits from `limits`, with acceleration and jerk scaled by `excess`, so that the motor may saturate.
    pub fn new(limits: &LimitsConfig, period: Nanoseconds, excess: f64) -> Self {
        MotionLimits {
            period: seconds(period),
            velocity: WITHIN * limits.velocity,
            acceleration: excess * limits.acceleration,
            jerk: excess * limits.jerk,
            low: limits.travel_min.max(-UNLIMITED),
            high: limits.travel_max.min(UNLIMITED),
        }
    }

    fn span(&self) -> f64 {
        TRAVEL_FRACTION * (self.high - self.low)
    }

    /// Draws a start from which displacements between `low` and `high` stay within the travel limits.
    pub fn start(&self, random: &mut RandomSource, low: f64, high: f64) -> f64 {
        random.between(self.low - low.min(0.0), self.high - high.max(0.0))
    }

    /// Draws the displacements of a rest-to-rest motion over `periods` position cycles, one per period.
    ///
    /// The velocity is the convolution of three rectangular pulses of n₁, n₂ and n₃ periods: velocity ≤ D/(n₁T),
    /// acceleration ≤ D/(n₁n₂T²), jerk ≤ D/(n₁n₂n₃T³), or twice that if no pulse is as wide as the other two together
    /// (Biagiotti and Melchiorri 2012).
    pub fn rest_to_rest(&self, random: &mut RandomSource, periods: usize) -> Vec<f64> {
        let spare = periods.saturating_sub(3).max(1);
        let second = random.below(spare / 2 + 1) + 1;
        let third = random.below((spare - second.min(spare)) / 2 + 1) + 1;
        let first = (periods + 2).saturating_sub(second + third).max(1);
        let t = self.period;
        let counts = [first, second, third].map(|n| n as f64);
        // Two falling edges of the acceleration coincide unless the widest pulse is as wide as the others together.
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

    /// Draws the displacements of a random walk over `periods` position cycles that ends at rest.
    pub fn walk(&self, random: &mut RandomSource, periods: usize) -> Vec<f64> {
        let (t, change) = (self.period, self.acceleration * self.period);
        let (mut velocity, mut acceleration) = (0.0, 0.0);
        let steps = (1..=periods).map(|k| {
            if random.chance(0.3) {
                acceleration = random.between(-change, change);
            }
            // Largest velocity from which the axis can still stop in time.
            let most = f64::min(self.velocity, change * (periods - k) as f64);
            velocity = f64::clamp(velocity + acceleration, -most, most);
            velocity * t
        });
        self.fitting(summed(steps.collect()))
    }

    /// Draws the displacements of a stream with stepwise constant velocity.
    pub fn steps(&self, random: &mut RandomSource, periods: usize) -> Vec<f64> {
        let mut velocity = 0.0;
        let steps = (1..=periods).map(|k| {
            if k == 1 || random.chance(0.15) {
                velocity = random.between(-self.velocity, self.velocity);
            }
            if k == periods { 0.0 } else { velocity * self.period }
        });
        self.fitting(summed(steps.collect()))
    }

    /// Scales displacements down to the usable travel range.
    fn fitting(&self, mut displacements: Vec<f64>) -> Vec<f64> {
        let (low, high) = extent(&displacements);
        let scale = (self.span() / (high - low)).min(1.0);
        displacements.iter_mut().for_each(|value| *value *= scale);
        displacements
    }

    /// Returns the largest scale factor that keeps a curve with this largest velocity, acceleration and extent within all
    /// limits.
    pub fn scale(&self, velocity: f64, acceleration: f64, span: f64) -> f64 {
        (self.velocity / velocity).min(self.acceleration / acceleration).min(self.span() / span)
    }
}

/// Returns the smallest and the largest displacement, including 0.
pub fn extent(displacements: &[f64]) -> (f64, f64) {
    displacements.iter().fold((0.0, 0.0), |(low, high): (f64, f64), &value| (low.min(value), high.max(value)))
}

/// Returns the cumulative sums, starting with 0.
fn summed(steps: Vec<f64>) -> Vec<f64> {
    let mut sum = 0.0;
    std::iter::once(0.0)
        .chain(steps.into_iter().map(|step| {
            sum += step;
            sum
        }))
        .collect()
}
