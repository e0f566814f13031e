//! Estimation and compensation of the lag of the recorded current behind the motion.

use std::ops::Range;

use super::filtered_section::FilteredSection;
use super::regression::LeastSquares;
use super::spans::CURRENT;
use virtual_axes_core::config::{AxisKind, Periods};
use virtual_axes_core::statistics::quantile;
use virtual_axes_core::units::seconds;

/// Range of the scanned lags, s: seen with buses and filters of oscilloscopes, with reserve.
pub(super) const LOWEST_LAG: f64 = -0.010;
pub(super) const HIGHEST_LAG: f64 = 0.020;
/// Cut-off frequency of the filter for the scan, times the position cycle. The zero-order hold of the
/// setpoint causes a ripple at that period whose maxima look like lags one period apart; 0.5 % of it pass.
const CUTOFF_PERIOD: f64 = 0.25;
/// Step of the scan, s; a parabola through three steps locates the maximum to a hundredth of a step.
const STEP: f64 = 5e-4;
/// Speed, relative to the largest, below which the direction of friction is uncertain.
const MOVING: f64 = 0.05;
/// Largest number of samples in the regression; more do not improve the estimate.
const MOST_SAMPLES: usize = 100_000;
/// Fewest samples for an estimate.
const FEWEST_SAMPLES: usize = 100;
/// Smallest relative reduction of the unexplained variance of a significant lag.
const BETTER: f64 = 0.1;
/// R² below which the current is unrelated to the motion.
const EXPLAINED: f64 = 0.5;
/// Smallest lag in sampling periods. Ripple of a sampled drive and the zero-order hold of its output look
/// like shorter lags.
const PERIODS: f64 = 1.0;
/// Tolerance, in samples, within which a shift counts as a whole number of samples.
const WHOLE: f64 = 1e-9;

/// Returns the highest cut-off frequency for a lag estimate, Hz.
pub(super) fn max_cutoff(periods: &Periods) -> f64 {
    CUTOFF_PERIOD / seconds(periods.position)
}

/// Result of the lag scan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct CurrentLag {
    /// Lag that explains the current best, s.
    pub lag: f64,
    /// R² of the regression with the lag.
    pub r2: f64,
    /// R² of the regression without lag.
    pub r2_without: f64,
    /// True if the lag reduces the unexplained variance significantly.
    pub is_better: bool,
    /// True if the lag is longer than the sampling effects.
    pub exceeds_period: bool,
    /// True if the best lag is at an end of the scan range.
    pub is_at_end: bool,
}

/// Regressors of the current at moving samples: acceleration, velocity, direction and, on a rotary axis, sine
/// and cosine of the position.
///
/// Samples within the filter length or lag range of a start, stop or reversal are excluded, since the sign of
/// friction is uncertain there.
pub(super) struct MovingSamples {
    /// Section index and sample index.
    pub indices: Vec<(usize, usize)>,
    pub columns: Vec<Vec<f64>>,
}

impl MovingSamples {
    /// Selects the moving samples of `parts`, at least `before` and `behind` samples away from the ends.
    pub fn new(parts: &[FilteredSection], kind: AxisKind, before: usize, behind: usize) -> Self {
        Self::select(parts, kind, |part| [before + part.filter.radius(), behind + part.filter.radius()])
    }

    /// Selects all moving samples of `parts`, also those whose filter reaches beyond the move.
    pub fn with_ends(parts: &[FilteredSection], kind: AxisKind) -> Self {
        Self::select(parts, kind, |_| [0, 0])
    }

    fn select(
        parts: &[FilteredSection],
        kind: AxisKind,
        margins: impl Fn(&FilteredSection) -> [usize; 2],
    ) -> Self {
        let mut speeds: Vec<f64> =
            parts.iter().flat_map(|p| p.motion.first.iter().map(|v| v.abs())).collect();
        let threshold = MOVING * quantile(&mut speeds, 0.99).unwrap_or(0.0);
        let mut indices = Vec::new();
        for (p, part) in parts.iter().enumerate() {
            let [before, behind] = margins(part);
            let runs = runs(&part.motion.first, threshold);
            let inside = runs.into_iter().map(|run| run.start + before..run.end.saturating_sub(behind));
            indices.extend(inside.flatten().map(|n| (p, n)));
        }
        let stride = indices.len().div_ceil(MOST_SAMPLES).max(1);
        let indices: Vec<(usize, usize)> = indices.into_iter().step_by(stride).collect();
        let column = |of: &dyn Fn(usize, usize) -> f64| indices.iter().map(|&(p, n)| of(p, n)).collect();
        let mut columns: Vec<Vec<f64>> = vec![
            column(&|p, n| parts[p].motion.second[n]),
            column(&|p, n| parts[p].motion.first[n]),
            column(&|p, n| parts[p].motion.first[n].signum()),
        ];
        if kind == AxisKind::Rotary {
            columns.push(column(&|p, n| parts[p].motion.value[n].sin()));
            columns.push(column(&|p, n| parts[p].motion.value[n].cos()));
        }
        MovingSamples { indices, columns }
    }
}

/// Returns the sample ranges in which the axis moves faster than `threshold` in one direction.
fn runs(velocity: &[f64], threshold: f64) -> Vec<Range<usize>> {
    let direction = |v: f64| if v.abs() > threshold { v.signum() } else { 0.0 };
    let mut runs: Vec<Range<usize>> = Vec::new();
    let mut before = 0.0;
    for (n, &v) in velocity.iter().enumerate() {
        let now = direction(v);
        match runs.last_mut() {
            Some(run) if now != 0.0 && now == before => run.end = n + 1,
            _ if now != 0.0 => runs.push(n..n + 1),
            _ => {}
        }
        before = now;
    }
    runs
}

/// Estimates the lag of the current of `parts`, whose samples are `period` apart. Returns none without motion
/// or without current.
pub(super) fn estimate(parts: &[FilteredSection], kind: AxisKind, period: f64) -> Option<CurrentLag> {
    let samples = |lag: f64| (lag.abs() / period).ceil() as usize + 2;
    let moving = MovingSamples::new(parts, kind, samples(LOWEST_LAG), samples(HIGHEST_LAG));
    if moving.indices.len() < FEWEST_SAMPLES || parts.iter().any(|part| part.smooth_current.is_none()) {
        return None;
    }
    let regression = LeastSquares::new(moving.columns);
    let explained = |lag: f64| {
        let shift = lag / period;
        let currents = moving.indices.iter().map(|&(p, n)| {
            parts[p]
                .smooth_current
                .as_ref()
                .map_or(0.0, |current| interpolate_cubic(current, n as f64 + shift))
        });
        regression.fit(&currents.collect::<Vec<_>>()).r2
    };
    // Whole steps on either side of zero include lag 0 as a candidate.
    let (first, last) = ((LOWEST_LAG / STEP).round() as i64, (HIGHEST_LAG / STEP).round() as i64);
    let scan: Vec<f64> = (first..=last).map(|k| explained(k as f64 * STEP)).collect();
    let best = (0..scan.len()).max_by(|&a, &b| scan[a].total_cmp(&scan[b]))?;
    let at_end = best == 0 || best + 1 == scan.len();
    let offset = if at_end { 0.0 } else { parabola_vertex(scan[best - 1], scan[best], scan[best + 1]) };
    let lag = (first as f64 + best as f64 + offset) * STEP;
    let (r2, r2_without) = (explained(lag.clamp(LOWEST_LAG, HIGHEST_LAG)), explained(0.0));
    Some(CurrentLag {
        lag,
        r2,
        r2_without,
        is_better: r2 > EXPLAINED && 1.0 - r2 < (1.0 - BETTER) * (1.0 - r2_without),
        exceeds_period: lag.abs() > PERIODS * period,
        is_at_end: at_end,
    })
}

/// Returns the vertex of the parabola through three values, in steps from the middle one, which is the
/// largest.
fn parabola_vertex(left: f64, middle: f64, right: f64) -> f64 {
    let bend = left - 2.0 * middle + right;
    if bend < 0.0 { (0.5 * (left - right) / bend).clamp(-0.5, 0.5) } else { 0.0 }
}

/// Compensates a `lag` (s): shifts the current of each section forward by `lag` and cuts off samples without
/// current.
pub(super) fn compensate(parts: &mut [FilteredSection], lag: f64, period: f64) {
    let exact = lag / period;
    let shift = if (exact - exact.round()).abs() < WHOLE { exact.round() } else { exact };
    for part in parts {
        let count = part.section.len();
        let (before, behind) = ((-shift).max(0.0).ceil() as usize, shift.max(0.0).ceil() as usize);
        let range = before.min(count)..count.saturating_sub(behind).max(before.min(count));
        let currents = [part.section.columns[CURRENT].as_mut(), part.smooth_current.as_mut()];
        for current in currents.into_iter().flatten() {
            let old = std::mem::take(current);
            *current = (0..count).map(|n| interpolate_cubic(&old, n as f64 + shift)).collect();
        }
        part.cut(range, period);
    }
}

/// Interpolates at the fractional index `index` with the cubic through the four nearest samples; exact at a
/// sample.
fn interpolate_cubic(values: &[f64], index: f64) -> f64 {
    let last = values.len() as isize - 1;
    let whole = index.floor();
    let part = index - whole;
    let value = |offset: isize| values[(whole as isize + offset).clamp(0, last) as usize];
    if part == 0.0 {
        return value(0);
    }
    let (a, b, c, d) = (value(-1), value(0), value(1), value(2));
    let (t0, t1, t2, t3) = (part + 1.0, part, part - 1.0, part - 2.0);
    -a * t1 * t2 * t3 / 6.0 + b * t0 * t2 * t3 / 2.0 - c * t0 * t1 * t3 / 2.0 + d * t0 * t1 * t2 / 6.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cubic_between_samples_is_exact() {
        let cubic = |t: f64| 1.0 - 2.0 * t + 0.5 * t * t - 0.1 * t * t * t;
        let values: Vec<f64> = (0..10).map(|n| cubic(n as f64)).collect();
        for index in [1.25, 4.5, 7.9] {
            assert!((interpolate_cubic(&values, index) - cubic(index)).abs() < 1e-12);
        }
        assert_eq!(interpolate_cubic(&values, 3.0), values[3]);
    }

    #[test]
    fn the_vertex_of_a_parabola_is_exact() {
        let parabola = |t: f64| 2.0 - (t - 0.3) * (t - 0.3);
        assert!((parabola_vertex(parabola(-1.0), parabola(0.0), parabola(1.0)) - 0.3).abs() < 1e-12);
    }
}
