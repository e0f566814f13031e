//! Features of a program for the evaluation: circles at constant feed and corners.

use std::f64::consts::TAU;
use std::ops::Range;

use nalgebra::DVector;

use crate::config::AxisKind;
use crate::path::{Block, Program};

/// Time excluded at both ends of a circle at constant feed, s: decay of transients after the ramps.
const MARGIN: f64 = 0.5;
/// Relative tolerance within which the feed is the largest one.
const STEADY: f64 = 1e-9;
/// Half the base of the difference quotient for the feed, s.
const HALF_STEP: f64 = 5e-5;
/// Number of samples of the feed along a circle.
const FEED_SAMPLES: usize = 20_000;
/// Change of direction below which a path is straight, rad.
const STRAIGHT: f64 = 1e-6;
/// Relative tolerance for a whole turn.
const TURN_TOLERANCE: f64 = 1e-9;

/// Returns the time range of block `index` at constant feed with a margin at both ends, s, or `None` if
/// that is less than a whole turn.
pub(super) fn steady_window(program: &Program, index: usize) -> Option<Range<f64>> {
    let circle = program.path().blocks()[index].circle()?;
    let span = program.time_range(index);
    let step = (span.end - span.start) / FEED_SAMPLES as f64;
    let feed = |t: f64| {
        let (before, behind) = ((t - HALF_STEP).max(span.start), (t + HALF_STEP).min(span.end));
        (program.progress(behind) - program.progress(before)) / (behind - before)
    };
    let time = |i: usize| span.start + step * i as f64;
    let top = program.highest_feed_of(index);
    let is_steady = |i: &usize| feed(time(*i)) >= top * (1.0 - STEADY);
    let (first, last) = ((0..=FEED_SAMPLES).find(is_steady)?, (0..=FEED_SAMPLES).rev().find(is_steady)?);
    let (first, last) = (time(first), time(last));
    let turn = TAU * circle.radius / top;
    let spare = last - first - turn;
    if spare < -TURN_TOLERANCE * turn {
        return None;
    }
    let margin = MARGIN.min(spare.max(0.0) / 2.0);
    Some(first + margin..last - margin)
}

/// Returns the change of direction between two blocks along linear coordinates, rad, or `None` if it is 0
/// or one of the blocks only rotates the tool.
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
    // Twice the half angle between unit vectors is exact for small and for large angles.
    let turn = 2.0 * (&u - &v).norm().atan2((&u + &v).norm());
    (turn > STRAIGHT).then_some(turn)
}
