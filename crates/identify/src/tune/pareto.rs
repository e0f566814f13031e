//! Tunings that no other beats in two respects at once.

use super::bench::Candidate;

/// Of `candidates` those for which none both costs less and has more of `merit` (or one of both and as much
/// of the other), the cheapest first.
pub fn front(candidates: &[Candidate], merit: impl Fn(&Candidate) -> f64) -> Vec<&Candidate> {
    let mut sorted: Vec<(&Candidate, f64)> = candidates.iter().map(|c| (c, merit(c))).collect();
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
