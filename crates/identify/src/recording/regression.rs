//! How well the motion explains the current: least squares on centerd, scaled columns.

use nalgebra::{DMatrix, DVector};

/// Part of the largest eigenvalue below which a combination of columns counts as not there.
const RANK: f64 = 1e-10;

/// Least squares with a constant, for many right-hand sides.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Regression {
    columns: Vec<Vec<f64>>,
    scales: Vec<f64>,
    inverse: DMatrix<f64>,
}

/// What a [`Regression`] finds.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Fit {
    /// Per column.
    pub coefficients: Vec<f64>,
    /// Part of the variance that is explained.
    pub r2: f64,
}

impl Regression {
    /// A regression on `columns`, all as long, and a constant. A column that does not vary gets 0.
    pub fn new(mut columns: Vec<Vec<f64>>) -> Self {
        let mut scales = Vec::new();
        for column in &mut columns {
            let mean = mean(column);
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
        Regression { columns, scales, inverse }
    }

    /// Explains `values`, as many as each column has.
    pub fn fit(&self, values: &[f64]) -> Fit {
        let mean = mean(values);
        let centerd: Vec<f64> = values.iter().map(|y| y - mean).collect();
        let products =
            DVector::from_iterator(self.columns.len(), self.columns.iter().map(|x| dot(x, &centerd)));
        let solution = &self.inverse * &products;
        let total = dot(&centerd, &centerd);
        let r2 = if total > 0.0 { solution.dot(&products) / total } else { 0.0 };
        let coefficients = solution.iter().zip(&self.scales).map(|(c, scale)| c / scale).collect();
        Fit { coefficients, r2 }
    }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Correlation of two signals about their means; 0 where one of them does not vary.
pub(super) fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let (mean_a, mean_b) = (mean(a), mean(b));
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
