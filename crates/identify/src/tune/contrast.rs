//! Tunings that are better than the present one on one path and worse on another.

use super::error::TuneError;
use super::gpc::design_grid;
use super::margin_limits::MarginLimits;
use super::problem::{TuningCandidate, TuningProblem, within_limits};
use super::tuning::Tuning;
use super::workload::Workload;

/// Tuning evaluated on two paths.
#[derive(Debug, Clone, PartialEq)]
pub struct Contrast {
    /// Run on the path of the problem, with a lower cost than the present tuning.
    pub better: TuningCandidate,
    /// Run on the other path, with a higher cost than the present tuning.
    pub worse: TuningCandidate,
}

/// Finds predictive controllers of the grid within `limits` that cost less than the present tuning on the
/// path of the problem and more on `other`.
///
/// Returns the present tuning on `other` and the contrasts in order of falling cost on `other`. The figures
/// of the first contrast are complete; the others lack circles.
///
/// # Errors
/// [`TuneError`] if a run fails.
pub fn find_contrasts(
    problem: &TuningProblem<'_>,
    other: &Workload,
    limits: &MarginLimits,
) -> Result<(TuningCandidate, Vec<Contrast>), TuneError> {
    let present = problem.run_on(other, &Tuning::Present)?;
    let designs = within_limits(problem.designs(design_grid())?, limits);
    let is_better = |candidate: &TuningCandidate| candidate.cost < problem.present().cost;
    let is_worse = |candidate: &TuningCandidate| candidate.cost > present.cost;
    // The shorter path is run first, which reduces the runs on the longer one.
    let other_first = present.figures.duration < problem.present().figures.duration;
    let all: Vec<Tuning> = designs.into_iter().map(|(tuning, _)| tuning).collect();
    let on_own = |tunings: Vec<Tuning>| problem.runs_on(problem.workload(), tunings);
    let on_other = |tunings: Vec<Tuning>| problem.runs_on(other, tunings);
    let tunings =
        |candidates: &[TuningCandidate]| candidates.iter().map(|c| c.tuning.clone()).collect::<Vec<_>>();
    let (better, worse) = if other_first {
        let mut worse = on_other(all)?;
        worse.retain(is_worse);
        (on_own(tunings(&worse))?, worse)
    } else {
        let mut better = on_own(all)?;
        better.retain(is_better);
        let worse = on_other(tunings(&better))?;
        (better, worse)
    };
    let pairs = better.into_iter().zip(worse).map(|(better, worse)| Contrast { better, worse });
    let mut contrasts: Vec<Contrast> = pairs.filter(|c| is_better(&c.better) && is_worse(&c.worse)).collect();
    contrasts.sort_by(|a, b| b.worse.cost.total_cmp(&a.worse.cost));
    if let Some(worst) = contrasts.first_mut() {
        worst.better = problem.with_complete_figures(problem.workload(), &worst.better)?;
        worst.worse = problem.with_complete_figures(other, &worst.worse)?;
    }
    Ok((present, contrasts))
}
