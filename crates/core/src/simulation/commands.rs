//! Commands to a running simulation between two position cycles: trajectories, cancellation, streamed
//! setpoints, loads, parameters, reset.

use std::sync::Arc;

use super::motions::{AbortReason, CancelState, MotionOutcome, PositionGrid};
use super::tolerance::{ErrorHistory, Tolerances};
use super::{Simulation, stream_delay};
use crate::machine::{MachineError, MachineParameters};
use crate::trajectory::spline::KinematicState;
use crate::trajectory::{
    Admission, CancelOutcome, InvalidFeedOverride, JointSet, MotionChunk, MotionId, Rejection, StreamCounts,
    StreamEnd, Trajectory,
};
use crate::units::Nanoseconds;

impl Simulation {
    /// Submits a trajectory, which takes effect at its start and preempts earlier ones.
    ///
    /// # Errors
    /// [`Rejection`] if the trajectory cannot be joined to the commanded setpoints at its start, see
    /// [`Timeline::submit`](crate::trajectory::Timeline::submit). Nothing changes then.
    pub fn submit(&mut self, id: MotionId, trajectory: Arc<Trajectory>) -> Result<Admission, Rejection> {
        self.submit_motion(id, trajectory, None)
    }

    /// Submits a trajectory with path and goal tolerances; the motion ends when it violates them, see
    /// [`MotionOutcome`].
    ///
    /// # Errors
    /// [`Rejection`] for the causes of [`submit`](Self::submit). Nothing changes then.
    pub fn submit_with_tolerances(
        &mut self,
        id: MotionId,
        trajectory: Arc<Trajectory>,
        tolerances: Tolerances,
    ) -> Result<Admission, Rejection> {
        self.submit_motion(id, trajectory, Some(tolerances))
    }

    fn submit_motion(
        &mut self,
        id: MotionId,
        trajectory: Arc<Trajectory>,
        tolerances: Option<Tolerances>,
    ) -> Result<Admission, Rejection> {
        let axis_indices = trajectory.joints().to_vec();
        let admission = self.timeline.submit(id, trajectory, self.grid.origin)?;
        self.motions.add(id, &axis_indices, tolerances);
        Ok(admission)
    }

    /// Begins a motion of all joints that is planned while it runs, and returns the positions at which it begins, m or
    /// rad; see [`Timeline::begin_motion`](crate::trajectory::Timeline::begin_motion). It preempts all motions.
    pub fn begin_motion(&mut self, id: MotionId) -> Vec<f64> {
        let rest = self.timeline.begin_motion(id);
        let axis_indices: Vec<usize> = (0..rest.len()).collect();
        self.motions.add(id, &axis_indices, None);
        rest
    }

    /// Appends a chunk to a motion; returns false if the motion has ended.
    ///
    /// # Errors
    /// [`Rejection`] if the chunk does not continue the motion. Nothing changes then.
    pub fn extend_motion(&mut self, id: MotionId, chunk: Arc<dyn MotionChunk>) -> Result<bool, Rejection> {
        self.timeline.extend_motion(id, chunk)
    }

    /// Ends a motion with its last chunk; returns false if it has ended.
    pub fn finish_motion(&mut self, id: MotionId) -> bool {
        self.timeline.finish_motion(id)
    }

    /// Cancels a motion: its joints come to rest by a controlled stop, and it ends as
    /// [`MotionOutcome::Canceled`] when they are commanded to rest.
    ///
    /// A waiting motion is discarded. Returns false for an unknown motion.
    pub fn cancel(&mut self, id: MotionId) -> bool {
        match self.motions.cancel(id) {
            CancelState::Unknown => return false,
            CancelState::AlreadyCanceled => {}
            CancelState::NewlyCanceled => {
                if self.timeline.cancel(id) != CancelOutcome::Stopping {
                    // No joint has to be stopped, so the motion ends now.
                    let time = self.time_of(self.next - 1);
                    self.motions.end(id, MotionOutcome::Canceled, time, &mut self.finished);
                }
            }
        }
        true
    }

    /// Continues at `time` (ns) with the next position cycle, after a jump of the followed clock.
    ///
    /// All motions are aborted, every axis comes to rest by a controlled stop, loads and the stream are
    /// cleared. The motion of the axes does not depend on the absolute time.
    pub fn jump_to(&mut self, time: Nanoseconds) {
        let from = self.time_of(self.next - 1);
        self.abort_motions(AbortReason::ClockJump { from, to: time });
        self.grid.origin = time.saturating_sub(self.next.saturating_mul(self.grid.period));
    }

    /// Ends motions, loads and the stream as [`jump_to`](Self::jump_to) does, before a change to a clock whose time is not
    /// known yet.
    pub fn prepare_clock_change(&mut self) {
        self.abort_motions(AbortReason::ClockChange);
    }

    fn abort_motions(&mut self, reason: AbortReason) {
        let time = self.time_of(self.next - 1);
        self.motions.abort_all(reason, time, &mut self.finished);
        // Before the first cycle the axes are at rest: a stop would make them busy for a cycle.
        if self.next > 0 || self.has_active_commands() {
            self.timeline.halt();
        }
        self.loads.clear();
    }

    /// Submits one streamed setpoint of a joint, m or rad, for the next position cycle.
    ///
    /// Returns true if it is accepted; it is commanded [`stream_delay`](Self::stream_delay) later. Returns
    /// false while a trajectory or a stop commands the joint, and after a stop until the stream has
    /// paused. A stream is not a motion: it has no figures and no end.
    ///
    /// # Errors
    /// [`Rejection`] for the causes of
    /// [`Timeline::submit_setpoint`](crate::trajectory::Timeline::submit_setpoint). Nothing changes then.
    pub fn submit_setpoint(&mut self, joint: usize, position: f64) -> Result<bool, Rejection> {
        self.timeline.submit_setpoint(joint, position)
    }

    /// Submits one streamed setpoint of a joint with the source time stamp `sent`, ns; see
    /// [`Timeline::submit_setpoint_stamped`](crate::trajectory::Timeline::submit_setpoint_stamped).
    ///
    /// # Errors
    /// [`Rejection`] for the causes of [`submit_setpoint`](Self::submit_setpoint). Nothing changes then.
    pub fn submit_setpoint_stamped(
        &mut self,
        joint: usize,
        position: f64,
        sent: Option<Nanoseconds>,
    ) -> Result<bool, Rejection> {
        self.timeline.submit_setpoint_stamped(joint, position, sent)
    }

    /// Returns true if streamed setpoints arrive and are ignored after a stop.
    pub fn is_stream_inhibited(&self) -> bool {
        self.timeline.is_stream_inhibited()
    }

    /// Returns the counters of streamed setpoints since construction.
    pub fn stream_counts(&self) -> StreamCounts {
        self.timeline.stream_counts()
    }

    /// Returns once the last cause for which a stream lost joints, and these joints.
    pub fn take_stream_end(&mut self) -> Option<(StreamEnd, JointSet)> {
        self.timeline.take_stream_end()
    }

    /// Returns the delay of streamed setpoints in effect, ns: the preview of the controllers.
    ///
    /// After [`update_parameters`](Self::update_parameters) it changes when the stream pauses, see
    /// [`set_stream_delay`](crate::trajectory::Timeline::set_stream_delay).
    pub fn stream_delay(&self) -> Nanoseconds {
        Nanoseconds::from(self.timeline.stream_delay()) * self.grid.period
    }

    /// Returns true if a stream is active, in motion or not: see
    /// [`is_streaming`](crate::trajectory::Timeline::is_streaming).
    pub fn is_streaming(&self) -> bool {
        self.timeline.is_streaming()
    }

    /// Sets the feed override, 0 to 2 (200 %), from the next position cycle on; see
    /// [`Timeline::set_feed_override`](crate::trajectory::Timeline::set_feed_override).
    ///
    /// # Errors
    /// [`InvalidFeedOverride`]; the feed override is unchanged then.
    pub fn set_feed_override(&mut self, factor: f64) -> Result<(), InvalidFeedOverride> {
        self.timeline.set_feed_override(factor)
    }

    /// Begins or ends a feed hold from the next position cycle on: trajectories stop on their path and continue there.
    /// A reset ends it.
    pub fn set_feed_hold(&mut self, is_held: bool) {
        self.timeline.set_feed_hold(is_held);
    }

    /// Returns true during a feed hold.
    pub fn is_feed_hold(&self) -> bool {
        self.timeline.is_feed_hold()
    }

    /// Returns the feed override in effect at the last position cycle, the fraction of the planned speed.
    pub fn feed_rate(&self) -> f64 {
        self.timeline.feed_rate()
    }

    /// Returns the setpoints planned for all joints at `time` (ns), rounded up to a position cycle and at the earliest the
    /// last one, and true if a trajectory commands one of them there; see
    /// [`Timeline::planned_state`](crate::trajectory::Timeline::planned_state).
    pub fn planned_states(&self, time: Nanoseconds) -> (Vec<KinematicState>, bool) {
        let PositionGrid { origin, period } = self.grid;
        let k = -(origin.saturating_sub(time).div_euclid(period));
        let joints = 0..self.machine.axis_count();
        let planned: Vec<_> = joints.filter_map(|joint| self.timeline.planned_state(joint, k)).collect();
        let is_commanded = planned.iter().any(|(_, is_commanded)| *is_commanded);
        (planned.into_iter().map(|(state, _)| state).collect(), is_commanded)
    }

    /// Returns true if a trajectory is active or waiting.
    pub fn has_trajectory(&self) -> bool {
        self.timeline.has_trajectory()
    }

    /// Sets the external force or torque on an axis, N or N·m, positive in positive direction, from the
    /// next position cycle on for `hold` ns; limited to ±[`MAX_INPUT`](crate::machine::MAX_INPUT), zero for NaN.
    pub fn set_load(&mut self, axis: usize, load: f64, hold: Nanoseconds) {
        let until = self.next + hold.max(0).div_euclid(self.grid.period).max(1);
        self.loads.set(axis, load, until);
    }

    /// Sets an external force or torque on an axis beside that of [`set_load`](Self::set_load), from the next position cycle
    /// until it is set again or the machine is reset. The simulation is not busy because of it.
    pub fn set_lasting_load(&mut self, axis: usize, load: f64) {
        self.loads.set_lasting(axis, load);
    }

    /// Replaces gains, weights or delays at the next position cycle.
    ///
    /// # Errors
    /// [`MachineError::AnotherMachine`] if joints or periods differ. Nothing changes then.
    pub fn update_parameters(&mut self, parameters: Arc<MachineParameters>) -> Result<(), MachineError> {
        self.machine.update_parameters(parameters)?;
        self.timeline.set_stream_delay(stream_delay(&self.machine));
        Ok(())
    }

    /// Resets the machine to rest at home; all motions are aborted.
    pub fn reset(&mut self) {
        let home = vec![0.0; self.machine.axis_count()];
        // Cannot be rejected: home is finite and has one value per joint.
        let _ = self.reset_to(&home);
    }

    /// Resets the machine to rest at `positions` (m or rad, one per joint); all motions are aborted.
    ///
    /// # Errors
    /// [`Rejection`] if a position is not finite or there is not one position for each joint. Nothing
    /// changes then.
    pub fn reset_to(&mut self, positions: &[f64]) -> Result<(), Rejection> {
        self.timeline.reset(positions)?;
        self.machine.reset(positions);
        self.loads.clear();
        self.motions.abort_all(AbortReason::Reset, self.time_of(self.next), &mut self.finished);
        self.saturated.fill(false);
        self.errors.fill(ErrorHistory::default());
        self.has_moved = false;
        self.settled_from = self.next;
        self.copy_samples();
        Ok(())
    }
}
