//! Feed override and feed hold: time along the planned motion passes more slowly, within the limits of the axes.
//!
//! In each position cycle the planned time advances by a step, at most the position period. A constant step below the
//! period keeps all limits, since it scales speed, acceleration and jerk down. A change of the step is accepted if the
//! setpoints keep the limits until the change has been taken back, with margin for any later decision: the release. If
//! no change is accepted, the release of the last one continues. So a constant step is always reachable, and the path is
//! never left.

use super::vector::{JointVector, MAX_JOINTS};
use super::window::JointBounds;

/// BlendTolerance of the limits in the simulated cycles.
const TOLERANCE: f64 = 2e-7;
/// Rounding of a position, in units of ε.
const ROUNDINGS: f64 = 16.0;
/// Fractions of the desired change that are tried.
const FRACTIONS: [f64; 5] = [1.0, 0.6, 0.3, 0.1, 0.0];
/// Fractions of the largest change of step per cycle² at which a change is taken back.
const RELEASES: [f64; 2] = [0.9, 0.4];
/// Largest change of step per cycle², in periods.
const MAX_CHANGE: f64 = 0.25;
/// Largest number of cycles of a release.
const MAX_RELEASE: usize = 2000;
/// Bisection steps for the change that ends at the target.
const BISECTIONS: usize = 60;
/// Distance from the target that counts as reached, in periods.
const REACHED: f64 = 1e-12;

/// Position along the planned motion, `time` seconds from the present.
pub(super) trait PlannedMotion {
    /// Returns the joints `time` seconds of planned motion after the present.
    fn joints_after(&self, time: f64) -> JointVector;
}

/// Steps of the planned time per position cycle.
#[derive(Debug, Clone)]
pub(super) struct StepControl {
    period: f64,
    /// Step of the last cycle, s.
    step: f64,
    /// Difference of the last two steps, s.
    change: f64,
    /// Change of the difference per cycle while it is taken back, s.
    release: f64,
    /// Setpoints of the last three cycles, the latest last.
    history: [JointVector; 3],
}

impl StepControl {
    pub fn new(period: f64, start: JointVector) -> Self {
        Self { period, step: period, change: 0.0, release: period, history: [start; 3] }
    }

    /// Sets the fraction of the planned speed at a standstill.
    pub fn start_at(&mut self, rate: f64) {
        self.step = rate * self.period;
    }

    /// Returns the fraction of the planned speed.
    pub fn rate(&self) -> f64 {
        self.step / self.period
    }

    /// Sets the setpoints of the present cycle.
    pub fn record(&mut self, joints: JointVector) {
        self.history.rotate_left(1);
        self.history[2] = joints;
    }

    /// Returns the step of the next cycle, s, toward the fraction `target` of the planned speed.
    pub fn advance(&mut self, target: f64, motion: &impl PlannedMotion, bounds: &[JointBounds]) -> f64 {
        let goal = target * self.period;
        if self.change == 0.0 && (self.step - goal).abs() <= REACHED * self.period {
            self.step = goal;
            return goal;
        }
        let largest = self.largest_change(motion, bounds);
        for part in RELEASES {
            let release = part * largest;
            let wanted = self.wanted(goal, largest, release);
            for fraction in FRACTIONS {
                let first = fraction * wanted;
                if self.is_within_limits(first, release, motion, bounds) {
                    (self.release, self.change) = (release, self.change + first);
                    return self.apply();
                }
            }
        }
        self.change = released(self.change, self.release);
        self.apply()
    }

    fn apply(&mut self) -> f64 {
        if self.change.abs() < 1e-15 * self.period {
            self.change = 0.0;
        }
        self.step = (self.step + self.change).clamp(0.0, self.period);
        self.step
    }

    /// Returns the change of step per cycle² for the jerk limits, where the planned speed is that of the next cycles.
    fn largest_change(&self, motion: &impl PlannedMotion, bounds: &[JointBounds]) -> f64 {
        let (near, far) = (motion.joints_after(0.0), motion.joints_after(self.period));
        let cube = self.period * self.period * self.period;
        let changes = bounds.iter().enumerate().map(|(j, bounds)| {
            let speed = (far[j] - near[j]).abs() / self.period;
            bounds.jerk * cube / speed
        });
        changes.fold(MAX_CHANGE * self.period, f64::min)
    }

    /// Returns the final step after a first change and its release, an increasing function of the change.
    fn settled(&self, first: f64, release: f64) -> f64 {
        let change = self.change + first;
        // Whole cycles of the release.
        let count = ((change.abs() / release).ceil() - 1.0).max(0.0);
        self.step + change + count * change - 0.5 * count * (count + 1.0) * release * change.signum()
    }

    /// Returns the change that ends nearest to `goal`, at most `largest`.
    fn wanted(&self, goal: f64, largest: f64, release: f64) -> f64 {
        let (mut low, mut high) = (-largest, largest);
        if self.settled(low, release) >= goal {
            return low;
        }
        if self.settled(high, release) <= goal {
            return high;
        }
        for _ in 0..BISECTIONS {
            let middle = 0.5 * (low + high);
            if self.settled(middle, release) > goal { high = middle } else { low = middle }
        }
        0.5 * (low + high)
    }

    /// Returns true if the joints keep their limits with the change `first` and its release, and the step stays within 0
    /// and the period.
    fn is_within_limits(
        &self,
        first: f64,
        release: f64,
        motion: &impl PlannedMotion,
        bounds: &[JointBounds],
    ) -> bool {
        let reserve = REACHED * self.period;
        let mut history = self.history;
        let (mut change, mut step, mut time) = (self.change + first, self.step, 0.0);
        let mut steady = 0;
        for _ in 0..MAX_RELEASE {
            step += change;
            if step < -reserve || step > self.period + reserve {
                return false;
            }
            time += step.clamp(0.0, self.period);
            let joints = motion.joints_after(time);
            if !keeps_limits(&history, &joints, bounds, self.period) {
                return false;
            }
            history = [history[1], history[2], joints];
            if change == 0.0 {
                steady += 1;
                if steady == 3 {
                    return true;
                }
            }
            change = released(change, release);
        }
        false
    }
}

/// Returns the change of the next cycle of a release.
fn released(change: f64, release: f64) -> f64 {
    if change.abs() <= release { 0.0 } else { change - release * change.signum() }
}

/// Returns true if the differences of three setpoints and the next one are within the limits.
fn keeps_limits(history: &[JointVector; 3], next: &JointVector, bounds: &[JointBounds], period: f64) -> bool {
    let (second, third) = (period * period, period * period * period);
    (0..bounds.len().min(MAX_JOINTS)).all(|j| {
        let ([a, b, c], d, bounds) = (history.map(|joints| joints[j]), next[j], &bounds[j]);
        let rounding = ROUNDINGS * f64::EPSILON * a.abs().max(d.abs());
        let within = |difference: f64, limit: f64| difference.abs() <= limit * (1.0 + TOLERANCE) + rounding;
        within(d - c, bounds.velocity * period)
            && within(d - 2.0 * c + b, bounds.acceleration * second)
            && within(d - 3.0 * (c - b) - a, bounds.jerk * third)
    })
}
