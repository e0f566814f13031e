//! Verification of sampled setpoints against the joint limits.

use super::limit_use::LimitUse;
use super::program::Program;
use crate::config::LimitsConfig;
use crate::units::{Nanoseconds, seconds};

/// Number of instants up to which a program is checked completely: more than an hour and a half at 6 ms. In
/// a longer program each span gets an equal share, half at its start and half at its end; in between, the
/// feed is constant.
const MAX_INSTANTS: u64 = 1_000_000;
/// Smallest share per span, instants.
const MIN_SHARE: u64 = 64;
/// Number of setpoints in the third difference.
const WINDOW: usize = LimitUse::WINDOW;

/// Properties of a span and of the junction after it that the verification needs.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct SpanProperties {
    /// The joints move along a straight line, so the limits hold by construction.
    pub is_straight: bool,
    /// The span is exempt from the limits.
    pub is_exempt: bool,
    /// The acceleration jumps at the junction after the span.
    pub has_jump: bool,
    /// The speed jumps at the junction after the span, as permitted.
    pub is_corner: bool,
}

/// The largest limit violation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Excess {
    pub span: usize,
    /// Time of the violation, s.
    pub time: f64,
    pub joint: usize,
    pub found: LimitUse,
}

/// Reduction factors of spans and junctions, 1 for none, and the largest violation.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct LimitViolations {
    pub span_factors: Vec<f64>,
    pub junction_factors: Vec<f64>,
    pub worst: Option<Excess>,
}

/// Checks the setpoints of `program`, `period` apart, against the joint limits wherever these do not hold
/// by construction.
///
/// Compares first, second and third differences. A violation is attributed to a junction with an
/// acceleration jump, otherwise to the curves near it, or with `strict` to everything near it. The memory
/// used depends on the number of spans, not on the duration.
pub(super) fn verify(
    program: &Program,
    properties: &[SpanProperties],
    joints: &[LimitsConfig],
    period: Nanoseconds,
    strict: bool,
) -> LimitViolations {
    let mut verifier = Verifier {
        program,
        properties,
        joints,
        period,
        strict,
        window: std::array::from_fn(|_| (0, vec![0.0; joints.len()])),
        violations: LimitViolations {
            span_factors: vec![1.0; properties.len()],
            junction_factors: vec![1.0; properties.len()],
            worst: None,
        },
    };
    let count = |t: f64| (t / seconds(period)) as u64;
    let curved =
        || program.spans.iter().zip(properties).filter(|(_, span)| !span.is_straight || span.has_jump);
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
            verifier.check_instants(from, from + share / 2);
            verifier.check_instants(to - share / 2, to);
        } else {
            verifier.check_instants(from, to);
        }
        next = next.max(to);
    }
    verifier.violations
}

struct Verifier<'a> {
    program: &'a Program,
    properties: &'a [SpanProperties],
    joints: &'a [LimitsConfig],
    period: Nanoseconds,
    strict: bool,
    /// Span index and setpoints of the latest instants.
    window: [(usize, Vec<f64>); WINDOW],
    violations: LimitViolations,
}

impl Verifier<'_> {
    /// Checks the instants `from..to`, using the instants before them.
    fn check_instants(&mut self, from: u64, to: u64) {
        for k in (from.saturating_sub(WINDOW as u64 - 1)..to).take_while(|_| from < to) {
            // An instant whose time overflows has no setpoint.
            let count = i64::try_from(k).ok().and_then(|k| k.checked_mul(self.period));
            let Some(t) = count.map(seconds) else { return };
            self.window.rotate_left(1);
            let (span, joints) = &mut self.window[WINDOW - 1];
            *span = self.program.span_index_at(t);
            self.program.psec(t, joints);
            if k == 0 {
                // The machine rests at the first setpoint before the program starts.
                let first = self.window[WINDOW - 1].clone();
                self.window.fill(first);
            }
            if k >= from {
                self.check_limits(t);
            }
        }
    }

    fn check_limits(&mut self, t: f64) {
        let period = seconds(self.period);
        for (joint, limits) in self.joints.iter().enumerate() {
            let setpoints = std::array::from_fn(|i| self.window[i].1[joint]);
            for (order, found) in (1..).zip(LimitUse::of_setpoints(setpoints, t, period, limits)) {
                if found.is_exceeded() {
                    let (from, to) = (self.window[WINDOW - 1 - order as usize].0, self.window[WINDOW - 1].0);
                    self.attribute(from, to, order, Excess { span: to, time: t, joint, found });
                }
            }
        }
    }

    /// Records reduction factors for `excess` in the spans `from` to `to`.
    fn attribute(&mut self, from: usize, to: usize, order: i32, excess: Excess) {
        let (spans, junctions) = (&self.properties[from..=to], &self.properties[from..to]);
        if spans.iter().any(|span| span.is_exempt) || junctions.iter().any(|junction| junction.is_corner) {
            return;
        }
        let ratio = excess.found.ratio();
        if self.violations.worst.is_none_or(|worst| worst.found.ratio() < ratio) {
            self.violations.worst = Some(excess);
        }
        let factor = ratio.powf(-1.0 / f64::from(order));
        let slow = |factors: &mut [f64], is_cause: &dyn Fn(&SpanProperties) -> bool| {
            for (slowed, _) in factors.iter_mut().zip(spans).filter(|(_, span)| is_cause(span)) {
                *slowed = slowed.min(factor);
            }
        };
        slow(&mut self.violations.junction_factors[from..to], &|junction| junction.has_jump);
        if junctions.iter().any(|junction| junction.has_jump) && !self.strict {
            return;
        }
        let all = self.strict || spans.iter().all(|span| span.is_straight);
        slow(&mut self.violations.span_factors[from..=to], &|span| all || !span.is_straight);
    }
}
