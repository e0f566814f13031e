//! Search of the gain of cross-coupled control: a grid below the largest gain within the margin limits, refined once.

use super::error::TuneError;
use super::margin_limits::MarginLimits;
use super::problem::{SearchResult, TuningCandidate, TuningProblem, ranked, within_limits};
use super::tuning::{Tuning, round_significant};
use virtual_axes_core::config::AxisKind;

/// Gains of the first grid.
const GRID: usize = 32;
/// Gains of the second grid, between the neighbors of the best of the first.
const FINE: usize = 15;
/// First trial of the largest gain and its limit, (m/min)/mm.
const FIRST: f64 = 0.125;
const LARGEST: f64 = 1000.0;
/// Bisections of the largest gain.
const BISECTIONS: usize = 20;
/// Significant digits of a gain.
const DIGITS: usize = 4;

/// Searches a gain of cross-coupled control with a low cost; the position controllers keep their tuning.
///
/// The margins are those of the position loops, along the path without and across it with the gain.
///
/// # Errors
/// [`TuneError`] if less than two linear axes move, a run fails or no gain is within the limits.
pub fn tune_contour_gain(
    problem: &TuningProblem<'_>,
    limits: &MarginLimits,
) -> Result<SearchResult, TuneError> {
    if problem.axes().filter(|axis| axis.kind() == AxisKind::Linear).count() < 2 {
        return Err(TuneError::NoContour);
    }
    let allows = |gain: f64| {
        let margins = problem.margins(&Tuning::ContourGain(gain));
        margins.is_some_and(|margins| limits.allows(&margins))
    };
    let mut designs = 1;
    if !allows(0.0) {
        return Err(match problem.margins(&Tuning::ContourGain(0.0)) {
            Some(m) => TuneError::NoMargins { designs, limits: *limits, modulus: m.modulus, delay: m.delay },
            None => TuneError::NoneStable { designs },
        });
    }
    let mut rejected = FIRST;
    while rejected < LARGEST && allows(rejected) {
        rejected *= 2.0;
        designs += 1;
    }
    let mut largest = if rejected > FIRST { 0.5 * rejected } else { 0.0 };
    for _ in 0..BISECTIONS {
        let middle = 0.5 * (largest + rejected);
        if allows(middle) { largest = middle } else { rejected = middle }
    }
    designs += BISECTIONS;
    let step = largest / GRID as f64;
    let mut tried = grid(problem, limits, "gains", (0..=GRID).map(|k| k as f64 * step))?;
    let best = tried.iter().min_by(|a, b| a.cost.total_cmp(&b.cost)).map(|best| best.tuning.clone());
    if let Some(Tuning::ContourGain(best)) = best {
        let part = |k: usize| best + step * (2.0 * k as f64 / (FINE + 1) as f64 - 1.0);
        let about = (1..=FINE).map(part).filter(|gain| *gain > 0.0 && *gain <= largest && *gain != best);
        tried.extend(grid(problem, limits, "gains near the best", about)?);
    }
    designs += tried.len();
    let runs = tried.len();
    let tried = ranked(tried);
    let best = tried.first().ok_or(TuneError::Saturated { runs })?;
    let best = problem.with_complete_figures(problem.workload(), best)?;
    Ok(SearchResult { best, tried, designs, runs })
}

/// Runs the gains within the limits.
fn grid(
    problem: &TuningProblem<'_>,
    limits: &MarginLimits,
    part: &'static str,
    gains: impl Iterator<Item = f64>,
) -> Result<Vec<TuningCandidate>, TuneError> {
    let tunings = gains.map(|gain| Tuning::ContourGain(round_significant(gain, DIGITS))).collect();
    problem.runs(part, within_limits(problem.designs(tunings)?, limits))
}
