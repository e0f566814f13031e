//! Identification of the friction law from constant velocities (Prévost section 3.3, eq. 3, fig. 5).

use nalgebra::{DMatrix, DVector};
use serde::Serialize;

use super::fit::{BoundedParameter, Effort, NonlinearFit, fit_linear, minimize, r_squared};
use super::gravity::SteadyCurrent;
use crate::recording::Finding;
use virtual_axes_core::config::{AxisConfig, FrictionConfig};

/// Fewest speeds for the law of four parameters: two more than it has parameters.
pub const SPEEDS_OF_DOUBLE_EXPONENTIAL: usize = 6;
/// Smallest ratio of fastest to slowest speed for the law of four parameters.
const SPREAD_OF_DOUBLE_EXPONENTIAL: f64 = 5.0;
/// Bounds of b and d, min/m or min/rev. The slow part rises by less than e² over the range of the paper; the
/// fast part falls to a third within 0.1 … 10 m/min.
const SLOW: (f64, f64) = (-0.05, 0.1);
const FAST: (f64, f64) = (-10.0, -0.1);
/// Start values of b and d.
const SLOW_STARTS: [f64; 2] = [0.005, 0.04];
const FAST_STARTS: [f64; 4] = [-0.15, -0.4, -1.0, -3.0];
/// Step of the difference quotients, relative to the range of a parameter.
const STEP: f64 = 1e-6;
/// Exponent b of a straight line in the form of eq. 3, min/m or min/rev: `i0 cosh(bV) + s/b sinh(bV)` differs
/// from `i0 + sV` by less than 2 parts in 10⁴ up to 20 m/min.
pub(super) const LINEAR_EXPONENT: f64 = 1e-3;
/// R² below which a law does not describe the measurement.
pub const LEAST_DETERMINATION: f64 = 0.95;
/// Relative difference between directions above which a finding is reported.
const ASYMMETRIC: f64 = 0.05;

/// Form of the friction law.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum FrictionLaw {
    /// `a e^{bV} + c e^{dV}` (Prévost eq. 3).
    DoubleExponential,
    /// Coulomb level and viscous slope, `i0 + s V`, in the form of eq. 3.
    Linear,
}

/// Source of the breakaway current i0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Breakaway {
    /// Fixed to i0 = a + c.
    #[default]
    Held,
    /// Refined as a separate parameter on starts and reversals of the closed loop.
    Freed,
}

/// Friction law fitted to steady currents.
#[derive(Debug, Clone, PartialEq)]
pub struct LawFit {
    /// Form of the law.
    pub law: FrictionLaw,
    /// Parameters of the law; V in m/min or rev/min.
    pub config: FrictionConfig,
    /// Standard errors of a, b, c, d; NaN for a linear law.
    pub errors: [f64; 4],
    /// Coefficient of determination R² over speeds and directions.
    pub r_squared: f64,
    covariance: DMatrix<f64>,
}

/// Identified friction of an axis.
#[derive(Debug, Clone, PartialEq)]
pub struct FrictionFit {
    /// Law for both directions, odd in V.
    pub law: LawFit,
    /// Laws of the positive and negative direction; none without enough speeds.
    pub directions: [Option<LawFit>; 2],
    /// Largest difference between the directions relative to their mean; NaN with one direction only.
    pub asymmetry: f64,
}

impl LawFit {
    /// Creates a law with the standard errors and the covariance of a, b, c, d.
    pub(super) fn new(
        law: FrictionLaw,
        config: FrictionConfig,
        errors: [f64; 4],
        r_squared: f64,
        covariance: DMatrix<f64>,
    ) -> Self {
        LawFit { law, config, errors, r_squared, covariance }
    }

    /// Returns the law with the standard errors and the covariance of `other`.
    pub(super) fn with_errors_of(self, other: &LawFit) -> Self {
        LawFit { errors: other.errors, covariance: other.covariance.clone(), ..self }
    }

    /// Returns the friction current at V (m/min or rev/min), A, with the sign of V.
    pub fn at(&self, v: f64) -> f64 {
        friction_current(&self.config, v)
    }

    /// Returns the standard error of the friction current at V, A.
    pub fn error_at(&self, v: f64) -> f64 {
        let (v, law) = (v.abs(), &self.config);
        let gradient = match self.law {
            FrictionLaw::Linear => DVector::from_vec(vec![1.0, v]),
            FrictionLaw::DoubleExponential => {
                let (slow, fast) = ((law.b * v).exp(), (law.d * v).exp());
                DVector::from_vec(vec![slow, law.a * v * slow, fast, law.c * v * fast])
            }
        };
        gradient.dot(&(&self.covariance * &gradient)).max(0.0).sqrt()
    }

    /// Returns Coulomb level (A) and viscous slope (A per m/min or rev/min) of a linear law.
    pub fn line(&self) -> Option<(f64, f64)> {
        let FrictionConfig { a, b, c, .. } = self.config;
        (self.law == FrictionLaw::Linear).then_some((a + c, (a - c) * b))
    }
}

/// Evaluates the friction law (Prévost eq. 3), A; V in m/min or rev/min.
pub(super) fn friction_current(law: &FrictionConfig, v: f64) -> f64 {
    let speed = v.abs();
    let magnitude = law.a * (law.b * speed).exp() + law.c * (law.d * speed).exp();
    if v == 0.0 { 0.0 } else { magnitude.copysign(v) }
}

/// Point of the law: |V| and friction current against the motion. All speeds and directions have the same
/// weight, since their deviation from the law exceeds the noise of their means.
type Point = (f64, f64);

/// Fits the friction law to `levels` and reports findings. Returns none with fewer than two speeds.
pub fn fit_friction(
    levels: &[SteadyCurrent],
    axis: &AxisConfig,
    findings: &mut Vec<Finding>,
) -> Option<FrictionFit> {
    let unit = axis.units().speed;
    let of = |directions: &[f64]| -> Vec<Point> {
        let chosen = levels.iter().filter(|l| directions.contains(&l.velocity.signum()));
        chosen.map(|l| (l.velocity.abs() / unit, l.friction * l.velocity.signum())).collect()
    };
    let both = of(&[-1.0, 1.0]);
    let mut speeds: Vec<f64> = both.iter().map(|point| point.0).collect();
    speeds.sort_by(f64::total_cmp);
    speeds.dedup_by(|next, kept| *next - *kept < 0.03 * *kept);
    let (name, list) = (axis.units().speed_name, join_speeds(&speeds));
    let missing = |what: String| {
        let top = 20.0_f64.min(axis.limits().velocity / unit);
        let remedy = format!(
            "record at least {SPEEDS_OF_DOUBLE_EXPONENTIAL} speeds between {:.3} and {top:.3} {name}, each in both \
             directions (`virtual_axes psec campaign`)",
            top / 200.0
        );
        (what, remedy)
    };
    if speeds.len() < 2 {
        let (what, remedy) = missing(match speeds.first() {
            None => "no friction law: the axis does not move at constant velocity".to_owned(),
            Some(only) => format!("no friction law: 1 speed at constant velocity ({only:.3} {name})"),
        });
        findings.push(Finding::missing("few-speeds", what, remedy));
        return None;
    }
    let spread = speeds.last().zip(speeds.first()).map_or(0.0, |(last, first)| last / first);
    let rich = speeds.len() >= SPEEDS_OF_DOUBLE_EXPONENTIAL && spread >= SPREAD_OF_DOUBLE_EXPONENTIAL;
    let fit = |points: &[Point]| if rich { fit_double_exponential(points) } else { fit_line(points) };
    if !rich {
        let (what, remedy) = missing(format!(
            "{} speeds ({list} {name}) are too few for the law of four parameters: Coulomb level and viscous slope \
             are fitted",
            speeds.len()
        ));
        findings.push(Finding::warning("few-speeds", what, remedy));
    }
    let law = fit(&both)?;
    let (plus, minus) = (of(&[1.0]), of(&[-1.0]));
    let asymmetry = asymmetry(&plus, &minus);
    report_law(&law, asymmetry, findings);
    Some(FrictionFit { directions: [fit(&plus), fit(&minus)], law, asymmetry })
}

/// Reports exponents at their bounds, a low R², and differences between the directions.
fn report_law(law: &LawFit, asymmetry: f64, findings: &mut Vec<Finding>) {
    report_bounds(law, findings);
    if law.r_squared < LEAST_DETERMINATION {
        findings.push(Finding::warning(
            "poor-friction-law",
            format!("the friction law explains {:.1} % of the measured variance", 100.0 * law.r_squared),
            "check the friction plot; friction that depends on position or temperature needs longer and more \
             uniform recordings",
        ));
    }
    if asymmetry.is_nan() {
        findings.push(Finding::warning(
            "one-direction",
            "constant velocities in one direction only: friction and gravity cannot be separated",
            "record each speed in both directions",
        ));
    } else if asymmetry > ASYMMETRIC {
        findings.push(Finding::note(
            "asymmetric-friction",
            format!(
                "friction differs between the directions by up to {:.1} %; the model uses the mean",
                100.0 * asymmetry
            ),
        ));
    }
}

fn join_speeds(speeds: &[f64]) -> String {
    speeds.iter().map(|v| format!("{v:.3}")).collect::<Vec<_>>().join(", ")
}

/// Returns the largest |f₊ − f₋| / mean over the speeds present in both directions.
fn asymmetry(plus: &[Point], minus: &[Point]) -> f64 {
    let pairs = plus.iter().filter_map(|p| {
        let m = minus.iter().min_by(|a, b| (a.0 - p.0).abs().total_cmp(&(b.0 - p.0).abs()))?;
        ((m.0 - p.0).abs() < 0.05 * p.0).then(|| 2.0 * (p.1 - m.1).abs() / (p.1 + m.1).abs())
    });
    pairs.fold(f64::NAN, f64::max)
}

/// Returns `level + slope V` in the form of eq. 3.
pub(super) fn linear_law(level: f64, slope: f64) -> FrictionConfig {
    let (a, c) = ((level + slope / LINEAR_EXPONENT) / 2.0, (level - slope / LINEAR_EXPONENT) / 2.0);
    FrictionConfig { a, b: LINEAR_EXPONENT, c, d: -LINEAR_EXPONENT, i0: level }
}

fn fit_line(points: &[Point]) -> Option<LawFit> {
    let fit = fit_linear(points.iter().map(|&(v, current)| (vec![1.0, v], current, 1.0)))?;
    let (level, slope) = (fit.values[0], fit.values[1]);
    // Friction is never negative, although a line through fast speeds can be negative at standstill.
    (level > 0.0).then(|| LawFit {
        law: FrictionLaw::Linear,
        config: linear_law(level, slope),
        errors: [f64::NAN; 4],
        r_squared: r_squared(points.iter().map(|p| (p.1, level + slope * p.0))),
        covariance: fit.covariance,
    })
}

fn fit_double_exponential(points: &[Point]) -> Option<LawFit> {
    let most = points.iter().map(|p| p.1.abs()).fold(f64::MIN_POSITIVE, f64::max);
    let starts = SLOW_STARTS.iter().flat_map(|b| FAST_STARTS.iter().map(move |d| (*b, *d)));
    let found = starts.filter_map(|(b, d)| fit_double_exponential_from(points, b, d, most));
    let best = found.min_by(|x, y| x.sum_of_squares.total_cmp(&y.sum_of_squares))?;
    let [a, b, c, d] = *best.values else { return None };
    let config = FrictionConfig { a, b, c, d, i0: (a + c).max(0.0) };
    Some(LawFit {
        law: FrictionLaw::DoubleExponential,
        config,
        errors: [0, 1, 2, 3].map(|k| best.error(k)),
        r_squared: r_squared(points.iter().map(|p| (p.1, friction_current(&config, p.0)))),
        covariance: best.covariance,
    })
}

/// Fits a, b, c, d from one start value of the exponents.
fn fit_double_exponential_from(points: &[Point], b: f64, d: f64, most: f64) -> Option<NonlinearFit> {
    let amplitudes =
        fit_linear(points.iter().map(|&(v, current)| (vec![(b * v).exp(), (d * v).exp()], current, 1.0)))?;
    // Bounds of the amplitudes: friction is at most three times the measured maximum; bounding the sum keeps
    // a + c ≥ 0.
    let (low, high) = (0.0, 3.0 * most);
    let bounded =
        |start: f64, low: f64, high: f64| BoundedParameter { start, low, high, step: STEP * (high - low) };
    let (a, sum) = (amplitudes.values[0], amplitudes.values[0] + amplitudes.values[1]);
    let parameters = [
        bounded(a, low, high),
        bounded(b, SLOW.0, SLOW.1),
        bounded(sum, low, high),
        bounded(d, FAST.0, FAST.1),
    ];
    let mut fit = minimize(&parameters, Effort::Formula, |x| {
        let [a, b, sum, d] = *x else { return None };
        let law = FrictionConfig { a, b, c: sum - a, d, i0: sum };
        let left = points.iter().map(|&(v, measured)| friction_current(&law, v) - measured);
        Some(DVector::from_iterator(points.len(), left))
    })?;
    // Transforms from a + c back to c.
    let mut back = DMatrix::identity(4, 4);
    back[(2, 0)] = -1.0;
    fit.values[2] -= fit.values[0];
    fit.covariance = &back * fit.covariance * back.transpose();
    Some(fit)
}

fn report_bounds(law: &LawFit, findings: &mut Vec<Finding>) {
    if law.law != FrictionLaw::DoubleExponential {
        return;
    }
    for (name, value, (low, high)) in [("b", law.config.b, SLOW), ("d", law.config.d, FAST)] {
        if (value - low).min(high - value) < 1e-3 * (high - low) {
            findings.push(Finding::warning(
                "at-bound",
                format!("friction.{name} ends at its bound: {value:.4}, permitted {low} … {high}"),
                "record more speeds, slow ones for d and fast ones for b; the law is valid within the recorded speeds",
            ));
        }
    }
}
