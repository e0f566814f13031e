//! Feed override of a timeline, and the setpoints planned ahead.

use std::ops::RangeInclusive;

use super::feed_override::{InvalidFeedOverride, check_feed_override};
use super::path_clock::has_trajectory;
use super::path_time::{PathTime, PlanInstant};
use super::plan::{JointPlan, PlanKind};
use super::spline::KinematicState;
use super::timeline::Timeline;

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
            _ => self.clock.state_of(plan, instant, period),
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
