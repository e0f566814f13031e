//! Where the axis stands, moves at constant velocity, and accelerates.

use std::ops::Range;

use super::fit::robust;
use crate::recording::{Signals, Span};

/// An axis accelerates beyond this part of its largest acceleration.
const ACCELERATING: f64 = 0.05;
/// It stands below this part of its largest velocity.
const STANDING: f64 = 1e-3;
/// Standard deviations of the noise of a derivative that are still noise.
const NOISE: f64 = 4.0;
/// Part of the samples, the fastest, that are left out when the largest value is taken: outliers.
const OUTLIERS: f64 = 0.001;
/// Shortest segment of standstill or constant velocity, s.
const SHORTEST: f64 = 0.1;
/// Time that the drive needs to settle behind an acceleration, s: six time constants of a position loop of
/// 25 s⁻¹; of short segments no more than this part.
const SETTLING: f64 = 0.25;
const SETTLING_PART: f64 = 0.5;
/// Largest change of velocity within a segment of constant velocity, part of it.
const STEADY: f64 = 0.02;
/// Standard deviation of the filter's kernel, s, times its cut-off frequency in Hz: √(ln 2) / 2π.
const KERNEL: f64 = 0.132_496_2;

/// What an axis does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SegmentKind {
    /// It stands.
    Static,
    /// It moves at constant velocity, and the drive has settled.
    ConstantVelocity,
    /// Its velocity changes.
    Accelerating,
}

/// A part of a recording in which the axis does one thing.
#[derive(Debug, Clone, PartialEq)]
pub struct Segment {
    /// What it does.
    pub kind: SegmentKind,
    /// Number of the span in [`Signals::spans`].
    pub span: usize,
    /// Samples of the span.
    pub samples: Range<usize>,
    /// Mean velocity, m/s or rad/s.
    pub velocity: f64,
    /// Mean position, m or rad.
    pub position: f64,
    /// Sign of the velocity that led here; 0 at the beginning of a recording.
    pub approach: f64,
}

impl Segment {
    /// The samples of a channel that belong to it.
    pub(super) fn of<'a>(&self, channel: &'a [f64]) -> &'a [f64] {
        channel.get(self.samples.clone()).unwrap_or_default()
    }
}

/// Divides a recording; what is neither one nor the other for long enough is left out.
pub fn segments(signals: &Signals) -> Vec<Segment> {
    let all = |channel: fn(&Span) -> &[f64]| -> Vec<f64> {
        signals.spans.iter().flat_map(|span| channel(span).iter().copied()).collect()
    };
    let (accelerations, velocities) = (all(|s| &s.acceleration), all(|s| &s.velocity));
    // Most of a campaign is steady: the middle of its accelerations is noise, which is that of the position.
    let noise = robust(&accelerations).1;
    let velocity_noise = noise * KERNEL / signals.cutoff * (2.0_f64 / 3.0).sqrt();
    let limits = Limits {
        acceleration: (ACCELERATING * largest(&accelerations)).max(NOISE * noise),
        velocity: (STANDING * largest(&velocities)).max(NOISE * velocity_noise),
        period: signals.period,
        filter: (3.0 * KERNEL / signals.cutoff / signals.period).ceil() as usize,
    };
    let mut found = Vec::new();
    for (number, span) in signals.spans.iter().enumerate() {
        limits.divide(number, span, &mut found);
    }
    found
}

/// Largest magnitude but for outliers.
pub(super) fn largest(values: &[f64]) -> f64 {
    let mut magnitudes: Vec<f64> = values.iter().map(|value| value.abs()).collect();
    let place = ((magnitudes.len() as f64) * (1.0 - OUTLIERS)) as usize;
    match magnitudes.len() {
        0 => 0.0,
        count => *magnitudes.select_nth_unstable_by(place.min(count - 1), f64::total_cmp).1,
    }
}

struct Limits {
    acceleration: f64,
    velocity: f64,
    period: f64,
    /// Samples over which the filter carries an acceleration.
    filter: usize,
}

impl Limits {
    fn kind(&self, span: &Span, i: usize) -> SegmentKind {
        let (v, a) = (span.velocity[i], span.acceleration[i]);
        if a.abs() > self.acceleration {
            SegmentKind::Accelerating
        } else if v.abs() <= self.velocity {
            SegmentKind::Static
        } else {
            SegmentKind::ConstantVelocity
        }
    }

    fn divide(&self, number: usize, span: &Span, found: &mut Vec<Segment>) {
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
                // The axis settles first, and the filter sees the next acceleration before it comes.
                _ => {
                    let from = if begin == 0 { 0 } else { begin + settling.min(part_of(end - begin)) };
                    from..if end == count { end } else { end.saturating_sub(self.filter) }
                }
            };
            let long = kind == SegmentKind::Accelerating || samples.len() >= shortest;
            if long {
                let segment = Segment {
                    velocity: mean(&span.velocity[samples.clone()]),
                    position: mean(&span.position[samples.clone()]),
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

    /// Whether the velocity is the same at both ends.
    fn is_steady(&self, span: &Span, segment: &Segment) -> bool {
        let velocity = segment.of(&span.velocity);
        let third = velocity.len().div_ceil(3);
        let (first, last) = (mean(&velocity[..third]), mean(&velocity[velocity.len() - third..]));
        (last - first).abs() <= (STEADY * segment.velocity.abs()).max(self.velocity)
    }
}

/// Mean of a list; NaN if it is empty.
pub(super) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}
