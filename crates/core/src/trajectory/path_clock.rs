//! Path time of a timeline: feed override and feed hold.

use super::feed_override::{FeedControl, MAX_FEED_OVERRIDE, PlannedMotion};
use super::limits::JointLimits;
use super::path_time::{PathTime, PlanInstant};
use super::plan::{JointPlan, JointQueue, PlanKind};
use super::spline::KinematicState;
use crate::units::{Nanoseconds, seconds};

/// Path time with its feed override.
#[derive(Debug, Clone)]
pub(super) struct PathClock {
    /// Path time of the last commanded instant.
    pub time: PathTime,
    /// Requested feed override.
    pub feed_override: f64,
    /// Feed hold: trajectories stop on their path.
    pub is_held: bool,
    pub control: FeedControl,
}

/// Returns true if a trajectory is active or waiting.
pub(super) fn has_trajectory(queues: &[JointQueue]) -> bool {
    let is_active = |queue: &JointQueue| queue.plans.front().is_some_and(JointPlan::is_trajectory);
    queues.iter().any(|queue| queue.plans.len() > 1 || is_active(queue))
}

impl PathClock {
    /// Creates the path time of joints at rest at `positions`, before instant 0.
    pub fn new(joints: &[JointLimits], period: Nanoseconds, positions: &[f64]) -> Self {
        Self {
            time: PathTime::of_instant(-1, period),
            feed_override: 1.0,
            is_held: false,
            control: FeedControl::new(joints, period, positions, MAX_FEED_OVERRIDE),
        }
    }

    fn target(&self) -> f64 {
        if self.is_held { 0.0 } else { self.feed_override }
    }

    /// Returns true if the path time stands still and remains so.
    pub fn is_stopped(&self) -> bool {
        self.target() == 0.0 && self.control.step() == 0.0 && self.control.change() == 0.0
    }

    /// Returns the next instant of the position grid after the path time.
    pub fn next_instant(&self, period: Nanoseconds) -> i64 {
        self.time.instant(period).saturating_add(1)
    }

    /// Advances to position cycle `k`. Without a trajectory in `queues`, the path time is that of the position cycle.
    ///
    /// With `needs_chunk`, the active motion is not planned far enough: it stops as at a feed hold.
    pub fn advance(
        &mut self,
        k: i64,
        period: Nanoseconds,
        queues: &[JointQueue],
        needs_chunk: bool,
    ) -> PlanInstant {
        if has_trajectory(queues) {
            let motion = QueuedMotion { queues, path: self.time, period };
            let target = if needs_chunk { 0.0 } else { self.target() };
            let step = self.control.advance(target, &motion);
            self.time = self.time.after(step * period as f64);
        } else {
            self.rest(k, period);
        }
        PlanInstant { k, path: self.time }
    }

    /// Sets the path time to position cycle `k`, without a trajectory.
    pub fn rest(&mut self, k: i64, period: Nanoseconds) {
        self.control.start_at(self.target());
        self.time = PathTime::of_instant(k, period);
    }

    /// Records the setpoints `psec` of the joints of `queues` at position cycle `k`.
    pub fn record(&mut self, k: i64, psec: &[f64], queues: &[JointQueue], period: Nanoseconds) {
        if !has_trajectory(queues) {
            self.rest(k, period);
        }
        self.control.record(psec);
        for (joint, queue) in queues.iter().enumerate() {
            if !queue.plans.front().is_some_and(JointPlan::is_trajectory) {
                self.control.exclude(joint, psec[joint]);
            }
        }
    }

    /// Returns the path time `cycles` position cycles after the last commanded instant, if the feed override does not
    /// change.
    pub fn ahead(&self, cycles: u32, period: Nanoseconds) -> PathTime {
        self.time.after(self.control.steps_ahead(cycles) * period as f64)
    }

    /// Returns the state of `plan` at `instant`, with derivatives with respect to time.
    pub fn state_of(&self, plan: &JointPlan, instant: PlanInstant, period: Nanoseconds) -> KinematicState {
        let state = plan.state(instant, period);
        if plan.is_trajectory() { self.state_in_time(state, period) } else { state }
    }

    /// Returns `state` with its derivatives with respect to time.
    fn state_in_time(&self, state: KinematicState, period: Nanoseconds) -> KinematicState {
        if self.control.is_as_planned() {
            return state;
        }
        let (rate, change) = (self.control.step(), self.control.change() / seconds(period));
        KinematicState {
            position: state.position,
            velocity: rate * state.velocity,
            acceleration: rate * rate * state.acceleration + change * state.velocity,
        }
    }
}

/// Motion of the plans of all joints after the path time `path`.
struct QueuedMotion<'a> {
    queues: &'a [JointQueue],
    path: PathTime,
    period: Nanoseconds,
}

impl PlannedMotion for QueuedMotion<'_> {
    fn positions_after(&self, steps: f64, joints: &mut [f64]) {
        let path = self.path.after(steps * self.period as f64);
        let path_k = path.instant(self.period);
        // One evaluation for all joints.
        if let Some(JointPlan { kind: PlanKind::Chunk(column), .. }) =
            self.queues.first().and_then(|queue| queue.plan_at(path_k))
        {
            column.chunk.positions(column.local_time(path, self.period), joints);
        }
        let mut near = None;
        for (queue, position) in self.queues.iter().zip(joints) {
            match queue.plan_at(path_k) {
                Some(JointPlan { kind: PlanKind::Chunk(_), .. }) => {}
                Some(plan) if plan.is_trajectory() => {
                    *position = plan.position(PlanInstant { k: i64::MAX, path }, self.period, &mut near);
                }
                // Stops and streams do not follow the path time.
                _ => *position = queue.state.position,
            }
        }
    }
}
