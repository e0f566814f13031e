//! Linear position controllers in RST form.

use crate::config::{MAX_HORIZON, RST_TERMS};
use crate::units::Told;

/// Most coefficients of R and of S.
pub const MAX_COEFFICIENTS: usize = RST_TERMS;
/// Furthest setpoint that T may read, in position periods ahead (and, of its first, behind).
pub const MAX_PREVIEW: i64 = MAX_HORIZON;
/// Largest coefficient, relative to s₀: as large as a gain may be.
const MAX_COEFFICIENT: f64 = 1e9;
/// How far T(1) may be from R(1), relative: 35 nm over a stroke of 350 mm.
const GAIN_TOLERANCE: f64 = 1e-7;
/// |S(1)| up to which S contains the factor 1 − q⁻¹, relative to the sum of its |sᵢ|.
pub(crate) const INTEGRATOR_TOLERANCE: f64 = 1e-9;

/// Why three polynomials are no position controller.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RstError {
    /// A polynomial without coefficients, or with too many.
    #[error("{polynomial} has {count} coefficients; it must have 1 … {max}")]
    Count {
        /// r, s or t.
        polynomial: &'static str,
        /// How many there are.
        count: usize,
        /// How many there may be.
        max: usize,
    },
    /// A coefficient that is not finite.
    #[error("{polynomial}[{index}] = {value} is not finite")]
    NotFinite {
        /// r, s or t.
        polynomial: &'static str,
        /// Place, from 0.
        index: usize,
        /// What stands there.
        value: f64,
    },
    /// A coefficient that is too large relative to s₀.
    #[error("{polynomial}[{index}] is {value:e} times s[0]; it must be at most {max:e} times", max = MAX_COEFFICIENT)]
    TooLarge {
        /// r, s or t.
        polynomial: &'static str,
        /// Place, from 0.
        index: usize,
        /// Coefficient divided by s₀.
        value: f64,
    },
    /// S cannot be solved for Ω*(k).
    #[error("s[0] = 0; it must not be zero, since Ω* is divided by it")]
    LeadingZero,
    /// T reads setpoints too far ahead or behind.
    #[error("t reads setpoints {first} … {last} periods ahead; it may read -{max} … {max}", max = MAX_PREVIEW)]
    Preview {
        /// Exponent of the first coefficient.
        first: i64,
        /// Exponent of the last one.
        last: i64,
    },
    /// The axis would not go where it is told to.
    #[error(
        "T(1) = {} and R(1) = {} differ; they must be equal, or the axis does not go where it is told to",
        Told(*t), Told(*r)
    )]
    Gain {
        /// T(1).
        t: f64,
        /// R(1).
        r: f64,
    },
    /// The position is not controlled.
    #[error("R(1) = 0; it must not be zero, or nothing holds the position")]
    NoGain,
}

/// A linear position controller in RST form (Prévost eq. 9).
///
/// ```text
/// S(q⁻¹) Ω*(k) = −R(q⁻¹) θ(k) + T(q) θ*(k)          T(1) = R(1)
/// ```
///
/// R and S are in rising powers of q⁻¹, T in rising powers of q from `q^t_first` on: a T with positive
/// powers reads setpoints ahead. Units of the motor: θ and θ* in rad, Ω* in rad/s; S is scaled so that
/// s₀ = 1, then R and T are in s⁻¹.
#[derive(Debug, Clone, PartialEq)]
pub struct Rst {
    r: Vec<f64>,
    s: Vec<f64>,
    t: Vec<f64>,
    t_first: i64,
}

impl Rst {
    /// The controller with these coefficients; `t_first` is the exponent of q of `t[0]`.
    ///
    /// # Errors
    /// [`RstError`].
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

    /// The proportional controller `Ω* = Kp (θ* − θ)` with `gain` Kp, s⁻¹.
    ///
    /// # Errors
    /// [`RstError`] for a gain that is 0, too large or not finite.
    pub fn proportional(gain: f64) -> Result<Self, RstError> {
        Rst::new(&[gain], &[1.0], &[gain], 0)
    }

    /// R, in rising powers of q⁻¹, s⁻¹.
    pub fn r(&self) -> &[f64] {
        &self.r
    }

    /// S, in rising powers of q⁻¹; the first is 1.
    pub fn s(&self) -> &[f64] {
        &self.s
    }

    /// T, in rising powers of q from [`t_first`](Self::t_first) on, s⁻¹.
    pub fn t(&self) -> &[f64] {
        &self.t
    }

    /// Exponent of q of the first coefficient of T.
    pub fn t_first(&self) -> i64 {
        self.t_first
    }

    /// The furthest setpoint that T reads, position periods ahead; not below 0.
    pub fn preview(&self) -> i64 {
        (self.t_first + self.t.len() as i64 - 1).max(0)
    }

    /// The oldest setpoint that T reads, position periods back; not below 0.
    pub fn lookback(&self) -> i64 {
        (-self.t_first).max(0)
    }

    /// Whether S contains the factor 1 − q⁻¹.
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
