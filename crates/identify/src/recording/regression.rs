//! Linear least squares on centered, scaled columns, and correlation.

use nalgebra::{DMatrix, DVector};
use virtual_axes_core::statistics::mean;

/// Relative eigenvalue below which a combination of columns is treated as zero.
const RANK: f64 = 1e-10;

/// Linear least-squares regression with a constant term, for many right-hand sides.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct LeastSquares {
    columns: Vec<Vec<f64>>,
    scales: Vec<f64>,
    inverse: DMatrix<f64>,
}

/// Result of a [`LeastSquares`] fit.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct LeastSquaresFit {
    /// Coefficient of each column.
    pub coefficients: Vec<f64>,
    /// Coefficient of determination R².
    pub r2: f64,
}

impl LeastSquares {
    /// Creates a regression on `columns` of equal length and a constant. The coefficient of a constant column
    /// is 0.
    pub fn new(mut columns: Vec<Vec<f64>>) -> Self {
        let mut scales = Vec::new();
        for column in &mut columns {
            let mean = mean(column).unwrap_or(0.0);
            column.iter_mut().for_each(|x| *x -= mean);
            let scale = column.iter().map(|x| x * x).sum::<f64>().sqrt();
            if scale > 0.0 && scale.is_finite() {
                column.iter_mut().for_each(|x| *x /= scale);
                scales.push(scale);
            } else {
                column.fill(0.0);
                scales.push(1.0);
            }
        }
        let count = columns.len();
        let gram = DMatrix::from_fn(count, count, |i, j| dot(&columns[i], &columns[j]));
        let eigen = gram.symmetric_eigen();
        let largest = eigen.eigenvalues.iter().fold(0.0_f64, |most, l| most.max(*l));
        let reciprocal = eigen.eigenvalues.map(|l| if l > RANK * largest { 1.0 / l } else { 0.0 });
        let inverse =
            &eigen.eigenvectors * DMatrix::from_diagonal(&reciprocal) * eigen.eigenvectors.transpose();
        LeastSquares { columns, scales, inverse }
    }

    /// Fits `values`, one per row of the columns.
    pub fn fit(&self, values: &[f64]) -> LeastSquaresFit {
        let mean = mean(values).unwrap_or(0.0);
        let centerd: Vec<f64> = values.iter().map(|y| y - mean).collect();
        let products =
            DVector::from_iterator(self.columns.len(), self.columns.iter().map(|x| dot(x, &centerd)));
        let solution = &self.inverse * &products;
        let total = dot(&centerd, &centerd);
        let r2 = if total > 0.0 { solution.dot(&products) / total } else { 0.0 };
        let coefficients = solution.iter().zip(&self.scales).map(|(c, scale)| c / scale).collect();
        LeastSquaresFit { coefficients, r2 }
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Returns the correlation coefficient of two signals, or 0 if one of them is constant.
pub(super) fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let (mean_a, mean_b) = (mean(a).unwrap_or(0.0), mean(b).unwrap_or(0.0));
    let (mut cross, mut square_a, mut square_b) = (0.0, 0.0, 0.0);
    for (a, b) in a.iter().zip(b) {
        let (a, b) = (a - mean_a, b - mean_b);
        cross += a * b;
        square_a += a * a;
        square_b += b * b;
    }
    let scale = (square_a * square_b).sqrt();
    if scale > 0.0 { cross / scale } else { 0.0 }
}
