//! Polynomials in q⁻¹, coefficients in rising powers.

use std::cmp::Ordering;

use nalgebra::{Complex, DMatrix, DVector, Schur};

/// Steps of the QR iteration for each root; it needs two or three.
const ITERATIONS_PER_ROOT: usize = 40;

/// Product of two polynomials.
pub(crate) fn product(a: &[f64], b: &[f64]) -> Vec<f64> {
    let mut product = vec![0.0; (a.len() + b.len()).saturating_sub(1)];
    for (i, x) in a.iter().enumerate() {
        for (j, y) in b.iter().enumerate() {
            product[i + j] += x * y;
        }
    }
    product
}

/// Sum of two polynomials.
pub(super) fn sum(a: &[f64], b: &[f64]) -> Vec<f64> {
    let at = |p: &[f64], i: usize| p.get(i).copied().unwrap_or(0.0);
    (0..a.len().max(b.len())).map(|i| at(a, i) + at(b, i)).collect()
}

/// The value at q⁻¹ = `x`.
pub(super) fn value(polynomial: &[f64], x: Complex<f64>) -> Complex<f64> {
    polynomial.iter().rev().fold(Complex::new(0.0, 0.0), |sum, c| sum * x + c)
}

/// Roots in z = q, largest modulus first; a polynomial of degree n in q⁻¹ has n, some of them 0. None
/// if the iteration does not end. The first coefficient must not be 0.
///
/// The eigenvalues of the companion matrix.
pub(super) fn roots(polynomial: &[f64]) -> Option<Vec<Complex<f64>>> {
    let leading = *polynomial.first()?;
    let largest = polynomial.iter().fold(0.0_f64, |m, c| m.max(c.abs()));
    // What is below the rounding of the others is none: those roots are 0.
    let significant = polynomial.iter().rposition(|c| c.abs() > f64::EPSILON * largest)?;
    let mut roots = eigenvalues(significant, |i| -polynomial[i + 1] / leading)?;
    roots.resize(polynomial.len() - 1, Complex::new(0.0, 0.0));
    roots.sort_by(|a, b| {
        // Pairs stand together, the one above the real axis first.
        let by_modulus = b.norm().partial_cmp(&a.norm()).unwrap_or(Ordering::Equal);
        by_modulus.then(b.im.partial_cmp(&a.im).unwrap_or(Ordering::Equal))
    });
    Some(roots)
}

/// Eigenvalues of the companion matrix with this first row.
fn eigenvalues(size: usize, first_row: impl Fn(usize) -> f64) -> Option<Vec<Complex<f64>>> {
    if size == 0 {
        return Some(Vec::new());
    }
    let companion = DMatrix::from_fn(size, size, |row, column| match row {
        0 => first_row(column),
        _ => f64::from(u8::from(row == column + 1)),
    });
    if !companion.iter().all(|c| c.is_finite()) {
        return None;
    }
    let limit = ITERATIONS_PER_ROOT * size;
    let schur = |matrix| Schur::try_new(matrix, f64::EPSILON, limit);
    // The iteration stands still on matrices such as that of zⁿ − 1; mirrored, they are as any other.
    let schur = schur(companion.clone()).or_else(|| schur(mirrored(companion)))?;
    Some(schur.complex_eigenvalues().iter().copied().collect())
}

/// H M H with a Householder matrix H of no symmetry.
fn mirrored(matrix: DMatrix<f64>) -> DMatrix<f64> {
    let size = matrix.nrows();
    let normal = DVector::from_fn(size, |i, _| 1.0 / (i + 1) as f64).normalize();
    let mirror = DMatrix::identity(size, size) - &normal * normal.transpose() * 2.0;
    &mirror * matrix * &mirror
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roots_on_a_circle_do_not_hold_the_iteration() {
        for size in 1..=24 {
            let mut polynomial = vec![0.0; size + 1];
            polynomial[0] = 2.0;
            polynomial[size] = -2.0;
            let found = roots(&polynomial).expect("it ends");
            assert_eq!(found.len(), size);
            for root in found {
                let power = root.powu(size as u32);
                assert!((power - 1.0).norm() < 1e-12, "{root} to the {size} is {power}");
            }
        }
    }

    #[test]
    fn trailing_zeros_are_roots_at_zero() {
        assert_eq!(roots(&[1.0, -0.5, 0.0, 0.0]), Some([0.5, 0.0, 0.0].map(|re| re.into()).to_vec()));
        assert_eq!(roots(&[3.0]), Some(Vec::new()));
        assert_eq!(roots(&[1.0, 0.0]), Some(vec![0.0.into()]));
    }
}
