//! Motion of all joints that is planned while it runs, such as a part program: it is appended in chunks, so that its
//! length does not affect the memory.

use std::sync::Arc;

use super::chunk::{ChunkColumn, MotionChunk, PathPlace, RestChunk};
use super::event::MotionId;
use super::motion_table::Release;
use super::path_time::PathTime;
use super::plan::{JointPlan, JointQueue, PlanKind};
use super::rejection::{Rejection, RejectionCode};
use super::stream::StreamEnd;
use super::timeline::Timeline;
use crate::units::{SECOND_NS, seconds};

/// Time from a speed limit to standstill and back that a motion must be planned ahead, in stopping times.
const STOPPING_TIMES: f64 = 2.0;

impl Timeline {
    /// Begins a motion of all joints that is planned while it runs, and returns the positions at which it begins, m or
    /// rad: the joints come to rest there by controlled stops. It preempts all motions.
    pub fn begin_motion(&mut self, id: MotionId) -> Vec<f64> {
        let joints = self.queues.len();
        let slot = self.motions.open(id, joints);
        let next = self.clock.next_instant(self.period);
        let mut stopped_k = self.next_k;
        for joint in 0..joints {
            self.release_all(joint, Release::Preempted(id));
            stopped_k = stopped_k.max(self.brake(joint, None));
        }
        self.end_stream(0..joints, StreamEnd::Preempted(id));
        let rest: Vec<f64> = self.queues.iter().map(|queue| queue.end_position()).collect();
        let chunk: Arc<dyn MotionChunk> = Arc::new(RestChunk(rest.clone()));
        // Path time passes at most twice as fast as the stops.
        let start_k = next.saturating_add(2 * (stopped_k - self.next_k));
        for joint in 0..joints {
            self.push_chunk(joint, slot, start_k, &chunk);
        }
        self.motions.settle(&mut self.pending);
        self.reserve_events();
        rest
    }

    /// Appends a chunk to a motion that was begun with [`begin_motion`](Self::begin_motion). Returns false if the motion
    /// has ended or lost a joint.
    ///
    /// # Errors
    /// [`RejectionCode::Jump`] if the chunk does not begin within Vmax·Tsp of the end of the chunk before.
    pub fn extend_motion(&mut self, id: MotionId, chunk: Arc<dyn MotionChunk>) -> Result<bool, Rejection> {
        let Some(slot) = self.open_motion(id) else { return Ok(false) };
        for (queue, limits) in self.queues.iter().zip(&self.joints) {
            let Some(JointPlan { kind: PlanKind::Chunk(column), .. }) = queue.plans.back() else { continue };
            let before =
                column.state(PathTime::of_instant(column.end_k(), self.period), self.period).position;
            let first = chunk.state(column.joint, 0.0).position;
            limits.check_finite(first)?;
            limits.check_jump(0, before, first, seconds(self.period))?;
        }
        let next = self.clock.next_instant(self.period);
        for joint in 0..self.queues.len() {
            let plans = &mut self.queues[joint].plans;
            let Some(JointPlan { join_k, kind: PlanKind::Chunk(last), .. }) = plans.back_mut() else {
                continue;
            };
            // A standstill ends when the first chunk begins.
            let start_k = if last.chunk.cycles() == 0 { next.max(*join_k + 1) } else { last.end_k() };
            self.push_chunk(joint, slot, start_k, &chunk);
        }
        Ok(true)
    }

    /// Ends a motion with its last chunk. Returns false if it has ended or lost a joint.
    pub fn finish_motion(&mut self, id: MotionId) -> bool {
        if self.open_motion(id).is_none() {
            return false;
        }
        for queue in &mut self.queues {
            if let Some(plan) = queue.plans.back_mut()
                && let PlanKind::Chunk(column) = &plan.kind
            {
                plan.end_k = column.end_k();
                plan.nominal_end = i128::from(plan.end_k) * i128::from(self.period);
            }
        }
        true
    }

    /// Returns true if a motion that is planned while it runs could not stop before the end of its last chunk.
    pub fn needs_chunk(&self) -> bool {
        let Some(JointPlan { kind: PlanKind::Chunk(last), end_k: i64::MAX, .. }) =
            self.queues.first().and_then(|queue| queue.plans.back())
        else {
            return false;
        };
        let stopping_time = |joint: &super::limits::JointLimits| {
            let limits = &joint.limits;
            limits.velocity / limits.acceleration + limits.acceleration / limits.jerk
        };
        let longest = self.joints.iter().map(stopping_time).fold(0.0, f64::max);
        let left = -self.clock.time.since(last.end_k().saturating_mul(self.period));
        left < STOPPING_TIMES * longest * SECOND_NS as f64
    }

    /// Returns the place on the path of the active motion that is planned while it runs, with the path rate in effect.
    pub fn path_place(&self) -> Option<PathPlace> {
        let plan = self.queues.first()?.plans.front()?;
        let PlanKind::Chunk(column) = &plan.kind else { return None };
        let place = column.chunk.place(column.local_time(self.clock.time, self.period));
        Some(PathPlace { path_rate: place.path_rate * self.feed_rate(), ..place })
    }

    /// Returns the slot of a motion that chunks can be appended to.
    fn open_motion(&self, id: MotionId) -> Option<usize> {
        let slot = self.motions.find(id)?;
        let is_open = |plan: &JointPlan| plan.slot == Some(slot) && plan.is_open();
        let all_open = self.queues.iter().all(|queue| queue.plans.back().is_some_and(is_open));
        all_open.then_some(slot)
    }

    fn push_chunk(&mut self, joint: usize, slot: usize, start_k: i64, chunk: &Arc<dyn MotionChunk>) {
        let column = ChunkColumn { chunk: Arc::clone(chunk), joint, start_k };
        self.queues[joint].plans.push_back(JointPlan {
            slot: Some(slot),
            join_k: start_k,
            end_k: i64::MAX,
            nominal_start: i128::from(start_k) * i128::from(self.period),
            nominal_end: i128::MAX,
            kind: PlanKind::Chunk(column),
        });
    }

    /// Rejects a trajectory that would preempt a motion that is planned while it runs at an instant beyond its last
    /// chunk.
    pub(super) fn check_planned_until(&self, joint: usize, join_k: i64) -> Result<(), Rejection> {
        let last = self.queues[joint].plans.iter().rev().find(|plan| plan.join_k < join_k);
        let Some(JointPlan { kind: PlanKind::Chunk(column), end_k: i64::MAX, .. }) = last else {
            return Ok(());
        };
        if join_k <= column.end_k().max(self.clock.next_instant(self.period)) {
            return Ok(());
        }
        let limits = &self.joints[joint];
        let text = format!(
            "{}: a part program is active at its start and not planned that far; send it with stamp 0, or cancel the \
             program first",
            limits.name
        );
        Err(Rejection::new(RejectionCode::Jump, text).joint(&limits.name))
    }

    /// Stops the joints of a motion that is planned while it runs and has lost another joint.
    pub(super) fn stop_incomplete_motion(&mut self) {
        let chunk = |plan: &JointPlan| matches!(plan.kind, PlanKind::Chunk(_)).then_some(plan.slot).flatten();
        let Some(slot) = self.queues.iter().flat_map(|queue| &queue.plans).find_map(chunk) else { return };
        let has_slot = |queue: &JointQueue| queue.plans.iter().any(|plan| plan.slot == Some(slot));
        if self.queues.iter().all(has_slot) {
            return;
        }
        for joint in 0..self.queues.len() {
            if has_slot(&self.queues[joint]) {
                self.release_all(joint, Release::Stopped(None));
                self.brake(joint, None);
            }
        }
        self.motions.settle(&mut self.pending);
    }
}
