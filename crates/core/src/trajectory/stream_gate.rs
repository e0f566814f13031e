//! Acceptance of streamed setpoints, per joint: jump check, pause detection, inhibit after a stop.
//!
//! A stream must begin within Vmax·Tsp of the last setpoint in the preview buffer. Each further setpoint
//! must be reachable from the previously accepted one in the time between the two plus
//! [`STREAM_JITTER`]. After a pause, a trajectory or a stop, the stream must begin again.

use super::limits::{JointLimits, SPEED_TOLERANCE};
use super::rejection::{Rejection, RejectionCode};
use crate::units::{MILLISECOND_NS, Nanoseconds, Rounded, seconds};

/// Jitter allowance for early setpoints, ns: one sample of a 50 Hz sender that arrives together with
/// the next one.
pub const STREAM_JITTER: Nanoseconds = 20 * MILLISECOND_NS;
/// Time without a change after which a stream has paused, ns; longer than the jitter of a sender.
pub const STREAM_PAUSE: Nanoseconds = 100 * MILLISECOND_NS;

/// Returns the position cycles of [`STREAM_PAUSE`].
pub(super) fn pause_cycles(period: Nanoseconds) -> i64 {
    STREAM_PAUSE / period + 1
}

/// Acceptance state of the streamed setpoints of one joint.
#[derive(Debug, Default, Clone)]
pub(super) struct StreamGate {
    /// Last accepted setpoint while the stream commands the joint.
    accepted: Option<AcceptedSetpoint>,
    /// Last received setpoint, accepted or not.
    received: Option<ReceivedSetpoint>,
    /// Instant of a stop; cleared when the stream has paused after it.
    inhibited_k: Option<i64>,
}

#[derive(Debug, Clone, Copy)]
struct AcceptedSetpoint {
    k: i64,
    position: f64,
    /// The velocity is higher than the axis can brake within one sample.
    is_in_motion: bool,
}

#[derive(Debug, Clone, Copy)]
struct ReceivedSetpoint {
    k: i64,
    position: f64,
    /// Instant of the last change of position.
    changed_k: i64,
    /// Source time stamp, ns.
    sent: Option<Nanoseconds>,
}

/// State of a joint at the arrival of a streamed setpoint.
#[derive(Debug, Clone, Copy)]
pub(super) struct JointStatus<'a> {
    pub limits: &'a JointLimits,
    /// Vmax·Tsp, m or rad.
    pub reach: f64,
    /// Tsp, ns.
    pub period: Nanoseconds,
    /// Next position cycle.
    pub k: i64,
    /// Last entry of the preview buffer, m or rad.
    pub last_entry: f64,
    /// No trajectory and no stop commands the joint.
    pub is_free: bool,
}

impl StreamGate {
    /// Validates a setpoint `position` (m or rad) with the source time stamp `sent` (ns).
    ///
    /// Returns true if it is accepted, false if it is ignored because the joint is not free or the
    /// stream is inhibited after a stop.
    ///
    /// # Errors
    /// [`RejectionCode::Jump`].
    pub fn validate(
        &mut self,
        joint: JointStatus<'_>,
        position: f64,
        sent: Option<Nanoseconds>,
    ) -> Result<bool, Rejection> {
        let JointStatus { limits, reach, period, k, last_entry, is_free } = joint;
        let previous = self.received;
        self.record_received(k, position, sent);
        let changed_k = previous.map(|received| received.changed_k);
        let has_not_paused =
            |stop_k: &i64| k - changed_k.unwrap_or(*stop_k).max(*stop_k) <= pause_cycles(period);
        self.inhibited_k = self.inhibited_k.filter(has_not_paused);
        if !is_free || self.inhibited_k.is_some() {
            return Ok(false);
        }
        let elapsed = previous.map_or(0, |previous| time_between(previous, k, sent, period));
        let accepted = self.accepted.filter(|_| self.is_active(k, period));
        let (from, allowed) = match accepted {
            Some(accepted) if (position - last_entry).abs() > reach => {
                (accepted.position, reach * (elapsed + STREAM_JITTER) as f64 / period as f64)
            }
            // The stream begins, or returns to the position of the joint.
            _ => (last_entry, reach),
        };
        check_jump(limits, from, position, allowed)?;
        let time = seconds(elapsed.max(period));
        let is_in_motion = accepted.is_some_and(|accepted| {
            let is_fast = (position - accepted.position).abs() > limits.limits.acceleration * time * time;
            is_fast || (accepted.is_in_motion && accepted.k == k)
        });
        self.accepted = Some(AcceptedSetpoint { k, position, is_in_motion });
        Ok(true)
    }

    fn record_received(&mut self, k: i64, position: f64, sent: Option<Nanoseconds>) {
        let same = self.received.filter(|received| received.position == position);
        let changed_k = same.map_or(k, |received| received.changed_k);
        self.received = Some(ReceivedSetpoint { k, position, changed_k, sent });
    }

    /// Returns true if the stream commands the joint before instant `k`.
    pub fn is_active(&self, k: i64, period: Nanoseconds) -> bool {
        self.accepted.is_some_and(|accepted| k - accepted.k <= pause_cycles(period))
    }

    /// Returns true if setpoints arrive and are ignored because of a stop.
    pub fn is_inhibited(&self, k: i64, period: Nanoseconds) -> bool {
        self.inhibited_k.is_some()
            && self.received.is_some_and(|received| k - received.k <= pause_cycles(period))
    }

    /// Ends the stream of the joint before instant `k`; after a stop it is inhibited until it pauses.
    pub fn end(&mut self, k: i64, is_stopped: bool) {
        self.accepted = None;
        if is_stopped {
            self.inhibited_k = Some(k);
        }
    }

    /// Returns true once when the stream has paused in motion at instant `k`.
    pub fn detect_gap(&mut self, k: i64, period: Nanoseconds) -> bool {
        let Some(accepted) = self.accepted.as_mut().filter(|accepted| accepted.is_in_motion) else {
            return false;
        };
        let has_gap = self.received.is_some_and(|received| k - received.k > pause_cycles(period));
        accepted.is_in_motion &= !has_gap;
        has_gap
    }
}

/// Returns the time from `previous` to a setpoint that arrives before instant `k`, ns; at most one pause.
fn time_between(
    previous: ReceivedSetpoint,
    k: i64,
    sent: Option<Nanoseconds>,
    period: Nanoseconds,
) -> Nanoseconds {
    let arrived = (k - previous.k).saturating_mul(period);
    let sent = sent.zip(previous.sent).map_or(0, |(sent, before)| sent.saturating_sub(before));
    arrived.max(sent).min(pause_cycles(period).saturating_mul(period))
}

fn check_jump(limits: &JointLimits, from: f64, position: f64, allowed: f64) -> Result<(), Rejection> {
    let jump = (position - from).abs();
    if jump <= allowed * (1.0 + SPEED_TOLERANCE) {
        return Ok(());
    }
    let (name, unit) = (&limits.name, limits.unit());
    let text = format!(
        "{name}: streamed setpoint {} {unit} is {} {unit} away from the previous setpoint {} {unit}; \
         at most {} {unit} is allowed in the elapsed time",
        Rounded(position),
        Rounded(jump),
        Rounded(from),
        Rounded(allowed)
    );
    Err(Rejection::new(RejectionCode::Jump, text).joint(name).numbers(jump, allowed))
}
