//! Symmetric positive definite matrices with two off-diagonals on each side.

/// Symmetric band matrix with its right-hand side.
#[derive(Debug, Clone, Default)]
pub(super) struct BandSystem {
    /// Row i: entries (i, i), (i, i + 1), (i, i + 2).
    rows: Vec<[f64; 3]>,
    right: Vec<f64>,
}

impl BandSystem {
    /// Sets all entries of a system of `size` unknowns to 0.
    pub fn clear(&mut self, size: usize) {
        self.rows.clear();
        self.rows.resize(size, [0.0; 3]);
        self.right.clear();
        self.right.resize(size, 0.0);
    }

    /// Adds `weight · g gᵀ` to the matrix and `value · g` to the right-hand side, for a gradient g with three entries from
    /// unknown `first` on.
    pub fn add(&mut self, first: usize, gradient: &[f64; 3], weight: f64, value: f64) {
        for a in 0..3 {
            let g = gradient[a];
            if g == 0.0 {
                continue;
            }
            let row = &mut self.rows[first + a];
            for b in a..3 {
                row[b - a] += weight * g * gradient[b];
            }
            self.right[first + a] += value * g;
        }
    }

    /// Fixes unknown `index` at 0.
    pub fn fix(&mut self, index: usize) {
        self.rows[index] = [1.0, 0.0, 0.0];
        self.right[index] = 0.0;
        for back in 1..=2 {
            if let Some(before) = index.checked_sub(back) {
                self.rows[before][back] = 0.0;
            }
        }
    }

    /// Solves the system in place and returns the unknowns, or `None` if the matrix is not positive definite.
    pub fn solve(&mut self) -> Option<&[f64]> {
        let n = self.rows.len();
        for i in 0..n {
            let [d, e, f] = self.rows[i];
            if !(d > 0.0 && d.is_finite()) {
                return None;
            }
            let right = self.right[i];
            if i + 1 < n {
                let l = e / d;
                self.rows[i + 1][0] -= l * e;
                self.rows[i + 1][1] -= l * f;
                self.right[i + 1] -= l * right;
            }
            if i + 2 < n {
                let l = f / d;
                self.rows[i + 2][0] -= l * f;
                self.right[i + 2] -= l * right;
            }
        }
        for i in (0..n).rev() {
            let [d, e, f] = self.rows[i];
            let mut value = self.right[i];
            if i + 1 < n {
                value -= e * self.right[i + 1];
            }
            if i + 2 < n {
                value -= f * self.right[i + 2];
            }
            self.right[i] = value / d;
        }
        Some(&self.right)
    }
}
