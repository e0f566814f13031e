//! Setpoints that come one at a time, for joints that no trajectory moves.
//!
//! Nothing is known ahead of a stream, and a controller with a preview needs that. So each setpoint
//! waits in a look-ahead buffer of D position periods: what arrives before instant k is commanded at
//! instant k + D, and until then [`Timeline::psec_ahead`] answers with it. When nothing arrives the
//! last setpoint holds, and goes on being pushed through the buffer.
//!
//! A sender has a clock and a rate of its own, and a network delays: two setpoints can come in one
//! period and none in the next. What enters the buffer therefore goes towards the newest setpoint by
//! Vmax·Tsp in each period at most, and which setpoints are taken is judged against those before
//! them: see `arrivals`.

use std::collections::VecDeque;

use super::arrivals::{Place, Verdict};
use super::event::{JointSet, MotionId};
use super::limits::{JointLimits, SPEED_TOLERANCE};
use super::plan::Kind;
use super::rejection::{Code, Rejection};
use super::spline::State;
use super::timeline::{Timeline, check_finite};
use crate::units::{MILLISECOND_NS, Nanoseconds, seconds};

/// Longest delay of a stream, position periods: more than any preview, little to keep in memory.
pub const MAX_STREAM_DELAY: u32 = 1024;
/// How long nothing changes in a stream that has paused: more than a sender's jitter.
pub const STREAM_PAUSE: Nanoseconds = 100 * MILLISECOND_NS;

/// Setpoints of one joint that have entered the buffer and are not commanded yet, the next one in
/// front; as many as the delay has periods.
#[derive(Debug, Default)]
pub(super) struct LookAhead {
    buffer: VecDeque<f64>,
    /// What had entered when the newest setpoint was taken, m or rad.
    from: f64,
    /// Instants since then.
    since: i64,
}

/// What enters `instants` after a setpoint `newest` was taken, when `from` had entered before it:
/// the setpoint, or what is on the way to it at `reach` (m or rad) a period.
fn approach(from: f64, newest: f64, instants: i64, reach: f64) -> f64 {
    let way = newest - from;
    let instants = instants as f64;
    if way.abs() <= reach * (instants + SPEED_TOLERANCE) {
        newest
    } else {
        from + (reach * instants).copysign(way)
    }
}

/// What a stream did that is worth telling, since the beginning.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct StreamCounts {
    /// How often it broke off in motion: nothing came for [`STREAM_PAUSE`].
    pub gaps: u64,
    /// Position periods in which a joint went towards its setpoint at Vmax and was not there yet.
    pub limited: u64,
}

/// What took joints away from a stream that drove them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StreamEnd {
    /// A trajectory.
    Displaced(MotionId),
    /// A controlled stop.
    Stopped(MotionId),
    /// All was put at rest.
    Reset,
    /// The clock jumped.
    ClockJump,
}

/// The stream as a whole: one delay for all joints, so that they stay together.
#[derive(Debug, Default)]
pub(super) struct Stream {
    /// D, position periods.
    delay: usize,
    /// D as it was set last, for when the stream has paused.
    wanted: usize,
    /// The instant at which a setpoint last entered a buffer that differs from the one before it.
    moved_k: Option<i64>,
    /// The instant before which a setpoint was last taken.
    pub(super) taken_k: Option<i64>,
    pub(super) counts: StreamCounts,
    /// What ended it, and the joints that were taken, until that is asked for.
    ended: Option<(StreamEnd, JointSet)>,
}

impl LookAhead {
    /// At rest at `position`, m or rad.
    pub fn at_rest(position: f64) -> Self {
        Self { from: position, ..Self::default() }
    }

    /// What entered last; `state` is what is commanded.
    pub fn entered(&self, state: State) -> f64 {
        self.buffer.back().copied().unwrap_or(state.position)
    }

    /// Goes towards another setpoint from the next instant on.
    pub fn turn(&mut self, state: State) {
        (self.from, self.since) = (self.entered(state), 0);
    }

    /// Lets the way to `newest` enter, `reach` (m or rad) further at most, and gives the next state to
    /// command and whether `newest` has entered; `state` is the one before it.
    pub fn next(&mut self, newest: f64, reach: f64, state: State, period: Nanoseconds) -> (State, bool) {
        self.since = self.since.saturating_add(1);
        let entry = approach(self.from, newest, self.since, reach);
        let position = self.buffer.pop_front().map_or(entry, |position| {
            self.buffer.push_back(entry);
            position
        });
        (between(state.position, position, period), entry == newest)
    }

    /// State to be commanded `instants` after the next instant, if `newest` remains the newest.
    pub fn at(&self, instants: i64, newest: f64, reach: f64, state: State, period: Nanoseconds) -> State {
        let length = self.buffer.len() as i64;
        let entry = |place: i64| match usize::try_from(place).ok().and_then(|p| self.buffer.get(p)) {
            Some(&position) => position,
            None => {
                let since = self.since.saturating_add((place - length).saturating_add(1));
                approach(self.from, newest, since, reach)
            }
        };
        let instants = instants.max(0);
        let before = if instants == 0 { state.position } else { entry(instants - 1) };
        between(before, entry(instants), period)
    }

    /// Leaves nothing but `position`, m or rad.
    pub fn empty(&mut self, position: f64) {
        self.buffer.iter_mut().for_each(|entry| *entry = position);
        (self.from, self.since) = (position, 0);
    }
}

/// Position periods of a pause.
pub(super) fn pause(period: Nanoseconds) -> i64 {
    STREAM_PAUSE / period + 1
}

/// Vmax·Tsp, m or rad.
pub(super) fn reach(limits: &JointLimits, period: Nanoseconds) -> f64 {
    limits.limits.velocity * seconds(period)
}

/// The state at `position`, one period after `before`.
fn between(before: f64, position: f64, period: Nanoseconds) -> State {
    State { position, velocity: (position - before) / seconds(period), acceleration: 0.0 }
}

impl Stream {
    /// Notes whether the setpoints that entered at instant `k` differ from those before them.
    pub fn note(&mut self, k: i64, moved: bool) {
        if moved {
            self.moved_k = Some(k);
        }
    }
}

impl Timeline {
    /// Sets one setpoint of a stream, m or rad: `true` if it is taken; `false` while a trajectory or a
    /// stop moves the joint or waits for it, and after a stop until the stream has paused: until nothing
    /// has changed in it for [`STREAM_PAUSE`].
    ///
    /// What enters the look-ahead buffer from the next instant on goes to it, by Vmax·Tsp in each period
    /// at most, and is commanded [`Timeline::stream_delay`] instants after it has entered; of several
    /// before one instant the last one counts. A trajectory or a stop that begins takes the joint over
    /// from its commanded state, with the velocity of the stream, and forgets what is in the buffer.
    ///
    /// # Errors
    /// [`Code::UnknownJoint`], [`Code::NotFinite`], [`Code::OutsideStroke`]. [`Code::Jump`] if a stream
    /// begins further than one period's reach from what entered last, or goes on further from its last
    /// setpoint than the joint comes in the time between, [`STREAM_JITTER`] more. What was taken
    /// remains as it is then.
    ///
    /// [`STREAM_JITTER`]: super::STREAM_JITTER
    pub fn stream(&mut self, joint: usize, position: f64) -> Result<bool, Rejection> {
        self.stream_sent(joint, position, None)
    }

    /// Likewise, `sent` (ns) by the sender's clock: the time between two setpoints is that by this
    /// clock, if it is longer than that between their arrivals.
    ///
    /// # Errors
    /// As of [`Timeline::stream`].
    pub fn stream_sent(
        &mut self,
        joint: usize,
        position: f64,
        sent: Option<Nanoseconds>,
    ) -> Result<bool, Rejection> {
        let Some(limits) = self.joints.get(joint) else {
            let text = format!("there is no joint with index {joint}");
            return Err(Rejection::new(Code::UnknownJoint, text));
        };
        check_finite(limits, position)?;
        limits.check_stroke(0, position)?;
        self.settle_stream_delay();
        let (k, period) = (self.next_k, self.period);
        let limits = &self.joints[joint];
        let track = &mut self.tracks[joint];
        let is_free = track.queue.len() == 1
            && track.queue[0].slot.is_none()
            && matches!(track.queue[0].kind, Kind::Hold(_));
        let entered = track.ahead.entered(track.state);
        let place = Place { limits, period, k, entered, is_free };
        match track.arrivals.judge(place, position, sent)? {
            Verdict::Ignored => Ok(false),
            Verdict::Taken => {
                track.ahead.turn(track.state);
                track.queue[0].kind = Kind::Hold(position);
                self.stream.taken_k = Some(k);
                Ok(true)
            }
        }
    }

    /// Sets the delay of streamed setpoints, position periods, at most [`MAX_STREAM_DELAY`].
    ///
    /// It takes effect when no joint's streamed setpoints have changed for the present delay and
    /// [`STREAM_PAUSE`] more, when it moves nothing; with no stream that is at once. A stream that
    /// does not pause keeps the delay that it has.
    pub fn set_stream_delay(&mut self, periods: u32) {
        let wanted = periods.min(MAX_STREAM_DELAY) as usize;
        for track in &mut self.tracks {
            // Here, so that the instant at which it takes effect allocates nothing.
            let room = wanted.saturating_sub(track.ahead.buffer.len());
            track.ahead.buffer.reserve(room);
        }
        self.stream.wanted = wanted;
        self.settle_stream_delay();
    }

    /// Delay of streamed setpoints that is in effect, position periods.
    pub fn stream_delay(&self) -> u32 {
        self.stream.delay as u32
    }

    /// Whether a stream drives: whether one of its setpoints was taken within [`STREAM_PAUSE`], or
    /// is still to be commanded.
    pub fn is_streaming(&self) -> bool {
        !self.has_passed(self.stream.taken_k, self.pause())
    }

    /// Whether streamed setpoints moved a joint at the last instant, or will by what has arrived.
    pub fn is_stream_moving(&self) -> bool {
        !self.has_passed(self.stream.moved_k, 1)
    }

    /// Whether setpoints come for a joint that are ignored after a stop.
    pub fn is_stream_held_off(&self) -> bool {
        self.tracks.iter().any(|track| track.arrivals.is_held_off(self.next_k, self.period))
    }

    /// What the streams did, since the beginning.
    pub fn stream_counts(&self) -> StreamCounts {
        self.stream.counts
    }

    /// What last took joints away from a stream that drove them, and which; told once.
    pub fn take_stream_end(&mut self) -> Option<(StreamEnd, JointSet)> {
        self.stream.ended.take()
    }

    /// Takes `joints` away from a stream, which a stop does until the stream pauses.
    pub(super) fn end_stream(&mut self, joints: impl IntoIterator<Item = usize>, end: StreamEnd) {
        let mut driven = JointSet::default();
        for joint in joints {
            let arrivals = &mut self.tracks[joint].arrivals;
            if arrivals.drives(self.next_k, self.period) {
                driven.insert(joint);
            }
            arrivals.end(self.next_k, matches!(end, StreamEnd::Stopped(_)));
        }
        if !driven.is_empty() {
            self.stream.ended = Some((end, driven));
        }
    }

    /// Counts what is worth telling about the setpoints that entered at instant `k`; `limited` if one
    /// has not entered yet.
    pub(super) fn count_stream(&mut self, k: i64, limited: bool) {
        let mut broke_off = false;
        for track in &mut self.tracks {
            broke_off |= track.arrivals.broke_off(k, self.period);
        }
        self.stream.counts.gaps += u64::from(broke_off);
        self.stream.counts.limited += u64::from(limited);
    }

    /// Brings the delay that was set into effect, if the stream has paused.
    pub(super) fn settle_stream_delay(&mut self) {
        if self.stream.wanted == self.stream.delay || !self.has_passed(self.stream.moved_k, self.pause()) {
            return;
        }
        self.stream.delay = self.stream.wanted;
        self.stream.moved_k = None;
        for track in &mut self.tracks {
            // Of a joint that stands, all entries are what it is commanded.
            track.ahead.buffer.resize(self.stream.delay, track.state.position);
        }
    }

    /// Forgets that there was a stream.
    pub(super) fn forget_stream(&mut self) {
        (self.stream.moved_k, self.stream.taken_k) = (None, None);
    }

    fn pause(&self) -> i64 {
        pause(self.period)
    }

    /// Whether what happened at instant `k` left the buffer `instants` ago or more.
    fn has_passed(&self, k: Option<i64>, instants: i64) -> bool {
        k.is_none_or(|k| self.next_k - k > self.stream.delay as i64 + instants)
    }
}
