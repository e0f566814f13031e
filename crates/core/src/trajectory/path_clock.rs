//! Path time of a timeline: feed override, feed hold, and the plans ahead.

use super::feed_override::{
    FeedControl, InvalidFeedOverride, MAX_FEED_OVERRIDE, PlannedMotion, check_feed_override,
};
use super::limits::JointLimits;
use super::path_time::{PathTime, PlanInstant};
use super::plan::{JointPlan, PlanKind};
use super::spline::KinematicState;
use super::timeline::{JointQueue, Timeline};
use crate::units::{Nanoseconds, seconds};
use std::ops::RangeInclusive;

/// Path time with its feed override.
#[derive(Debug, Clone)]
pub(super) struct PathClock {
    /// Path time of the last commanded instant.
    pub time: PathTime,
    /// Requested feed override.
    pub feed_override: f64,
    /// Feed hold: trajectories stop on their path.
    pub is_held: bool,
    control: FeedControl,
}

/// Returns true if a trajectory is active or waiting.
fn has_trajectory(queues: &[JointQueue]) -> bool {
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
    fn is_stopped(&self) -> bool {
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
    fn ahead(&self, cycles: u32, period: Nanoseconds) -> PathTime {
        self.time.after(self.control.steps_ahead(cycles) * period as f64)
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

impl JointQueue {
    /// Returns the plan that commands the joint at instant `path_k` of the path time.
    #[inline]
    fn plan_at(&self, path_k: i64) -> Option<&JointPlan> {
        if self.plans.len() == 1 {
            return self.plans.front();
        }
        let after = self.plans.partition_point(|plan| plan.has_joined(path_k));
        self.plans.get(after.saturating_sub(1))
    }
}

impl Timeline {
    /// Sets the feed override, 0 to 2 (200 %), from the next instant on.
    ///
    /// Trajectories pass at this fraction of their planned speed. The change keeps the acceleration and jerk limits, and
    /// the setpoints stay on their path. Above 1 the speed is limited by the axes. Streamed setpoints and controlled stops
    /// are not affected. While trajectories are active or waiting, a start time is that of the path time, which passes
    /// with the feed override; otherwise the path time is the time of the position cycles.
    ///
    /// A trajectory that exceeds the acceleration or jerk limits as planned continues to exceed them; the part of
    /// acceleration and jerk that a change adds keeps them. At a constant feed override of 1 the setpoints are
    /// bit-identical to those without feed override.
    ///
    /// # Errors
    /// [`InvalidFeedOverride`]; the feed override is unchanged then.
    pub fn set_feed_override(&mut self, factor: f64) -> Result<(), InvalidFeedOverride> {
        check_feed_override(factor)?;
        self.clock.feed_override = factor;
        Ok(())
    }

    /// Begins or ends a feed hold from the next instant on: trajectories stop on their path, as at a feed override of 0,
    /// and continue there.
    pub fn set_feed_hold(&mut self, is_held: bool) {
        self.clock.is_held = is_held;
    }

    /// Returns true if a trajectory is active or waiting.
    pub fn has_trajectory(&self) -> bool {
        has_trajectory(&self.queues)
    }

    /// Returns true during a feed hold.
    pub fn is_feed_hold(&self) -> bool {
        self.clock.is_held
    }

    /// Returns the feed override in effect at the last instant, the fraction of the planned speed.
    pub fn feed_rate(&self) -> f64 {
        self.clock.control.step()
    }

    /// Returns true if a feed hold or a feed override of 0 has stopped the trajectories.
    pub fn is_feed_stopped(&self) -> bool {
        self.clock.is_stopped()
    }

    /// Returns the state of `plan` at `instant`, with derivatives with respect to time.
    pub(super) fn state_of(
        clock: &PathClock,
        plan: &JointPlan,
        instant: PlanInstant,
        period: Nanoseconds,
    ) -> KinematicState {
        let state = plan.state(instant, period);
        if plan.is_trajectory() { clock.state_in_time(state, period) } else { state }
    }

    /// Returns the previewed setpoint of `joint`, `cycles` position cycles after the last commanded
    /// instant, m or rad.
    ///
    /// The preview contains everything accepted up to now, at the present feed override; beyond its end the last
    /// setpoint is held. Returns `None` for an unknown joint.
    pub fn psec_ahead(&self, joint: usize, cycles: u32) -> Option<f64> {
        let mut psec = None;
        self.visit_ahead(joint..=joint, cycles, |_, position| psec = Some(position));
        psec
    }

    /// Writes the previewed setpoints of all joints to `psec`, as [`psec_ahead`](Self::psec_ahead) returns them; further
    /// values are unchanged.
    pub fn all_psec_ahead(&self, cycles: u32, psec: &mut [f64]) {
        self.visit_ahead(0..=usize::MAX, cycles, |joint, position| {
            if let Some(value) = psec.get_mut(joint) {
                *value = position;
            }
        });
    }

    /// Calls `visit` with the previewed setpoints of `joints`.
    fn visit_ahead(&self, joints: RangeInclusive<usize>, cycles: u32, mut visit: impl FnMut(usize, f64)) {
        let instant = PlanInstant {
            k: (self.next_k - 1).saturating_add(i64::from(cycles)),
            path: self.clock.ahead(cycles, self.period),
        };
        let path_k = instant.path.instant(self.period);
        let mut near = None;
        let queues = self.queues.iter().enumerate().skip(*joints.start());
        for (joint, queue) in queues.take_while(|(joint, _)| joint <= joints.end()) {
            let position = match queue.plan_at(path_k) {
                _ if cycles == 0 => queue.state.position,
                Some(JointPlan { kind: PlanKind::Hold(newest), .. }) => {
                    let cycles = instant.k - self.next_k;
                    self.stream.state_after(joint, cycles, *newest, queue.state.position).position
                }
                Some(plan) => plan.position(instant, self.period, &mut near),
                None => queue.state.position,
            };
            visit(joint, position);
        }
    }

    /// Returns the state planned for `joint` at position cycle `k`, at the earliest that of the last commanded instant,
    /// with derivatives with respect to time, and true if a trajectory commands the joint there. Returns `None` for an
    /// unknown joint.
    ///
    /// The plan contains everything accepted up to now, at the present feed override.
    pub fn planned_state(&self, joint: usize, k: i64) -> Option<(KinematicState, bool)> {
        let (queue, period) = (self.queues.get(joint)?, self.period);
        let cycles = u32::try_from(k.saturating_sub(self.next_k - 1).max(0)).unwrap_or(u32::MAX);
        let k = (self.next_k - 1).saturating_add(i64::from(cycles));
        let instant = PlanInstant { k, path: self.clock.ahead(cycles, period) };
        let Some(plan) = queue.plan_at(instant.path.instant(period)) else {
            return Some((queue.state, false));
        };
        let is_commanded = plan.is_trajectory() && plan.slot.is_some() && !plan.has_ended(instant, period);
        let state = match plan.kind {
            _ if cycles == 0 => queue.state,
            PlanKind::Hold(newest) => {
                self.stream.state_after(joint, k - self.next_k, newest, queue.state.position)
            }
            _ => Self::state_of(&self.clock, plan, instant, period),
        };
        Some((state, is_commanded))
    }

    /// Returns the state planned for `joint` at instant `path_k` of the path time, at the earliest the state of the
    /// last instant.
    pub(super) fn predicted(&self, joint: usize, path_k: i64) -> KinematicState {
        let queue = &self.queues[joint];
        let cycles = path_k.saturating_sub(self.clock.next_instant(self.period));
        if cycles < 0 {
            return queue.state;
        }
        match queue.plan_at(path_k) {
            Some(JointPlan { kind: PlanKind::Hold(newest), .. }) => {
                self.stream.state_after(joint, cycles, *newest, queue.state.position)
            }
            Some(plan) => {
                let k = self.next_k.saturating_add(cycles);
                let path = PathTime::of_instant(path_k, self.period);
                plan.state(PlanInstant { k, path }, self.period)
            }
            None => queue.state,
        }
    }
}
