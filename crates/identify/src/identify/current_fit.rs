//! Fit of the current at the samples in motion.

use nalgebra::DVector;

use super::delays::correlation_inflation;
use super::fit::{BoundedParameter, Effort, descend};
use super::moving_data::MovingData;
use virtual_axes_core::statistics::rms;

/// Number of values that the samples usually determine.
const DETERMINED: f64 = 4.0;
/// Center and standard deviation of the prior of −c / a, b in min/m and ln(−d m/min), within which the axes of Prévost
/// Appendix 2 lie; of the factor of the simulated ripple, with the deviation 1 instead of that of the simulation; of the lag
/// of the current, s.
pub(super) const PRIOR: [(f64, f64); 5] =
    [(0.35, 0.2), (0.016, 0.01), (-1.1, 0.5), (1.0, 1.0), (0.0, 0.1e-3)];
/// Bounds of these.
const BOUNDS: [(f64, f64); 5] = [(-1.0, 0.98), (0.0, 0.08), (-2.9, 1.5), (0.0, 2.0), (-1e-3, 1e-3)];
/// Index of the prior of the factor of the ripple.
pub(super) const RIPPLE_PRIOR: usize = 3;
/// Noise of the current in the first pass and least noise in the second one, relative to the largest current.
const NOISE: f64 = 0.01;
const LEAST_NOISE: f64 = 2e-3;

/// Fit of the current at the samples in motion.
pub(super) struct CurrentFit {
    pub parameters: Vec<BoundedParameter>,
    pub values: Vec<f64>,
    /// Standard deviation of a residual that counts as independent, A.
    pub noise: f64,
    /// Relative standard error of the ripple; none without ripple.
    pub ripple: Option<f64>,
}

impl MovingData {
    /// Returns the residuals of the samples, of the standstills and of the prior, A.
    pub fn residuals(
        &self,
        x: &[f64],
        measured: &[f64],
        (noise, ripple): (f64, Option<f64>),
    ) -> DVector<f64> {
        let left = self.modeled(x).into_iter().zip(measured).map(|(model, measured)| model - measured);
        let prior = PRIOR.iter().zip(&x[3..]).enumerate().map(|(k, ((center, deviation), x))| {
            let deviation = if k == RIPPLE_PRIOR { ripple.unwrap_or(*deviation) } else { *deviation };
            noise * (x - center) / deviation
        });
        let rows = measured.len() + self.standstills.len() + PRIOR.len();
        DVector::from_iterator(rows, left.chain(self.excesses(x)).chain(prior))
    }

    /// Returns the noise of the residuals of the samples, which counts with the correlation of neighbors, A.
    pub fn noise(left: &[f64], largest: f64) -> Option<f64> {
        let count = left.len() as f64;
        let freedom = (count / (count - DETERMINED).max(1.0)).sqrt();
        let noise = freedom * rms(left.iter().copied())? * correlation_inflation(left).sqrt();
        Some(noise.max(LEAST_NOISE * largest))
    }

    /// Fits the current `measured` with the ripple of the samples, whose relative standard error is `ripple`.
    pub fn fit(&self, measured: &[f64], ripple: Option<f64>, has_gravity: bool) -> Option<CurrentFit> {
        let largest = largest(measured);
        let fastest = self.samples.iter().fold(0.0_f64, |most, s| most.max(s.acceleration.abs()));
        let bounded = |start: f64, low: f64, high: f64| BoundedParameter {
            start: start.clamp(low, high),
            low,
            high,
            step: 1e-5 * (high - low),
        };
        let factor = 3.0 * largest / fastest.max(f64::MIN_POSITIVE);
        let prior_of = |k: usize| {
            let ((center, _), (low, high)) = (PRIOR[k], BOUNDS[k]);
            // Without ripple its factor is nothing.
            if k == RIPPLE_PRIOR && ripple.is_none() {
                bounded(0.0, -1e-9, 1e-9)
            } else {
                bounded(center, low, high)
            }
        };
        let mut parameters = vec![
            bounded(0.3 * factor, 0.0, factor),
            if has_gravity { bounded(0.0, -2.0 * largest, 2.0 * largest) } else { bounded(0.0, -1e-9, 1e-9) },
            bounded(0.2 * largest, 0.0, 3.0 * largest),
        ];
        parameters.extend((0..PRIOR.len()).map(prior_of));
        let mut noise = NOISE * largest;
        let mut values: Vec<f64> = Vec::new();
        for _ in 0..2 {
            let residuals = |x: &[f64]| Some(self.residuals(x, measured, (noise, ripple)));
            (values, _) = descend(&parameters, Effort::Formula, residuals)?;
            let left = self.residuals(&values, measured, (noise, ripple));
            noise = Self::noise(left.as_slice().get(..measured.len())?, largest)?;
            parameters.iter_mut().zip(&values).for_each(|(parameter, value)| parameter.start = *value);
        }
        Some(CurrentFit { parameters, values, noise, ripple })
    }
}

/// Returns the largest current, A.
pub(super) fn largest(measured: &[f64]) -> f64 {
    measured.iter().fold(0.0_f64, |most, i| most.max(i.abs())).max(f64::MIN_POSITIVE)
}
