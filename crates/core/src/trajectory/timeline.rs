//! Real-time part of trajectory execution: one position setpoint per joint and position cycle.

use super::event::{JointSet, TimelineEvent};
use super::limits::JointLimits;
use super::motion_table::{MotionTable, Release};
use super::path_clock::PathClock;
use super::path_time::PlanInstant;
use super::plan::{JointPlan, JointQueue, PlanKind};
use super::rejection::{Rejection, RejectionCode};
use super::spline::KinematicState;
use super::stop::StopPlanner;
use super::stream::{SetpointStream, StreamCounts, StreamEnd, StreamedSetpoint};
use crate::units::Nanoseconds;
use std::collections::VecDeque;

/// Largest number of trajectories that wait for one joint.
pub const MAX_WAITING: usize = 1024;

/// Position setpoints of all joints, one position cycle after another.
///
/// Each joint has a queue of plans, ordered by the instant from which they command the joint. A plan
/// gives the state of its joint at any instant. Therefore future setpoints can be previewed, and a new
/// trajectory is checked at its start against the setpoint commanded there. [`Timeline::next`] does not
/// allocate; its cost does not depend on the length of the queues. A trajectory is dropped when its
/// last joint leaves it: a caller that keeps an `Arc` of it until its last event moves the deallocation
/// out of the real-time thread.
///
/// [`Timeline::submit`] implements the rules for a received `JointTrajectory`, with replacement and
/// preemption; [`Timeline::submit_setpoint`] those for a stream of setpoints.
#[derive(Debug, Clone)]
pub struct Timeline {
    pub(super) joints: Vec<JointLimits>,
    /// Tsp, ns.
    pub(super) period: Nanoseconds,
    /// Next position cycle.
    pub(super) next_k: i64,
    pub(super) queues: Vec<JointQueue>,
    pub(super) motions: MotionTable,
    pub(super) planner: StopPlanner,
    pub(super) stream: SetpointStream,
    pub(super) clock: PathClock,
    psec: Vec<f64>,
    events: Vec<TimelineEvent>,
    /// Events since the last instant, reported at the next one.
    pub(super) pending: Vec<TimelineEvent>,
}

/// Invalid arguments of [`Timeline::new`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum TimelineError {
    /// No joint, or more than [`JointSet::CAPACITY`].
    #[error("machine has {0} joints; a timeline supports 1 to {max}", max = JointSet::CAPACITY)]
    Joints(usize),
    /// Number of positions different from the number of joints.
    #[error("{positions} positions are given for {joints} joints; give one position for each joint")]
    Positions {
        /// Number of positions.
        positions: usize,
        /// Number of joints.
        joints: usize,
    },
    /// Position cycle Tsp of 0 or less.
    #[error("position cycle is {0} ns; it must be greater than 0")]
    Period(Nanoseconds),
}

impl Timeline {
    /// Creates a timeline with all joints at rest at `positions` (m or rad); its first instant is 0.
    /// `period` is Tsp, ns.
    ///
    /// # Errors
    /// [`TimelineError`] if the number of joints or positions or the period is invalid.
    pub fn new(
        joints: Vec<JointLimits>,
        period: Nanoseconds,
        positions: &[f64],
    ) -> Result<Self, TimelineError> {
        if joints.is_empty() || joints.len() > JointSet::CAPACITY {
            return Err(TimelineError::Joints(joints.len()));
        }
        if positions.len() != joints.len() {
            return Err(TimelineError::Positions { positions: positions.len(), joints: joints.len() });
        }
        if period <= 0 {
            return Err(TimelineError::Period(period));
        }
        let queue = |&position: &f64| JointQueue {
            plans: VecDeque::from([JointPlan::hold(position)]),
            state: KinematicState::at_rest(position),
        };
        Ok(Self {
            queues: positions.iter().map(queue).collect(),
            motions: MotionTable::new(joints.len()),
            planner: StopPlanner::default(),
            stream: SetpointStream::new(&joints, period, positions),
            clock: PathClock::new(&joints, period, positions),
            psec: positions.to_vec(),
            events: Vec::new(),
            pending: Vec::new(),
            next_k: 0,
            joints,
            period,
        })
    }

    /// Commands the next position cycle and returns its index k; see [`Timeline::psec`] and
    /// [`Timeline::events`].
    // An iterator could not lend the setpoints.
    #[allow(clippy::should_implement_trait)]
    pub fn next(&mut self) -> i64 {
        let (k, period) = (self.next_k, self.period);
        self.events.clear();
        self.events.append(&mut self.pending);
        self.stream.begin_instant(k, &self.psec);
        let needs_chunk = self.needs_chunk();
        let instant = self.clock.advance(k, period, &self.queues, needs_chunk);
        let path_k = instant.path.instant(period);
        let mut is_incomplete = false;
        for (joint, queue) in self.queues.iter_mut().enumerate() {
            while queue.plans.get(1).is_some_and(|plan| plan.has_joined(path_k)) {
                let old = queue.plans.pop_front();
                let new = queue.plans.front();
                if let (Some(old), Some(new)) = (old, new) {
                    is_incomplete |= matches!(old.kind, PlanKind::Chunk(_)) && old.slot != new.slot;
                    self.motions.hand_over(&old, new, joint);
                    self.motions.start(new.slot, &mut self.events);
                }
            }
            let Some(plan) = queue.plans.front_mut() else {
                continue;
            };
            plan.advance(instant, period);
            queue.state = match plan.kind {
                PlanKind::Hold(newest) => self.stream.next_state(joint, k, newest, queue.state.position),
                _ => self.clock.state_of(plan, instant, period),
            };
            self.psec[joint] = queue.state.position;
            if plan.has_ended(instant, period)
                && let Some(slot) = plan.slot.take()
            {
                self.motions.release(slot, joint, Release::Completed);
            }
            let is_over = plan.slot.is_none() && !plan.is_moving(instant, period);
            if is_over && !matches!(plan.kind, PlanKind::Hold(_)) {
                plan.kind = PlanKind::Hold(queue.state.position);
                self.stream.flush(joint, queue.state.position);
            }
        }
        self.motions.settle(&mut self.events);
        self.stream.finish_instant(k);
        self.clock.record(k, &self.psec, &self.queues, period);
        self.next_k += 1;
        if is_incomplete {
            self.stop_incomplete_motion();
        }
        k
    }

    /// Returns the setpoints of the last commanded instant, m or rad, one per joint.
    pub fn psec(&self) -> &[f64] {
        &self.psec
    }

    /// Returns the events of the last commanded instant and since the instant before it.
    pub fn events(&self) -> &[TimelineEvent] {
        &self.events
    }

    /// Returns the index of the instant that [`Timeline::next`] commands next.
    pub fn next_instant(&self) -> i64 {
        self.next_k
    }

    /// Returns the joint limits.
    pub fn joints(&self) -> &[JointLimits] {
        &self.joints
    }

    /// Returns the position cycle Tsp, ns.
    pub fn period(&self) -> Nanoseconds {
        self.period
    }

    /// Returns the state of `joint` commanded at the last instant; its derivatives are those of the
    /// commanding plan.
    pub fn commanded_state(&self, joint: usize) -> Option<KinematicState> {
        self.queues.get(joint).map(|queue| queue.state)
    }

    /// Returns true if a started trajectory or stop commands motion of a joint after the last instant.
    /// Motion by streamed setpoints: [`Timeline::is_stream_moving`].
    pub fn is_moving(&self) -> bool {
        let instant = PlanInstant { k: self.next_k - 1, path: self.clock.time };
        self.queues
            .iter()
            .filter_map(|queue| queue.plans.front())
            .any(|plan| plan.slot.is_some() || plan.is_moving(instant, self.period))
    }

    /// Returns true if an accepted trajectory or stop has not started.
    pub fn is_waiting(&self) -> bool {
        self.queues.iter().any(|queue| queue.plans.len() > 1)
    }

    /// Resets all joints to rest at `positions` (m or rad) from the next instant on and clears the
    /// queues. All active and waiting motions end with [`TimelineEvent::Stopped`].
    ///
    /// # Errors
    /// [`RejectionCode::WrongSize`] if there is not one position for each joint,
    /// [`RejectionCode::NotFinite`] for NaN and infinity. The timeline is unchanged then.
    pub fn reset(&mut self, positions: &[f64]) -> Result<(), Rejection> {
        if positions.len() != self.joints.len() {
            let (found, wanted) = (positions.len(), self.joints.len());
            return Err(Rejection::new(
                RejectionCode::WrongSize,
                format!("{found} positions for {wanted} joints"),
            )
            .numbers(found as f64, wanted as f64));
        }
        for (joint, &position) in self.joints.iter().zip(positions) {
            joint.check_finite(position)?;
        }
        self.end_stream(0..positions.len(), StreamEnd::Reset);
        for (joint, &position) in positions.iter().enumerate() {
            self.release_all(joint, Release::Stopped(None));
            let queue = &mut self.queues[joint];
            queue.plans.clear();
            queue.plans.push_back(JointPlan::hold(position));
            queue.state = KinematicState::at_rest(position);
            self.stream.flush(joint, position);
            self.psec[joint] = position;
        }
        self.clock.is_held = false;
        self.clock.rest(self.next_k - 1, self.period);
        self.stream.clear_activity();
        self.stream.apply_delay(self.next_k, &self.psec);
        self.motions.settle(&mut self.pending);
        self.reserve_events();
        Ok(())
    }

    /// Reserves memory for all events of the next instant, a start and an end of each motion, so that
    /// it does not allocate.
    pub(super) fn reserve_events(&mut self) {
        self.events.reserve(self.pending.len() + 2 * self.motions.capacity());
    }

    /// Releases `joint` from all active and waiting motions.
    pub(super) fn release_all(&mut self, joint: usize, release: Release) {
        let slots = self.queues[joint].plans.iter_mut().filter_map(|plan| plan.slot.take());
        self.motions.release_each(slots, None, joint, release);
    }
}

/// Stream of setpoints.
impl Timeline {
    /// Submits one streamed setpoint, m or rad.
    ///
    /// Returns true if it is accepted. Returns false while a trajectory or a stop commands the joint or
    /// waits for it, and after a stop until the stream has paused, i.e. has not changed for
    /// [`STREAM_PAUSE`].
    ///
    /// From the next instant on, the preview buffer approaches the setpoint by at most Vmax·Tsp in each
    /// position cycle. An entry is commanded [`Timeline::stream_delay`] instants after it has entered.
    /// The last of several setpoints before one instant applies. A trajectory or a stop takes the joint
    /// over from its commanded state, with the velocity of the stream, and clears the buffer.
    ///
    /// # Errors
    /// - [`RejectionCode::UnknownJoint`].
    /// - [`RejectionCode::NotFinite`] for NaN and infinity.
    /// - [`RejectionCode::OutsideTravelLimits`].
    /// - [`RejectionCode::Jump`] if the first setpoint of a stream is more than Vmax·Tsp away from the
    ///   last entry of the buffer, or a further one cannot be reached from the previously accepted one in
    ///   the elapsed time plus [`STREAM_JITTER`].
    ///
    /// The previously accepted setpoint remains valid then.
    ///
    /// [`STREAM_JITTER`]: super::STREAM_JITTER
    /// [`STREAM_PAUSE`]: super::stream::STREAM_PAUSE
    pub fn submit_setpoint(&mut self, joint: usize, position: f64) -> Result<bool, Rejection> {
        self.submit_setpoint_stamped(joint, position, None)
    }

    /// Submits one streamed setpoint, m or rad, with the source time stamp `sent`, ns.
    ///
    /// The elapsed time between two setpoints is the longer of the times between their stamps and
    /// between their arrivals. See [`Timeline::submit_setpoint`].
    ///
    /// # Errors
    /// Those of [`Timeline::submit_setpoint`].
    pub fn submit_setpoint_stamped(
        &mut self,
        joint: usize,
        position: f64,
        sent: Option<Nanoseconds>,
    ) -> Result<bool, Rejection> {
        let (Some(limits), Some(queue)) = (self.joints.get(joint), self.queues.get_mut(joint)) else {
            let text = format!("unknown joint index {joint}; the machine has {} joints", self.joints.len());
            return Err(Rejection::new(RejectionCode::UnknownJoint, text));
        };
        let is_free = queue.plans.len() == 1
            && queue.plans[0].slot.is_none()
            && matches!(queue.plans[0].kind, PlanKind::Hold(_));
        let setpoint = StreamedSetpoint { joint, position, sent };
        let is_accepted = self.stream.submit(setpoint, limits, self.next_k, &self.psec, is_free)?;
        if is_accepted {
            queue.plans[0].kind = PlanKind::Hold(position);
        }
        Ok(is_accepted)
    }

    /// Sets the delay of streamed setpoints, position cycles, at most
    /// [`MAX_STREAM_DELAY`](super::stream::MAX_STREAM_DELAY).
    ///
    /// The delay takes effect when the streamed setpoints of all joints have not changed for the present
    /// delay plus [`STREAM_PAUSE`](super::stream::STREAM_PAUSE), so that it causes no motion; without a
    /// stream immediately. A stream without a pause keeps its delay.
    pub fn set_stream_delay(&mut self, cycles: u32) {
        self.stream.set_delay(cycles, self.next_k, &self.psec);
    }

    /// Returns the delay of streamed setpoints in effect, position cycles.
    pub fn stream_delay(&self) -> u32 {
        self.stream.delay()
    }

    /// Returns true if a streamed setpoint was accepted within
    /// [`STREAM_PAUSE`](super::stream::STREAM_PAUSE) or is still to be commanded.
    pub fn is_streaming(&self) -> bool {
        self.stream.is_active(self.next_k)
    }

    /// Returns true if streamed setpoints moved a joint at the last instant or are about to.
    pub fn is_stream_moving(&self) -> bool {
        self.stream.is_moving(self.next_k)
    }

    /// Returns true if setpoints of a joint arrive and are ignored after a stop.
    pub fn is_stream_inhibited(&self) -> bool {
        self.stream.is_inhibited(self.next_k)
    }

    /// Returns the counters of streamed setpoints since construction.
    pub fn stream_counts(&self) -> StreamCounts {
        self.stream.counts()
    }

    /// Returns once the last cause for which a stream lost joints, and these joints.
    pub fn take_stream_end(&mut self) -> Option<(StreamEnd, JointSet)> {
        self.stream.take_end()
    }

    /// Ends the stream of `joints`; after a stop it is inhibited until it pauses.
    pub(super) fn end_stream(&mut self, joints: impl IntoIterator<Item = usize>, end: StreamEnd) {
        self.stream.end(joints, end, self.next_k);
    }

    /// Ends the stream of all joints because of a clock jump.
    pub(super) fn abort_stream(&mut self) {
        self.end_stream(0..self.joints.len(), StreamEnd::ClockJump);
        self.stream.clear_activity();
    }
}
