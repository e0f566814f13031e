//! Cancellation of a motion, and halt of all joints after a clock jump.

use super::event::MotionId;
use super::motion_table::Release;
use super::plan::{JointPlan, PlanKind};
use super::timeline::Timeline;
use crate::units::seconds;

/// Result of canceling a motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CancelOutcome {
    /// Unknown motion, or its last setpoint has been commanded.
    NotActive,
    /// Removed from the queue before its start.
    Discarded,
    /// Its joints are being stopped.
    Stopping,
}

impl Timeline {
    /// Cancels a motion: its joints come to rest by a controlled stop.
    ///
    /// The stop belongs to the motion, so [`TimelineEvent::Completed`](super::TimelineEvent::Completed)
    /// reports the instant at which the last joint is at rest. Joints for which the motion waits continue
    /// their active motion. Motions that wait behind it for one of its joints are stopped too, because
    /// they were to start at its end.
    pub fn cancel(&mut self, id: MotionId) -> CancelOutcome {
        let Some(slot) = self.motions.find(id) else { return CancelOutcome::NotActive };
        let mut outcome = CancelOutcome::Discarded;
        for joint in 0..self.queues.len() {
            let plans = &mut self.queues[joint].plans;
            let Some(index) = plans.iter().position(|plan| plan.slot == Some(slot)) else { continue };
            let behind = plans.drain(index + 1..).filter_map(|behind| behind.slot);
            self.motions.release_each(behind, Some(slot), joint, Release::Stopped(Some(id)));
            if index == 0 {
                // The stop takes over the slot of the motion.
                plans[0].slot = None;
                self.brake(joint, Some(slot));
                outcome = CancelOutcome::Stopping;
            } else {
                plans.truncate(index);
                self.motions.release(slot, joint, Release::Completed);
            }
        }
        self.motions.settle(&mut self.pending);
        self.reserve_events();
        outcome
    }

    /// Brings every joint to rest by a controlled stop after a clock jump; all active and waiting
    /// motions and the stream are stopped.
    pub fn halt(&mut self) {
        self.abort_stream();
        for joint in 0..self.queues.len() {
            self.release_all(joint, Release::Stopped(None));
            self.brake(joint, None);
        }
        self.motions.settle(&mut self.pending);
        self.reserve_events();
    }

    /// Plans a controlled stop of a joint from the next instant on in place of all waiting plans, and
    /// returns the first instant at rest.
    pub(super) fn brake(&mut self, joint: usize, slot: Option<usize>) -> i64 {
        let join_k = self.clock.next_instant(self.period);
        let queue = &mut self.queues[joint];
        let stop = self.planner.plan(queue.state, &self.joints[joint].limits);
        let cycles = (stop.duration() / seconds(self.period)).ceil() as i64;
        let from_k = self.next_k - 1;
        let end_k = from_k.saturating_add(cycles).max(self.next_k);
        let path_end = join_k.saturating_add(end_k - self.next_k);
        queue.plans.truncate(1);
        queue.plans.push_back(JointPlan {
            slot,
            join_k,
            end_k,
            nominal_start: i128::from(join_k) * i128::from(self.period),
            nominal_end: i128::from(path_end) * i128::from(self.period),
            kind: PlanKind::Stop { from_k, stop },
        });
        end_k
    }
}
