//! Standard errors of fitted values.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::fit::{BoundedParameter, RANK, pseudo_inverse};

/// Returns the covariance of fitted values from the sums of the residuals over clusters, which are independent although
/// the residuals within a cluster are not (sandwich estimator). Rows without cluster, such as priors, have no noise.
pub(super) fn clustered_covariance(
    parameters: &[BoundedParameter],
    values: &[f64],
    residuals: impl Fn(&[f64]) -> Option<DVector<f64>> + Sync,
    clusters: &[Option<usize>],
) -> Option<DMatrix<f64>> {
    let here = residuals(values)?;
    let (jacobian, scale) = scaled_jacobian(parameters, values, &residuals)?;
    let bread = pseudo_inverse(jacobian.transpose() * &jacobian, RANK)?;
    let count = clusters.iter().flatten().max().map_or(0, |last| last + 1);
    let mut scores = vec![DVector::zeros(values.len()); count];
    for (row, cluster) in clusters.iter().enumerate().take(here.len()) {
        if let Some(score) = cluster.and_then(|cluster| scores.get_mut(cluster)) {
            *score += jacobian.row(row).transpose() * here[row];
        }
    }
    let used: Vec<&DVector<f64>> = scores.iter().filter(|score| score.norm() > 0.0).collect();
    let mut meat = DMatrix::zeros(values.len(), values.len());
    for score in &used {
        meat += *score * score.transpose();
    }
    // Few clusters underestimate the variance.
    let freedom = used.len().saturating_sub(values.len()).max(1);
    let covariance = &bread * meat * &bread * (used.len() as f64 / freedom as f64);
    Some(unscaled(covariance, &scale))
}

/// Returns the covariance of fitted values if the residuals are no noise but an error of the model, which may act in the
/// direction of any one parameter: (JᵀJ)⁻¹ |r|², an upper bound.
pub(super) fn systematic_covariance(
    parameters: &[BoundedParameter],
    values: &[f64],
    residuals: impl Fn(&[f64]) -> Option<DVector<f64>> + Sync,
) -> Option<DMatrix<f64>> {
    let squares = residuals(values)?.norm_squared();
    let (jacobian, scale) = scaled_jacobian(parameters, values, &residuals)?;
    let inverse = pseudo_inverse(jacobian.transpose() * &jacobian, RANK)?;
    Some(unscaled(inverse * squares, &scale))
}

/// Returns the Jacobian with columns of norm 1, and their norms; parameters without effect have the norm 0.
fn scaled_jacobian(
    parameters: &[BoundedParameter],
    values: &[f64],
    residuals: &(impl Fn(&[f64]) -> Option<DVector<f64>> + Sync),
) -> Option<(DMatrix<f64>, Vec<f64>)> {
    let column = |k: usize| {
        let at = |x: f64| {
            let mut moved = values.to_vec();
            *moved.get_mut(k)? = x;
            residuals(&moved)
        };
        let (x, step) = (*values.get(k)?, parameters.get(k)?.step);
        Some((at(x + step)? - at(x - step)?) / (2.0 * step))
    };
    let columns: Option<Vec<DVector<f64>>> = (0..values.len()).into_par_iter().map(column).collect();
    let mut jacobian = DMatrix::from_columns(&columns?);
    let scale: Vec<f64> = jacobian.column_iter().map(|column| column.norm()).collect();
    for (mut column, norm) in jacobian.column_iter_mut().zip(&scale) {
        column /= norm.max(f64::MIN_POSITIVE);
    }
    Some((jacobian, scale))
}

/// Returns the covariance of the values from that of the scaled values.
fn unscaled(mut covariance: DMatrix<f64>, scale: &[f64]) -> DMatrix<f64> {
    for j in 0..scale.len() {
        for k in 0..scale.len() {
            covariance[(j, k)] /= scale[j] * scale[k];
        }
    }
    covariance
}
