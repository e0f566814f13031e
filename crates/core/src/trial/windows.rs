//! When a program runs a circle at steady feed, and when it turns.

use std::f64::consts::TAU;
use std::ops::Range;

use nalgebra::DVector;

use crate::config::AxisKind;
use crate::path::{Block, Program};

/// What is left out at both ends of the steady part of a circle, s: what the ramps have stirred up.
const MARGIN: f64 = 0.5;
/// A feed this near the largest one is steady.
const STEADY: f64 = 1e-9;
/// Half the base of the difference that measures the feed, s.
const HALF_STEP: f64 = 5e-5;
/// Instants at which the feed of a circle is looked at.
const LOOKS: usize = 20_000;
/// A turn below this is rounding of a straight path, rad.
const STRAIGHT: f64 = 1e-6;
/// Less than a whole turn by this is still a whole one, rad.
const TURN_TOLERANCE: f64 = 1e-9;

/// When block `index` is run at steady feed with a margin at both ends, s; none for what is no whole
/// turn then.
pub(super) fn steady_circle(program: &Program, index: usize) -> Option<Range<f64>> {
    let circle = program.path().blocks()[index].circle()?;
    let span = program.span(index);
    let step = (span.end - span.start) / LOOKS as f64;
    let feed = |t: f64| {
        let (before, behind) = ((t - HALF_STEP).max(span.start), (t + HALF_STEP).min(span.end));
        (program.progress(behind) - program.progress(before)) / (behind - before)
    };
    let time = |i: usize| span.start + step * i as f64;
    let feeds: Vec<f64> = (0..=LOOKS).map(|i| feed(time(i))).collect();
    let top = feeds.iter().copied().fold(0.0, f64::max);
    let steady = |feed: &f64| *feed >= top * (1.0 - STEADY);
    let (first, last) = (time(feeds.iter().position(steady)?), time(feeds.iter().rposition(steady)?));
    let turn = TAU * circle.radius / top;
    let spare = last - first - turn;
    if spare < -TURN_TOLERANCE * turn {
        return None;
    }
    let margin = MARGIN.min(spare.max(0.0) / 2.0);
    Some(first + margin..last - margin)
}

/// Turn of the direction between two blocks along linear coordinates, rad; none where it goes straight
/// on, and where one of them turns the tool only.
pub(super) fn turn(first: &Block, second: &Block, kinds: &[AxisKind]) -> Option<f64> {
    if first.kind() != AxisKind::Linear || second.kind() != AxisKind::Linear {
        return None;
    }
    let direction = |block: &Block, s: f64| -> DVector<f64> {
        let derivatives = block.derivatives(s);
        let linear = derivatives.first.iter().zip(kinds).filter(|(_, k)| **k == AxisKind::Linear);
        DVector::from_iterator(
            kinds.iter().filter(|k| **k == AxisKind::Linear).count(),
            linear.map(|(d, _)| *d),
        )
    };
    let (u, v) = (direction(first, first.length()), direction(second, 0.0));
    // Twice the half angle between unit vectors is exact for small and for large turns.
    let turn = 2.0 * (&u - &v).norm().atan2((&u + &v).norm());
    (turn > STRAIGHT).then_some(turn)
}
