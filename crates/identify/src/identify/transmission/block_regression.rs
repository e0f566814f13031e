//! Linear regression with standard errors from the scatter without each block of the rows in turn (jackknife).

use nalgebra::{DMatrix, DVector};

use super::super::fit::pseudo_inverse;

/// Relative singular value below which a combination of columns has no influence.
const RANK: f64 = 1e-12;

/// Normal equations of a regression, by blocks of consecutive rows.
#[derive(Debug, Clone)]
pub(super) struct BlockRegression {
    blocks: Vec<(DMatrix<f64>, DVector<f64>)>,
    /// Sum of the squared values.
    squares: f64,
}

impl BlockRegression {
    /// Creates a regression without rows.
    pub fn new(columns: usize, blocks: usize) -> Self {
        let block = (DMatrix::zeros(columns, columns), DVector::zeros(columns));
        BlockRegression { blocks: vec![block; blocks], squares: 0.0 }
    }

    /// Adds a row to a block.
    pub fn add(&mut self, block: usize, row: &[f64], value: f64) {
        let Some((normal, right)) = self.blocks.get_mut(block) else { return };
        for (i, x) in row.iter().enumerate() {
            right[i] += x * value;
            for (j, y) in row.iter().enumerate().take(i + 1) {
                normal[(i, j)] += x * y;
            }
        }
        self.squares += value * value;
    }

    /// Adds the rows of another regression with the same columns and blocks.
    pub fn merge(&mut self, other: &Self) {
        for ((normal, right), (part, of_part)) in self.blocks.iter_mut().zip(&other.blocks) {
            *normal += part;
            *right += of_part;
        }
        self.squares += other.squares;
    }

    /// Returns the sums of the blocks, without one of them, for the first `count` columns.
    fn sums(&self, count: usize, without: Option<usize>) -> (DMatrix<f64>, DVector<f64>) {
        let (mut normal, mut right) = (DMatrix::zeros(count, count), DVector::zeros(count));
        for (_, (part, of_part)) in self.blocks.iter().enumerate().filter(|(k, _)| Some(*k) != without) {
            for i in 0..count {
                right[i] += of_part[i];
                for j in 0..=i {
                    normal[(i, j)] += part[(i, j)];
                }
            }
        }
        normal.fill_upper_triangle_with_lower_triangle();
        (normal, right)
    }

    /// Returns the coefficients of the first `count` columns, without one of the blocks; columns without influence have
    /// the coefficient 0.
    pub fn solve(&self, count: usize, without: Option<usize>) -> Option<DVector<f64>> {
        let (mut normal, mut right) = self.sums(count, without);
        let scale = normal.diagonal().map(|square| if square > 0.0 { 1.0 / square.sqrt() } else { 0.0 });
        for i in 0..count {
            right[i] *= scale[i];
            for j in 0..count {
                normal[(i, j)] *= scale[i] * scale[j];
            }
        }
        let solution = pseudo_inverse(normal, RANK)? * right;
        let solution = solution.component_mul(&scale);
        solution.iter().all(|x| x.is_finite()).then_some(solution)
    }

    /// Returns the part of the squares of a column that the other ones of the first `count` columns do not explain, 0 … 1.
    pub fn independence(&self, count: usize, column: usize) -> f64 {
        let (mut normal, _) = self.sums(count, None);
        let scale = normal.diagonal().map(|square| if square > 0.0 { 1.0 / square.sqrt() } else { 0.0 });
        for i in 0..count {
            for j in 0..count {
                normal[(i, j)] *= scale[i] * scale[j];
            }
        }
        // Column `column` on the others.
        let others = normal.clone().remove_row(column).remove_column(column);
        let with = normal.column(column).clone_owned().remove_row(column);
        match pseudo_inverse(others, RANK) {
            Some(inverse) if normal[(column, column)] > 0.0 => (1.0 - with.dot(&(inverse * &with))).max(0.0),
            _ => 0.0,
        }
    }

    /// Returns the sum of the squared residuals of a solution.
    pub fn residual_squares(&self, solution: &DVector<f64>) -> f64 {
        let (normal, right) = self.sums(solution.len(), None);
        self.squares - 2.0 * right.dot(solution) + solution.dot(&(normal * solution))
    }

    /// Returns the value of a function of the coefficients of the first `count` columns, and the values without each of the
    /// blocks.
    pub fn jackknife<T>(&self, count: usize, of: impl Fn(&DVector<f64>) -> T) -> Option<(T, Vec<T>)> {
        let all = of(&self.solve(count, None)?);
        let without: Option<Vec<T>> = (0..self.blocks.len())
            .map(|k| self.solve(count, Some(k)).map(|solution| of(&solution)))
            .collect();
        Some((all, without?))
    }
}

/// Returns the standard error of a value from its values without each of the blocks.
pub(super) fn scatter(without: &[f64]) -> f64 {
    let count = without.len() as f64;
    let middle = without.iter().sum::<f64>() / count;
    let sum: f64 = without.iter().map(|x| (x - middle) * (x - middle)).sum();
    (sum * (count - 1.0) / count).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_of_any_size_end_without_a_solution_or_with_finite_coefficients() {
        for size in [0.0, 1e-170, 1e-160, 1e160, 1e300, f64::NAN, f64::INFINITY] {
            let mut regression = BlockRegression::new(3, 10);
            for k in 0..1000 {
                let x = f64::from(k) / 100.0;
                regression.add(k as usize / 100, &[1.0, size * x, size * x.sin()], 2.0 + 3.0 * x);
            }
            let solution = regression.solve(3, None);
            assert!(solution.is_none_or(|solution| solution.iter().all(|c| c.is_finite())), "{size}");
            assert!((0.0..=1.0).contains(&regression.independence(3, 1)), "{size}");
        }
    }

    #[test]
    fn a_line_is_found_and_its_error_is_the_noise() {
        // y = 2 + 3 x with alternating errors of 0.1.
        let mut regression = BlockRegression::new(3, 10);
        for k in 0..1000 {
            let x = f64::from(k) / 100.0;
            let error = if k % 2 == 0 { 0.1 } else { -0.1 };
            regression.add(k as usize / 100, &[1.0, x, 0.0], 2.0 + 3.0 * x + error);
        }
        let solution = regression.solve(3, None).expect("a solution");
        assert!((solution[0] - 2.0).abs() < 0.01 && (solution[1] - 3.0).abs() < 0.01, "{solution}");
        assert_eq!(solution[2], 0.0);
        // A quarter of the squares of a line from 0 is that about its mean; a column of zeros has none.
        assert!((regression.independence(2, 1) - 0.25).abs() < 1e-3, "{}", regression.independence(2, 1));
        assert_eq!(regression.independence(3, 2), 0.0);
        assert!((regression.residual_squares(&solution) - 10.0).abs() < 0.01);
        let (slope, without) = regression.jackknife(2, |c| c[1]).expect("a solution");
        assert!((slope - 3.0).abs() < 0.01 && scatter(&without) < 0.01);
        assert!((scatter(&[1.0, 2.0, 3.0]) - (4.0_f64 / 3.0).sqrt()).abs() < 1e-15);
    }
}
