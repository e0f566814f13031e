//! Positions of rotary axes that the control counts modulo 360°.

use std::f64::consts::{PI, TAU};

use super::{Finding, RawRecording};
use virtual_axes_core::config::{AxisConfig, AxisKind};

/// Range of positions that are counted modulo 360°, rad, with rounding.
const RANGE: f64 = 1.001 * TAU;

/// Returns the recording of a rotary axis with continuous positions in place of those modulo 360°; none if no position
/// jumps by a turn.
pub(super) fn without_resets(
    raw: &RawRecording,
    axis: &AxisConfig,
    findings: &mut Vec<Finding>,
) -> Option<RawRecording> {
    if axis.kind() != AxisKind::Rotary {
        return None;
    }
    let start_of = |channel: &Vec<f64>| channel.iter().copied().find(|value| value.is_finite());
    let start = raw.position.as_ref().and_then(start_of)?;
    let mut unrolled = raw.clone();
    let mut resets = 0;
    let channels = [&mut unrolled.position, &mut unrolled.psec, &mut unrolled.motor_position];
    for channel in channels.into_iter().flatten() {
        let finite = || channel.iter().copied().filter(|value| value.is_finite());
        let (low, high) = finite().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
        if high - low <= RANGE {
            resets += unroll(channel);
        }
        // All begin within half a turn of the position.
        let turns = start_of(channel).map_or(0.0, |first| ((start - first) / TAU).round());
        channel.iter_mut().for_each(|value| *value += turns * TAU);
    }
    (resets > 0).then(|| {
        findings.push(Finding::note(
            "modulo",
            format!(
                "{}: the positions are counted modulo 360°: {resets} jumps by a turn are removed",
                raw.name
            ),
        ));
        unrolled
    })
}

/// Removes jumps by more than half a turn and returns their number.
fn unroll(positions: &mut [f64]) -> usize {
    let (mut turns, mut resets) = (0.0, 0);
    let mut before = f64::NAN;
    for value in positions.iter_mut().filter(|value| value.is_finite()) {
        let jump = *value - before;
        if jump.abs() > PI {
            turns -= jump.signum();
            resets += 1;
        }
        before = *value;
        *value += turns * TAU;
    }
    resets
}
