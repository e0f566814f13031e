//! Design of position controllers from a prediction model: pure mathematics, no axis.

mod classic;
mod gpc;
mod margins;
mod model;
mod pole_placement;
mod poles;
pub(crate) mod polynomial;

pub use classic::{MAX_GAIN, Pid, p, pi, pid};
pub use gpc::{GpcTuning, Weight, gpc};
pub use margins::{Margins, margins};
pub use model::PredictionModel;
pub use pole_placement::{PolePlacement, pole_pair, pole_placement};
pub use poles::{accept, check_stable, poles};

use crate::control::RstError;
use crate::units::Told;

/// Why there is no controller.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DesignError {
    /// A tuning parameter out of its range.
    #[error("{name} = {} must {allowed}", Told(*value))]
    OutOfRange {
        /// Name of the parameter, in SI units.
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
    /// A pole of the closed loop lies on or outside the unit circle.
    #[error(
        "the closed loop is unstable: its pole {} has the modulus {modulus:.9}; it must be below 1 − 10⁻⁶",
        complex(*re, *im)
    )]
    Unstable {
        /// Real part.
        re: f64,
        /// Imaginary part.
        im: f64,
        /// Distance from 0.
        modulus: f64,
    },
    /// The poles of the closed loop cannot be computed.
    #[error("the poles of the closed loop cannot be computed from these polynomials")]
    NoPoles,
    /// A pole to be placed where a stable loop has none.
    #[error("the wanted pole {} has the modulus {modulus}; it must be below 1 − 10⁻⁶", complex(*re, *im))]
    PoleOutside {
        /// Real part.
        re: f64,
        /// Imaginary part.
        im: f64,
        /// Distance from 0.
        modulus: f64,
    },
    /// A pole to be placed off the real axis, alone.
    #[error("the wanted pole {} must come with its conjugate {}", complex(*re, *im), complex(*re, -im))]
    NoConjugate {
        /// Real part.
        re: f64,
        /// Imaginary part.
        im: f64,
    },
    /// A and B have a root in common, which no controller moves.
    #[error(
        "poles cannot be placed: A and B of the prediction model share the root {} or nearly so",
        complex(*re, *im)
    )]
    SharedRoot {
        /// Real part.
        re: f64,
        /// Imaginary part.
        im: f64,
    },
    /// The polynomials that came out are no controller.
    #[error(transparent)]
    Rst(#[from] RstError),
}

/// A complex number for people.
fn complex(re: f64, im: f64) -> String {
    // Beyond, digits behind the point say nothing.
    const LARGE: f64 = 1e6;
    if re.abs() > LARGE || im.abs() > LARGE {
        return format!("{re:e} {} {:e}j", if im < 0.0 { '−' } else { '+' }, im.abs());
    }
    if im == 0.0 {
        return format!("{re:.6}");
    }
    format!("{re:.6} {} {:.6}j", if im < 0.0 { '−' } else { '+' }, im.abs())
}
