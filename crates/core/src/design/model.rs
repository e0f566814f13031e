//! Prediction model: discrete transfer function that a position controller is designed for.

use super::DesignError;
use crate::units::Rounded;

/// Prediction model `A(q⁻¹) θ = B(q⁻¹) Ω*` over one position cycle (Prévost section 5).
///
/// A = 1 + a₁q⁻¹ + …, B = b₁q⁻¹ + …; both are stored from q⁰ on, so that B begins with 0.
#[derive(Debug, Clone, PartialEq)]
pub struct PredictionModel {
    a: Vec<f64>,
    b: Vec<f64>,
    period: f64,
}

impl PredictionModel {
    /// Creates a model from `a` (a₀ = 1) and `b` (b₀ = 0) in rising powers of q⁻¹, sampled every `period` s.
    ///
    /// # Errors
    /// [`DesignError::Model`] if a₀ ≠ 1, b₀ ≠ 0, B = 0, or a coefficient or the period is out of range.
    pub fn new(a: Vec<f64>, b: Vec<f64>, period: f64) -> Result<Self, DesignError> {
        let invalid = |reason: String| Err(DesignError::Model(reason));
        if a.first() != Some(&1.0) {
            return invalid(format!("A begins with {:?}; it must begin with 1", a.first().unwrap_or(&0.0)));
        }
        if b.first() != Some(&0.0) || b.iter().all(|c| *c == 0.0) {
            return invalid(
                "B must begin with 0 (delay of one cycle) and contain another coefficient".to_owned(),
            );
        }
        if !a.iter().chain(&b).all(|c| c.is_finite()) {
            return invalid("a coefficient of A or B is not finite".to_owned());
        }
        if !(period.is_finite() && period > 0.0) {
            return invalid(format!("the period is {} s; it must be above 0", Rounded(period)));
        }
        Ok(PredictionModel { a, b, period })
    }

    /// Returns A in rising powers of q⁻¹; the first coefficient is 1.
    pub fn a(&self) -> &[f64] {
        &self.a
    }

    /// Returns B in rising powers of q⁻¹, s; the first coefficient is 0.
    pub fn b(&self) -> &[f64] {
        &self.b
    }

    /// Returns the position cycle Tsp, s.
    pub fn period(&self) -> f64 {
        self.period
    }
}
