//! The promise of a program, looked at in its own setpoints.

use super::error::Quantity;
use super::program::Program;
use crate::config::LimitsConfig;
use crate::trajectory::limits::SPEED_TOLERANCE;
use crate::units::{Nanoseconds, seconds};

/// Excess that is let through, relative: what the program promises.
const TOLERANCE: f64 = 1e-6;
/// The same for speeds, half of what trajectories are let through with.
const VELOCITY_TOLERANCE: f64 = 0.5 * SPEED_TOLERANCE;
/// Roundings of a position and of a time that a difference may add up.
const ROUNDINGS: f64 = 16.0;
/// Instants up to which a program is looked at entirely: more than an hour and a half at 6 ms. Of a longer one each span
/// has its share, half from its start, half up to its end: in between the feed is constant.
const MAX_INSTANTS: u64 = 1_000_000;
/// Least share.
const MIN_SHARE: u64 = 64;
/// Setpoints that the highest difference needs.
const WINDOW: usize = 4;

/// What the verification must know of a span and of the junction after it.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Nature {
    /// The limits hold by construction: the joints run along a straight line.
    pub straight: bool,
    /// The limits need not hold.
    pub exempt: bool,
    /// Acceleration jumps at the junction after it.
    pub jumps: bool,
    /// Speed jumps there, as permitted.
    pub corner: bool,
}

/// The largest excess that was found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Excess {
    pub span: usize,
    /// s.
    pub time: f64,
    pub joint: usize,
    pub quantity: Quantity,
    /// What was found over what is allowed.
    pub ratio: f64,
    pub allowed: f64,
}

/// By how much spans and junctions are to be slowed; 1 where not at all.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Finding {
    pub spans: Vec<f64>,
    pub junctions: Vec<f64>,
    pub worst: Option<Excess>,
}

/// Looks at the setpoints of `program`, `period` apart, wherever limits do not hold by construction:
/// three differences of each joint against its limits. What is blamed for an excess is a junction
/// where acceleration jumps, or else the curves near it, or with `strict` everything near it. The
/// memory needed is that of the spans, whatever the duration.
pub(super) fn verify(
    program: &Program,
    natures: &[Nature],
    joints: &[LimitsConfig],
    period: Nanoseconds,
    strict: bool,
) -> Finding {
    let mut verifier = Verifier {
        program,
        natures,
        joints,
        period,
        strict,
        window: std::array::from_fn(|_| (0, vec![0.0; joints.len()])),
        finding: Finding {
            spans: vec![1.0; natures.len()],
            junctions: vec![1.0; natures.len()],
            worst: None,
        },
    };
    let count = |t: f64| (t / seconds(period)) as u64;
    let curved = || program.spans.iter().zip(natures).filter(|(_, nature)| !nature.straight || nature.jumps);
    let ranges =
        curved().map(|(span, _)| (count(span.start) + 1, count(span.end).saturating_add(WINDOW as u64)));
    let total = ranges.clone().fold(0_u64, |total, (from, to)| total.saturating_add(to - from));
    let share = match curved().count() as u64 {
        spans if total > MAX_INSTANTS => (MAX_INSTANTS / spans.max(1)).max(MIN_SHARE),
        _ => u64::MAX,
    };
    let mut next = 0;
    for (from, to) in ranges {
        let from = from.max(next);
        if to.saturating_sub(from) > share {
            verifier.look(from, from + share / 2);
            verifier.look(to - share / 2, to);
        } else {
            verifier.look(from, to);
        }
        next = next.max(to);
    }
    verifier.finding
}

struct Verifier<'a> {
    program: &'a Program,
    natures: &'a [Nature],
    joints: &'a [LimitsConfig],
    period: Nanoseconds,
    strict: bool,
    /// Span and setpoints of the last instants.
    window: [(usize, Vec<f64>); WINDOW],
    finding: Finding,
}

impl Verifier<'_> {
    /// Looks at instants `from` to `to`, the latter excluded, with those before.
    fn look(&mut self, from: u64, to: u64) {
        for k in (from.saturating_sub(WINDOW as u64 - 1)..to).take_while(|_| from < to) {
            // An instant that cannot be counted has no setpoint.
            let count = i64::try_from(k).ok().and_then(|k| k.checked_mul(self.period));
            let Some(t) = count.map(seconds) else { return };
            self.window.rotate_left(1);
            let (span, joints) = &mut self.window[WINDOW - 1];
            *span = self.program.span_at(t);
            self.program.psec(t, joints);
            if k == 0 {
                // Before its first setpoint the machine stands there.
                let first = self.window[WINDOW - 1].clone();
                self.window.fill(first);
            }
            if k >= from {
                self.compare(t);
            }
        }
    }

    fn compare(&mut self, t: f64) {
        let period = seconds(self.period);
        for (joint, limits) in self.joints.iter().enumerate() {
            let [a, b, c, d] = std::array::from_fn(|i| self.window[i].1[joint]);
            let rounding = ROUNDINGS * f64::EPSILON * (a.abs().max(d.abs()) + t * ((d - a) / period).abs());
            let orders = [
                (Quantity::Speed, d - c, limits.velocity, 1, VELOCITY_TOLERANCE),
                (Quantity::Acceleration, d - 2.0 * c + b, limits.acceleration, 2, TOLERANCE),
                (Quantity::Jerk, d - 3.0 * (c - b) - a, limits.jerk, 3, TOLERANCE),
            ];
            for (quantity, difference, allowed, order, tolerance) in orders {
                let found = (difference.abs() - rounding).max(0.0) / period.powi(order);
                let ratio = found / allowed;
                if ratio > 1.0 + tolerance {
                    let (from, to) = (self.window[WINDOW - 1 - order as usize].0, self.window[WINDOW - 1].0);
                    let excess = Excess { span: to, time: t, joint, quantity, ratio, allowed };
                    self.blame(from, to, order, excess);
                }
            }
        }
    }

    /// Notes who is to be slowed for `excess` in the spans `from` to `to`.
    fn blame(&mut self, from: usize, to: usize, order: i32, excess: Excess) {
        let (spans, borders) = (&self.natures[from..=to], &self.natures[from..to]);
        if spans.iter().any(|span| span.exempt) || borders.iter().any(|border| border.corner) {
            return;
        }
        if self.finding.worst.is_none_or(|worst| worst.ratio < excess.ratio) {
            self.finding.worst = Some(excess);
        }
        let pace = excess.ratio.powf(-1.0 / f64::from(order));
        let slow = |paces: &mut [f64], blamed: &dyn Fn(&Nature) -> bool| {
            for (slowed, _) in paces.iter_mut().zip(spans).filter(|(_, nature)| blamed(nature)) {
                *slowed = slowed.min(pace);
            }
        };
        slow(&mut self.finding.junctions[from..to], &|border| border.jumps);
        if borders.iter().any(|border| border.jumps) && !self.strict {
            return;
        }
        let all = self.strict || spans.iter().all(|span| span.straight);
        slow(&mut self.finding.spans[from..=to], &|span| all || !span.straight);
    }
}
