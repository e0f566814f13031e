//! Tunings that are better than the present one on one path and worse on another.

use super::TuneError;
use super::bench::{Bench, Candidate, keeping};
use super::course::Course;
use super::gpc::grid;
use super::loops::MarginLimits;
use super::tuning::Tuning;

/// A tuning on two paths.
#[derive(Debug, Clone, PartialEq)]
pub struct Contrast {
    /// On the bench's path, where it costs less than the machine as it is.
    pub better: Candidate,
    /// On the other path, where it costs more.
    pub worse: Candidate,
}

/// Predictive controllers of the grid that keep `limits`, cost less than the machine as it is on the bench's
/// path and more than it on `other`, with what the machine as it is costs there; those that cost most on
/// `other` first. The figures of the first one are complete; those of the others have no circles.
///
/// # Errors
/// [`TuneError`].
pub fn contrast(
    bench: &Bench<'_>,
    other: &Course,
    limits: &MarginLimits,
) -> Result<(Candidate, Vec<Contrast>), TuneError> {
    let present = bench.run_on(other, &Tuning::Present)?;
    let designs = keeping(bench.designs(grid()), limits);
    let is_better = |candidate: &Candidate| candidate.cost < bench.present().cost;
    let is_worse = |candidate: &Candidate| candidate.cost > present.cost;
    // The shorter path sorts out first what need not be run on the longer one.
    let other_first = present.figures.duration < bench.present().figures.duration;
    let all: Vec<Tuning> = designs.into_iter().map(|(tuning, _)| tuning).collect();
    let on_bench = |tunings: Vec<Tuning>| bench.runs_on(bench.course(), tunings);
    let on_other = |tunings: Vec<Tuning>| bench.runs_on(other, tunings);
    let tunings = |candidates: &[Candidate]| candidates.iter().map(|c| c.tuning.clone()).collect::<Vec<_>>();
    let (better, worse) = if other_first {
        let mut worse = on_other(all)?;
        worse.retain(is_worse);
        (on_bench(tunings(&worse))?, worse)
    } else {
        let mut better = on_bench(all)?;
        better.retain(is_better);
        let worse = on_other(tunings(&better))?;
        (better, worse)
    };
    let pairs = better.into_iter().zip(worse).map(|(better, worse)| Contrast { better, worse });
    let mut contrasts: Vec<Contrast> = pairs.filter(|c| is_better(&c.better) && is_worse(&c.worse)).collect();
    contrasts.sort_by(|a, b| b.worse.cost.total_cmp(&a.worse.cost));
    if let Some(worst) = contrasts.first_mut() {
        worst.better = bench.completed(bench.course(), &worst.better)?;
        worst.worse = bench.completed(other, &worst.worse)?;
    }
    Ok((present, contrasts))
}
