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

    /// Adds a symmetric block of three unknowns from `first` on, by its entries (0, 0), (0, 1), (0, 2), (1, 1), (1, 2) and
    /// (2, 2), and their right-hand side.
    pub fn add(&mut self, first: usize, [a, b, c, d, e, f]: &[f64; 6], right: &[f64; 3]) {
        for (row, block) in self.rows[first..].iter_mut().zip([[*a, *b, *c], [*d, *e, 0.0], [*f, 0.0, 0.0]]) {
            add(row, &block);
        }
        add(&mut self.right[first..], right);
    }

    /// Adds `factor · right` to the right-hand side.
    pub fn add_right(&mut self, factor: f64, right: &[f64]) {
        self.right.iter_mut().zip(right).for_each(|(sum, value)| *sum += factor * value);
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

/// Adds `terms` to the first of `sums`.
pub(super) fn add(sums: &mut [f64], terms: &[f64]) {
    sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
}
