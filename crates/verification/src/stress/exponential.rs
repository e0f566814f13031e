//! Matrix exponential by scaling and squaring, independent of the one in the drive model.

use nalgebra::SMatrix;

/// Norm up to which the series is summed; larger matrices are halved.
const SMALL: f64 = 0.5;
/// Terms of the series: 0.5¹⁸ / 18! is far below the rounding.
const TERMS: u32 = 18;

/// Returns e^A: the Taylor series of A/2ˢ, squared s times.
pub fn exponential<const N: usize>(a: &SMatrix<f64, N, N>) -> SMatrix<f64, N, N> {
    let mut halved = *a;
    let mut squarings = 0;
    while halved.norm() > SMALL {
        halved *= 0.5;
        squarings += 1;
    }
    let mut term = SMatrix::<f64, N, N>::identity();
    let mut sum = term;
    for k in 1..=TERMS {
        term = term * halved / f64::from(k);
        sum += term;
    }
    for _ in 0..squarings {
        sum = sum * sum;
    }
    sum
}
