//! Pareto front of cost and a second figure of merit.

use super::problem::TuningCandidate;

/// Returns the Pareto-optimal `candidates` with low cost and high `merit` in order of rising cost.
pub fn pareto_front(
    candidates: &[TuningCandidate],
    merit: impl Fn(&TuningCandidate) -> f64,
) -> Vec<&TuningCandidate> {
    let mut sorted: Vec<(&TuningCandidate, f64)> = candidates.iter().map(|c| (c, merit(c))).collect();
    sorted.retain(|(candidate, merit)| candidate.cost.is_finite() && !merit.is_nan());
    sorted.sort_by(|a, b| a.0.cost.total_cmp(&b.0.cost).then(b.1.total_cmp(&a.1)));
    let mut most = f64::NEG_INFINITY;
    sorted.retain(|(_, merit)| {
        let better = *merit > most;
        most = most.max(*merit);
        better
    });
    sorted.into_iter().map(|(candidate, _)| candidate).collect()
}
