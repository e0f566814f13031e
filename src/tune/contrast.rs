//! Tunings that are better than the present one on one path and worse on another.

use rayon::prelude::*;

use super::TuneError;
use super::bench::{Bench, Candidate, keeping};
use super::course::Course;
use super::gpc::grid;
use super::loops::MarginLimits;

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
/// `other` first.
///
/// # Errors
/// [`TuneError`].
pub fn contrast(
    bench: &Bench<'_>,
    other: &Course,
    limits: &MarginLimits,
) -> Result<(Candidate, Vec<Contrast>), TuneError> {
    let present = bench.run_on(other, &bench.present().tuning)?;
    let better = |c: &Candidate| c.cost < bench.present().cost;
    let designs = keeping(bench.designs(grid()), limits);
    let found: Vec<Candidate> = bench.runs("grid", designs)?.into_iter().filter(better).collect();
    bench.watch().begin("on the other path", found.len());
    let mut contrasts = found
        .into_par_iter()
        .map(|better| Ok(Contrast { worse: bench.run_on(other, &better.tuning)?, better }))
        .collect::<Result<Vec<_>, TuneError>>()?;
    contrasts.retain(|contrast| contrast.worse.cost > present.cost);
    contrasts.sort_by(|a, b| b.worse.cost.total_cmp(&a.worse.cost));
    Ok((present, contrasts))
}
