//! Comparison of the ways in which a control can log the current.
//!
//! A recording does not say it: a mean and instants of the cycle are compared by their residuals, and the standard errors
//! contain the differences between those that explain the current alike.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::current_fit::{CurrentFit, PRIOR, RIPPLE_PRIOR, largest};
use super::moving_data::{CurrentRipple, MovingData, RIPPLE, Sample, law_of};
use crate::recording::{GaussianFilter, Signals};

/// Factor of the variance of the noise by which the costs of the ways are compared, since the simulated ripples have errors of
/// the model.
const MODEL_ERROR: f64 = 16.0;
/// Passes of a comparison, whose prior depends on the inertia.
const LINEAR_PASSES: usize = 3;

/// Instant of a position cycle at which a control can log the current.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct LoggedInstant {
    /// Time behind the sample, s.
    pub offset: f64,
    /// Probability before the comparison.
    pub prior: f64,
    /// True if position cycle and β of the simulation are those of the axis: others widen the standard errors only.
    pub is_identified: bool,
    /// Simulated current of the instant minus the mean over a position cycle.
    pub ripple: CurrentRipple,
    /// Inertia of the simulation, kg·m².
    pub inertia: f64,
}

/// Ways in which a control can log the current.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct CurrentLoggings {
    /// Instants; a mean over a position cycle has the rest of the probability.
    pub instants: Vec<LoggedInstant>,
    /// Relative standard error of the simulated ripple.
    pub error: f64,
    /// True if the loop is the identified one: a ripple of another size than the simulated one then leaves values in doubt.
    pub is_of_identified_loop: bool,
}

/// Comparison of the ways in which a control can log the current.
pub(super) struct ComparedLoggings {
    /// Index of the most probable instant of the identified position cycle; none for a mean.
    pub best: Option<usize>,
    /// Covariance of inertia, gravity and friction by the differences of the probable ways from the best one.
    pub spread: DMatrix<f64>,
}

impl MovingData {
    /// Returns the filtered ripple of the acceleration at each sample, m/s² or rad/s²; `per_current` is Kt r.
    pub fn ripple_of(&self, recordings: &[&Signals], instant: &LoggedInstant, per_current: f64) -> Vec<f64> {
        let filters: Vec<GaussianFilter> =
            recordings.iter().map(|signals| GaussianFilter::new(signals.cutoff, signals.period)).collect();
        let scale = per_current / instant.inertia;
        let at = |sample: &Sample| {
            let ripple = instant.ripple.get(sample.recording)?.get(sample.number)?;
            // Close to the ends of the simulation the filter lacks values.
            let smooth =
                filters[sample.recording].value_at(ripple, sample.index).filter(|value| value.is_finite());
            smooth.or_else(|| ripple.get(sample.index).copied()).map(|value| scale * value)
        };
        self.samples.iter().map(|sample| at(sample).unwrap_or(0.0)).collect()
    }

    /// Compares the ways in which the control can log the current by linear least squares around `fit`, that of a mean.
    /// `columns` are the ripples of the instants.
    pub fn compare(
        &self,
        measured: &[f64],
        (fit, has_gravity): (&CurrentFit, bool),
        (loggings, columns): (&CurrentLoggings, &[Vec<f64>]),
    ) -> ComparedLoggings {
        let x = &fit.values;
        let friction = |x: &[f64]| DVector::from_vec(self.friction(&law_of(x)));
        let mut right = DVector::from_column_slice(measured) - friction(x);
        let mut design =
            vec![DVector::from_iterator(measured.len(), self.samples.iter().map(|s| s.acceleration))];
        design.push(DVector::from_element(measured.len(), if has_gravity { 1.0 } else { 0.0 }));
        for k in 2..RIPPLE {
            let (step, mut moved) = (fit.parameters[k].step, x.clone());
            moved[k] = x[k] + step;
            let above = friction(&moved);
            moved[k] = x[k] - step;
            let column = (above - friction(&moved)) / (2.0 * step);
            right.axpy(x[k], &column, 1.0);
            design.push(column);
        }
        design.push(DVector::from_iterator(measured.len(), self.samples.iter().map(|s| -s.slope)));
        let design = DMatrix::from_columns(&design);
        let size = design.ncols();
        let (gram, projected, square) = (design.tr_mul(&design), design.tr_mul(&right), right.norm_squared());
        // Solutions: values, and cost without that of the mean; none for a mean.
        let solve = |ripple: Option<&Vec<f64>>, noise: f64| -> Option<(DVector<f64>, f64)> {
            let mut full = gram.clone().resize(size + 1, size + 1, 0.0);
            let mut vector = projected.clone().resize_vertically(size + 1, 0.0);
            if let Some(ripple) = ripple {
                let ripple = DVector::from_column_slice(ripple);
                let with = design.tr_mul(&ripple);
                for k in 0..size {
                    full[(k, size)] = with[k];
                    full[(size, k)] = with[k];
                }
                full[(size, size)] = ripple.norm_squared();
                vector[size] = ripple.dot(&right);
            }
            let mut constant = square;
            for (k, (center, deviation)) in PRIOR.iter().enumerate().filter(|(k, _)| *k != RIPPLE_PRIOR) {
                let (at, weight) =
                    (if k < RIPPLE_PRIOR { k + 3 } else { size - 1 }, (noise / deviation).powi(2));
                full[(at, at)] += weight;
                vector[at] += weight * center;
                constant += weight * center * center;
            }
            if !has_gravity {
                full[(1, 1)] += 1.0;
            }
            if ripple.is_none() {
                full[(size, size)] = 1.0;
            }
            let mut inertia = x[0];
            let mut found = (DVector::zeros(size + 1), f64::INFINITY);
            for _ in 0..LINEAR_PASSES {
                let mut tied = full.clone();
                if ripple.is_some() {
                    // The coefficient of the ripple is that of the acceleration times a factor of about 1.
                    let weight = (noise / (loggings.error * inertia.max(f64::MIN_POSITIVE))).powi(2);
                    tied[(0, 0)] += weight;
                    tied[(size, size)] += weight;
                    tied[(0, size)] -= weight;
                    tied[(size, 0)] -= weight;
                }
                let solution = super::fit::inverse(&tied)? * &vector;
                let cost = constant - solution.dot(&vector);
                inertia = solution[0];
                found = (solution, cost);
            }
            (inertia > 0.0).then_some(found)
        };
        let largest = largest(measured);
        let mut noise = fit.noise;
        let mut compared: Vec<(Option<usize>, DVector<f64>, f64)> = Vec::new();
        for _ in 0..2 {
            let ways: Vec<Option<usize>> =
                std::iter::once(None).chain((0..columns.len()).map(Some)).collect();
            compared = ways
                .into_par_iter()
                .filter_map(|way| {
                    let (solution, cost) = solve(way.map(|k| &columns[k]), noise)?;
                    Some((way, solution, cost))
                })
                .collect();
            let Some((way, solution, _)) = compared.iter().min_by(|a, b| a.2.total_cmp(&b.2)) else { break };
            let mut left = &right - &design * solution.rows(0, size);
            if let Some(k) = way {
                left.axpy(-solution[size], &DVector::from_column_slice(&columns[*k]), 1.0);
            }
            noise = Self::noise(left.as_slice(), largest).unwrap_or(noise);
        }
        let least = compared.iter().map(|(_, _, cost)| *cost).fold(f64::INFINITY, f64::min);
        let of_instants: f64 = loggings.instants.iter().map(|instant| instant.prior).sum();
        let variance = MODEL_ERROR * noise * noise;
        let weight = |(way, _, cost): &(Option<usize>, DVector<f64>, f64)| {
            let prior = way.map_or(1.0 - of_instants, |k| loggings.instants[k].prior);
            prior * (-0.5 * (cost - least) / variance).exp()
        };
        let sum: f64 = compared.iter().map(weight).sum();
        let best = compared
            .iter()
            .filter(|(way, _, _)| way.is_none_or(|k| loggings.instants[k].is_identified))
            .max_by(|a, b| weight(a).total_cmp(&weight(b)));
        let mut spread = DMatrix::zeros(x.len(), x.len());
        if let Some((_, center, _)) = best.filter(|_| sum > 0.0) {
            for way in &compared {
                let mut change = DVector::zeros(x.len());
                change.rows_mut(0, RIPPLE).copy_from(&(&way.1 - center).rows(0, RIPPLE));
                spread += &change * change.transpose() * (weight(way) / sum);
            }
        }
        ComparedLoggings { best: best.and_then(|(way, _, _)| *way), spread }
    }
}
