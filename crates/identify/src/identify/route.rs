//! Choice between the steps of the paper and the joint fit of the closed loop, by the content of the recordings.

use super::closed_loop::find_experiments;
use super::feedforward_mode::FeedforwardMode;
use super::options::IdentificationInput;
use super::segments::{MotionSegment, SegmentKind};
use super::setpoints::{longest_cycle, stride};
use crate::recording::Signals;
use virtual_axes_core::config::{AxisConfig, Periods, PositionControllerConfig};
use virtual_axes_core::units::seconds;

/// Fewest speeds, each in both directions, from which friction and gravity follow step by step.
const SPEEDS: usize = 2;
/// Relative difference of two speeds that count as one.
const ONE_SPEED: f64 = 0.1;
/// Relative tolerance of the longest position cycle.
const PERMITTED: f64 = 1e-3;

/// Returns true if the recordings have what the steps of the paper need: constant velocities in both directions, and, if
/// there are setpoints, those of each position cycle, starting at rest without feedforward.
///
/// Those of another position controller than the cascade take the steps too, since the joint fit is that of the cascade.
pub(super) fn takes_steps(
    inputs: &[IdentificationInput<'_>],
    segments: &[Vec<MotionSegment>],
    axis: &AxisConfig,
    periods: &Periods,
) -> bool {
    if axis.position_loop.controller != PositionControllerConfig::Cascade {
        return true;
    }
    let with_psec: Vec<&IdentificationInput<'_>> =
        inputs.iter().filter(|input| has_psec(input.signals)).collect();
    let is_complete = |input: &&&IdentificationInput<'_>| {
        let mode = input.feedforward.unwrap_or(FeedforwardMode::Both);
        shows_cycles(input.signals, periods)
            && find_experiments(input.signals, 0, axis, periods, mode)
                .iter()
                .any(|experiment| experiment.mode == FeedforwardMode::Off && experiment.moves())
    };
    let has_speeds = speeds_in_both_directions(segments) >= SPEEDS;
    has_speeds && (with_psec.is_empty() || with_psec.iter().any(|input| is_complete(&input)))
}

fn has_psec(signals: &Signals) -> bool {
    signals.spans.iter().any(|span| span.psec.is_some())
}

/// Returns true if the recording contains the setpoint of each position cycle of the machine file.
fn shows_cycles(signals: &Signals, periods: &Periods) -> bool {
    let tsp = seconds(periods.position);
    let (longest, is_certain) = longest_cycle(signals);
    let is_that = (longest / tsp - 1.0).abs() <= PERMITTED;
    stride(signals.period, tsp).is_some()
        && if is_certain { is_that } else { longest >= tsp * (1.0 - PERMITTED) }
}

/// Returns the number of constant velocities that occur in both directions.
fn speeds_in_both_directions(segments: &[Vec<MotionSegment>]) -> usize {
    let steady = segments.iter().flatten().filter(|segment| segment.kind == SegmentKind::ConstantVelocity);
    let velocities: Vec<f64> = steady.map(|segment| segment.velocity).collect();
    let mut speeds: Vec<f64> = velocities
        .iter()
        .copied()
        .filter(|v| *v > 0.0 && velocities.iter().any(|w| (v + w).abs() < ONE_SPEED * v))
        .collect();
    speeds.sort_by(f64::total_cmp);
    speeds.dedup_by(|next, kept| *next - *kept < ONE_SPEED * *kept);
    speeds.len()
}
