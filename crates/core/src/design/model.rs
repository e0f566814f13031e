//! The transfer function that a controller is designed for.

use super::DesignError;

/// `A(q⁻¹) θ = B(q⁻¹) Ω*` over one position period (Prévost section 5).
///
/// A = 1 + a₁q⁻¹ + …, B = b₁q⁻¹ + …: both are held with their coefficient of q⁰, so that B begins with 0.
#[derive(Debug, Clone, PartialEq)]
pub struct PredictionModel {
    a: Vec<f64>,
    b: Vec<f64>,
    period: f64,
}

impl PredictionModel {
    /// The model with `a` (a₀ = 1) and `b` (b₀ = 0) in rising powers of q⁻¹, sampled every `period` s.
    ///
    /// # Errors
    /// [`DesignError::Model`].
    pub fn new(a: Vec<f64>, b: Vec<f64>, period: f64) -> Result<Self, DesignError> {
        let refused = |reason: String| Err(DesignError::Model(reason));
        if a.first() != Some(&1.0) {
            return refused(format!("A must begin with 1, not {:?}", a.first()));
        }
        if b.first() != Some(&0.0) || b.iter().all(|c| *c == 0.0) {
            return refused(
                "B must begin with 0, the delay of one period, and have a coefficient".to_owned(),
            );
        }
        if !a.iter().chain(&b).all(|c| c.is_finite()) {
            return refused("a coefficient is not finite".to_owned());
        }
        if !(period.is_finite() && period > 0.0) {
            return refused(format!("its period is {period} s; it must be more than 0"));
        }
        Ok(PredictionModel { a, b, period })
    }

    /// A, rising powers of q⁻¹; the first is 1.
    pub fn a(&self) -> &[f64] {
        &self.a
    }

    /// B, rising powers of q⁻¹, s; the first is 0.
    pub fn b(&self) -> &[f64] {
        &self.b
    }

    /// Tsp, s.
    pub fn period(&self) -> f64 {
        self.period
    }
}
