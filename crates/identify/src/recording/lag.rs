//! By how much the recorded current lags behind the motion.

use std::ops::Range;

use super::condition::Part;
use super::order::quantile;
use super::regression::Regression;
use super::spans::CURRENT;
use virtual_axes_core::config::{AxisKind, Periods};
use virtual_axes_core::units::seconds;

/// Lags that are tried, s: what buses and filters of oscilloscopes have been seen to do, with reserve.
pub(super) const LOWEST_LAG: f64 = -0.010;
pub(super) const HIGHEST_LAG: f64 = 0.020;
/// Cut-off of the filter for the scan, times the position period: the setpoint's staircase makes a ripple at
/// that period, whose crests look like lags that are a period apart; a two-hundredth of it passes.
const CUTOFF_PERIOD: f64 = 0.25;
/// Step of the scan, s; the parabola through three of them finds the top to a hundredth of it.
const STEP: f64 = 5e-4;
/// Part of the largest speed below which friction does not say its direction.
const MOVING: f64 = 0.05;
/// Most samples that are regarded; more do not tell more.
const MOST_SAMPLES: usize = 100_000;
/// Fewest samples that tell a lag.
const FEWEST_SAMPLES: usize = 100;
/// Part of the unexplained variance that must vanish for a lag to be believed.
const BETTER: f64 = 0.1;
/// Explained part of the variance below which the current does not go with the motion at all.
const EXPLAINED: f64 = 0.5;
/// Sampling periods that a lag must exceed: the ripple of a sampled drive, and its output that is held over a
/// period, look like less.
const PERIODS: f64 = 1.0;
/// Part of a sample within which a shift is a whole number of samples.
const WHOLE: f64 = 1e-9;

/// Highest cut-off, Hz, at which a lag is sought.
pub(super) fn cutoff(periods: &Periods) -> f64 {
    CUTOFF_PERIOD / seconds(periods.position)
}

/// What the scan finds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Lag {
    /// Lag that explains the current best, s.
    pub lag: f64,
    /// Explained part of the variance with it.
    pub r2: f64,
    /// The same without.
    pub r2_without: f64,
    /// Whether it explains clearly more than none.
    pub better: bool,
    /// Whether it is longer than what a sampling period can feign.
    pub long: bool,
    /// Whether the scan ends before the best lag.
    pub at_end: bool,
}

/// What the current is regressed on at the samples that move: acceleration, velocity, direction, and on a rotary
/// axis the sine and cosine of the position; with where these samples are. Where the axis starts, stops or turns
/// within reach of the filter or of a lag, friction says nothing for sure: these samples are not among them.
pub(super) struct Moving {
    /// Part and sample.
    pub places: Vec<(usize, usize)>,
    pub columns: Vec<Vec<f64>>,
}

impl Moving {
    /// The moving samples of `parts` that are `before` and `behind` samples from the ends.
    pub fn new(parts: &[Part], kind: AxisKind, before: usize, behind: usize) -> Self {
        let mut speeds: Vec<f64> =
            parts.iter().flat_map(|p| p.motion.first.iter().map(|v| v.abs())).collect();
        let threshold = MOVING * quantile(&mut speeds, 0.99);
        let mut places = Vec::new();
        for (p, part) in parts.iter().enumerate() {
            let reach = part.filter.radius();
            let runs = runs(&part.motion.first, threshold);
            let inside = runs
                .into_iter()
                .map(|run| run.start + before + reach..run.end.saturating_sub(behind + reach));
            places.extend(inside.flatten().map(|n| (p, n)));
        }
        let stride = places.len().div_ceil(MOST_SAMPLES).max(1);
        let places: Vec<(usize, usize)> = places.into_iter().step_by(stride).collect();
        let column = |of: &dyn Fn(usize, usize) -> f64| places.iter().map(|&(p, n)| of(p, n)).collect();
        let mut columns: Vec<Vec<f64>> = vec![
            column(&|p, n| parts[p].motion.second[n]),
            column(&|p, n| parts[p].motion.first[n]),
            column(&|p, n| parts[p].motion.first[n].signum()),
        ];
        if kind == AxisKind::Rotary {
            columns.push(column(&|p, n| parts[p].motion.value[n].sin()));
            columns.push(column(&|p, n| parts[p].motion.value[n].cos()));
        }
        Moving { places, columns }
    }
}

/// Where the axis moves faster than `threshold` in one direction.
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

/// The lag of the current of `parts`, samples `period` apart; none where nothing moves or nothing was recorded.
pub(super) fn estimate(parts: &[Part], kind: AxisKind, period: f64) -> Option<Lag> {
    let samples = |lag: f64| (lag.abs() / period).ceil() as usize + 2;
    let moving = Moving::new(parts, kind, samples(LOWEST_LAG), samples(HIGHEST_LAG));
    if moving.places.len() < FEWEST_SAMPLES || parts.iter().any(|part| part.smooth_current.is_none()) {
        return None;
    }
    let regression = Regression::new(moving.columns);
    let explained = |lag: f64| {
        let shift = lag / period;
        let currents = moving.places.iter().map(|&(p, n)| {
            parts[p].smooth_current.as_ref().map_or(0.0, |current| at(current, n as f64 + shift))
        });
        regression.fit(&currents.collect::<Vec<_>>()).r2
    };
    // Whole steps on either side of zero, so that no lag is one of the candidates.
    let (first, last) = ((LOWEST_LAG / STEP).round() as i64, (HIGHEST_LAG / STEP).round() as i64);
    let scan: Vec<f64> = (first..=last).map(|k| explained(k as f64 * STEP)).collect();
    let best = (0..scan.len()).max_by(|&a, &b| scan[a].total_cmp(&scan[b]))?;
    let at_end = best == 0 || best + 1 == scan.len();
    let offset = if at_end { 0.0 } else { summit(scan[best - 1], scan[best], scan[best + 1]) };
    let lag = (first as f64 + best as f64 + offset) * STEP;
    let (r2, r2_without) = (explained(lag.clamp(LOWEST_LAG, HIGHEST_LAG)), explained(0.0));
    Some(Lag {
        lag,
        r2,
        r2_without,
        better: r2 > EXPLAINED && 1.0 - r2 < (1.0 - BETTER) * (1.0 - r2_without),
        long: lag.abs() > PERIODS * period,
        at_end,
    })
}

/// Where a parabola through three values has its top, in steps from the middle one, which is the largest.
fn summit(left: f64, middle: f64, right: f64) -> f64 {
    let bend = left - 2.0 * middle + right;
    if bend < 0.0 { (0.5 * (left - right) / bend).clamp(-0.5, 0.5) } else { 0.0 }
}

/// Takes back a `lag` (s): the current of each part is that of `lag` later; the ends without one are cut off.
pub(super) fn take_back(parts: &mut [Part], lag: f64, period: f64) {
    let exact = lag / period;
    let shift = if (exact - exact.round()).abs() < WHOLE { exact.round() } else { exact };
    for part in parts {
        let count = part.piece.len();
        let (before, behind) = ((-shift).max(0.0).ceil() as usize, shift.max(0.0).ceil() as usize);
        let range = before.min(count)..count.saturating_sub(behind).max(before.min(count));
        let currents = [part.piece.columns[CURRENT].as_mut(), part.smooth_current.as_mut()];
        for current in currents.into_iter().flatten() {
            let old = std::mem::take(current);
            *current = (0..count).map(|n| at(&old, n as f64 + shift)).collect();
        }
        part.cut(range, period);
    }
}

/// Value between samples by the cubic through the four nearest; exactly the sample at a sample.
fn at(values: &[f64], place: f64) -> f64 {
    let last = values.len() as isize - 1;
    let whole = place.floor();
    let part = place - whole;
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
        for place in [1.25, 4.5, 7.9] {
            assert!((at(&values, place) - cubic(place)).abs() < 1e-12);
        }
        assert_eq!(at(&values, 3.0), values[3]);
    }

    #[test]
    fn the_top_of_a_parabola() {
        let parabola = |t: f64| 2.0 - (t - 0.3) * (t - 0.3);
        assert!((summit(parabola(-1.0), parabola(0.0), parabola(1.0)) - 0.3).abs() < 1e-12);
    }
}
