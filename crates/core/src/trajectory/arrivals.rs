//! Which setpoints of a stream are taken, joint by joint.
//!
//! A stream has to begin where the joint is: within Vmax·Tsp of what entered the look-ahead buffer last.
//! From then on it drives the joint, and each setpoint is judged against the one that was taken before:
//! the joint must be able to come from there in the time between the two, and [`STREAM_JITTER`] more. A
//! stream that pauses, or whose joint a trajectory or a stop takes, has to begin anew.

use super::limits::{JointLimits, SPEED_TOLERANCE};
use super::rejection::{Code, Rejection};
use super::stream::{pause, reach};
use crate::units::{MILLISECOND_NS, Nanoseconds, Told, seconds};

/// How much earlier than it was due a setpoint may come: one sample of a sender of 50 Hz that was held
/// up and comes together with the next.
pub const STREAM_JITTER: Nanoseconds = 20 * MILLISECOND_NS;

/// What is known of the setpoints that came for one joint.
#[derive(Debug, Default)]
pub(super) struct Arrivals {
    /// The setpoint that was last taken, while the stream drives.
    taken: Option<Taken>,
    /// The last one that came, whatever became of it.
    seen: Option<Seen>,
    /// The instant of a stop, until the stream has paused after it.
    held_off: Option<i64>,
}

#[derive(Debug, Clone, Copy)]
struct Taken {
    k: i64,
    position: f64,
    /// Faster than the axis can brake in one sample: rest is not what follows.
    in_motion: bool,
}

#[derive(Debug, Clone, Copy)]
struct Seen {
    k: i64,
    position: f64,
    /// The instant before which it differed from the one before it.
    changed_k: i64,
    /// When it was sent by the sender's clock, ns.
    sent: Option<Nanoseconds>,
}

/// What becomes of a setpoint that is in order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Verdict {
    Taken,
    Ignored,
}

/// Where a joint is in its stream.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place<'a> {
    pub limits: &'a JointLimits,
    /// Tsp, ns.
    pub period: Nanoseconds,
    /// The next instant.
    pub k: i64,
    /// What entered the look-ahead buffer last, m or rad.
    pub entered: f64,
    /// Whether neither a trajectory nor a stop has the joint.
    pub is_free: bool,
}

impl Arrivals {
    /// What becomes of a setpoint `position` (m or rad), sent at `sent` (ns) by the sender's clock.
    ///
    /// # Errors
    /// [`Code::Jump`].
    pub fn judge(
        &mut self,
        place: Place<'_>,
        position: f64,
        sent: Option<Nanoseconds>,
    ) -> Result<Verdict, Rejection> {
        let Place { limits, period, k, entered, is_free } = place;
        let before = self.seen;
        self.see(k, position, sent);
        let changed_k = before.map(|seen| seen.changed_k);
        let goes_on = |stop_k: &i64| k - changed_k.unwrap_or(*stop_k).max(*stop_k) <= pause(period);
        self.held_off = self.held_off.filter(goes_on);
        if !is_free || self.held_off.is_some() {
            return Ok(Verdict::Ignored);
        }
        let between = before.map_or(0, |before| time_between(before, k, sent, period));
        let one = reach(limits, period);
        let taken = self.taken.filter(|_| self.drives(k, period));
        let (from, allowed) = match taken {
            Some(taken) if (position - entered).abs() > one => {
                (taken.position, one * (between + STREAM_JITTER) as f64 / period as f64)
            }
            // A stream that begins, or comes back to where the joint is.
            _ => (entered, one),
        };
        check_jump(limits, from, position, allowed)?;
        let time = seconds(between.max(period));
        let in_motion = taken.is_some_and(|taken| {
            let is_fast = (position - taken.position).abs() > limits.limits.acceleration * time * time;
            is_fast || (taken.in_motion && taken.k == k)
        });
        self.taken = Some(Taken { k, position, in_motion });
        Ok(Verdict::Taken)
    }

    fn see(&mut self, k: i64, position: f64, sent: Option<Nanoseconds>) {
        let same = self.seen.filter(|seen| seen.position == position);
        let changed_k = same.map_or(k, |seen| seen.changed_k);
        self.seen = Some(Seen { k, position, changed_k, sent });
    }

    /// Whether a stream drives the joint before instant `k`.
    pub fn drives(&self, k: i64, period: Nanoseconds) -> bool {
        self.taken.is_some_and(|taken| k - taken.k <= pause(period))
    }

    /// Whether setpoints come and are ignored because of a stop.
    pub fn is_held_off(&self, k: i64, period: Nanoseconds) -> bool {
        self.held_off.is_some() && self.seen.is_some_and(|seen| k - seen.k <= pause(period))
    }

    /// Takes the joint away from the stream before instant `k`; after a stop until it has paused.
    pub fn end(&mut self, k: i64, stopped: bool) {
        self.taken = None;
        if stopped {
            self.held_off = Some(k);
        }
    }

    /// Whether the stream has just paused, at instant `k`, in motion; told once.
    pub fn broke_off(&mut self, k: i64, period: Nanoseconds) -> bool {
        let Some(taken) = self.taken.as_mut().filter(|taken| taken.in_motion) else { return false };
        let broke_off = self.seen.is_some_and(|seen| k - seen.k > pause(period));
        taken.in_motion &= !broke_off;
        broke_off
    }
}

/// Time from `before` to a setpoint that comes before instant `k`, ns; no more than a pause.
fn time_between(before: Seen, k: i64, sent: Option<Nanoseconds>, period: Nanoseconds) -> Nanoseconds {
    let arrived = (k - before.k).saturating_mul(period);
    let sent = sent.zip(before.sent).map_or(0, |(sent, before)| sent.saturating_sub(before));
    arrived.max(sent).min(pause(period).saturating_mul(period))
}

fn check_jump(limits: &JointLimits, from: f64, position: f64, allowed: f64) -> Result<(), Rejection> {
    let jump = (position - from).abs();
    if jump <= allowed * (1.0 + SPEED_TOLERANCE) {
        return Ok(());
    }
    let (name, unit) = (&limits.name, limits.unit());
    let text = format!(
        "{name}: {} {unit} is {} {unit} away from the setpoint {} {unit} before it; \
         the axis comes {} {unit} in the time between at most",
        Told(position),
        Told(jump),
        Told(from),
        Told(allowed)
    );
    Err(Rejection::new(Code::Jump, text).joint(name).numbers(jump, allowed))
}
