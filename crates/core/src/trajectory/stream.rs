//! Stream of setpoints: single setpoints at run time for joints without a trajectory.
//!
//! A controller with a preview needs future setpoints, which a stream does not provide. Therefore each
//! setpoint passes a preview buffer of D position cycles: a setpoint accepted before instant k is
//! commanded at instant k + D. While no setpoint arrives, the last one is held and continues to enter
//! the buffer.
//!
//! The sender has its own clock and rate, and the network delays messages: two setpoints can arrive in
//! one position cycle and none in the next. Therefore the setpoint that enters the buffer approaches
//! the newest accepted setpoint by at most Vmax·Tsp in each position cycle (slew-rate limit).
//! The module `stream_gate` decides which setpoints are accepted.

use super::event::{JointSet, MotionId};
use super::limits::JointLimits;
use super::preview::PreviewBuffer;
use super::rejection::Rejection;
use super::spline::KinematicState;
use super::stream_gate::{JointStatus, StreamGate, pause_cycles};
use crate::units::{Nanoseconds, seconds};

pub use super::stream_gate::{STREAM_JITTER, STREAM_PAUSE};

/// Longest delay of a stream, position cycles; longer than the preview of any controller.
pub const MAX_STREAM_DELAY: u32 = 1024;

/// Counters of streamed setpoints since construction.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct StreamCounts {
    /// Number of gaps: no setpoint for [`STREAM_PAUSE`] while the joint was in motion.
    pub gaps: u64,
    /// Position cycles in which a joint approached its setpoint at Vmax and did not reach it.
    pub limited: u64,
}

/// Cause for which a stream lost joints that it commanded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StreamEnd {
    /// Preemption by a trajectory.
    Preempted(MotionId),
    /// Controlled stop.
    Stopped(MotionId),
    /// Reset of all joints.
    Reset,
    /// Clock jump.
    ClockJump,
}

/// Streamed setpoints of all joints: acceptance, preview buffers with one common delay, counters.
#[derive(Debug, Clone)]
pub(super) struct SetpointStream {
    /// Tsp, ns.
    period: Nanoseconds,
    joints: Vec<StreamedJoint>,
    /// Delay D in effect, position cycles.
    delay: usize,
    /// Delay that takes effect when the stream has paused, position cycles.
    requested_delay: usize,
    /// Last instant at which a setpoint different from the previous one entered a buffer.
    moved_k: Option<i64>,
    /// Instant before which a setpoint was last accepted.
    accepted_k: Option<i64>,
    counts: StreamCounts,
    /// Last end and the joints that the stream commanded; cleared by [`SetpointStream::take_end`].
    ended: Option<(StreamEnd, JointSet)>,
    /// A joint has not reached its setpoint at the present instant.
    is_limited: bool,
}

/// One streamed setpoint of one joint.
#[derive(Debug, Clone, Copy)]
pub(super) struct StreamedSetpoint {
    /// Index of the joint.
    pub joint: usize,
    /// Position setpoint, m or rad.
    pub position: f64,
    /// Source time stamp, ns.
    pub sent: Option<Nanoseconds>,
}

#[derive(Debug, Clone)]
struct StreamedJoint {
    /// Vmax·Tsp, m or rad.
    reach: f64,
    preview: PreviewBuffer,
    gate: StreamGate,
}

impl SetpointStream {
    /// Creates an idle stream without delay for `limits.len()` joints at rest at `positions` (m or rad).
    pub fn new(limits: &[JointLimits], period: Nanoseconds, positions: &[f64]) -> Self {
        let joint = |(limits, &position): (&JointLimits, &f64)| StreamedJoint {
            reach: limits.limits.velocity * seconds(period),
            preview: PreviewBuffer::new(position),
            gate: StreamGate::default(),
        };
        Self {
            period,
            joints: limits.iter().zip(positions).map(joint).collect(),
            delay: 0,
            requested_delay: 0,
            moved_k: None,
            accepted_k: None,
            counts: StreamCounts::default(),
            ended: None,
            is_limited: false,
        }
    }

    /// Submits a setpoint before instant `k`.
    ///
    /// `psec` contains the commanded setpoints of all joints; `is_free` is true if neither a trajectory
    /// nor a stop commands the joint. Returns true if the setpoint is accepted; the caller then holds it
    /// as the newest setpoint of the joint.
    ///
    /// # Errors
    /// `NotFinite` for NaN and infinity, `OutsideTravelLimits`, `Jump`.
    pub fn submit(
        &mut self,
        setpoint: StreamedSetpoint,
        limits: &JointLimits,
        k: i64,
        psec: &[f64],
        is_free: bool,
    ) -> Result<bool, Rejection> {
        let StreamedSetpoint { joint, position, sent } = setpoint;
        limits.check_finite(position)?;
        limits.check_travel_limits(None, position)?;
        self.apply_delay(k, psec);
        let StreamedJoint { reach, preview, gate } = &mut self.joints[joint];
        let last_entry = preview.last_entry(psec[joint]);
        let status = JointStatus { limits, reach: *reach, period: self.period, k, last_entry, is_free };
        let is_accepted = gate.validate(status, position, sent)?;
        if is_accepted {
            preview.retarget(psec[joint]);
            self.accepted_k = Some(k);
        }
        Ok(is_accepted)
    }

    /// Begins instant `k`: applies a requested delay.
    pub fn begin_instant(&mut self, k: i64, psec: &[f64]) {
        // A setpoint accepted for this instant keeps the delay with which it was previewed.
        if self.accepted_k != Some(k) {
            self.apply_delay(k, psec);
        }
        self.is_limited = false;
    }

    /// Returns the state of `joint` at instant `k`, which holds or approaches the setpoint `newest`;
    /// `commanded` is its position setpoint of the previous instant.
    pub fn next_state(&mut self, joint: usize, k: i64, newest: f64, commanded: f64) -> KinematicState {
        let StreamedJoint { reach, preview, .. } = &mut self.joints[joint];
        if newest != preview.last_entry(commanded) {
            self.moved_k = Some(k);
        }
        let (state, has_entered) = preview.next(newest, *reach, commanded, self.period);
        self.is_limited |= !has_entered;
        state
    }

    /// Finishes instant `k`: updates the counters.
    pub fn finish_instant(&mut self, k: i64) {
        let mut has_gap = false;
        for joint in &mut self.joints {
            has_gap |= joint.gate.detect_gap(k, self.period);
        }
        self.counts.gaps += u64::from(has_gap);
        self.counts.limited += u64::from(self.is_limited);
    }

    /// Returns the state of `joint` `instants` after the next instant if `newest` remains the newest
    /// setpoint.
    pub fn state_after(&self, joint: usize, instants: i64, newest: f64, commanded: f64) -> KinematicState {
        let StreamedJoint { reach, preview, .. } = &self.joints[joint];
        preview.state_after(instants, newest, *reach, commanded, self.period)
    }

    /// Replaces the preview of `joint` by `position`, m or rad.
    pub fn flush(&mut self, joint: usize, position: f64) {
        self.joints[joint].preview.flush(position);
    }

    /// Ends the stream of `joints` before instant `k`; after a stop it is inhibited until it pauses.
    pub fn end(&mut self, joints: impl IntoIterator<Item = usize>, end: StreamEnd, k: i64) {
        let mut commanded = JointSet::default();
        for joint in joints {
            let gate = &mut self.joints[joint].gate;
            if gate.is_active(k, self.period) {
                commanded.insert(joint);
            }
            gate.end(k, matches!(end, StreamEnd::Stopped(_)));
        }
        if !commanded.is_empty() {
            self.ended = Some((end, commanded));
        }
    }

    /// Forgets the activity of the stream: it counts as paused.
    pub fn clear_activity(&mut self) {
        (self.moved_k, self.accepted_k) = (None, None);
    }

    /// Requests a delay of `cycles` position cycles, at most [`MAX_STREAM_DELAY`]; it takes effect when
    /// the stream has paused.
    pub fn set_delay(&mut self, cycles: u32, k: i64, psec: &[f64]) {
        let requested = cycles.min(MAX_STREAM_DELAY) as usize;
        for joint in &mut self.joints {
            // Allocates here, so that the instant at which the delay takes effect does not allocate.
            joint.preview.reserve(requested);
        }
        self.requested_delay = requested;
        self.apply_delay(k, psec);
    }

    /// Applies the requested delay if the stream has paused.
    pub fn apply_delay(&mut self, k: i64, psec: &[f64]) {
        let pause = pause_cycles(self.period);
        if self.requested_delay == self.delay || !self.has_passed(self.moved_k, pause, k) {
            return;
        }
        self.delay = self.requested_delay;
        self.moved_k = None;
        for (joint, &position) in self.joints.iter_mut().zip(psec) {
            // All entries of a joint at standstill equal its commanded setpoint.
            joint.preview.resize(self.delay, position);
        }
    }

    /// Returns the delay in effect, position cycles.
    pub fn delay(&self) -> u32 {
        self.delay as u32
    }

    /// Returns true if a setpoint was accepted within [`STREAM_PAUSE`] or is still to be commanded.
    pub fn is_active(&self, k: i64) -> bool {
        !self.has_passed(self.accepted_k, pause_cycles(self.period), k)
    }

    /// Returns true if streamed setpoints moved a joint at the last instant or are about to.
    pub fn is_moving(&self, k: i64) -> bool {
        !self.has_passed(self.moved_k, 1, k)
    }

    /// Returns true if setpoints of a joint arrive and are ignored after a stop.
    pub fn is_inhibited(&self, k: i64) -> bool {
        self.joints.iter().any(|joint| joint.gate.is_inhibited(k, self.period))
    }

    /// Returns the counters since construction.
    pub fn counts(&self) -> StreamCounts {
        self.counts
    }

    /// Returns once the cause of the last end and the joints that the stream commanded.
    pub fn take_end(&mut self) -> Option<(StreamEnd, JointSet)> {
        self.ended.take()
    }

    /// Returns true if an entry of instant `entered_k` left the buffer `instants` or more before `k`.
    fn has_passed(&self, entered_k: Option<i64>, instants: i64, k: i64) -> bool {
        entered_k.is_none_or(|entered_k| k - entered_k > self.delay as i64 + instants)
    }
}
