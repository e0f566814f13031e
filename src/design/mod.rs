//! Design of position controllers from a prediction model: pure mathematics, no axis.

mod gpc;
mod model;
pub(crate) mod polynomial;

pub use gpc::{GpcTuning, Weight, gpc};
pub use model::PredictionModel;

use crate::control::RstError;

/// Why there is no controller.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DesignError {
    /// A tuning parameter out of its range.
    #[error("{name} = {value} must {allowed}")]
    OutOfRange {
        /// Name of the parameter, as in a machine file.
        name: &'static str,
        /// What was given.
        value: f64,
        /// What is allowed, after "must".
        allowed: String,
    },
    /// GᵀG + λI cannot be inverted.
    #[error(
        "the matrix GᵀG + λI of n1 = {n1}, n2 = {n2}, nu = {nu} is singular with lambda = {lambda}; take \
         lambda > 0 or a smaller nu"
    )]
    Singular {
        /// N1.
        n1: usize,
        /// N2.
        n2: usize,
        /// Nu.
        nu: usize,
        /// λ.
        lambda: f64,
    },
    /// The prediction model is no model.
    #[error("prediction model: {0}")]
    Model(String),
    /// The polynomials that came out are no controller.
    #[error(transparent)]
    Rst(#[from] RstError),
}
