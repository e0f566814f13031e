//! Errors of a controller design.

use crate::control::RstError;
use crate::units::Rounded;

/// Error of a controller design.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DesignError {
    /// Tuning parameter out of range.
    #[error("{name} = {} must {allowed}", Rounded(*value))]
    OutOfRange {
        /// Name of the parameter, in SI units.
        name: &'static str,
        /// Value found.
        value: f64,
        /// Allowed range, worded to follow "must".
        allowed: String,
    },
    /// Singular matrix GᵀG + λI.
    #[error(
        "the matrix GᵀG + λI of n1 = {n1}, n2 = {n2}, nu = {nu} is singular with lambda = {}; use \
         lambda > 0 or a smaller nu",
        Rounded(*lambda)
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
    /// Invalid prediction model.
    #[error("prediction model: {0}")]
    Model(String),
    /// Unstable velocity or current loop.
    #[error("prediction model: the inner loops {0}")]
    UnstableInnerLoops(String),
    /// Pole of the closed loop on or outside the unit circle.
    #[error(
        "the closed loop is unstable: its pole {} has the modulus {}; it must be below 1 − 10⁻⁶",
        format_complex(*re, *im),
        format_modulus(*modulus)
    )]
    Unstable {
        /// Real part.
        re: f64,
        /// Imaginary part.
        im: f64,
        /// Modulus.
        modulus: f64,
    },
    /// Poles of the closed loop that cannot be computed.
    #[error("the poles of the closed loop cannot be computed from these polynomials")]
    NoPoles,
    /// Desired pole on or outside the unit circle.
    #[error("the desired pole {} has the modulus {}; it must be below 1 − 10⁻⁶", format_complex(*re, *im), Rounded(*modulus))]
    PoleOutside {
        /// Real part.
        re: f64,
        /// Imaginary part.
        im: f64,
        /// Modulus.
        modulus: f64,
    },
    /// Complex desired pole without its conjugate.
    #[error("the desired pole {} must come with its conjugate {}", format_complex(*re, *im), format_complex(*re, -im))]
    NoConjugate {
        /// Real part.
        re: f64,
        /// Imaginary part.
        im: f64,
    },
    /// Common root of A and B, which no controller can move.
    #[error(
        "poles cannot be placed: A and B of the prediction model share the root {} or nearly so",
        format_complex(*re, *im)
    )]
    SharedRoot {
        /// Real part.
        re: f64,
        /// Imaginary part.
        im: f64,
    },
    /// Filters of iterative learning control that do not reduce the error at every frequency.
    #[error(
        "the learning does not converge: |Q (1 − L T)| is {} at {frequency:.1} Hz with a bandwidth of {} Hz and a \
         learning gain of {}; it must be below 1 at every frequency; reduce the bandwidth or the learning gain",
        Rounded(*factor), Rounded(*bandwidth), Rounded(*gain)
    )]
    NotContracting {
        /// Largest |Q (1 − L T)|.
        factor: f64,
        /// Its frequency, Hz.
        frequency: f64,
        /// Bandwidth of Q, Hz.
        bandwidth: f64,
        /// Learning gain.
        gain: f64,
    },
    /// Closed loop whose impulse response does not end.
    #[error(
        "the position has not settled {cycles} position cycles after an impulse of the setpoint; it must settle"
    )]
    NotSettling {
        /// Position cycles that were computed.
        cycles: usize,
    },
    /// Designed polynomials that do not form a controller.
    #[error(transparent)]
    Rst(#[from] RstError),
}

/// Formats a complex number for messages.
fn format_modulus(modulus: f64) -> String {
    // Near 1, the digits show the distance to the limit.
    const LARGE: f64 = 10.0;
    if modulus < LARGE { format!("{modulus:.9}") } else { Rounded(modulus).to_string() }
}

fn format_complex(re: f64, im: f64) -> String {
    // Larger numbers are printed with an exponent.
    const LARGE: f64 = 1e6;
    if re.abs() > LARGE || im.abs() > LARGE {
        return format!("{} {} {}j", Rounded(re), if im < 0.0 { '−' } else { '+' }, Rounded(im.abs()));
    }
    if im == 0.0 {
        return format!("{re:.6}");
    }
    format!("{re:.6} {} {:.6}j", if im < 0.0 { '−' } else { '+' }, im.abs())
}
