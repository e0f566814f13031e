//! Search of the tuning of a predictive controller (GPC): grid search, then local refinement.

use std::collections::HashSet;

use super::error::TuneError;
use super::margin_limits::MarginLimits;
use super::problem::{SearchResult, TuningCandidate, TuningProblem, ranked, within_limits};
use super::tuning::{Tuning, round_significant};
use virtual_axes_core::config::Value;

/// Largest N2 of the grid.
pub const GRID_N2: usize = 24;
/// Largest Nu of the grid.
pub const GRID_NU: usize = 8;
/// λ_rel of the grid.
pub const GRID_LAMBDA: [f64; 12] = [1e-4, 2e-4, 5e-4, 1e-3, 2e-3, 5e-3, 1e-2, 2e-2, 5e-2, 1e-1, 2e-1, 5e-1];

/// Largest N2 of the local refinement.
const MAX_N2: usize = 60;
/// Number of starts refined in each round: the best tunings with different horizons.
const CENTERS: usize = 8;
/// Steps of N1, N2 and Nu to a neighbor.
const STEPS: [isize; 4] = [-4, -1, 1, 4];
/// Initial factor of λ_rel to a neighbor: less than half a step of the grid.
const FIRST_FACTOR: f64 = 1.4;
/// Factor of λ_rel at which the search ends.
const LAST_FACTOR: f64 = 1.02;
/// Relative improvement of the cost below which the steps of λ_rel shrink.
const GAIN: f64 = 1e-3;
/// Largest number of rounds.
const ROUNDS: usize = 16;
/// Significant digits of λ_rel.
const DIGITS: usize = 3;

/// Largest number of kept tunings; the cheapest are kept.
const MAX_KEPT: usize = 10_000;

/// Returns the grid: N1 = 1, N2 up to [`GRID_N2`], Nu up to [`GRID_NU`] and N2, λ_rel of [`GRID_LAMBDA`].
pub fn design_grid() -> Vec<Tuning> {
    let horizons = (1..=GRID_N2).flat_map(|n2| (1..=GRID_NU.min(n2)).map(move |nu| (n2, nu)));
    let of_horizon = |(n2, nu)| GRID_LAMBDA.map(|lambda_rel| Tuning::Gpc { n1: 1, n2, nu, lambda_rel });
    horizons.flat_map(of_horizon).collect()
}

/// Returns a grid of at least `designs` tunings: [`design_grid`] if it has as many, otherwise logarithmically spaced
/// λ_rel over the range of [`GRID_LAMBDA`].
pub fn fine_design_grid(designs: usize) -> Vec<Tuning> {
    let horizons = || (1..=GRID_N2).flat_map(|n2| (1..=GRID_NU.min(n2)).map(move |nu| (n2, nu)));
    let count = designs.div_ceil(horizons().count());
    if count <= GRID_LAMBDA.len() {
        return design_grid();
    }
    let (least, most) = (GRID_LAMBDA[0], GRID_LAMBDA[GRID_LAMBDA.len() - 1]);
    let lambda = |i: usize| least * (most / least).powf(i as f64 / (count - 1) as f64);
    let of_horizon = |(n2, nu)| (0..count).map(move |i| Tuning::Gpc { n1: 1, n2, nu, lambda_rel: lambda(i) });
    horizons().flat_map(of_horizon).collect()
}

/// Sorts `candidates` by cost and keeps the cheapest.
fn keep_cheapest(candidates: Vec<TuningCandidate>) -> Vec<TuningCandidate> {
    let mut candidates = ranked(candidates);
    candidates.truncate(MAX_KEPT);
    candidates
}

/// Searches a predictive controller, common to all moving axes, with a low cost.
///
/// Runs every design of the grid and the preset of the machine within `limits`. Then rounds refine λ_rel of the best
/// designs with different horizons, and run their neighbors in N1, N2 and Nu, also beyond the grid, with each λ_rel of
/// [`GRID_LAMBDA`], since the best λ_rel changes by a factor of 10 from one horizon to the next. The result is the best
/// of these runs; the cost has many local minima, and a lower one is possible.
///
/// # Errors
/// [`TuneError`] if a run fails or no tuning is within the limits.
pub fn tune_gpc(problem: &TuningProblem<'_>, limits: &MarginLimits) -> Result<SearchResult, TuneError> {
    tune_gpc_from(problem, limits, design_grid())
}

/// Searches like [`tune_gpc`] with another grid `first`, such as a [`fine_design_grid`].
///
/// # Errors
/// [`TuneError`] if a run fails or no tuning is within the limits.
pub fn tune_gpc_from(
    problem: &TuningProblem<'_>,
    limits: &MarginLimits,
    mut first: Vec<Tuning>,
) -> Result<SearchResult, TuneError> {
    first.extend(preset(problem).filter(|preset| !first.contains(preset)));
    let mut seen: HashSet<Key> = first.iter().filter_map(key).collect();
    let mut designs = first.len();
    let all = problem.designs(first)?;
    let closest =
        all.iter().filter_map(|(_, margins)| *margins).max_by(|a, b| a.modulus.total_cmp(&b.modulus));
    let kept = within_limits(all, limits);
    if kept.is_empty() {
        return Err(match closest {
            Some(most) => {
                TuneError::NoMargins { designs, limits: *limits, modulus: most.modulus, delay: most.delay }
            }
            None => TuneError::NoneStable { designs },
        });
    }
    let mut runs = kept.len();
    let mut tried = keep_cheapest(problem.runs("grid", kept)?);
    let mut factor = FIRST_FACTOR;
    for _ in 0..ROUNDS {
        let Some(best) = tried.first().map(|best| best.cost) else { break };
        let around: Vec<Tuning> = starts(&tried)
            .into_iter()
            .flat_map(|center| neighbors(center, factor))
            .filter(|tuning| key(tuning).is_some_and(|key| seen.insert(key)))
            .collect();
        designs += around.len();
        let kept = within_limits(problem.designs(around)?, limits);
        runs += kept.len();
        tried.extend(problem.runs("refinement", kept)?);
        tried = keep_cheapest(tried);
        let saved = tried.first().is_some_and(|now| now.cost < best * (1.0 - GAIN));
        if !saved {
            factor = factor.sqrt();
            if factor < LAST_FACTOR {
                break;
            }
        }
    }
    let best = tried.first_mut().ok_or(TuneError::Saturated { runs })?;
    *best = problem.with_complete_figures(problem.workload(), best)?;
    let best = best.clone();
    Ok(SearchResult { best, tried, designs, runs })
}

/// N1, N2, Nu and the bits of λ_rel.
type Key = (usize, usize, usize, u64);

fn key(tuning: &Tuning) -> Option<Key> {
    match tuning {
        Tuning::Gpc { n1, n2, nu, lambda_rel } => Some((*n1, *n2, *nu, lambda_rel.to_bits())),
        _ => None,
    }
}

/// Returns the predictive controller of the machine file if it is the same on all axes.
pub(super) fn preset(problem: &TuningProblem<'_>) -> Option<Tuning> {
    let parameters = problem.parameters();
    let own = |joint: &String| {
        let get = |key: &str| parameters.get(&format!("{joint}.position_loop.gpc.{key}"));
        let count = |key: &str| match get(key) {
            Some(Value::Integer(value)) => usize::try_from(value).ok(),
            _ => None,
        };
        match (get("lambda"), get("lambda_rel")) {
            (None, Some(Value::Double(lambda_rel))) => {
                Some(Tuning::Gpc { n1: count("n1")?, n2: count("n2")?, nu: count("nu")?, lambda_rel })
            }
            _ => None,
        }
    };
    let mut presets = problem.joints().iter().map(own);
    let first = presets.next()??;
    let alike = presets.all(|other| other.as_ref() == Some(&first));
    alike.then_some(first)
}

/// Returns the best tunings with different horizons from `tried`, which is sorted by cost.
fn starts(tried: &[TuningCandidate]) -> Vec<&Tuning> {
    let mut horizons = HashSet::new();
    let is_new = |tuning: &&Tuning| key(tuning).is_some_and(|(n1, n2, nu, _)| horizons.insert((n1, n2, nu)));
    tried.iter().map(|candidate| &candidate.tuning).filter(is_new).take(CENTERS).collect()
}

/// Returns the neighbors of a tuning: its horizons with the next λ_rel, the next horizons with each λ_rel of the grid.
fn neighbors(center: &Tuning, factor: f64) -> Vec<Tuning> {
    let Tuning::Gpc { n1, n2, nu, lambda_rel } = *center else { return Vec::new() };
    let mut around = Vec::new();
    for lambda in [lambda_rel / factor, lambda_rel * factor] {
        around.push(Tuning::Gpc { n1, n2, nu, lambda_rel: round_significant(lambda, DIGITS) });
    }
    for step in STEPS {
        let moved = |value: usize| value.saturating_add_signed(step);
        for (n1, n2, nu) in [(moved(n1), n2, nu), (n1, moved(n2), nu), (n1, n2, moved(nu))] {
            if (1..=n2).contains(&n1) && (1..=n2).contains(&nu) && n2 <= MAX_N2 {
                around.extend(GRID_LAMBDA.map(|lambda_rel| Tuning::Gpc { n1, n2, nu, lambda_rel }));
            }
        }
    }
    around
}
