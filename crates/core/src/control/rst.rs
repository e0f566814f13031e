//! Linear position controllers in RST form.

use crate::config::{MAX_HORIZON, MAX_RST_TERMS};
use crate::units::Rounded;

/// Largest number of coefficients of R and of S.
pub const MAX_COEFFICIENTS: usize = MAX_RST_TERMS;
/// Largest preview and lookback of T, position cycles.
pub const MAX_PREVIEW: i64 = MAX_HORIZON;
/// Largest |coefficient|, relative to s₀; equal to the largest allowed gain.
const MAX_COEFFICIENT: f64 = 1e9;
/// Largest relative difference of T(1) and R(1): 35 nm over a travel of 350 mm.
const GAIN_TOLERANCE: f64 = 1e-7;
/// |S(1)|, relative to Σ |sᵢ|, up to which S contains the factor 1 − q⁻¹.
pub(crate) const INTEGRATOR_TOLERANCE: f64 = 1e-9;

/// Error of three polynomials that do not form a position controller.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RstError {
    /// Number of coefficients out of range.
    #[error("{polynomial} has {count} coefficients; it must have 1 … {max}")]
    Count {
        /// Name of the polynomial: r, s or t.
        polynomial: &'static str,
        /// Number of coefficients.
        count: usize,
        /// Largest allowed number.
        max: usize,
    },
    /// Coefficient that is not finite.
    #[error("{polynomial}[{index}] = {value} is not finite")]
    NotFinite {
        /// Name of the polynomial: r, s or t.
        polynomial: &'static str,
        /// Index of the coefficient, from 0.
        index: usize,
        /// Coefficient.
        value: f64,
    },
    /// Coefficient that is too large relative to s₀.
    #[error(
        "{polynomial}[{index}] is {} times s[0]; it must be at most {max:e} times",
        Rounded(*value), max = MAX_COEFFICIENT
    )]
    TooLarge {
        /// Name of the polynomial: r, s or t.
        polynomial: &'static str,
        /// Index of the coefficient, from 0.
        index: usize,
        /// Coefficient divided by s₀.
        value: f64,
    },
    /// s₀ = 0, by which Ω*(k) is divided.
    #[error("s[0] = 0; it must not be 0, since Ω* is divided by it")]
    LeadingZero,
    /// Preview or lookback of T beyond the allowed range.
    #[error("t reads setpoints {first} … {last} position cycles ahead; allowed are -{max} … {max}", max = MAX_PREVIEW)]
    Preview {
        /// Exponent of the first coefficient.
        first: i64,
        /// Exponent of the last coefficient.
        last: i64,
    },
    /// Static gain other than 1: T(1) ≠ R(1).
    #[error(
        "T(1) = {} and R(1) = {} differ; they must be equal, or the axis does not reach its setpoint",
        Rounded(*t), Rounded(*r)
    )]
    Gain {
        /// T(1).
        t: f64,
        /// R(1).
        r: f64,
    },
    /// R(1) = 0: no position feedback at standstill.
    #[error("R(1) = 0; it must not be 0, or the position is not controlled")]
    NoGain,
}

/// Linear position controller in RST form (Prévost eq. 9).
///
/// ```text
/// S(q⁻¹) Ω*(k) = −R(q⁻¹) θ(k) + T(q) θ*(k)          T(1) = R(1)
/// ```
///
/// R and S are in rising powers of q⁻¹, T in rising powers of q from `q^t_first` on; positive powers read future
/// setpoints (preview). Units are those of the motor: θ and θ* in rad, Ω* in rad/s. S is scaled to s₀ = 1; R and T are
/// in s⁻¹ then.
#[derive(Debug, Clone, PartialEq)]
pub struct Rst {
    r: Vec<f64>,
    s: Vec<f64>,
    t: Vec<f64>,
    t_first: i64,
}

impl Rst {
    /// Creates a controller from its coefficients; `t_first` is the exponent of q of `t[0]`.
    ///
    /// # Errors
    /// [`RstError`] if a number of coefficients, a coefficient or an exponent is out of range, or if R(1) = 0 or
    /// T(1) ≠ R(1).
    pub fn new(r: &[f64], s: &[f64], t: &[f64], t_first: i64) -> Result<Self, RstError> {
        check_polynomial("r", r, MAX_COEFFICIENTS)?;
        check_polynomial("s", s, MAX_COEFFICIENTS)?;
        check_polynomial("t", t, 2 * MAX_PREVIEW as usize + 1)?;
        let leading = s[0];
        if leading == 0.0 {
            return Err(RstError::LeadingZero);
        }
        let last = t_first.saturating_add(t.len() as i64 - 1);
        if t_first < -MAX_PREVIEW || last > MAX_PREVIEW {
            return Err(RstError::Preview { first: t_first, last });
        }
        for (polynomial, coefficients) in [("r", r), ("s", s), ("t", t)] {
            let ratio = |c: &f64| c / leading;
            if let Some(index) = coefficients.iter().position(|c| ratio(c).abs() > MAX_COEFFICIENT) {
                return Err(RstError::TooLarge { polynomial, index, value: ratio(&coefficients[index]) });
            }
        }
        let (r_gain, t_gain) = (r.iter().sum::<f64>(), t.iter().sum::<f64>());
        let scale = r.iter().map(|c| c.abs()).sum::<f64>();
        if r_gain.abs() <= INTEGRATOR_TOLERANCE * scale {
            return Err(RstError::NoGain);
        }
        if (t_gain - r_gain).abs() > GAIN_TOLERANCE * r_gain.abs() {
            return Err(RstError::Gain { t: t_gain, r: r_gain });
        }
        let scaled = |polynomial: &[f64]| polynomial.iter().map(|c| c / leading).collect();
        Ok(Rst { r: scaled(r), s: scaled(s), t: scaled(t), t_first })
    }

    /// Creates the proportional controller `Ω* = Kp (θ* − θ)` with `gain` Kp, s⁻¹.
    ///
    /// # Errors
    /// [`RstError`] for a gain that is 0, too large or not finite.
    pub fn proportional(gain: f64) -> Result<Self, RstError> {
        Rst::new(&[gain], &[1.0], &[gain], 0)
    }

    /// Returns R, in rising powers of q⁻¹, s⁻¹.
    pub fn r(&self) -> &[f64] {
        &self.r
    }

    /// Returns S, in rising powers of q⁻¹; the first coefficient is 1.
    pub fn s(&self) -> &[f64] {
        &self.s
    }

    /// Returns T, in rising powers of q from [`t_first`](Self::t_first) on, s⁻¹.
    pub fn t(&self) -> &[f64] {
        &self.t
    }

    /// Returns the exponent of q of the first coefficient of T.
    pub fn t_first(&self) -> i64 {
        self.t_first
    }

    /// Returns the preview of T: furthest setpoint ahead, position cycles, at least 0.
    pub fn preview(&self) -> i64 {
        (self.t_first + self.t.len() as i64 - 1).max(0)
    }

    /// Returns the lookback of T: oldest setpoint, position cycles back, at least 0.
    pub fn lookback(&self) -> i64 {
        (-self.t_first).max(0)
    }

    /// Returns true if S contains the factor 1 − q⁻¹.
    pub fn has_integral_action(&self) -> bool {
        let scale: f64 = self.s.iter().map(|c| c.abs()).sum();
        self.s.iter().sum::<f64>().abs() <= INTEGRATOR_TOLERANCE * scale
    }
}

fn check_polynomial(polynomial: &'static str, coefficients: &[f64], max: usize) -> Result<(), RstError> {
    let count = coefficients.len();
    if count == 0 || count > max {
        return Err(RstError::Count { polynomial, count, max });
    }
    match coefficients.iter().position(|c| !c.is_finite()) {
        Some(index) => Err(RstError::NotFinite { polynomial, index, value: coefficients[index] }),
        None => Ok(()),
    }
}
