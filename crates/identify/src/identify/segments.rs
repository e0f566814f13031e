//! Segmentation of a recording into standstill, constant velocity and acceleration.

use std::ops::Range;

use super::fit::robust_mean_and_deviation;
use crate::recording::{SignalSpan, Signals};
use virtual_axes_core::statistics::mean;

/// Acceleration, relative to the largest, above which an axis accelerates.
const ACCELERATING: f64 = 0.05;
/// Velocity, relative to the largest, below which an axis is at rest.
const STANDING: f64 = 1e-3;
/// Noise limit of a derivative in standard deviations.
const NOISE: f64 = 4.0;
/// Share of the largest values that are excluded as outliers.
const OUTLIERS: f64 = 0.001;
/// Shortest segment of standstill or constant velocity, s.
const SHORTEST: f64 = 0.1;
/// Settling time after an acceleration, s (six time constants of a position loop of 25 s⁻¹), and its largest
/// share of a segment.
const SETTLING: f64 = 0.25;
const SETTLING_PART: f64 = 0.5;
/// Largest relative change of velocity within a segment of constant velocity.
const STEADY: f64 = 0.02;
/// Standard deviation of the filter kernel, s, times its cut-off frequency in Hz: √(ln 2) / 2π.
const KERNEL: f64 = 0.132_496_2;

/// State of motion of an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SegmentKind {
    /// Standstill.
    Static,
    /// Constant velocity after settling.
    ConstantVelocity,
    /// Changing velocity.
    Accelerating,
}

/// Section of a recording with one state of motion.
#[derive(Debug, Clone, PartialEq)]
pub struct MotionSegment {
    /// State of motion.
    pub kind: SegmentKind,
    /// Index of the span in [`Signals::spans`].
    pub span: usize,
    /// Sample range in the span.
    pub samples: Range<usize>,
    /// Mean velocity, m/s or rad/s.
    pub velocity: f64,
    /// Mean position, m or rad.
    pub position: f64,
    /// Sign of the approach velocity; 0 at the start of a recording.
    pub approach: f64,
}

impl MotionSegment {
    /// Returns the samples of a channel in the segment.
    pub(super) fn of<'a>(&self, channel: &'a [f64]) -> &'a [f64] {
        channel.get(self.samples.clone()).unwrap_or_default()
    }
}

/// Splits a recording into segments; short and unsteady sections are omitted.
pub fn find_segments(signals: &Signals) -> Vec<MotionSegment> {
    let all = |channel: fn(&SignalSpan) -> &[f64]| -> Vec<f64> {
        signals.spans.iter().flat_map(|span| channel(span).iter().copied()).collect()
    };
    let (accelerations, velocities) = (all(|s| &s.acceleration), all(|s| &s.velocity));
    // Most of a campaign is steady, so the median acceleration is noise of the position.
    let noise = robust_mean_and_deviation(&accelerations).1;
    let velocity_noise = noise * KERNEL / signals.cutoff * (2.0_f64 / 3.0).sqrt();
    let limits = SegmentThresholds {
        acceleration: (ACCELERATING * largest_magnitude(&accelerations)).max(NOISE * noise),
        velocity: (STANDING * largest_magnitude(&velocities)).max(NOISE * velocity_noise),
        period: signals.period,
        filter: (3.0 * KERNEL / signals.cutoff / signals.period).ceil() as usize,
    };
    let mut found = Vec::new();
    for (number, span) in signals.spans.iter().enumerate() {
        limits.split_span(number, span, &mut found);
    }
    found
}

/// Returns the largest magnitude without outliers.
pub(super) fn largest_magnitude(values: &[f64]) -> f64 {
    let mut magnitudes: Vec<f64> = values.iter().map(|value| value.abs()).collect();
    let index = ((magnitudes.len() as f64) * (1.0 - OUTLIERS)) as usize;
    match magnitudes.len() {
        0 => 0.0,
        count => *magnitudes.select_nth_unstable_by(index.min(count - 1), f64::total_cmp).1,
    }
}

struct SegmentThresholds {
    acceleration: f64,
    velocity: f64,
    period: f64,
    /// Samples over which the filter spreads an acceleration.
    filter: usize,
}

impl SegmentThresholds {
    fn kind(&self, span: &SignalSpan, i: usize) -> SegmentKind {
        let (v, a) = (span.velocity[i], span.acceleration[i]);
        if a.abs() > self.acceleration {
            SegmentKind::Accelerating
        } else if v.abs() <= self.velocity {
            SegmentKind::Static
        } else {
            SegmentKind::ConstantVelocity
        }
    }

    fn split_span(&self, number: usize, span: &SignalSpan, found: &mut Vec<MotionSegment>) {
        let count = span.position.len();
        let settling = (SETTLING / self.period).round() as usize;
        let part_of = |samples: usize| (SETTLING_PART * samples as f64) as usize;
        let shortest = (SHORTEST / self.period).ceil().max(3.0) as usize;
        let (mut begin, mut approach) = (0, 0.0);
        while begin < count {
            let kind = self.kind(span, begin);
            let mut end = begin + 1;
            while end < count && self.kind(span, end) == kind {
                end += 1;
            }
            let samples = match kind {
                SegmentKind::Accelerating => begin..end,
                // Excludes the settling time, and the end where the filter contains the next acceleration.
                _ => {
                    let from = if begin == 0 { 0 } else { begin + settling.min(part_of(end - begin)) };
                    from..if end == count { end } else { end.saturating_sub(self.filter) }
                }
            };
            let long = kind == SegmentKind::Accelerating || samples.len() >= shortest;
            if long {
                let segment = MotionSegment {
                    velocity: mean(&span.velocity[samples.clone()]).unwrap_or(f64::NAN),
                    position: mean(&span.position[samples.clone()]).unwrap_or(f64::NAN),
                    kind,
                    span: number,
                    samples,
                    approach,
                };
                if kind != SegmentKind::ConstantVelocity || self.is_steady(span, &segment) {
                    found.push(segment);
                }
            }
            if kind != SegmentKind::Static {
                let last = span.velocity[begin..end].iter().rev().find(|v| v.abs() > self.velocity);
                approach = last.map_or(approach, |v| v.signum());
            }
            begin = end;
        }
    }

    /// Returns true if the velocity is equal at both ends.
    fn is_steady(&self, span: &SignalSpan, segment: &MotionSegment) -> bool {
        let velocity = segment.of(&span.velocity);
        let third = velocity.len().div_ceil(3);
        let (first, last) = (
            mean(&velocity[..third]).unwrap_or(f64::NAN),
            mean(&velocity[velocity.len() - third..]).unwrap_or(f64::NAN),
        );
        (last - first).abs() <= (STEADY * segment.velocity.abs()).max(self.velocity)
    }
}
