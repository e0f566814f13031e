//! The real-time side: what each joint is commanded at each position instant.

use super::arrivals::Arrivals;
use super::event::{Event, JointSet, MotionId};
use super::limits::JointLimits;
use super::motions::{Motions, Release};
use super::plan::{Kind, Plan};
use super::rejection::{Code, Rejection};
use super::spline::State;
use super::stop::StopPlanner;
use super::stream::{LookAhead, Stream, StreamEnd, reach};
use crate::units::Nanoseconds;
use std::collections::VecDeque;

/// Most trajectories that wait for one joint.
pub const MAX_WAITING: usize = 1024;

/// Position setpoints of all joints, one position instant after another.
///
/// Each joint has a queue of plans, ordered by the instant from which they command it. A plan says
/// where its joint is at any instant, so the timeline can look ahead, and a new trajectory is
/// checked at its start against what will be commanded there. [`Timeline::next`] does not allocate
/// and costs the same whatever waits. A trajectory is released when its last joint leaves it: who
/// keeps an `Arc` of it until its last event spares the machine's thread the freeing.
///
/// The rules of [`Timeline::offer`] are those of a `JointTrajectory` that arrives.
#[derive(Debug)]
pub struct Timeline {
    pub(super) joints: Vec<JointLimits>,
    /// Tsp, ns.
    pub(super) period: Nanoseconds,
    /// The position instant that comes next.
    pub(super) next_k: i64,
    pub(super) tracks: Vec<Track>,
    pub(super) motions: Motions,
    pub(super) planner: StopPlanner,
    pub(super) stream: Stream,
    psec: Vec<f64>,
    pub(super) events: Vec<Event>,
    /// Events since the last instant, told at the next.
    pub(super) pending: Vec<Event>,
}

/// One joint: its plans, the first of which is the present one, and what was last commanded.
#[derive(Debug)]
pub(super) struct Track {
    pub queue: VecDeque<Plan>,
    pub state: State,
    /// Streamed setpoints between the last commanded one and the one that the joint holds.
    pub ahead: LookAhead,
    /// The streamed setpoints that came.
    pub arrivals: Arrivals,
}

/// Why there is no timeline for these joints.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum TimelineError {
    /// No joint, or more than [`JointSet::CAPACITY`].
    #[error("{0} joints; a timeline has 1 to {max}", max = JointSet::CAPACITY)]
    Joints(usize),
    /// As many positions as joints are wanted.
    #[error("{positions} positions for {joints} joints")]
    Positions {
        /// Number of positions.
        positions: usize,
        /// Number of joints.
        joints: usize,
    },
    /// Tsp is not positive.
    #[error("the position period is {0} ns; it must be more than 0")]
    Period(Nanoseconds),
}

impl Timeline {
    /// All joints at rest at `positions` (m or rad); the first instant is 0. `period` is Tsp, ns.
    ///
    /// # Errors
    /// [`TimelineError`].
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
        let track = |&position: &f64| Track {
            queue: VecDeque::from([Plan::hold(position)]),
            state: State::rest(position),
            ahead: LookAhead::at_rest(position),
            arrivals: Arrivals::default(),
        };
        Ok(Self {
            tracks: positions.iter().map(track).collect(),
            motions: Motions::new(joints.len()),
            planner: StopPlanner::default(),
            stream: Stream::default(),
            psec: positions.to_vec(),
            events: Vec::new(),
            pending: Vec::new(),
            next_k: 0,
            joints,
            period,
        })
    }

    /// Commands the next position instant and returns its index k; see [`Timeline::psec`] and
    /// [`Timeline::events`].
    // An iterator could not lend the setpoints.
    #[allow(clippy::should_implement_trait)]
    pub fn next(&mut self) -> i64 {
        let (k, period) = (self.next_k, self.period);
        self.events.clear();
        self.events.append(&mut self.pending);
        // A setpoint that was taken comes with the delay that it was foreseen with.
        if self.stream.taken_k != Some(k) {
            self.settle_stream_delay();
        }
        let mut limited = false;
        for (joint, track) in self.tracks.iter_mut().enumerate() {
            if track.queue.get(1).is_some_and(|plan| plan.join_k <= k) {
                let old = track.queue.pop_front();
                let new = track.queue.front();
                if let (Some(old), Some(new)) = (old, new) {
                    self.motions.hand_over(&old, new, joint);
                    self.motions.start(new.slot, &mut self.events);
                }
            }
            let Some(plan) = track.queue.front_mut() else {
                continue;
            };
            plan.advance(k, period);
            track.state = match plan.kind {
                Kind::Hold(newest) => {
                    self.stream.note(k, newest != track.ahead.entered(track.state));
                    let reach = reach(&self.joints[joint], period);
                    let (state, arrived) = track.ahead.next(newest, reach, track.state, period);
                    limited |= !arrived;
                    state
                }
                _ => plan.state(k, period),
            };
            self.psec[joint] = track.state.position;
            if k >= plan.end_k
                && let Some(slot) = plan.slot.take()
            {
                self.motions.release(slot, joint, Release::Completed);
            }
            let is_over = plan.slot.is_none() && !plan.is_moving(k, period);
            if is_over && !matches!(plan.kind, Kind::Hold(_)) {
                plan.kind = Kind::Hold(track.state.position);
                track.ahead.empty(track.state.position);
            }
        }
        self.motions.settle(&mut self.events);
        self.count_stream(k, limited);
        self.next_k += 1;
        k
    }

    /// Setpoints of the last commanded instant, m or rad, one per joint.
    pub fn psec(&self) -> &[f64] {
        &self.psec
    }

    /// What happened at the last commanded instant, and since the one before it.
    pub fn events(&self) -> &[Event] {
        &self.events
    }

    /// Index of the instant that [`Timeline::next`] commands next.
    pub fn next_instant(&self) -> i64 {
        self.next_k
    }

    /// The joints.
    pub fn joints(&self) -> &[JointLimits] {
        &self.joints
    }

    /// Tsp, ns.
    pub fn period(&self) -> Nanoseconds {
        self.period
    }

    /// Commanded state of `joint` at the last instant, with the derivatives of what commands it.
    pub fn commanded_state(&self, joint: usize) -> Option<State> {
        self.tracks.get(joint).map(|track| track.state)
    }

    /// Setpoint of `joint` `periods` instants after the last commanded one, m or rad, by what is
    /// known now; the last one of all beyond it. `None` for a joint that there is not.
    pub fn psec_ahead(&self, joint: usize, periods: u32) -> Option<f64> {
        (joint < self.tracks.len()).then(|| {
            let k = (self.next_k - 1).saturating_add(i64::from(periods));
            self.predicted(joint, k).position
        })
    }

    /// State that `joint` is commanded at instant `k`, not before the last one.
    pub(super) fn predicted(&self, joint: usize, k: i64) -> State {
        let track = &self.tracks[joint];
        if k < self.next_k {
            return track.state;
        }
        let after = track.queue.partition_point(|plan| plan.join_k <= k);
        match track.queue.get(after.saturating_sub(1)) {
            Some(Plan { kind: Kind::Hold(newest), .. }) => {
                let reach = reach(&self.joints[joint], self.period);
                track.ahead.at(k - self.next_k, *newest, reach, track.state, self.period)
            }
            Some(plan) => plan.state(k, self.period),
            None => track.state,
        }
    }

    /// Whether a joint is commanded to move after the last instant by a trajectory or a stop that
    /// has started already. A stream is another matter: [`Timeline::is_stream_moving`].
    pub fn is_moving(&self) -> bool {
        let k = self.next_k - 1;
        self.tracks
            .iter()
            .filter_map(|track| track.queue.front())
            .any(|plan| plan.slot.is_some() || plan.is_moving(k, self.period))
    }

    /// Whether a trajectory or a stop has been accepted and has not started.
    pub fn is_waiting(&self) -> bool {
        self.tracks.iter().any(|track| track.queue.len() > 1)
    }

    /// Forgets everything and stands at `positions` (m or rad) from the next instant on. Whatever
    /// moved or waited is told to have been stopped.
    ///
    /// # Errors
    /// [`Code::WrongSize`], [`Code::NotFinite`]; nothing has changed then.
    pub fn reset(&mut self, positions: &[f64]) -> Result<(), Rejection> {
        if positions.len() != self.joints.len() {
            let (found, wanted) = (positions.len(), self.joints.len());
            return Err(Rejection::new(Code::WrongSize, format!("{found} positions for {wanted} joints"))
                .numbers(found as f64, wanted as f64));
        }
        for (joint, &position) in self.joints.iter().zip(positions) {
            check_finite(joint, position)?;
        }
        self.end_stream(0..positions.len(), StreamEnd::Reset);
        for (joint, &position) in positions.iter().enumerate() {
            self.stop_all(joint, None);
            let track = &mut self.tracks[joint];
            track.queue.clear();
            track.queue.push_back(Plan::hold(position));
            track.state = State::rest(position);
            track.ahead.empty(position);
            self.psec[joint] = position;
        }
        self.forget_stream();
        self.settle_stream_delay();
        self.motions.settle(&mut self.pending);
        self.reserve_events();
        Ok(())
    }

    /// Makes room for all that the next instant can tell, a start and an end of each motion, so
    /// that it does not allocate.
    pub(super) fn reserve_events(&mut self) {
        self.events.reserve(self.pending.len() + 2 * self.motions.capacity());
    }

    /// Takes `joint` away from everything that moves it or waits for it.
    pub(super) fn stop_all(&mut self, joint: usize, by: Option<MotionId>) {
        for plan in &mut self.tracks[joint].queue {
            if let Some(slot) = plan.slot.take() {
                self.motions.release(slot, joint, Release::Stopped(by));
            }
        }
    }
}

pub(super) fn check_finite(joint: &JointLimits, position: f64) -> Result<(), Rejection> {
    if position.is_finite() {
        return Ok(());
    }
    let text = format!("{}: position is {position}, not a finite number", joint.name);
    Err(Rejection::new(Code::NotFinite, text).joint(&joint.name).numbers(position, 0.0))
}
