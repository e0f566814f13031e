//! Standard errors of fitted values.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::fit::{BoundedParameter, RANK, pseudo_inverse};

/// Fewest clusters per value that show the variance of their sums.
const CLUSTERS: usize = 3;

/// Returns the posterior covariance of fitted values. The first rows of the residuals, one per element of `clusters`, are
/// data with the standard deviation `noise` of an independent row; the others are priors of that deviation.
///
/// With many clusters, which are independent although the residuals within a cluster are not, the sums of the residuals
/// over the clusters replace the noise where they are larger (sandwich estimator).
pub(super) fn posterior_covariance(
    parameters: &[BoundedParameter],
    values: &[f64],
    residuals: impl Fn(&[f64]) -> Option<DVector<f64>> + Sync,
    clusters: &[Option<usize>],
    noise: f64,
) -> Option<DMatrix<f64>> {
    let here = residuals(values)? / noise;
    let (jacobian, scale) =
        scaled_jacobian(parameters, values, &|x: &[f64]| residuals(x).map(|left| left / noise))?;
    // Columns of norm 1 make a prior comparable with the data.
    let posterior = pseudo_inverse(jacobian.transpose() * &jacobian, RANK)?;
    let priors = jacobian.rows(clusters.len(), jacobian.nrows() - clusters.len());
    let mut scores =
        vec![DVector::zeros(values.len()); clusters.iter().flatten().max().map_or(0, |last| last + 1)];
    for (row, cluster) in clusters.iter().enumerate() {
        if let Some(score) = cluster.and_then(|cluster| scores.get_mut(cluster)) {
            *score += jacobian.row(row).transpose() * here[row];
        }
    }
    let used: Vec<&DVector<f64>> = scores.iter().filter(|score| score.norm() > 0.0).collect();
    if used.len() < CLUSTERS * values.len() {
        return Some(unscaled(posterior, &scale));
    }
    let mut meat = DMatrix::zeros(values.len(), values.len());
    for score in &used {
        meat += *score * score.transpose();
    }
    // Few clusters underestimate the variance.
    meat *= used.len() as f64 / (used.len() - values.len()) as f64;
    let sandwich = &posterior * (meat + priors.transpose() * priors) * &posterior;
    let grown = DMatrix::from_fn(values.len(), values.len(), |j, k| {
        let growth = |k: usize| (sandwich[(k, k)] / posterior[(k, k)]).max(1.0).sqrt();
        posterior[(j, k)] * growth(j) * growth(k)
    });
    Some(unscaled(grown, &scale))
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
