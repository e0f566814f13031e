//! The friction law from constant velocities (Prévost section 3.3, eq. 3, fig. 5).

use nalgebra::{DMatrix, DVector};

use super::fit::{Bounded, Effort, Minimum, determination, linear, minimize};
use super::gravity::Level;
use crate::recording::Finding;
use virtual_axes_core::config::{AxisConfig, AxisKind, FrictionConfig};
use virtual_axes_core::units::{METER_PER_MINUTE, RPM};

/// Speeds that a law of four parameters asks for: two more than it has parameters.
pub const SPEEDS_OF_DOUBLE_EXPONENTIAL: usize = 6;
/// Fastest over slowest speed that a law of four parameters asks for.
const SPREAD_OF_DOUBLE_EXPONENTIAL: f64 = 5.0;
/// Bounds of b and d, min/m or min/rev. The slow part rises by less than e² over the range of the paper's law,
/// the fast one falls to a third within 10 m/min at least and within 0.1 m/min at most.
const SLOW: (f64, f64) = (-0.05, 0.1);
const FAST: (f64, f64) = (-10.0, -0.1);
/// Starts of b and d.
const SLOW_STARTS: [f64; 2] = [0.005, 0.04];
const FAST_STARTS: [f64; 4] = [-0.15, -0.4, -1.0, -3.0];
/// Step of the difference quotients, part of a parameter's range.
const STEP: f64 = 1e-6;
/// b with which a straight line is written in the form of eq. 3, min/m or min/rev: `i0 cosh(bV) + s/b sinh(bV)`
/// differs from `i0 + sV` by less than 2 parts in 10⁴ up to 20 m/min.
pub(super) const STRAIGHT: f64 = 1e-3;
/// R² below which a law does not describe what was measured.
pub const LEAST_DETERMINATION: f64 = 0.95;
/// Difference between directions, part of the friction, beyond which it is told.
const ASYMMETRIC: f64 = 0.05;

/// Which law.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FrictionLaw {
    /// `a e^{bV} + c e^{dV}` (Prévost eq. 3).
    DoubleExponential,
    /// Coulomb level and viscous slope, `i0 + s V`; written in the form of eq. 3.
    Linear,
}

/// Where i0 comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Breakaway {
    /// i0 = a + c.
    #[default]
    Held,
    /// i0 is refined by itself, on starts and reversals of the closed loop.
    Freed,
}

/// A friction law that was fitted to levels.
#[derive(Debug, Clone, PartialEq)]
pub struct LawFit {
    /// Which law.
    pub law: FrictionLaw,
    /// Its parameters; V in m/min or rev/min.
    pub config: FrictionConfig,
    /// Standard errors of a, b, c, d; NaN for a law that has them not.
    pub errors: [f64; 4],
    /// R² over speeds and directions.
    pub determination: f64,
    covariance: DMatrix<f64>,
}

/// Friction of an axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Friction {
    /// One law for both directions, odd in V.
    pub law: LawFit,
    /// By direction, towards plus and towards minus, where each has speeds enough.
    pub directions: [Option<LawFit>; 2],
    /// Largest difference between the directions, part of their mean; NaN where only one was moved in.
    pub asymmetry: f64,
}

/// Unit of V, m/s or rad/s.
pub(super) fn speed_unit(axis: &AxisConfig) -> f64 {
    match axis.kind() {
        AxisKind::Linear => METER_PER_MINUTE,
        AxisKind::Rotary => RPM,
    }
}

/// Name of the unit of V.
pub(super) fn speed_name(axis: &AxisConfig) -> &'static str {
    match axis.kind() {
        AxisKind::Linear => "m/min",
        AxisKind::Rotary => "rpm",
    }
}

impl LawFit {
    /// Friction current at V (m/min or rev/min, its sign the current's), A.
    pub fn at(&self, v: f64) -> f64 {
        current(&self.config, v)
    }

    /// Standard error of that current, A.
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

    /// Coulomb level (A) and viscous slope (A per m/min or rev/min) of a linear law.
    pub fn line(&self) -> Option<(f64, f64)> {
        let FrictionConfig { a, b, c, .. } = self.config;
        (self.law == FrictionLaw::Linear).then_some((a + c, (a - c) * b))
    }
}

/// (Prévost eq. 3), A; V in m/min or rev/min.
pub(super) fn current(law: &FrictionConfig, v: f64) -> f64 {
    let speed = v.abs();
    let magnitude = law.a * (law.b * speed).exp() + law.c * (law.d * speed).exp();
    if v == 0.0 { 0.0 } else { magnitude.copysign(v) }
}

/// A point of the law: |V| and friction current against the motion. Each speed and direction counts alike: what
/// keeps them off the law is more than the noise of their means.
type Point = (f64, f64);

/// The friction law of `levels`, with what must be said about it; none without speeds enough.
pub fn friction(levels: &[Level], axis: &AxisConfig, findings: &mut Vec<Finding>) -> Option<Friction> {
    let unit = speed_unit(axis);
    let of = |directions: &[f64]| -> Vec<Point> {
        let chosen = levels.iter().filter(|l| directions.contains(&l.velocity.signum()));
        chosen.map(|l| (l.velocity.abs() / unit, l.friction * l.velocity.signum())).collect()
    };
    let both = of(&[-1.0, 1.0]);
    let mut speeds: Vec<f64> = both.iter().map(|point| point.0).collect();
    speeds.sort_by(f64::total_cmp);
    speeds.dedup_by(|next, kept| *next - *kept < 0.03 * *kept);
    let (name, list) = (speed_name(axis), texts(&speeds));
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
            None => "no friction law: the axis never moves at constant velocity".to_owned(),
            Some(only) => format!("no friction law: 1 speed at constant velocity ({only:.3} {name})"),
        });
        findings.push(Finding::missing("few-speeds", what, remedy));
        return None;
    }
    let spread = speeds.last().zip(speeds.first()).map_or(0.0, |(last, first)| last / first);
    let rich = speeds.len() >= SPEEDS_OF_DOUBLE_EXPONENTIAL && spread >= SPREAD_OF_DOUBLE_EXPONENTIAL;
    let fit = |points: &[Point]| if rich { double_exponential(points) } else { straight(points) };
    if !rich {
        let (what, remedy) = missing(format!(
            "the law of four parameters is not fitted to {} speeds ({list} {name}): a Coulomb level and a viscous \
             slope are",
            speeds.len()
        ));
        findings.push(Finding::warning("few-speeds", what, remedy));
    }
    let law = fit(&both)?;
    told_bounds(&law, findings);
    if law.determination < LEAST_DETERMINATION {
        findings.push(Finding::warning(
            "poor-friction-law",
            format!("the friction law explains {:.1} % of what was measured", 100.0 * law.determination),
            "look at its picture; a friction that depends on position or temperature asks for longer and more \
             even recordings",
        ));
    }
    let (plus, minus) = (of(&[1.0]), of(&[-1.0]));
    let asymmetry = asymmetry(&plus, &minus);
    if asymmetry.is_nan() {
        findings.push(Finding::warning(
            "one-direction",
            "constant velocities in one direction only: friction and gravity cannot be told apart",
            "record each speed in both directions",
        ));
    } else if asymmetry > ASYMMETRIC {
        findings.push(Finding::note(
            "asymmetric-friction",
            format!(
                "friction differs between the directions by up to {:.1} %; the law of the model is their mean",
                100.0 * asymmetry
            ),
        ));
    }
    Some(Friction { directions: [fit(&plus), fit(&minus)], law, asymmetry })
}

fn texts(speeds: &[f64]) -> String {
    speeds.iter().map(|v| format!("{v:.3}")).collect::<Vec<_>>().join(", ")
}

/// Largest |f₊ − f₋| / mean of speeds that both have.
fn asymmetry(plus: &[Point], minus: &[Point]) -> f64 {
    let pairs = plus.iter().filter_map(|p| {
        let m = minus.iter().min_by(|a, b| (a.0 - p.0).abs().total_cmp(&(b.0 - p.0).abs()))?;
        ((m.0 - p.0).abs() < 0.05 * p.0).then(|| 2.0 * (p.1 - m.1).abs() / (p.1 + m.1).abs())
    });
    pairs.fold(f64::NAN, f64::max)
}

/// `level + slope V` in the form of eq. 3.
pub(super) fn straight_law(level: f64, slope: f64) -> FrictionConfig {
    let (a, c) = ((level + slope / STRAIGHT) / 2.0, (level - slope / STRAIGHT) / 2.0);
    FrictionConfig { a, b: STRAIGHT, c, d: -STRAIGHT, i0: level }
}

fn straight(points: &[Point]) -> Option<LawFit> {
    let fit = linear(points.iter().map(|&(v, current)| (vec![1.0, v], current, 1.0)))?;
    let (level, slope) = (fit.values[0], fit.values[1]);
    // Friction does not drive, also where a line through fast speeds meets standstill below zero.
    (level > 0.0).then(|| LawFit {
        law: FrictionLaw::Linear,
        config: straight_law(level, slope),
        errors: [f64::NAN; 4],
        determination: determination(points.iter().map(|p| (p.1, level + slope * p.0))),
        covariance: fit.covariance,
    })
}

fn double_exponential(points: &[Point]) -> Option<LawFit> {
    let most = points.iter().map(|p| p.1.abs()).fold(f64::MIN_POSITIVE, f64::max);
    let starts = SLOW_STARTS.iter().flat_map(|b| FAST_STARTS.iter().map(move |d| (*b, *d)));
    let found = starts.filter_map(|(b, d)| from(points, b, d, most));
    let best = found.min_by(|x, y| x.squares.total_cmp(&y.squares))?;
    let [a, b, c, d] = *best.values else { return None };
    let config = FrictionConfig { a, b, c, d, i0: (a + c).max(0.0) };
    Some(LawFit {
        law: FrictionLaw::DoubleExponential,
        config,
        errors: [0, 1, 2, 3].map(|k| best.error(k)),
        determination: determination(points.iter().map(|p| (p.1, current(&config, p.0)))),
        covariance: best.covariance,
    })
}

/// A fit of a, b, c, d from one start of the exponents.
fn from(points: &[Point], b: f64, d: f64, most: f64) -> Option<Minimum> {
    let amplitudes =
        linear(points.iter().map(|&(v, current)| (vec![(b * v).exp(), (d * v).exp()], current, 1.0)))?;
    // Amplitudes: friction does not exceed a few times what was measured; a + c ≥ 0 is kept by bounding the
    // sum, not c.
    let (low, high) = (0.0, 3.0 * most);
    let bounded = |start: f64, low: f64, high: f64| Bounded { start, low, high, step: STEP * (high - low) };
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
        let left = points.iter().map(|&(v, measured)| current(&law, v) - measured);
        Some(DVector::from_iterator(points.len(), left))
    })?;
    // From a + c back to c.
    let mut back = DMatrix::identity(4, 4);
    back[(2, 0)] = -1.0;
    fit.values[2] -= fit.values[0];
    fit.covariance = &back * fit.covariance * back.transpose();
    Some(fit)
}

fn told_bounds(law: &LawFit, findings: &mut Vec<Finding>) {
    if law.law != FrictionLaw::DoubleExponential {
        return;
    }
    for (name, value, (low, high)) in [("b", law.config.b, SLOW), ("d", law.config.d, FAST)] {
        if (value - low).min(high - value) < 1e-3 * (high - low) {
            findings.push(Finding::warning(
                "at-bound",
                format!("friction.{name} ends at its bound, {value:.4} of {low} … {high}"),
                "record more speeds, slow ones for d and fast ones for b; within the speeds recorded the law holds",
            ));
        }
    }
}
