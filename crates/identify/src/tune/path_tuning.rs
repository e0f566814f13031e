//! Tuning for a path with comparison on other paths: search for the best tuning, or for a contrast.

use super::{
    Contrast, MarginLimits, SearchResult, TuneError, Tuning, TuningCandidate, TuningProblem, Workload,
    find_contrasts, fine_design_grid, tune_cascade, tune_contour_gain, tune_gpc, tune_gpc_from,
};

/// Search for a tuning.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TuningSearch {
    /// N1, N2, Nu and λ of the predictive controller. The first grid has at least this number of designs.
    Gpc(Option<usize>),
    /// Kp and feedforward weights of the cascade, with the seed of the starting points.
    Cascade(u64),
    /// Gain of cross-coupled control; the position controllers keep their tuning.
    ContourGain,
    /// Predictive controllers that are better than the initial tuning on the path and worse on the other path.
    Contrast,
}

/// Results of the initial and the best tuning on another path.
#[derive(Debug, Clone)]
pub struct ComparedPath {
    /// Name of the path.
    pub name: String,
    /// Initial tuning on this path.
    pub present: TuningCandidate,
    /// Best tuning on this path.
    pub tuned: TuningCandidate,
}

/// Result of a [`TuningSearch`].
#[derive(Debug)]
pub struct TuningResult {
    /// Best tuning, on the path that it was tuned for.
    pub best: TuningCandidate,
    /// All simulated tunings within the margin limits, sorted by increasing cost; `None` for a contrast.
    pub search: Option<SearchResult>,
    /// Tunings that are better on the first path and worse on the other path, the worst first.
    pub contrasts: Vec<Contrast>,
    /// Results on the other paths.
    pub elsewhere: Vec<ComparedPath>,
}

impl TuningResult {
    /// Runs the search and compares the best tuning with the initial one on `paths`. Returns `None` if no contrast exists
    /// on the first of them.
    ///
    /// # Errors
    /// [`TuneError`] if no tuning is within the limits, or if a path cannot be simulated.
    pub fn find(
        problem: &TuningProblem<'_>,
        search: TuningSearch,
        paths: &[Workload],
        limits: &MarginLimits,
    ) -> Result<Option<Self>, TuneError> {
        let search = match (search, paths.first()) {
            (TuningSearch::Contrast, None) => return Ok(None),
            (TuningSearch::Contrast, Some(path)) => return TuningResult::contrast(problem, path, limits),
            (TuningSearch::Gpc(Some(designs)), _) => {
                tune_gpc_from(problem, limits, fine_design_grid(designs))?
            }
            (TuningSearch::Gpc(None), _) => tune_gpc(problem, limits)?,
            (TuningSearch::Cascade(seed), _) => tune_cascade(problem, limits, seed)?,
            (TuningSearch::ContourGain, _) => tune_contour_gain(problem, limits)?,
        };
        let elsewhere = paths.iter().map(|path| {
            Ok(ComparedPath {
                name: path.name().to_owned(),
                present: problem.run_on(path, &Tuning::Present)?,
                tuned: problem.run_on(path, &search.best.tuning)?,
            })
        });
        let elsewhere = elsewhere.collect::<Result<Vec<_>, TuneError>>()?;
        Ok(Some(TuningResult {
            best: search.best.clone(),
            search: Some(search),
            contrasts: Vec::new(),
            elsewhere,
        }))
    }

    /// Searches the contrast that is worst on `path`.
    fn contrast(
        problem: &TuningProblem<'_>,
        path: &Workload,
        limits: &MarginLimits,
    ) -> Result<Option<Self>, TuneError> {
        let (present, contrasts) = find_contrasts(problem, path, limits)?;
        Ok(contrasts.first().cloned().map(|worst| TuningResult {
            best: worst.better,
            search: None,
            elsewhere: vec![ComparedPath { name: path.name().to_owned(), present, tuned: worst.worse }],
            contrasts,
        }))
    }

    /// Returns the Pareto front of cost and modulus margin.
    pub fn pareto(&self) -> Vec<&TuningCandidate> {
        let modulus = |one: &TuningCandidate| one.margins.map_or(f64::NAN, |margins| margins.modulus);
        self.search.as_ref().map_or_else(Vec::new, |search| super::pareto_front(&search.tried, modulus))
    }
}
