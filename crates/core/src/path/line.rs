//! Straight line.

use super::derivatives::Derivatives;

/// A straight line, parametrized by arc length.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Line {
    /// Change of each coordinate per unit of length.
    pub slopes: Vec<f64>,
}

impl Line {
    pub fn point(&self, from: &[f64], s: f64, out: &mut [f64]) {
        for ((value, from), slope) in out.iter_mut().zip(from).zip(&self.slopes) {
            *value = from + slope * s;
        }
    }

    pub fn derivatives(&self, out: &mut Derivatives) {
        out.first.copy_from_slice(&self.slopes);
        out.second.fill(0.0);
        out.third.fill(0.0);
    }
}
