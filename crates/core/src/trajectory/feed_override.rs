//! Feed override and feed hold: the planned motion passes more slowly or faster, within the limits of the axes and on
//! its path.
//!
//! In each position cycle the planned motion advances by a step, in position cycles: 1 as planned, 0 at a feed hold. A
//! constant step of at most 1 keeps the limits that the planned motion keeps, since it scales speed, acceleration and
//! jerk down. A change of the step is accepted if the setpoints keep the limits while it is taken back, and, from a step
//! above 1, while the step returns to 1; so each accepted step leaves a safe course, which continues if no change is
//! accepted.
//!
//! A motion that exceeds the acceleration or jerk limits as planned, such as a polyline with corners, cannot be checked
//! in this way. There the change of the step keeps the limits: the part of acceleration and jerk that it adds.

use super::limits::JointLimits;
use crate::units::{Nanoseconds, seconds};

/// Largest feed override: 200 %.
pub const MAX_FEED_OVERRIDE: f64 = 2.0;
/// Relative tolerance of the limits in the simulated cycles.
const TOLERANCE: f64 = 2e-7;
/// Largest ratio to a limit that counts as rounding of the planned motion.
const ROUNDED_PLAN: f64 = 1.001;
/// Rounding of a position, in units of ε.
const ROUNDINGS: f64 = 16.0;
/// Fractions of the desired change that are tried.
const FRACTIONS: [f64; 5] = [1.0, 0.6, 0.3, 0.1, 0.0];
/// Fractions of the largest change of the step per cycle² at which a change is taken back.
const RELEASES: [f64; 2] = [0.9, 0.4];
/// Fraction of the largest change of the step per cycle with which a step above 1 returns to it.
const RETURN: f64 = 0.6;
/// Largest change of the step per cycle².
const MAX_CHANGE: f64 = 0.25;
/// Largest number of simulated cycles.
const MAX_CYCLES: usize = 2000;
/// Bisection steps for the change that ends at the target.
const BISECTIONS: usize = 60;
/// Distance from a step that counts as reached.
const REACHED: f64 = 1e-12;
/// Change of the step that is rounding.
const ROUNDED_CHANGE: f64 = 1e-15;
/// Cycles at a constant step after which all differences belong to it.
const STEADY_CYCLES: u32 = 3;

/// Feed override outside 0 to 2.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("feed override {0} must be a number from 0 to {MAX_FEED_OVERRIDE} (200 %)")]
pub struct InvalidFeedOverride(pub f64);

/// Checks a feed override.
///
/// # Errors
/// [`InvalidFeedOverride`] if it is negative, greater than 2 or NaN.
pub fn check_feed_override(factor: f64) -> Result<(), InvalidFeedOverride> {
    if (0.0..=MAX_FEED_OVERRIDE).contains(&factor) { Ok(()) } else { Err(InvalidFeedOverride(factor)) }
}

/// Planned motion of all joints ahead of the present.
pub trait PlannedMotion {
    /// Writes the positions of the joints into `joints`, m or rad, `steps` position cycles of planned motion after the
    /// present.
    fn positions_after(&self, steps: f64, joints: &mut [f64]);
}

/// Largest differences of the setpoints of a joint in a position cycle: first, second and third, m or rad.
type Bounds = [f64; 3];

/// Changes of the step while it settles.
#[derive(Debug, Clone, Copy)]
struct Ramp {
    /// Change of the change per cycle while the change is taken back.
    release: f64,
    /// Largest change per cycle on the return to a step of 1.
    largest: f64,
}

impl Ramp {
    /// Returns the change of the next cycle after a step with `change`: it is taken back, and a step above 1 returns to 1.
    fn next(self, step: f64, change: f64) -> f64 {
        let returns = step > 1.0 + REACHED && change <= 0.0 && step + self.remaining(change) > 1.0;
        if returns { (change - self.release).max(-self.largest).min(change) } else { self.released(change) }
    }

    fn released(self, change: f64) -> f64 {
        if change.abs() <= self.release { 0.0 } else { change - self.release * change.signum() }
    }

    /// Returns the number of further cycles until `change` is taken back.
    fn cycles(self, change: f64) -> f64 {
        ((change.abs() / self.release).ceil() - 1.0).max(0.0)
    }

    /// Returns the sum of the changes while `change` is taken back, itself excluded.
    fn remaining(self, change: f64) -> f64 {
        let count = self.cycles(change);
        count * change - 0.5 * count * (count + 1.0) * self.release * change.signum()
    }
}

/// Largest ratios of differences to their limits that a course may have.
#[derive(Debug, Clone, Copy)]
struct Allowance {
    ratios: Bounds,
    /// The planned motion exceeds a limit; the change of the step alone must keep it.
    is_exceeded: bool,
}

/// Cycle of a simulated course.
struct Cycle<'a> {
    history: &'a [Vec<f64>; 3],
    next: &'a [f64],
    step: f64,
    change: f64,
    /// Difference of the last two changes.
    difference: f64,
}

impl Cycle<'_> {
    /// Returns the largest ratios of the differences of the setpoints to their limits.
    fn ratios(&self, bounds: &[Bounds]) -> Bounds {
        let [a, b, c] = self.history;
        let mut worst = [0.0_f64; 3];
        for (j, bounds) in bounds.iter().enumerate() {
            let (a, b, c, d) = (a[j], b[j], c[j], self.next[j]);
            let rounding = ROUNDINGS * f64::EPSILON * a.abs().max(d.abs());
            let differences = [d - c, d - 2.0 * c + b, d - 3.0 * (c - b) - a];
            for ((worst, difference), bound) in worst.iter_mut().zip(differences).zip(bounds) {
                *worst = worst.max((difference.abs() - rounding) / bound);
            }
        }
        worst
    }

    /// Returns true if the change of the step keeps the limits at the present speed along the path.
    fn keeps_limits_along_path(&self, bounds: &[Bounds]) -> bool {
        if self.step <= 0.0 {
            return true;
        }
        (0..bounds.len()).all(|j| {
            let speed = ((self.next[j] - self.history[2][j]) / self.step).abs();
            let [_, acceleration, jerk] = bounds[j].map(|bound| bound * (1.0 + TOLERANCE));
            speed * self.change.abs() <= acceleration && speed * self.difference.abs() <= jerk
        })
    }
}

/// Control of the step with which a planned motion passes.
#[derive(Debug, Clone)]
pub struct FeedControl {
    bounds: Vec<Bounds>,
    /// Largest step.
    fastest: f64,
    /// Step of the last cycle.
    step: f64,
    /// Difference of the last two steps.
    change: f64,
    ramp: Ramp,
    /// Setpoints of the last three cycles, the latest last.
    history: [Vec<f64>; 3],
    /// Setpoints of the simulated cycles.
    course: [Vec<f64>; 3],
    next: Vec<f64>,
    /// Largest distance that the courses of this cycle have reached, position cycles of planned motion.
    reach: f64,
}

impl FeedControl {
    /// Creates the control of joints with `limits` at rest at `positions` (m or rad), with a step of 1 and steps of at
    /// most `fastest`; `period` is Tsp, ns.
    pub fn new(limits: &[JointLimits], period: Nanoseconds, positions: &[f64], fastest: f64) -> Self {
        let t = seconds(period);
        let bounds = |joint: &JointLimits| {
            let limits = &joint.limits;
            [limits.velocity * t, limits.acceleration * t * t, limits.jerk * t * t * t]
        };
        let rows = || std::array::from_fn(|_| positions.to_vec());
        Self {
            bounds: limits.iter().map(bounds).collect(),
            fastest,
            step: 1.0,
            change: 0.0,
            ramp: Ramp { release: 1.0, largest: 1.0 },
            history: rows(),
            course: rows(),
            next: positions.to_vec(),
            reach: 0.0,
        }
    }

    /// Returns the step of the last cycle: the fraction of the planned speed.
    pub fn step(&self) -> f64 {
        self.step
    }

    /// Returns the difference of the last two steps.
    pub fn change(&self) -> f64 {
        self.change
    }

    /// Returns true if the step is 1 and does not change.
    pub fn is_as_planned(&self) -> bool {
        self.step == 1.0 && self.change == 0.0
    }

    /// Sets the step at a standstill: `target`, at most 1.
    pub fn start_at(&mut self, target: f64) {
        (self.step, self.change) = (target.clamp(0.0, 1.0), 0.0);
    }

    /// Records the setpoints of the present cycle, m or rad, one per joint.
    pub fn record(&mut self, joints: &[f64]) {
        self.history.rotate_left(1);
        self.history[2].copy_from_slice(joints);
    }

    /// Records that `joint` does not follow the planned motion; it is at `position`, m or rad.
    pub fn exclude(&mut self, joint: usize, position: f64) {
        self.history.iter_mut().for_each(|row| row[joint] = position);
    }

    /// Returns the sum of the next `cycles` steps if the target does not change: the planned motion ahead, in position
    /// cycles.
    pub fn steps_ahead(&self, cycles: u32) -> f64 {
        let cycles = f64::from(cycles);
        if self.change == 0.0 {
            return cycles * self.step;
        }
        // Sums of the step while the change is taken back, and at the constant step afterwards.
        let count = cycles.min(self.ramp.cycles(self.change));
        let release = self.ramp.release * self.change.signum();
        let sum = |n: f64| n * self.change - release * n * (n + 1.0) / 2.0;
        let sums =
            self.change * count * (count + 1.0) / 2.0 - release * count * (count + 1.0) * (count + 2.0) / 6.0;
        (cycles * self.step + sums + (cycles - count) * sum(count)).max(0.0)
    }

    /// Returns the step of the next cycle toward `target`.
    pub fn advance(&mut self, target: f64, motion: &impl PlannedMotion) -> f64 {
        let goal = target.clamp(0.0, self.fastest);
        if self.change == 0.0 && (self.step - goal).abs() <= REACHED && goal <= 1.0 {
            self.step = goal;
            return goal;
        }
        let limits = Allowance { ratios: [1.0 + TOLERANCE; 3], is_exceeded: false };
        self.reach = 0.0;
        let is_changed = self.try_changes(goal, limits, motion)
            || self
                .exceeded(motion)
                .is_some_and(|allowance| self.try_changes(goal.min(1.0), allowance, motion));
        if !is_changed {
            self.change = self.ramp.next(self.step, self.change);
        }
        self.step = (self.step + self.change).clamp(0.0, self.fastest);
        self.step
    }

    /// Takes the largest allowed change toward `goal`; returns false if no change is allowed.
    fn try_changes(&mut self, goal: f64, allowance: Allowance, motion: &impl PlannedMotion) -> bool {
        let [largest, return_change] = self.largest_changes(motion);
        for part in RELEASES {
            let ramp = Ramp { release: part * largest, largest: return_change };
            let wanted = self.wanted(goal, largest, ramp);
            for fraction in FRACTIONS {
                let change = self.change + fraction * wanted;
                // Here and not after the check: the course after a change of 0 is another one.
                let change = if change.abs() < ROUNDED_CHANGE { 0.0 } else { change };
                if self.is_allowed(change, ramp, allowance, motion) {
                    (self.ramp, self.change) = (ramp, change);
                    return true;
                }
                if wanted == 0.0 {
                    break;
                }
            }
        }
        false
    }

    /// Returns the change of the step per cycle² for the jerk limits and per cycle for the return to 1, where the
    /// planned speed is that of the next cycle.
    fn largest_changes(&mut self, motion: &impl PlannedMotion) -> [f64; 2] {
        let (near, far) = (&mut self.course[0], &mut self.next);
        motion.positions_after(0.0, near);
        motion.positions_after(1.0, far);
        let mut largest = [MAX_CHANGE; 2];
        for (bounds, (near, far)) in self.bounds.iter().zip(near.iter().zip(far.iter())) {
            let speed = (far - near).abs();
            largest[0] = largest[0].min(bounds[2] / speed);
            largest[1] = largest[1].min(RETURN * bounds[1] / speed);
        }
        largest
    }

    /// Returns the first change, at most `largest`, that ends nearest to `goal`.
    fn wanted(&self, goal: f64, largest: f64, ramp: Ramp) -> f64 {
        let settled = |first: f64| {
            let change = self.change + first;
            self.step + change + ramp.remaining(change)
        };
        let (mut low, mut high) = (-largest, largest);
        if settled(0.0) == goal {
            return 0.0;
        }
        if settled(low) >= goal {
            return low;
        }
        if settled(high) <= goal {
            return high;
        }
        for _ in 0..BISECTIONS {
            let middle = 0.5 * (low + high);
            if settled(middle) > goal { high = middle } else { low = middle }
        }
        0.5 * (low + high)
    }

    /// Returns true if a cycle with `change` and the course after it are within `allowance`.
    fn is_allowed(
        &mut self,
        change: f64,
        ramp: Ramp,
        allowance: Allowance,
        motion: &impl PlannedMotion,
    ) -> bool {
        let fastest = if allowance.is_exceeded { 1.0 } else { self.fastest };
        self.simulate(change, ramp, motion, |cycle, bounds| {
            if cycle.step < -REACHED || cycle.step > fastest + REACHED {
                return false;
            }
            let ratios = cycle.ratios(bounds);
            ratios.iter().zip(allowance.ratios).all(|(ratio, allowed)| *ratio <= allowed)
                && (!allowance.is_exceeded || cycle.keeps_limits_along_path(bounds))
        })
    }

    /// Returns the allowance for changes if the motion exceeds limits as planned, on the part that the simulated courses
    /// have reached.
    fn exceeded(&mut self, motion: &impl PlannedMotion) -> Option<Allowance> {
        let Self { bounds, course, next, reach, .. } = self;
        let mut worst = [1.0 + TOLERANCE; 3];
        for cycle in 0..=(reach.ceil() as usize).min(MAX_CYCLES) + 3 {
            motion.positions_after(cycle as f64, next);
            if cycle >= 3 {
                let cycle = Cycle { history: course, next, step: 1.0, change: 0.0, difference: 0.0 };
                let ratios = cycle.ratios(bounds);
                worst.iter_mut().zip(ratios).for_each(|(worst, ratio)| *worst = worst.max(ratio));
            }
            course.rotate_left(1);
            course[2].copy_from_slice(next);
        }
        if self.step > 1.0 + REACHED || worst == [1.0 + TOLERANCE; 3] {
            return None;
        }
        let relaxed = |ratio: f64| if ratio > ROUNDED_PLAN { f64::INFINITY } else { ratio };
        // Speed is validated with each trajectory.
        Some(Allowance { ratios: [worst[0], relaxed(worst[1]), relaxed(worst[2])], is_exceeded: true })
    }

    /// Simulates a cycle with `change` and the course after it, until a constant step of at most 1. Returns true if
    /// `is_within` is true in each cycle.
    fn simulate(
        &mut self,
        mut change: f64,
        ramp: Ramp,
        motion: &impl PlannedMotion,
        mut is_within: impl FnMut(&Cycle<'_>, &[Bounds]) -> bool,
    ) -> bool {
        let Self { bounds, course, next, history, reach, .. } = self;
        course.iter_mut().zip(&*history).for_each(|(to, from)| to.copy_from_slice(from));
        let (mut step, mut before, mut ahead, mut steady) = (self.step, self.change, 0.0, 0);
        for _ in 0..MAX_CYCLES {
            step += change;
            ahead += step.max(0.0);
            *reach = reach.max(ahead);
            motion.positions_after(ahead, next);
            let cycle = Cycle { history: course, next, step, change, difference: change - before };
            if !is_within(&cycle, bounds) {
                return false;
            }
            course.rotate_left(1);
            course[2].copy_from_slice(next);
            if change == 0.0 && step <= 1.0 + REACHED {
                steady += 1;
                if steady == STEADY_CYCLES {
                    return true;
                }
            }
            before = change;
            change = ramp.next(step, change);
        }
        false
    }
}
