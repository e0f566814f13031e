//! Set-points that come one at a time, for joints that no trajectory moves.
//!
//! Nothing is known ahead of a stream, and a controller with a preview needs that. So each set-point
//! waits in a look-ahead buffer of D position periods: what arrives before instant k is commanded at
//! instant k + D, and until then [`Timeline::psec_ahead`] answers with it. When nothing arrives the
//! last set-point holds, and goes on being pushed through the buffer.

use std::collections::VecDeque;

use super::plan::Kind;
use super::rejection::{Code, Rejection};
use super::spline::State;
use super::timeline::{Timeline, check_finite};
use crate::units::{MILLISECOND_NS, Nanoseconds, seconds};

/// Longest delay of a stream, position periods: more than any preview, little to keep in memory.
pub const MAX_STREAM_DELAY: u32 = 1024;
/// How long nothing changes in a stream that has paused: more than a sender's jitter.
pub const STREAM_PAUSE: Nanoseconds = 100 * MILLISECOND_NS;

/// Set-points of one joint that have entered the buffer and are not commanded yet, the next one in
/// front; as many as the delay has periods.
#[derive(Debug, Default)]
pub(super) struct LookAhead {
    buffer: VecDeque<f64>,
}

/// The stream as a whole: one delay for all joints, so that they stay together.
#[derive(Debug, Default)]
pub(super) struct Stream {
    /// D, position periods.
    delay: usize,
    /// D as it was set last, for when the stream has paused.
    wanted: usize,
    /// The instant at which a set-point last entered a buffer that differs from the one before it.
    moved_k: Option<i64>,
    /// The instant before which a set-point was last taken.
    pub(super) taken_k: Option<i64>,
}

impl LookAhead {
    /// The set-point that entered last; `state` is what is commanded.
    pub fn entered(&self, state: State) -> f64 {
        self.buffer.back().copied().unwrap_or(state.position)
    }

    /// Takes `newest` in and gives the next state to command; `state` is the one before it.
    pub fn next(&mut self, newest: f64, state: State, period: Nanoseconds) -> State {
        let position = self.buffer.pop_front().map_or(newest, |position| {
            self.buffer.push_back(newest);
            position
        });
        between(state.position, position, period)
    }

    /// State to be commanded `instants` after the next instant, if `newest` holds.
    pub fn at(&self, instants: i64, newest: f64, state: State, period: Nanoseconds) -> State {
        let instants = usize::try_from(instants).unwrap_or(0);
        let entry = |place: usize| self.buffer.get(place).copied().unwrap_or(newest);
        let before = instants.checked_sub(1).map_or(state.position, entry);
        between(before, entry(instants), period)
    }

    /// Leaves nothing but `position`, m or rad.
    pub fn empty(&mut self, position: f64) {
        self.buffer.iter_mut().for_each(|entry| *entry = position);
    }
}

/// The state at `position`, one period after `before`.
fn between(before: f64, position: f64, period: Nanoseconds) -> State {
    State { position, velocity: (position - before) / seconds(period), acceleration: 0.0 }
}

impl Stream {
    /// Notes whether the set-points that entered at instant `k` differ from those before them.
    pub fn note(&mut self, k: i64, moved: bool) {
        if moved {
            self.moved_k = Some(k);
        }
    }
}

impl Timeline {
    /// Sets one set-point of a stream, m or rad: `true` if it is taken, `false` while a trajectory or
    /// a stop moves the joint or waits for it. The set-point enters the look-ahead buffer at the next
    /// instant and is commanded [`Timeline::stream_delay`] instants after that; of several before one
    /// instant the last one counts.
    ///
    /// A trajectory or a stop that begins takes the joint over from its commanded state, with the
    /// velocity of the stream, and forgets what is in the buffer.
    ///
    /// # Errors
    /// [`Code::UnknownJoint`], [`Code::NotFinite`], [`Code::OutsideStroke`]; [`Code::Jump`] if the
    /// joint cannot reach it in one period from the set-point that entered before it. Nothing changes
    /// then.
    pub fn stream(&mut self, joint: usize, position: f64) -> Result<bool, Rejection> {
        let Some(limits) = self.joints.get(joint) else {
            let text = format!("there is no joint with index {joint}");
            return Err(Rejection::new(Code::UnknownJoint, text));
        };
        check_finite(limits, position)?;
        limits.check_stroke(0, position)?;
        self.settle_stream_delay();
        let limits = &self.joints[joint];
        let track = &mut self.tracks[joint];
        let waiting = track.queue.len() > 1;
        let Some(plan) = track.queue.front_mut().filter(|_| !waiting) else {
            return Ok(false);
        };
        if plan.slot.is_some() || !matches!(plan.kind, Kind::Hold(_)) {
            return Ok(false);
        }
        limits.check_jump(0, track.ahead.entered(track.state), position, seconds(self.period))?;
        plan.kind = Kind::Hold(position);
        self.stream.taken_k = Some(self.next_k);
        Ok(true)
    }

    /// Sets the delay of streamed set-points, position periods, at most [`MAX_STREAM_DELAY`].
    ///
    /// It takes effect when no joint's streamed set-points have changed for the present delay and
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

    /// Delay of streamed set-points that is in effect, position periods.
    pub fn stream_delay(&self) -> u32 {
        self.stream.delay as u32
    }

    /// Whether a stream drives: whether one of its set-points was taken within [`STREAM_PAUSE`], or
    /// is still to be commanded.
    pub fn is_streaming(&self) -> bool {
        !self.has_passed(self.stream.taken_k, self.pause())
    }

    /// Whether streamed set-points moved a joint at the last instant, or will by what has arrived.
    pub fn is_stream_moving(&self) -> bool {
        !self.has_passed(self.stream.moved_k, 1)
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
        STREAM_PAUSE / self.period + 1
    }

    /// Whether what happened at instant `k` left the buffer `instants` ago or more.
    fn has_passed(&self, k: Option<i64>, instants: i64) -> bool {
        k.is_none_or(|k| self.next_k - k > self.stream.delay as i64 + instants)
    }
}
