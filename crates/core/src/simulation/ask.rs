//! What is asked of the machine under way, between two position instants.

use std::sync::Arc;

use super::motion::{Abort, Cancel, Outcome};
use super::tolerance::{Errors, Tolerances};
use super::{Simulation, stream_delay};
use crate::machine::{MachineError, MachineParameters};
use crate::trajectory::{
    Admission, CallOff, JointSet, MotionId, Rejection, StreamCounts, StreamEnd, Trajectory,
};
use crate::units::Nanoseconds;

impl Simulation {
    /// Gives the axes a trajectory; it takes effect at its start.
    ///
    /// # Errors
    /// [`Rejection`] if it cannot follow what is commanded at its start; nothing changes then.
    pub fn offer(&mut self, id: MotionId, trajectory: Arc<Trajectory>) -> Result<Admission, Rejection> {
        self.take(id, trajectory, None)
    }

    /// Likewise, and the motion ends as soon as it does not keep `tolerances`; see [`Outcome`].
    ///
    /// # Errors
    /// As [`offer`](Self::offer).
    pub fn offer_within(
        &mut self,
        id: MotionId,
        trajectory: Arc<Trajectory>,
        tolerances: Tolerances,
    ) -> Result<Admission, Rejection> {
        self.take(id, trajectory, Some(tolerances))
    }

    fn take(
        &mut self,
        id: MotionId,
        trajectory: Arc<Trajectory>,
        tolerances: Option<Tolerances>,
    ) -> Result<Admission, Rejection> {
        let places = trajectory.joints().to_vec();
        let admission = self.timeline.offer(id, trajectory, self.grid.origin)?;
        self.motions.accept(id, &places, tolerances);
        Ok(admission)
    }

    /// Calls a motion off: its joints come to rest within their limits, and it ends as
    /// [`Outcome::Canceled`] when they are commanded to rest. One that waits is discarded. `false` if
    /// there is no such motion.
    pub fn cancel(&mut self, id: MotionId) -> bool {
        match self.motions.cancel(id) {
            Cancel::Unknown => return false,
            Cancel::Known => {}
            Cancel::New => {
                if self.timeline.cancel(id) != CallOff::Stopping {
                    // Nothing is left of it to be waited for.
                    self.motions.end(id, Outcome::Canceled, self.time_of(self.next - 1), &mut self.ends);
                }
            }
        }
        true
    }

    /// Goes on at `time` (ns) with the next position instant, because the clock that is followed jumped
    /// there: motions end as aborted, every axis comes to rest within its limits, loads and the stream
    /// are forgotten. What the axes do does not depend on the time that it is said to be.
    pub fn jump_to(&mut self, time: Nanoseconds) {
        let from = self.time_of(self.next - 1);
        self.motions.abort_all(Abort::ClockJump { from, to: time }, from, &mut self.ends);
        self.timeline.halt();
        self.loads.clear();
        self.grid.origin = time.saturating_sub(self.next.saturating_mul(self.grid.period));
    }

    /// Sets one setpoint of a stream, m or rad, for the next position instant; `false` while a
    /// trajectory or a stop has the joint, and after a stop until the stream has paused. It is commanded
    /// [`stream_delay`](Self::stream_delay) later. A stream is no motion: it has no figures and no end.
    ///
    /// # Errors
    /// [`Rejection`] as of [`Timeline::stream`](crate::trajectory::Timeline::stream); nothing changes then.
    pub fn stream(&mut self, place: usize, position: f64) -> Result<bool, Rejection> {
        self.timeline.stream(place, position)
    }

    /// Likewise, `sent` (ns) by the sender's clock; see
    /// [`stream_sent`](crate::trajectory::Timeline::stream_sent).
    ///
    /// # Errors
    /// As [`stream`](Self::stream).
    pub fn stream_sent(
        &mut self,
        place: usize,
        position: f64,
        sent: Option<Nanoseconds>,
    ) -> Result<bool, Rejection> {
        self.timeline.stream_sent(place, position, sent)
    }

    /// Whether setpoints come that are ignored after a stop.
    pub fn is_stream_held_off(&self) -> bool {
        self.timeline.is_stream_held_off()
    }

    /// What the streams did, since the beginning.
    pub fn stream_counts(&self) -> StreamCounts {
        self.timeline.stream_counts()
    }

    /// What last took joints away from a stream that drove them, and which; told once.
    pub fn take_stream_end(&mut self) -> Option<(StreamEnd, JointSet)> {
        self.timeline.take_stream_end()
    }

    /// Delay of streamed setpoints that is in effect, ns: as many position periods as the controllers
    /// look ahead. After [`adopt`](Self::adopt) it changes when the stream pauses, see
    /// [`set_stream_delay`](crate::trajectory::Timeline::set_stream_delay).
    pub fn stream_delay(&self) -> Nanoseconds {
        Nanoseconds::from(self.timeline.stream_delay()) * self.grid.period
    }

    /// Whether a stream drives, moving or not: see [`is_streaming`](crate::trajectory::Timeline::is_streaming).
    pub fn is_streaming(&self) -> bool {
        self.timeline.is_streaming()
    }

    /// External force or torque on an axis (N or N·m, positive towards plus) from the next position
    /// instant on, for `hold` ns; limited to ±[`MAX_LOAD`](super::MAX_LOAD), and none if it is NaN.
    pub fn set_load(&mut self, axis: usize, load: f64, hold: Nanoseconds) {
        let until = self.next + hold.max(0).div_euclid(self.grid.period).max(1);
        self.loads.set(axis, load, until);
    }

    /// Takes over changed gains, weights or delays at the next position instant.
    ///
    /// # Errors
    /// [`MachineError::AnotherMachine`] if joints or periods differ; nothing changes then.
    pub fn adopt(&mut self, parameters: Arc<MachineParameters>) -> Result<(), MachineError> {
        self.machine.adopt(parameters)?;
        self.timeline.set_stream_delay(stream_delay(&self.machine));
        Ok(())
    }

    /// Puts the machine back to rest at home; motions under way end as aborted.
    pub fn reset(&mut self) {
        let home = vec![0.0; self.machine.axis_count()];
        // Home is finite and has one value per joint: this cannot be refused.
        let _ = self.reset_to(&home);
    }

    /// Puts the machine to rest at `positions` (m or rad, one per joint); motions under way end as
    /// aborted.
    ///
    /// # Errors
    /// [`Rejection`] for a position that is not finite or not one per joint; nothing changes then.
    pub fn reset_to(&mut self, positions: &[f64]) -> Result<(), Rejection> {
        self.timeline.reset(positions)?;
        self.machine.reset(positions);
        self.loads.clear();
        self.motions.abort_all(Abort::Reset, self.time_of(self.next), &mut self.ends);
        self.saturated.fill(false);
        self.errors.fill(Errors::default());
        self.awake = false;
        self.settled_from = self.next;
        self.take_samples();
        Ok(())
    }
}
