//! Symmetric positive definite matrices with two off-diagonals on each side.

/// Symmetric band matrix with its right-hand side.
#[derive(Debug, Clone, Default)]
pub(super) struct BandSystem {
    /// Entries (i, i), (i, i + 1) and (i, i + 2).
    pub bands: [Vec<f64>; 3],
    pub right: Vec<f64>,
}

impl BandSystem {
    /// Sets all entries of a system of `size` unknowns to 0.
    pub fn clear(&mut self, size: usize) {
        for vector in self.bands.iter_mut().chain([&mut self.right]) {
            vector.clear();
            vector.resize(size, 0.0);
        }
    }

    /// Adds `factor · right` to the right-hand side.
    pub fn add_right(&mut self, factor: f64, right: &[f64]) {
        self.right.iter_mut().zip(right).for_each(|(sum, value)| *sum += factor * value);
    }

    /// Fixes unknown `index` at 0.
    pub fn fix(&mut self, index: usize) {
        for (k, band) in self.bands.iter_mut().enumerate() {
            band[index] = if k == 0 { 1.0 } else { 0.0 };
            if let Some(before) = index.checked_sub(k).filter(|_| k > 0) {
                band[before] = 0.0;
            }
        }
        self.right[index] = 0.0;
    }

    /// Makes the first unknown the second one times `tie`.
    pub fn tie_first(&mut self, tie: f64) {
        let [diagonal, first, second] = &mut self.bands;
        diagonal[1] += tie * (2.0 * first[0] + tie * diagonal[0]);
        first[1] += tie * second[0];
    }

    /// Makes the last of `n` unknowns the one before it times `tie`.
    pub fn tie_last(&mut self, n: usize, tie: f64) {
        let [diagonal, first, second] = &mut self.bands;
        diagonal[n - 2] += tie * (2.0 * first[n - 2] + tie * diagonal[n - 1]);
        first[n - 3] += tie * second[n - 3];
    }

    /// Solves the system of the first `n` unknowns in place and returns them, or `None` if the matrix is not positive
    /// definite.
    pub fn solve(&mut self, n: usize) -> Option<&[f64]> {
        let [diagonal, first, second] = self.bands.each_mut().map(|band| &mut band[..n]);
        let right = &mut self.right[..n];
        for i in 0..n {
            let d = diagonal[i];
            if !(d > 0.0 && d.is_finite()) {
                return None;
            }
            let (e, f, inverse) = (first[i], second[i], 1.0 / d);
            let (l, m) = (e * inverse, f * inverse);
            if i + 1 < n {
                diagonal[i + 1] -= l * e;
                first[i + 1] -= l * f;
                right[i + 1] -= l * right[i];
            }
            if i + 2 < n {
                diagonal[i + 2] -= m * f;
                right[i + 2] -= m * right[i];
            }
            (first[i], second[i]) = (l, m);
            right[i] *= inverse;
        }
        let (mut after, mut beyond) = (0.0, 0.0);
        for i in (0..n).rev() {
            let value = right[i] - first[i] * after - second[i] * beyond;
            (right[i], after, beyond) = (value, value, after);
        }
        Some(right)
    }
}
