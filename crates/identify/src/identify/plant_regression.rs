//! Inertia, friction and gravity from motion without phases of constant velocity, by regression of the current.
//!
//! `i = Jeq a / (Kt r) + s f(|V|) + C_gravity / Kt` (Prévost eqs. 1 to 3) over all samples in motion. The friction law is
//! parametrized such that a + c ≥ 0 and d < b always hold.

use nalgebra::{DMatrix, DVector};

use super::covariance::clustered_covariance;
use super::fit::{BoundedParameter, Effort, minimize, r_squared};
use super::friction::{FrictionFit, FrictionLaw, LawFit, friction_current, speed_unit};
use super::gravity::{GravityCurrent, GravityFit, GravitySource};
use super::inertia::InertiaFit;
use super::resample::CubicSpline;
use crate::recording::{SignalSpan, Signals};
use virtual_axes_core::config::{AxisConfig, FrictionConfig};
use virtual_axes_core::drive::Gravity;
use virtual_axes_core::statistics::quantile;
use virtual_axes_core::units::MILLIMETER;

/// Longest step of the friction current before it is filtered like the current, s.
const FINE: f64 = 2e-3;
/// Speed below which the direction of the friction is uncertain, m/s or rad/s.
const SLOWEST: f64 = 2.0 * MILLIMETER;
/// Speed at standstill relative to that: less than the steps of an encoder.
const STANDING: f64 = 0.1;
/// Fewest samples at standstill.
const FEWEST_STILL: usize = 10;
/// Standard deviations of the filter within which the axis must be faster than that.
const REACH: f64 = 3.0;
/// Fewest samples and moves.
const FEWEST_SAMPLES: usize = 30;
const FEWEST_MOVES: usize = 4;
/// Center and standard deviation of the weak prior of the shape: −c / a, b in min/m, ln(−d m/min); the axes of Prévost
/// Appendix 2 lie within it. Data of a few moves outweigh it.
const SHAPE: [(f64, f64); 3] = [(0.35, 0.2), (0.016, 0.01), (-1.1, 0.5)];
/// Bounds of the shape.
const SHAPE_BOUNDS: [(f64, f64); 3] = [(-1.0, 0.98), (0.0, 0.08), (-2.9, 1.5)];
/// Noise of the current, relative to the largest, that the prior is weighted with.
const NOISE: f64 = 0.01;
/// Correlation above which two parameters are reported as collinear.
const COLLINEAR: f64 = 0.95;

/// Result of the regression.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct PlantRegression {
    /// Inertia with clustered standard error.
    pub inertia: InertiaFit,
    /// Friction law.
    pub friction: FrictionFit,
    /// Gravity current with clustered standard error.
    pub gravity: GravityFit,
    /// Coefficient of determination R² over the samples in motion.
    pub r_squared: f64,
    /// Pairs of collinear parameters with their correlation.
    pub collinear: Vec<(&'static str, &'static str, f64)>,
}

/// Names of the parameters in messages.
const NAMES: [&str; 6] = ["inertia", "gravity", "friction.a", "friction.c", "friction.b", "friction.d"];

/// One sample in motion.
struct Sample {
    acceleration: f64,
    current: f64,
    /// Range of the fine speeds around the sample, with the first index, and the filter weights of these.
    from: usize,
    /// Number of the move.
    cluster: usize,
    span: usize,
    /// Index in the span.
    index: usize,
}

/// Samples in motion of all recordings.
struct MovingData {
    samples: Vec<Sample>,
    /// Fine velocities of each span, m/min or rev/min.
    speeds: Vec<Vec<f64>>,
    /// Weights of a filter window, from its first fine sample on.
    weights: Vec<f64>,
    moves: usize,
    /// Filtered currents at standstill, A.
    still: Vec<f64>,
}

impl MovingData {
    fn new(recordings: &[&Signals], axis: &AxisConfig) -> Option<Self> {
        let mut data = MovingData {
            samples: Vec::new(),
            speeds: Vec::new(),
            weights: Vec::new(),
            moves: 0,
            still: Vec::new(),
        };
        let first = recordings.first()?;
        let steps = (first.period / FINE).ceil().max(1.0) as usize;
        let fine = first.period / steps as f64;
        let sigma = crate::recording::deviation(first.cutoff) / fine;
        let radius = (REACH * sigma).ceil() as usize;
        let gauss = |k: usize| (-0.5 * ((k as f64 - radius as f64) / sigma).powi(2)).exp();
        let sum: f64 = (0..=2 * radius).map(gauss).sum();
        data.weights = (0..=2 * radius).map(|k| gauss(k) / sum).collect();
        for signals in recordings {
            for span in &signals.spans {
                data.add(span, signals.period, steps, axis);
            }
        }
        (data.samples.len() >= FEWEST_SAMPLES && data.moves >= FEWEST_MOVES).then_some(data)
    }

    fn add(&mut self, span: &SignalSpan, period: f64, steps: usize, axis: &AxisConfig) {
        let (Some(current), Some(raw)) = (&span.smooth_current, &span.current) else { return };
        let unit = speed_unit(axis);
        let spline = CubicSpline::new(&span.position, period);
        let fine = period / steps as f64;
        let count = (span.position.len().saturating_sub(1)) * steps + 1;
        let speeds: Vec<f64> = (0..count).map(|k| spline.at(k as f64 * fine)[1] / unit).collect();
        let (radius, slowest) = (self.weights.len() / 2, SLOWEST / unit);
        let limit = super::inertia::SATURATED * axis.motor.max_current;
        let mut moving = 0.0;
        for i in 0..span.position.len() {
            let window = (i * steps)
                .checked_sub(radius)
                .and_then(|from| Some((from, speeds.get(from..=from + 2 * radius)?)));
            let direction = window.map_or(0.0, |(_, speeds)| {
                let sign = speeds[radius].signum();
                if speeds.iter().all(|v| v * sign > slowest) { sign } else { 0.0 }
            });
            if direction != 0.0 && direction != moving {
                self.moves += 1;
            }
            moving = direction;
            let stands =
                window.is_some_and(|(_, speeds)| speeds.iter().all(|v| v.abs() < STANDING * slowest));
            if stands && current[i].is_finite() {
                self.still.push(current[i]);
            }
            let is_known = current[i].is_finite() && raw[i].is_finite() && raw[i].abs() < limit;
            if let (Some((from, _)), true) = (window.filter(|_| direction != 0.0), is_known) {
                self.samples.push(Sample {
                    acceleration: span.acceleration[i],
                    current: current[i],
                    from,
                    cluster: self.moves,
                    span: self.speeds.len(),
                    index: i,
                });
            }
        }
        self.speeds.push(speeds);
    }

    /// Returns the filtered friction current of each sample, A.
    fn friction(&self, law: &FrictionConfig) -> Vec<f64> {
        let friction: Vec<Vec<f64>> = self
            .speeds
            .iter()
            .map(|speeds| speeds.iter().map(|v| friction_current(law, *v)).collect())
            .collect();
        let of = |sample: &Sample| {
            let window = friction.get(sample.span).and_then(|all| all.get(sample.from..)).unwrap_or_default();
            self.weights.iter().zip(window).map(|(w, f)| w * f).sum()
        };
        self.samples.iter().map(of).collect()
    }

    /// Returns the modeled current of each sample for the parameters of [`NAMES`] in fitted form.
    fn modeled(&self, x: &[f64]) -> Vec<f64> {
        let friction = self.friction(&law_of(x));
        self.samples
            .iter()
            .zip(friction)
            .map(|(sample, friction)| x[0] * sample.acceleration + x[1] + friction)
            .collect()
    }
}

/// Filtered current of a sample in motion: recorded, and modeled by Prévost eqs. 1 to 3.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct MovingCurrent {
    /// Index of the span.
    pub span: usize,
    /// Index in the span.
    pub index: usize,
    /// Recorded and filtered current, A.
    pub recorded: f64,
    /// Modeled and filtered current, A.
    pub modeled: f64,
}

/// Computes the filtered current of a linear or rotary axis at the samples in motion.
pub(super) fn moving_current(signals: &Signals, axis: &AxisConfig) -> Vec<MovingCurrent> {
    let Some(data) = MovingData::new(&[signals], axis) else { return Vec::new() };
    let gravity = Gravity::new(&axis.gravity, axis.transmission_ratio);
    let (kt, r) = (axis.motor.torque_constant, axis.transmission_ratio);
    let spans: Vec<&SignalSpan> = signals.spans.iter().filter(|span| span.smooth_current.is_some()).collect();
    let numbers: Vec<usize> =
        (0..signals.spans.len()).filter(|k| signals.spans[*k].smooth_current.is_some()).collect();
    let friction = data.friction(&axis.friction);
    let of = |(sample, friction): (&Sample, f64)| {
        let position = spans.get(sample.span)?.position.get(sample.index)?;
        let modeled =
            axis.motor.inertia * sample.acceleration / (r * kt) + friction + gravity.torque(*position) / kt;
        Some(MovingCurrent {
            span: numbers[sample.span],
            index: sample.index,
            recorded: sample.current,
            modeled,
        })
    };
    data.samples.iter().zip(friction).filter_map(of).collect()
}

/// Returns the friction law of the fitted parameters: factor of the acceleration, gravity, a, −c / a, b, ln(−d).
fn law_of(x: &[f64]) -> FrictionConfig {
    let (a, ratio, b, d) = (x[2], x[3], x[4], -x[5].exp());
    FrictionConfig { a, b, c: -ratio * a, d, i0: (1.0 - ratio) * a }
}

/// Fits inertia, friction and gravity; none if the axis hardly moves.
pub(super) fn fit_plant_by_regression(recordings: &[&Signals], axis: &AxisConfig) -> Option<PlantRegression> {
    let data = MovingData::new(recordings, axis)?;
    let measured: Vec<f64> = data.samples.iter().map(|s| s.current).collect();
    let largest = measured.iter().fold(0.0_f64, |most, i| most.max(i.abs())).max(f64::MIN_POSITIVE);
    let fastest = data.samples.iter().fold(0.0_f64, |most, s| most.max(s.acceleration.abs()));
    let bounded = |start, low, high| BoundedParameter { start, low, high, step: 1e-5 * (high - low) };
    let factor = 3.0 * largest / fastest.max(f64::MIN_POSITIVE);
    let shape = [0, 1, 2].map(|k| bounded(SHAPE[k].0, SHAPE_BOUNDS[k].0, SHAPE_BOUNDS[k].1));
    let mut parameters = vec![
        bounded(0.3 * factor, 0.0, factor),
        bounded(0.0, -2.0 * largest, 2.0 * largest),
        bounded(0.2 * largest, 0.0, 3.0 * largest),
    ];
    parameters.extend(shape);
    let prior = |x: &[f64]| [0, 1, 2].map(|k| NOISE * largest * (x[3 + k] - SHAPE[k].0) / SHAPE[k].1);
    let residuals = |x: &[f64]| {
        let left = data.modeled(x).into_iter().zip(&measured).map(|(model, measured)| model - measured);
        Some(DVector::from_iterator(measured.len() + 3, left.chain(prior(x))))
    };
    let fit = minimize(&parameters, Effort::Formula, residuals)?;
    let clusters: Vec<Option<usize>> =
        data.samples.iter().map(|sample| Some(sample.cluster)).chain([None; 3]).collect();
    let covariance = clustered_covariance(&parameters, &fit.values, residuals, &clusters)?;
    Some(result(&data, &measured, axis, &fit.values, covariance))
}

/// Returns center and half width of the gravity currents that the standstills permit, A: friction holds the axis with any
/// current within ±i0.
fn gravity_at_rest(still: &[f64], i0: f64) -> Option<(GravityCurrent, GravityCurrent)> {
    if still.len() < FEWEST_STILL {
        return None;
    }
    let mut still = still.to_vec();
    let (low, high) = (quantile(&mut still, 0.05)?, quantile(&mut still, 0.95)?);
    let only = |constant| GravityCurrent { constant, ..GravityCurrent::default() };
    let half = i0 - 0.5 * (high - low);
    (half > 0.0).then(|| (only(0.5 * (low + high)), only(half)))
}

/// Converts the fitted values into results of the identification.
fn result(
    data: &MovingData,
    measured: &[f64],
    axis: &AxisConfig,
    x: &[f64],
    covariance: DMatrix<f64>,
) -> PlantRegression {
    let error = |k: usize| covariance[(k, k)].max(0.0).sqrt();
    let per_current = axis.motor.torque_constant * axis.transmission_ratio;
    let modeled = data.modeled(x);
    let r_squared = r_squared(measured.iter().copied().zip(modeled));
    // Derivatives of a, b, c, d with respect to the fitted a, −c/a, b, ln(−d).
    let law = law_of(x);
    let mut to_law = DMatrix::zeros(4, 6);
    to_law[(0, 2)] = 1.0;
    to_law[(1, 4)] = 1.0;
    to_law[(2, 2)] = -x[3];
    to_law[(2, 3)] = -x[2];
    to_law[(3, 5)] = law.d;
    let of_law = &to_law * &covariance * to_law.transpose();
    let errors = [0, 1, 2, 3].map(|k| of_law[(k, k)].max(0.0).sqrt());
    let force = axis.motor.torque_constant / axis.transmission_ratio;
    let only = |constant| GravityCurrent { constant, ..GravityCurrent::default() };
    let mut collinear = Vec::new();
    for j in 0..6 {
        for k in 0..j {
            let rho = covariance[(j, k)] / (error(j) * error(k));
            if rho.abs() > COLLINEAR {
                collinear.push((NAMES[k], NAMES[j], rho));
            }
        }
    }
    PlantRegression {
        inertia: InertiaFit {
            value: x[0] * per_current,
            error: error(0) * per_current,
            spread: f64::NAN,
            instants: Vec::new(),
            accelerations: data.moves,
        },
        friction: FrictionFit {
            law: LawFit::new(FrictionLaw::DoubleExponential, law, errors, r_squared, of_law),
            directions: [None, None],
            asymmetry: f64::NAN,
        },
        gravity: GravityFit {
            current: only(x[1]),
            error: only(error(1)),
            model: only(x[1]),
            weight: Some((x[1] * force, error(1) * force)),
            tilt: None,
            phase: None,
            source: GravitySource::Regression,
            at_rest: gravity_at_rest(&data.still, law.i0),
        },
        r_squared,
        collinear,
    }
}
