//! Derivatives of block coordinates with respect to arc length.

/// Derivatives of the coordinates with respect to arc length, one value per coordinate.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Derivatives {
    /// First derivatives.
    pub first: Vec<f64>,
    /// Second derivatives.
    pub second: Vec<f64>,
    /// Third derivatives.
    pub third: Vec<f64>,
}

impl Derivatives {
    /// Creates zero derivatives of `joints` coordinates.
    pub fn new(joints: usize) -> Self {
        Self { first: vec![0.0; joints], second: vec![0.0; joints], third: vec![0.0; joints] }
    }
}
