//! Least squares: weighted linear, and nonlinear within bounds (Levenberg–Marquardt).

use std::sync::OnceLock;

use levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt};
use nalgebra::{DMatrix, DVector, Dyn, Owned};
use rayon::prelude::*;
use virtual_axes_core::statistics::median;

/// Distance from a bound, relative to the range, within which a value is at the bound.
const AT_BOUND: f64 = 1e-3;
/// Accuracy of a nonlinear fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Effort {
    /// Closed-form residuals: central differences, tight tolerance.
    Formula,
    /// Simulated residuals: forward differences, loose tolerance.
    Simulation,
}

impl Effort {
    /// Returns the relative tolerance of sum of squares and parameters.
    fn tolerance(self) -> f64 {
        match self {
            Effort::Formula => 1e-10,
            Effort::Simulation => 1e-6,
        }
    }

    /// Returns the evaluation limit per parameter plus one; a simulation that still improves after it has a
    /// wrong model.
    fn max_evaluations_per_parameter(self) -> usize {
        match self {
            Effort::Formula => 60,
            Effort::Simulation => 8,
        }
    }
}

/// Relative size of singular values that are treated as zero.
pub(super) const RANK: f64 = 1e-10;
/// Iteration limit of the singular value decomposition of a matrix of about ten rows.
const SVD_ITERATIONS: usize = 1000;

/// Bounded parameter of a nonlinear fit.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct BoundedParameter {
    pub start: f64,
    pub low: f64,
    pub high: f64,
    /// Step of the difference quotients.
    pub step: f64,
}

/// Result of a nonlinear fit.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct NonlinearFit {
    pub values: Vec<f64>,
    /// Covariance of the values, from the residual variance.
    pub covariance: DMatrix<f64>,
    /// Sum of squares of the residuals.
    pub sum_of_squares: f64,
    /// True for each value at one of its bounds.
    pub is_at_bound: Vec<bool>,
}

impl NonlinearFit {
    /// Returns the standard error of value `k`.
    pub fn error(&self, k: usize) -> f64 {
        self.covariance.get((k, k)).map_or(f64::NAN, |variance| variance.max(0.0).sqrt())
    }

    /// Returns the correlation coefficient of two values.
    pub fn correlation(&self, j: usize, k: usize) -> f64 {
        self.covariance.get((j, k)).map_or(f64::NAN, |both| both / (self.error(j) * self.error(k)))
    }
}

/// Minimizes the sum of squares of `residuals` within bounds by the Levenberg–Marquardt method. Returns none
/// if the residuals cannot be computed.
///
/// The substitution `x = low + (high − low)(1 + sin z)/2` keeps the bounds.
pub(super) fn minimize(
    parameters: &[BoundedParameter],
    effort: Effort,
    residuals: impl Fn(&[f64]) -> Option<DVector<f64>> + Sync,
) -> Option<NonlinearFit> {
    let problem = search(parameters, effort, &residuals);
    let values = problem.values();
    let at_end = problem.here()?;
    let jacobian = problem.derivatives()?;
    let freedom = at_end.len().saturating_sub(values.len()).max(1);
    let squares = at_end.norm_squared();
    let covariance = inverse(&(jacobian.transpose() * &jacobian))? * (squares / freedom as f64);
    let at_bound = parameters
        .iter()
        .zip(&values)
        .map(|(p, &x)| (x - p.low).min(p.high - x) < AT_BOUND * (p.high - p.low))
        .collect();
    Some(NonlinearFit { values, covariance, sum_of_squares: squares, is_at_bound: at_bound })
}

/// Returns the values at the minimum of [`minimize`] and their sum of squares, also if they are not determined.
pub(super) fn descend(
    parameters: &[BoundedParameter],
    effort: Effort,
    residuals: impl Fn(&[f64]) -> Option<DVector<f64>> + Sync,
) -> Option<(Vec<f64>, f64)> {
    let problem = search(parameters, effort, &residuals);
    Some((problem.values(), problem.here()?.norm_squared()))
}

fn search<'a, R: Fn(&[f64]) -> Option<DVector<f64>> + Sync>(
    parameters: &'a [BoundedParameter],
    effort: Effort,
    residuals: &'a R,
) -> Problem<'a, R> {
    let problem = Problem { z: start(parameters), here: OnceLock::new(), parameters, effort, residuals };
    let (problem, _) = LevenbergMarquardt::new()
        .with_tol(effort.tolerance())
        .with_patience(effort.max_evaluations_per_parameter())
        .minimize(problem);
    problem
}

fn start(parameters: &[BoundedParameter]) -> DVector<f64> {
    let z = |p: &BoundedParameter| {
        // Away from the bounds, where the derivative vanishes.
        let inside = ((p.start - p.low) / (p.high - p.low)).clamp(AT_BOUND, 1.0 - AT_BOUND);
        (2.0 * inside - 1.0).asin()
    };
    DVector::from_iterator(parameters.len(), parameters.iter().map(z))
}

struct Problem<'a, R> {
    z: DVector<f64>,
    /// Residuals at `z`, once they are known.
    here: OnceLock<Option<DVector<f64>>>,
    parameters: &'a [BoundedParameter],
    effort: Effort,
    residuals: &'a R,
}

impl<R: Fn(&[f64]) -> Option<DVector<f64>> + Sync> Problem<'_, R> {
    fn values(&self) -> Vec<f64> {
        let value = |(p, z): (&BoundedParameter, &f64)| p.low + (p.high - p.low) * 0.5 * (1.0 + z.sin());
        self.parameters.iter().zip(self.z.iter()).map(value).collect()
    }

    /// Returns the residuals of the values.
    fn here(&self) -> Option<&DVector<f64>> {
        self.here.get_or_init(|| (self.residuals)(&self.values())).as_ref()
    }

    /// Returns the Jacobian of the residuals with respect to the values.
    fn derivatives(&self) -> Option<DMatrix<f64>> {
        let values = self.values();
        let at = |k: usize, x: f64| {
            let mut moved = values.clone();
            *moved.get_mut(k)? = x;
            (self.residuals)(&moved)
        };
        let here = match self.effort {
            Effort::Formula => None,
            Effort::Simulation => Some(self.here()?),
        };
        let column = |k: usize| {
            let (p, x) = (self.parameters.get(k)?, *values.get(k)?);
            let (low, high) = ((x - p.step).max(p.low), (x + p.step).min(p.high));
            match here {
                None => Some((at(k, high)? - at(k, low)?) / (high - low)),
                Some(here) if high > x => Some((at(k, high)? - here) / (high - x)),
                Some(here) => Some((here - at(k, low)?) / (x - low)),
            }
        };
        let columns: Option<Vec<DVector<f64>>> = (0..values.len()).into_par_iter().map(column).collect();
        let columns = columns?;
        (!columns.is_empty()).then(|| DMatrix::from_columns(&columns))
    }
}

impl<R: Fn(&[f64]) -> Option<DVector<f64>> + Sync> LeastSquaresProblem<f64, Dyn, Dyn> for Problem<'_, R> {
    type ResidualStorage = Owned<f64, Dyn>;
    type JacobianStorage = Owned<f64, Dyn, Dyn>;
    type ParameterStorage = Owned<f64, Dyn>;

    fn set_params(&mut self, z: &DVector<f64>) {
        if self.z != *z {
            self.z.copy_from(z);
            self.here = OnceLock::new();
        }
    }

    fn params(&self) -> DVector<f64> {
        self.z.clone()
    }

    fn residuals(&self) -> Option<DVector<f64>> {
        self.here().cloned()
    }

    fn jacobian(&self) -> Option<DMatrix<f64>> {
        let mut jacobian = self.derivatives()?;
        for ((mut column, p), z) in jacobian.column_iter_mut().zip(self.parameters).zip(self.z.iter()) {
            column *= (p.high - p.low) * 0.5 * z.cos();
        }
        Some(jacobian)
    }
}

/// Result of a linear fit.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct LinearFit {
    pub values: Vec<f64>,
    pub covariance: DMatrix<f64>,
}

impl LinearFit {
    /// Returns the standard error of value `k`.
    pub fn error(&self, k: usize) -> f64 {
        self.covariance.get((k, k)).map_or(f64::NAN, |variance| variance.max(0.0).sqrt())
    }
}

/// Solves weighted linear least squares. Each row contains factors, right-hand side and weight.
///
/// Returns none if the rows do not determine the values.
pub(super) fn fit_linear(rows: impl Iterator<Item = (Vec<f64>, f64, f64)>) -> Option<LinearFit> {
    let mut rows = rows.peekable();
    let size = rows.peek()?.0.len();
    let mut normal = DMatrix::zeros(size, size);
    let mut right = DVector::zeros(size);
    let (mut squares, mut count) = (0.0, 0_usize);
    for (factors, value, weight) in rows.filter(|row| row.0.len() == size) {
        let factors = DVector::from_vec(factors);
        normal.ger(weight, &factors, &factors, 1.0);
        right.axpy(value * weight, &factors, 1.0);
        squares += weight * value * value;
        count += 1;
    }
    if count < size {
        return None;
    }
    let inverse = inverse(&normal)?;
    let values = &inverse * &right;
    let left = (squares - values.dot(&right)).max(0.0);
    let variance = left / count.saturating_sub(size).max(1) as f64;
    Some(LinearFit { values: values.iter().copied().collect(), covariance: inverse * variance })
}

/// Returns the pseudo-inverse, without singular values up to `rank`; none of a matrix with elements that are not finite.
pub(super) fn pseudo_inverse(matrix: DMatrix<f64>, rank: f64) -> Option<DMatrix<f64>> {
    // The decomposition does not terminate with non-finite elements.
    let is_finite = matrix.iter().all(|element| element.is_finite());
    let svd = is_finite.then(|| matrix.try_svd(true, true, f64::EPSILON, SVD_ITERATIONS)).flatten()?;
    svd.pseudo_inverse(rank).ok()
}

/// Returns the inverse of a symmetric matrix after scaling of its diagonal, or none if it is rank-deficient.
pub(super) fn inverse(matrix: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let scale = matrix.diagonal().map(|d| 1.0 / d.sqrt());
    if !scale.iter().all(|s| s.is_finite()) {
        return None;
    }
    let scale = DMatrix::from_diagonal(&scale);
    let scaled = &scale * matrix * &scale;
    // The decomposition does not terminate with non-finite elements.
    if !scaled.iter().all(|s| s.is_finite()) {
        return None;
    }
    let values = scaled.clone().try_svd(false, false, f64::EPSILON, SVD_ITERATIONS)?.singular_values;
    let sound = values.min() > RANK * values.max();
    sound.then(|| scaled.try_inverse()).flatten().map(|inverse| &scale * inverse * &scale)
}

/// Returns the coefficient of determination R² of `(measured, modeled)` pairs; NaN if the measured values are
/// constant.
pub(super) fn r_squared(pairs: impl Iterator<Item = (f64, f64)> + Clone) -> f64 {
    let count = pairs.clone().count() as f64;
    let mean = pairs.clone().map(|(measured, _)| measured).sum::<f64>() / count;
    let (mut left, mut total) = (0.0, 0.0);
    for (measured, modeled) in pairs {
        left += (measured - modeled) * (measured - modeled);
        total += (measured - mean) * (measured - mean);
    }
    1.0 - left / total
}

/// Returns the median and 1.4826 times the median absolute deviation, the standard deviation of a normal
/// distribution.
pub(super) fn robust_mean_and_deviation(values: &[f64]) -> (f64, f64) {
    /// Ratio of the standard deviation of a normal distribution to its median absolute deviation.
    const NORMAL: f64 = 1.4826;
    let middle = median(&mut values.to_vec()).unwrap_or(f64::NAN);
    let mut distances: Vec<f64> = values.iter().map(|value| (value - middle).abs()).collect();
    (middle, NORMAL * median(&mut distances).unwrap_or(f64::NAN))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_matrix_with_non_finite_elements_has_no_inverse() {
        for strange in [f64::INFINITY, f64::NAN] {
            assert!(inverse(&DMatrix::from_row_slice(2, 2, &[1.0, 0.5, 0.5, strange])).is_none());
            assert!(inverse(&DMatrix::from_row_slice(2, 2, &[1.0, strange, strange, 1.0])).is_none());
        }
    }

    #[test]
    fn a_line_through_three_points_has_the_textbook_errors() {
        // y = 1, 2, 4 at x = 0, 1, 2: slope 3/2, intercept 5/6, residual sum of squares 1/6.
        let rows = [(0.0, 1.0), (1.0, 2.0), (2.0, 4.0)];
        let fit = fit_linear(rows.into_iter().map(|(x, y)| (vec![1.0, x], y, 1.0))).expect("two of three");
        assert!((fit.values[0] - 5.0 / 6.0).abs() < 1e-12 && (fit.values[1] - 1.5).abs() < 1e-12);
        // s² / Sxx = (1/6) / 2, and s² (1/3 + 1/2).
        assert!((fit.error(1) - (1.0_f64 / 12.0).sqrt()).abs() < 1e-9);
        assert!((fit.error(0) - (5.0_f64 / 36.0).sqrt()).abs() < 1e-9);
    }

    #[test]
    fn collinear_factors_are_no_fit() {
        assert!(fit_linear((0..9).map(|k| (vec![1.0, 2.0], f64::from(k), 1.0))).is_none());
    }

    #[test]
    fn an_exponential_is_fitted_and_a_bound_is_reported() {
        let residuals = |p: &[f64]| {
            Some(DVector::from_iterator(
                20,
                (0..20).map(|k| {
                    let x = f64::from(k) * 0.1;
                    p[0] * (p[1] * x).exp() - 3.0 * (-0.7 * x).exp()
                }),
            ))
        };
        let bounded = |start, low, high| BoundedParameter { start, low, high, step: 1e-5 };
        let free = minimize(&[bounded(1.0, 0.0, 10.0), bounded(0.5, -5.0, 5.0)], Effort::Formula, residuals)
            .expect("a minimum");
        assert!((free.values[0] - 3.0).abs() < 1e-6 && (free.values[1] + 0.7).abs() < 1e-6);
        assert_eq!(free.is_at_bound, [false, false]);
        let held = minimize(&[bounded(1.0, 0.0, 10.0), bounded(0.5, -0.2, 5.0)], Effort::Formula, residuals)
            .expect("a minimum");
        assert_eq!(held.is_at_bound, [false, true]);
        assert!(held.values[1] >= -0.2);
    }

    #[test]
    fn the_robust_deviation_of_a_normal_sample_is_its_standard_deviation() {
        // Quantiles of a normal distribution of mean 2 and deviation 1: -1.5, -0.6745, 0, 0.6745, 1.5.
        let (middle, spread) = robust_mean_and_deviation(&[0.5, 1.3255, 2.0, 2.6745, 3.5]);
        assert!((middle - 2.0).abs() < 1e-12 && (spread - 1.0).abs() < 1e-3);
    }
}
