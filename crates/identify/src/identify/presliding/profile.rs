//! Residuals over the length of presliding.

use rayon::prelude::*;

use super::reversal::{Reversal, ReversalFit};
use crate::recording::deviation;
use virtual_axes_core::statistics::{mean, median};

/// Duration of the filter relative to the time in which an axis passes the length.
const FILTER: f64 = 0.12;
/// Standard errors of a significant damping.
const SIGNIFICANT: f64 = 3.0;

/// Residuals of each reversal over the trial lengths.
pub(super) struct LengthProfile {
    lengths: Vec<f64>,
    /// Fits of each reversal, one per length.
    fits: Vec<Vec<ReversalFit>>,
    level: f64,
    /// Cut-off frequency of the filter, Hz.
    pub cutoff: f64,
    /// Median time in which an axis passes the length after a reversal, s.
    pub time: f64,
}

impl LengthProfile {
    /// Fits `chosen` reversals at trial lengths between `low` and `high`; window and filter are those of `length`.
    pub fn new(
        level: f64,
        chosen: &[Reversal<'_>],
        length: f64,
        ([low, high], per_decade): ([f64; 2], f64),
    ) -> Self {
        let points = ((high / low).log10() * per_decade).ceil().max(2.0) as usize;
        let lengths: Vec<f64> =
            (0..=points).map(|k| low * (high / low).powf(k as f64 / points as f64)).collect();
        let times = chosen
            .iter()
            .map(|r| r.motion.motion.samples_within(r.after, length) as f64 * r.motion.signals.period);
        let time = median(&mut times.collect::<Vec<_>>()).unwrap_or(0.0);
        let cutoff = deviation(1.0) / (FILTER * time).max(f64::MIN_POSITIVE);
        let fits = chosen.par_iter().map(|r| r.fit(length, &lengths, level, cutoff)).collect();
        LengthProfile { lengths, fits, level, cutoff, time }
    }

    /// Returns the length of the least squares and its stiffness, A/m or A/rad, without the reversal `left_out`.
    pub fn minimum(&self, left_out: Option<usize>) -> (f64, f64) {
        let used: Vec<&Vec<ReversalFit>> =
            self.fits.iter().enumerate().filter(|(k, _)| Some(*k) != left_out).map(|(_, fit)| fit).collect();
        let sums: Vec<f64> =
            (0..self.lengths.len()).map(|j| used.iter().map(|fit| fit[j].squares).sum()).collect();
        let least = (0..sums.len()).min_by(|&a, &b| sums[a].total_cmp(&sums[b])).unwrap_or(0);
        // Vertex of the parabola through the neighbors, over the logarithm of the length.
        let spacing = (self.lengths[1] / self.lengths[0]).ln();
        let shift = match least {
            0 => 0.0,
            last if last + 1 == sums.len() => 0.0,
            k => {
                let bend = sums[k - 1] - 2.0 * sums[k] + sums[k + 1];
                if bend > 0.0 { 0.5 * (sums[k - 1] - sums[k + 1]) / bend } else { 0.0 }
            }
        };
        let length = self.lengths[least] * (shift * spacing).exp();
        let level = mean(&used.iter().map(|fit| fit[least].level).collect::<Vec<_>>()).unwrap_or(f64::NAN);
        (length, level * self.level / length)
    }

    /// Returns the damping at the trial length next to `length` with its standard error, A/(m/s) or A/(rad/s), if it is
    /// significant. `shared` is the standard error that all reversals share.
    pub fn damping(&self, length: f64, shared: f64) -> Option<(f64, f64)> {
        let near = |j: &usize| (self.lengths[*j] / length).ln().abs();
        let at = (0..self.lengths.len()).min_by(|a, b| near(a).total_cmp(&near(b)))?;
        let values: Vec<f64> = self.fits.iter().map(|fit| fit[at].damping).collect();
        let value = mean(&values)?;
        let scatter: f64 = values.iter().map(|x| (x - value) * (x - value)).sum();
        let error = (scatter / (values.len() * (values.len() - 1)) as f64).sqrt().hypot(shared);
        (value > SIGNIFICANT * error).then_some((value, error))
    }
}

/// Returns the 97.5 % quantile of Student's distribution, by the expansion of Cornish and Fisher in powers of
/// 1 / `freedom`; the error is below 1 % from three degrees of freedom on.
pub(in crate::identify) fn student(freedom: usize) -> f64 {
    let n = freedom as f64;
    1.959_964 + (2.372_27 + (2.822_5 + 2.555_9 / n) / n) / n
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_quantile_is_that_of_the_tables() {
        for (freedom, table) in [(3, 3.182), (5, 2.571), (10, 2.228), (30, 2.042)] {
            assert!((student(freedom) / table - 1.0).abs() < 0.01, "{freedom}: {}", student(freedom));
        }
    }
}
