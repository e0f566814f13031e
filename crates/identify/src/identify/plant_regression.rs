//! Inertia, friction and gravity from any motion, by regression of the current.
//!
//! `i = Jeq a / (Kt r) + s f(|V|) + C_gravity / Kt + ρ i_ripple + δ di/dt` (Prévost eqs. 1 to 3) over all samples in motion.
//! i_ripple is the difference between the current of an instant and the mean over a position cycle, by simulation of the
//! closed loop; its share ρ and the lag δ of the current are fitted with a prior, since a recording does not say how the
//! control logs its current. The friction law is parametrized such that a + c ≥ 0 and d < b always hold. Each standstill
//! bounds the gravity: friction holds any current within ±i0 around it.

use nalgebra::{DMatrix, DVector};

use super::covariance::posterior_covariance;
use super::delays::correlation_inflation;
use super::fit::{BoundedParameter, Effort, descend, r_squared};
use super::friction::{FrictionFit, FrictionLaw, LawFit, friction_current};
use super::gravity::{GravityCurrent, GravityFit, GravitySource};
use super::inertia::InertiaFit;
use super::resample::CubicSpline;
use crate::recording::{GaussianFilter, SignalSpan, Signals};
use virtual_axes_core::config::{AxisConfig, AxisKind, FrictionConfig};
use virtual_axes_core::drive::Gravity;
use virtual_axes_core::statistics::{mean, quantile, rms};
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
/// Fewest samples in motion; the prior determines what they do not.
const FEWEST_SAMPLES: usize = 6;
/// Number of values that the samples usually determine.
const DETERMINED: f64 = 4.0;
/// Highest cut-off frequency, Hz: faster currents are those of elastic parts and of the sampling.
const CUTOFF: f64 = 25.0;
/// Standard errors of a 95 % interval.
const INTERVAL: f64 = 1.96;
/// Standard errors of a significant gravity.
const SIGNIFICANT: f64 = 3.0;
/// Gravity relative to friction below which it is neglected.
const RELEVANT: f64 = 0.02;
/// Center and standard deviation of the prior of −c / a, b in min/m and ln(−d m/min), within which the axes of Prévost
/// Appendix 2 lie; of the share of the ripple, from that of a mean to that of an instant; of the lag of the current, s.
const PRIOR: [(f64, f64); 5] = [(0.35, 0.2), (0.016, 0.01), (-1.1, 0.5), (0.4, 0.5), (0.0, 0.25e-3)];
/// Bounds of these.
const BOUNDS: [(f64, f64); 5] = [(-1.0, 0.98), (0.0, 0.08), (-2.9, 1.5), (-1.0, 1.2), (-1e-3, 1e-3)];
/// Index of the share of the ripple, and its standard error beyond that of the fit.
const RIPPLE: usize = 6;
const RIPPLE_ERROR: f64 = 0.25;
/// Noise of the current in the first pass and least noise in the second one, relative to the largest current.
const NOISE: f64 = 0.01;
const LEAST_NOISE: f64 = 2e-3;
/// Correlation above which two parameters are reported as collinear.
const COLLINEAR: f64 = 0.95;

/// Ripple of the current at each sample of each span of each recording, A; NaN where it is unknown.
pub(super) type CurrentRipple = Vec<Vec<Vec<f64>>>;

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
    /// Share of the ripple in the recorded current and its standard error; none without ripple.
    pub ripple: Option<(f64, f64)>,
    /// Pairs of collinear parameters with their correlation.
    pub collinear: Vec<(&'static str, &'static str, f64)>,
}

/// Names of the parameters in messages.
const NAMES: [&str; 6] = ["inertia", "gravity", "friction.a", "friction.c", "friction.b", "friction.d"];

/// One sample in motion.
struct Sample {
    acceleration: f64,
    current: f64,
    /// Derivative of the filtered current, A/s, and filtered ripple, A.
    slope: f64,
    ripple: f64,
    /// First of the fine speeds around the sample.
    from: usize,
    recording: usize,
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
    /// Weights of the filter window of each recording, from its first fine sample on.
    weights: Vec<Vec<f64>>,
    moves: usize,
    /// Filtered currents at standstill, A, and the mean of each standstill.
    still: Vec<f64>,
    standstills: Vec<f64>,
}

impl MovingData {
    fn new(recordings: &[&Signals], axis: &AxisConfig, ripple: Option<&CurrentRipple>) -> Option<Self> {
        let mut data = MovingData {
            samples: Vec::new(),
            speeds: Vec::new(),
            weights: Vec::new(),
            moves: 0,
            still: Vec::new(),
            standstills: Vec::new(),
        };
        for (recording, signals) in recordings.iter().enumerate() {
            let steps = (signals.period / FINE).ceil().max(1.0) as usize;
            let fine = signals.period / steps as f64;
            let sigma = crate::recording::deviation(signals.cutoff) / fine;
            let radius = (REACH * sigma).ceil() as usize;
            let gauss = |k: usize| (-0.5 * ((k as f64 - radius as f64) / sigma).powi(2)).exp();
            let sum: f64 = (0..=2 * radius).map(gauss).sum();
            data.weights.push((0..=2 * radius).map(|k| gauss(k) / sum).collect());
            for (number, span) in signals.spans.iter().enumerate() {
                let ripple = ripple.and_then(|all| all.get(recording)?.get(number)).map(Vec::as_slice);
                data.add((span, ripple), signals.period, steps, axis);
            }
        }
        (data.samples.len() >= FEWEST_SAMPLES).then_some(data)
    }

    fn add(
        &mut self,
        (span, ripple): (&SignalSpan, Option<&[f64]>),
        period: f64,
        steps: usize,
        axis: &AxisConfig,
    ) {
        let (Some(current), Some(raw)) = (&span.smooth_current, &span.current) else { return };
        let unit = axis.units().speed;
        let spline = CubicSpline::new(&span.position, period);
        let fine = period / steps as f64;
        let count = (span.position.len().saturating_sub(1)) * steps + 1;
        let speeds: Vec<f64> = (0..count).map(|k| spline.at(k as f64 * fine)[1] / unit).collect();
        let recording = self.weights.len() - 1;
        let (radius, slowest) = (self.weights[recording].len() / 2, SLOWEST / unit);
        let limit = super::inertia::SATURATED * axis.motor.max_current;
        let mut moving = 0.0;
        let mut standing: Vec<f64> = Vec::new();
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
                standing.push(current[i]);
            } else {
                self.add_standstill(&mut standing);
            }
            let ripple = ripple.map_or(0.0, |ripple| ripple.get(i).copied().unwrap_or(f64::NAN));
            let is_known = current[i].is_finite() && raw[i].is_finite() && raw[i].abs() < limit;
            let last = current.len().saturating_sub(1);
            let (before, after) = (i.saturating_sub(1), (i + 1).min(last));
            let slope = (current[after] - current[before]) / ((after - before).max(1) as f64 * period);
            if let (Some((from, _)), true) =
                (window.filter(|_| direction != 0.0), is_known && ripple.is_finite() && slope.is_finite())
            {
                self.samples.push(Sample {
                    acceleration: span.acceleration[i],
                    current: current[i],
                    slope,
                    ripple,
                    from,
                    recording,
                    cluster: self.moves,
                    span: self.speeds.len(),
                    index: i,
                });
            }
        }
        self.add_standstill(&mut standing);
        self.speeds.push(speeds);
    }

    /// Adds the currents of a standstill that ends.
    fn add_standstill(&mut self, standing: &mut Vec<f64>) {
        if standing.len() >= FEWEST_STILL {
            self.standstills.extend(mean(standing));
        }
        self.still.append(standing);
    }

    /// Returns the filtered current of each sample, without that of the gravity of a rotary axis, A.
    fn measured(&self, recordings: &[&Signals], axis: &AxisConfig) -> Vec<f64> {
        let gravity = Gravity::new(&axis.gravity, axis.transmission_ratio);
        let spans = recordings.iter().flat_map(|signals| &signals.spans);
        let spans: Vec<&SignalSpan> = spans.filter(|span| span.smooth_current.is_some()).collect();
        let held = |sample: &Sample| match (axis.kind(), spans.get(sample.span)) {
            (AxisKind::Rotary, Some(span)) => {
                gravity.torque(span.position[sample.index]) / axis.motor.torque_constant
            }
            _ => 0.0,
        };
        self.samples.iter().map(|sample| sample.current - held(sample)).collect()
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
            self.weights[sample.recording].iter().zip(window).map(|(w, f)| w * f).sum()
        };
        self.samples.iter().map(of).collect()
    }

    /// Returns the modeled current of each sample for the parameters of [`NAMES`] in fitted form.
    fn modeled(&self, x: &[f64]) -> Vec<f64> {
        let friction = self.friction(&law_of(x));
        self.samples
            .iter()
            .zip(friction)
            .map(|(sample, friction)| {
                let logged = x[RIPPLE] * sample.ripple - x[7] * sample.slope;
                x[0] * sample.acceleration + x[1] + friction + logged
            })
            .collect()
    }

    /// Returns by how much the mean current of each standstill is outside of ±i0 around the gravity, A.
    fn excesses(&self, x: &[f64]) -> impl Iterator<Item = f64> {
        // Difference quotients can leave the range of a.
        let i0 = law_of(x).i0.max(0.0);
        self.standstills.iter().map(move |current| {
            let held = current - x[1];
            held - held.clamp(-i0, i0)
        })
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
    let signals = &smoothed(signals);
    let Some(data) = MovingData::new(&[signals], axis, None) else { return Vec::new() };
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

/// Returns the recording with signals filtered at most at [`CUTOFF`].
fn smoothed(signals: &Signals) -> Signals {
    if signals.cutoff <= CUTOFF {
        return signals.clone();
    }
    let filter = GaussianFilter::new(CUTOFF, signals.period);
    let of = |span: &SignalSpan| {
        let motion = filter.apply(&span.position);
        SignalSpan {
            velocity: motion.first,
            acceleration: motion.second,
            smooth_current: span.current.as_ref().map(|current| filter.apply(current).value),
            ..span.clone()
        }
    };
    Signals { cutoff: CUTOFF, spans: signals.spans.iter().map(of).collect(), ..signals.clone() }
}

/// Fits inertia, friction and gravity, with the unfiltered ripple of the current if it is known; none if the axis hardly
/// moves. A gravity that is not significant, or that of a rotary axis, which a constant does not describe, is that of the
/// model without it.
pub(super) fn fit_plant(
    recordings: &[&Signals],
    axis: &AxisConfig,
    ripple: Option<&CurrentRipple>,
) -> Option<PlantRegression> {
    let smooth: Vec<Signals> = recordings.iter().map(|signals| smoothed(signals)).collect();
    let ripple = ripple.map(|all| -> CurrentRipple {
        let of = |(signals, spans): (&Signals, &Vec<Vec<f64>>)| {
            let filter = GaussianFilter::new(signals.cutoff, signals.period);
            spans.iter().map(|ripple| filtered(&filter, ripple)).collect()
        };
        smooth.iter().zip(all).map(of).collect()
    });
    let recordings: Vec<&Signals> = smooth.iter().collect();
    let free = fit_plant_by_regression(&recordings, axis, ripple.as_ref(), true)?;
    let (value, error) = (free.gravity.current.constant.abs(), free.gravity.error.constant);
    let law = &free.friction.law.config;
    let is_kept = axis.kind() == AxisKind::Linear
        && value >= SIGNIFICANT * error
        && value >= RELEVANT * (law.a + law.c).abs();
    if is_kept {
        return Some(free);
    }
    let mut fixed = fit_plant_by_regression(&recordings, axis, ripple.as_ref(), false)?;
    if axis.kind() == AxisKind::Linear {
        // The weight that is set to zero is as uncertain as before, and with it what the motion does not separate from it.
        fixed.friction.law = fixed.friction.law.with_errors_of(&free.friction.law);
        fixed.inertia.error = free.inertia.error.max(fixed.inertia.error);
        fixed.collinear = free.collinear;
    }
    fixed.gravity = GravityFit { model: GravityCurrent::default(), ..free.gravity };
    Some(fixed)
}

/// Returns the filtered signal between missing values at its ends.
fn filtered(filter: &GaussianFilter, signal: &[f64]) -> Vec<f64> {
    let is_known = |value: &f64| value.is_finite();
    let from = signal.iter().position(is_known).unwrap_or(signal.len());
    let to = signal.iter().rposition(is_known).map_or(from, |last| last + 1);
    let mut smooth = vec![f64::NAN; signal.len()];
    let known = filter.apply(&signal[from..to]).value;
    smooth.iter_mut().skip(from).zip(known).for_each(|(to, value)| *to = value);
    smooth
}

fn fit_plant_by_regression(
    recordings: &[&Signals],
    axis: &AxisConfig,
    ripple: Option<&CurrentRipple>,
    has_gravity: bool,
) -> Option<PlantRegression> {
    let data = MovingData::new(recordings, axis, ripple)?;
    let measured = data.measured(recordings, axis);
    let largest = measured.iter().fold(0.0_f64, |most, i| most.max(i.abs())).max(f64::MIN_POSITIVE);
    let fastest = data.samples.iter().fold(0.0_f64, |most, s| most.max(s.acceleration.abs()));
    let bounded = |start: f64, low: f64, high: f64| BoundedParameter {
        start: start.clamp(low, high),
        low,
        high,
        step: 1e-5 * (high - low),
    };
    let factor = 3.0 * largest / fastest.max(f64::MIN_POSITIVE);
    let prior_of = |k: usize| {
        let ((center, _), (low, high)) = (PRIOR[k], BOUNDS[k]);
        // Without ripple its share is nothing.
        if k == 3 && ripple.is_none() { bounded(0.0, -1e-9, 1e-9) } else { bounded(center, low, high) }
    };
    let mut parameters = vec![
        bounded(0.3 * factor, 0.0, factor),
        if has_gravity { bounded(0.0, -2.0 * largest, 2.0 * largest) } else { bounded(0.0, -1e-9, 1e-9) },
        bounded(0.2 * largest, 0.0, 3.0 * largest),
    ];
    parameters.extend((0..PRIOR.len()).map(prior_of));
    let rows = measured.len() + data.standstills.len() + PRIOR.len();
    let residuals = |x: &[f64], noise: f64| {
        let left = data.modeled(x).into_iter().zip(&measured).map(|(model, measured)| model - measured);
        let prior =
            PRIOR.iter().zip(&x[3..]).map(|((center, deviation), x)| noise * (x - center) / deviation);
        let held = data.excesses(x);
        Some(DVector::from_iterator(rows, left.chain(held).chain(prior)))
    };
    // The noise counts with the correlation of neighboring samples.
    let mut noise = NOISE * largest;
    let mut values: Vec<f64> = Vec::new();
    for _ in 0..2 {
        (values, _) = descend(&parameters, Effort::Formula, |x| residuals(x, noise))?;
        let left = residuals(&values, noise)?;
        let left = left.as_slice().get(..measured.len())?;
        let count = left.len() as f64;
        let freedom = (count / (count - DETERMINED).max(1.0)).sqrt();
        noise = freedom * rms(left.iter().copied())? * correlation_inflation(left).sqrt();
        noise = noise.max(LEAST_NOISE * largest);
        parameters.iter_mut().zip(&values).for_each(|(parameter, value)| parameter.start = *value);
    }
    let clusters: Vec<Option<usize>> = data.samples.iter().map(|sample| Some(sample.cluster)).collect();
    let mut covariance =
        posterior_covariance(&parameters, &values, |x| residuals(x, noise), &clusters, noise)?;
    if ripple.is_some() {
        // The others follow the share of the ripple, which the simulated loop does not determine exactly.
        let along = covariance.column(RIPPLE) / covariance[(RIPPLE, RIPPLE)];
        covariance += &along * along.transpose() * RIPPLE_ERROR.powi(2);
    }
    Some(result(&data, &measured, axis, (&values, ripple.is_some()), covariance))
}

/// Returns center and half width of the gravity currents that the standstills permit, A: friction holds the axis with any
/// current within ±`i0`, the largest that is probable.
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
    (x, has_ripple): (&[f64], bool),
    covariance: DMatrix<f64>,
) -> PlantRegression {
    let error = |k: usize| covariance[(k, k)].max(0.0).sqrt();
    let per_current = axis.motor.torque_constant * axis.transmission_ratio;
    let modeled = data.modeled(x);
    let r_squared = r_squared(measured.iter().copied().zip(modeled));
    // Derivatives of a, b, c, d with respect to the fitted a, −c/a, b, ln(−d).
    let law = law_of(x);
    let mut to_law = DMatrix::zeros(4, x.len());
    to_law[(0, 2)] = 1.0;
    to_law[(1, 4)] = 1.0;
    to_law[(2, 2)] = -x[3];
    to_law[(2, 3)] = -x[2];
    to_law[(3, 5)] = law.d;
    let of_law = &to_law * &covariance * to_law.transpose();
    let errors = [0, 1, 2, 3].map(|k| of_law[(k, k)].max(0.0).sqrt());
    // i0 = a + c.
    let i0_error = (of_law[(0, 0)] + of_law[(2, 2)] + 2.0 * of_law[(0, 2)]).max(0.0).sqrt();
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
            at_rest: gravity_at_rest(&data.still, law.i0 + INTERVAL * i0_error),
        },
        r_squared,
        ripple: has_ripple.then(|| (x[RIPPLE], error(RIPPLE))),
        collinear,
    }
}
