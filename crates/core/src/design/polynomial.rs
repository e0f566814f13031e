//! Polynomials in q⁻¹, coefficients in rising powers.

use std::cmp::Ordering;

use nalgebra::{Complex, DMatrix, DVector, Schur};

use crate::control::INTEGRATOR_TOLERANCE;

/// Largest number of QR iterations per root; two or three are usual.
const ITERATIONS_PER_ROOT: usize = 40;

/// Computes the product of two polynomials.
pub(crate) fn product(a: &[f64], b: &[f64]) -> Vec<f64> {
    let mut product = vec![0.0; (a.len() + b.len()).saturating_sub(1)];
    for (i, x) in a.iter().enumerate() {
        for (j, y) in b.iter().enumerate() {
            product[i + j] += x * y;
        }
    }
    product
}

/// Computes the sum of two polynomials.
pub(super) fn sum(a: &[f64], b: &[f64]) -> Vec<f64> {
    let at = |p: &[f64], i: usize| p.get(i).copied().unwrap_or(0.0);
    (0..a.len().max(b.len())).map(|i| at(a, i) + at(b, i)).collect()
}

/// Evaluates a polynomial at q⁻¹ = `x`.
pub(super) fn value(polynomial: &[f64], x: Complex<f64>) -> Complex<f64> {
    polynomial.iter().rev().fold(Complex::new(0.0, 0.0), |sum, c| sum * x + c)
}

/// Computes the roots in z = q, largest modulus first, as eigenvalues of the companion matrix.
///
/// A polynomial of degree n in q⁻¹ has n roots, some of them may be 0. The first coefficient must not be 0. Returns
/// `None` if the iteration does not converge.
pub(super) fn roots(polynomial: &[f64]) -> Option<Vec<Complex<f64>>> {
    let leading = *polynomial.first()?;
    let largest = polynomial.iter().fold(0.0_f64, |m, c| m.max(c.abs()));
    // Trailing coefficients within rounding error count as 0: their roots are 0.
    let significant = polynomial.iter().rposition(|c| c.abs() > f64::EPSILON * largest)?;
    let mut roots = eigenvalues(significant, |i| -polynomial[i + 1] / leading)?;
    roots.resize(polynomial.len() - 1, Complex::new(0.0, 0.0));
    roots.sort_by(|a, b| {
        // Conjugate pairs are adjacent, positive imaginary part first.
        let by_modulus = b.norm().partial_cmp(&a.norm()).unwrap_or(Ordering::Equal);
        by_modulus.then(b.im.partial_cmp(&a.im).unwrap_or(Ordering::Equal))
    });
    Some(roots)
}

/// Returns true if all roots in z are inside the circle of this radius (Schur–Cohn recursion, without computing the
/// roots).
pub(super) fn has_roots_within(polynomial: &[f64], radius: f64) -> bool {
    let mut scale = 1.0;
    let mut left: Vec<f64> = Vec::with_capacity(polynomial.len());
    for c in polynomial {
        left.push(c / scale);
        scale *= radius;
    }
    let mut next = left.clone();
    while left.len() > 1 {
        let last = left.len() - 1;
        let reflection = left[last] / left[0];
        // False for NaN.
        let is_inside = reflection.abs() < 1.0;
        if !is_inside {
            return false;
        }
        next.clear();
        next.extend((0..last).map(|i| left[i] - reflection * left[last - i]));
        std::mem::swap(&mut left, &mut next);
    }
    true
}

/// Divides a polynomial by all of its factors 1 − q⁻¹.
pub(super) fn without_integrators(polynomial: &[f64]) -> Vec<f64> {
    let mut left = polynomial.to_vec();
    let size: f64 = left.iter().map(|c| c.abs()).sum();
    while left.len() > 1 && left.iter().sum::<f64>().abs() <= INTEGRATOR_TOLERANCE * size {
        // Division by 1 − q⁻¹ sums up the coefficients.
        let mut sum = 0.0;
        for c in &mut left {
            sum += *c;
            *c = sum;
        }
        left.pop();
    }
    left
}

/// Computes the eigenvalues of the companion matrix with this first row; `None` without convergence.
fn eigenvalues(size: usize, first_row: impl Fn(usize) -> f64) -> Option<Vec<Complex<f64>>> {
    if size == 0 {
        return Some(Vec::new());
    }
    let companion = DMatrix::from_fn(size, size, |row, column| match row {
        0 => first_row(column),
        _ => f64::from(u8::from(row == column + 1)),
    });
    matrix_eigenvalues(companion)
}

/// Computes the eigenvalues of a square matrix of at least one row; `None` without convergence.
pub(super) fn matrix_eigenvalues(matrix: DMatrix<f64>) -> Option<Vec<Complex<f64>>> {
    if !matrix.iter().all(|c| c.is_finite()) {
        return None;
    }
    let limit = ITERATIONS_PER_ROOT * matrix.nrows();
    let schur = |matrix| Schur::try_new(matrix, f64::EPSILON, limit);
    // The QR iteration stalls on matrices such as that of zⁿ − 1; a Householder similarity transformation avoids it.
    let schur = schur(matrix.clone()).or_else(|| schur(householder_transformed(matrix)))?;
    Some(schur.complex_eigenvalues().iter().copied().collect())
}

/// Computes H M H with a Householder matrix H of an asymmetric normal.
fn householder_transformed(matrix: DMatrix<f64>) -> DMatrix<f64> {
    let size = matrix.nrows();
    let normal = DVector::from_fn(size, |i, _| 1.0 / (i + 1) as f64).normalize();
    let mirror = DMatrix::identity(size, size) - &normal * normal.transpose() * 2.0;
    &mirror * matrix * &mirror
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roots_on_a_circle_do_not_stall_the_iteration() {
        for size in 1..=24 {
            let mut polynomial = vec![0.0; size + 1];
            polynomial[0] = 2.0;
            polynomial[size] = -2.0;
            let found = roots(&polynomial).expect("convergence");
            assert_eq!(found.len(), size);
            for root in found {
                let power = root.powu(size as u32);
                assert!((power - 1.0).norm() < 1e-12, "{root} to the {size} is {power}");
            }
        }
    }

    #[test]
    fn schur_cohn_recursion_detects_roots_outside_the_circle() {
        for radius in [0.2, 0.7, 1.0, 1.5] {
            for (size, inside) in [(0.999_f64, true), (1.001, false)] {
                let (re, square) = (0.6 * size * radius, (size * radius).powi(2));
                let pair = [1.0, -2.0 * re, square];
                assert_eq!(has_roots_within(&pair, radius), inside);
                let more =
                    product(&product(&pair, &[2.0, -0.1 * radius]), &[1.0, 0.0, 0.3 * radius * radius]);
                assert_eq!(has_roots_within(&more, radius), inside);
            }
        }
        assert!(has_roots_within(&[1.0, -0.5, 0.0], 0.6) && !has_roots_within(&[1.0, f64::NAN], 1.0));
    }

    #[test]
    fn integrators_are_divided_out() {
        let double = product(&product(&[1.0, -1.0], &[1.0, -1.0]), &[1.0, -0.3]);
        let left = without_integrators(&double);
        assert!((left[0] - 1.0).abs() + (left[1] + 0.3).abs() < 1e-15 && left.len() == 2, "{left:?}");
    }

    #[test]
    fn trailing_zeros_are_roots_at_zero() {
        assert_eq!(roots(&[1.0, -0.5, 0.0, 0.0]), Some([0.5, 0.0, 0.0].map(|re| re.into()).to_vec()));
        assert_eq!(roots(&[3.0]), Some(Vec::new()));
        assert_eq!(roots(&[1.0, 0.0]), Some(vec![0.0.into()]));
    }
}
