//! Inertia, friction and gravity from any motion, by regression of the current.
//!
//! `i = Jeq (a + ρ a_ripple) / (Kt r) + s f(|V|) + C_gravity / Kt + δ di/dt` (Prévost eqs. 1 to 3) over all samples in
//! motion. a_ripple is the difference between the acceleration of an instant and the mean over a position cycle, by
//! simulation of the closed loop; its factor ρ and the lag δ of the current are fitted with a prior. A recording does not
//! say how the control logs its current: a mean and instants of the cycle are compared by their residuals, and the standard
//! errors contain the differences between those that explain the current alike. The friction law is parametrized such that a + c ≥ 0 and d < b always hold. Each standstill
//! bounds the gravity: friction holds any current within ±i0 around it.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::covariance::posterior_covariance;
use super::delays::correlation_inflation;
use super::experiment::CurrentLogging;
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
/// Appendix 2 lie; of the factor of the simulated ripple, with the deviation 1 instead of that of the simulation; of the lag
/// of the current, s.
const PRIOR: [(f64, f64); 5] = [(0.35, 0.2), (0.016, 0.01), (-1.1, 0.5), (1.0, 1.0), (0.0, 0.1e-3)];
/// Bounds of these.
const BOUNDS: [(f64, f64); 5] = [(-1.0, 0.98), (0.0, 0.08), (-2.9, 1.5), (0.0, 2.0), (-1e-3, 1e-3)];
/// Index of the factor of the ripple, and that of its prior.
const RIPPLE: usize = 6;
const RIPPLE_PRIOR: usize = 3;
/// Longest distance of the samples of the regression, s: a tenth of the length of its filter.
const THINNED: f64 = 2e-3;
/// Passes of a comparison, whose prior depends on the inertia.
const LINEAR_PASSES: usize = 3;
/// Noise of the current in the first pass and least noise in the second one, relative to the largest current.
const NOISE: f64 = 0.01;
const LEAST_NOISE: f64 = 2e-3;
/// Correlation above which two parameters are reported as collinear.
const COLLINEAR: f64 = 0.95;

/// Ripple of the current at each sample of each span of each recording, A; NaN where it is unknown.
pub(super) type CurrentRipple = Vec<Vec<Vec<f64>>>;

/// Instant of a position cycle at which a control can log the current.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct LoggedInstant {
    /// Time behind the sample, s.
    pub offset: f64,
    /// Probability before the comparison.
    pub prior: f64,
    /// True if position cycle and β of the simulation are those of the axis: others widen the standard errors only.
    pub is_identified: bool,
    /// Simulated current of the instant minus the mean over a position cycle.
    pub ripple: CurrentRipple,
    /// Inertia of the simulation, kg·m².
    pub inertia: f64,
}

/// Ways in which a control can log the current.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct CurrentLoggings {
    /// Instants; a mean over a position cycle has the rest of the probability.
    pub instants: Vec<LoggedInstant>,
    /// Relative standard error of the simulated ripple.
    pub error: f64,
    /// True if the phase of the samples in the position cycles is known. Otherwise all ways remain as probable as before.
    pub is_phase_known: bool,
}

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
    /// Logging of the current; none if none was compared.
    pub logging: Option<CurrentLogging>,
    /// Pairs of collinear parameters with their correlation.
    pub collinear: Vec<(&'static str, &'static str, f64)>,
}

/// Names of the parameters in messages.
const NAMES: [&str; 6] = ["inertia", "gravity", "friction.a", "friction.c", "friction.b", "friction.d"];

/// One sample in motion.
struct Sample {
    acceleration: f64,
    current: f64,
    /// Derivative of the filtered current, A/s.
    slope: f64,
    /// Filtered ripple of the acceleration, m/s² or rad/s².
    ripple: f64,
    /// First of the fine speeds around the sample.
    from: usize,
    recording: usize,
    /// Number of the move.
    cluster: usize,
    span: usize,
    /// Number of the span in the recording.
    number: usize,
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
    /// Selects the samples in motion, at most one per `distance` s, where `known` is finite.
    fn new(
        recordings: &[&Signals],
        axis: &AxisConfig,
        distance: f64,
        known: Option<&CurrentRipple>,
    ) -> Option<Self> {
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
                let known = known.and_then(|all| all.get(recording)?.get(number)).map(Vec::as_slice);
                let thinning = ((distance / signals.period + 1e-9) as usize).max(1);
                data.add((span, number, known), (signals.period, steps, thinning), axis);
            }
        }
        (data.samples.len() >= FEWEST_SAMPLES).then_some(data)
    }

    fn add(
        &mut self,
        (span, number, known): (&SignalSpan, usize, Option<&[f64]>),
        (period, steps, thinning): (f64, usize, usize),
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
            let is_simulated = known.is_none_or(|known| known.get(i).is_some_and(|value| value.is_finite()));
            let is_known =
                is_simulated && current[i].is_finite() && raw[i].is_finite() && raw[i].abs() < limit;
            let last = current.len().saturating_sub(1);
            let (before, after) = (i.saturating_sub(1), (i + 1).min(last));
            let slope = (current[after] - current[before]) / ((after - before).max(1) as f64 * period);
            if let (Some((from, _)), true) =
                (window.filter(|_| direction != 0.0), is_known && slope.is_finite() && i % thinning == 0)
            {
                self.samples.push(Sample {
                    acceleration: span.acceleration[i],
                    current: current[i],
                    slope,
                    ripple: 0.0,
                    from,
                    recording,
                    cluster: self.moves,
                    span: self.speeds.len(),
                    number,
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
                let acceleration = sample.acceleration + x[RIPPLE] * sample.ripple;
                x[0] * acceleration + x[1] + friction - x[7] * sample.slope
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
    let Some(data) = MovingData::new(&[signals], axis, 0.0, None) else { return Vec::new() };
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

/// Fits inertia, friction and gravity, with the ways in which the control can log the current if they are known; none if the
/// axis hardly moves. A gravity that is not significant, or that of a rotary axis, which a constant does not describe, is
/// that of the model without it.
pub(super) fn fit_plant(
    recordings: &[&Signals],
    axis: &AxisConfig,
    loggings: Option<&CurrentLoggings>,
) -> Option<PlantRegression> {
    let smooth: Vec<Signals> = recordings.iter().map(|signals| smoothed(signals)).collect();
    let recordings: Vec<&Signals> = smooth.iter().collect();
    let free = fit_plant_by_regression(&recordings, axis, loggings, true)?;
    let (value, error) = (free.gravity.current.constant.abs(), free.gravity.error.constant);
    let law = &free.friction.law.config;
    let is_kept = axis.kind() == AxisKind::Linear
        && value >= SIGNIFICANT * error
        && value >= RELEVANT * (law.a + law.c).abs();
    if is_kept {
        return Some(free);
    }
    let mut fixed = fit_plant_by_regression(&recordings, axis, loggings, false)?;
    if axis.kind() == AxisKind::Linear {
        // The weight that is set to zero is as uncertain as before, and with it what the motion does not separate from it.
        fixed.friction.law = fixed.friction.law.with_errors_of(&free.friction.law);
        fixed.inertia.error = free.inertia.error.max(fixed.inertia.error);
        fixed.collinear = free.collinear;
    }
    fixed.gravity = GravityFit { model: GravityCurrent::default(), ..free.gravity };
    Some(fixed)
}

fn fit_plant_by_regression(
    recordings: &[&Signals],
    axis: &AxisConfig,
    loggings: Option<&CurrentLoggings>,
    has_gravity: bool,
) -> Option<PlantRegression> {
    let known = loggings.and_then(|loggings| loggings.instants.first()).map(|instant| &instant.ripple);
    let mut data = MovingData::new(recordings, axis, THINNED, known)?;
    let measured = data.measured(recordings, axis);
    let mut fit = data.fit(&measured, None, has_gravity)?;
    let mut logging = loggings.map(|_| CurrentLogging::MEAN);
    let mut spread = None;
    if let Some(loggings) = loggings {
        let per_current = axis.motor.torque_constant * axis.transmission_ratio;
        let ripple_of = |instant| data.ripple_of(recordings, instant, per_current);
        let columns: Vec<Vec<f64>> = loggings.instants.par_iter().map(ripple_of).collect();
        let compared = data.compare(&measured, (&fit, has_gravity), (loggings, &columns));
        spread = Some(compared.spread);
        if let Some(k) = compared.best {
            data.samples.iter_mut().zip(&columns[k]).for_each(|(sample, ripple)| sample.ripple = *ripple);
            fit = data.fit(&measured, Some(loggings.error), has_gravity)?;
            logging =
                Some(CurrentLogging { ripple: fit.values[RIPPLE], offset: loggings.instants[k].offset });
        }
    }
    let clusters: Vec<Option<usize>> = data.samples.iter().map(|sample| Some(sample.cluster)).collect();
    let residuals = |x: &[f64]| Some(data.residuals(x, &measured, (fit.noise, fit.ripple)));
    let covariance = posterior_covariance(&fit.parameters, &fit.values, residuals, &clusters, fit.noise)?;
    Some(PlantRegression { logging, ..result(&data, &measured, axis, &fit.values, (covariance, spread)) })
}

/// Fit of the current at the samples in motion.
struct CurrentFit {
    parameters: Vec<BoundedParameter>,
    values: Vec<f64>,
    /// Standard deviation of a residual that counts as independent, A.
    noise: f64,
    /// Relative standard error of the ripple; none without ripple.
    ripple: Option<f64>,
}

/// Comparison of the ways in which a control can log the current.
struct ComparedLoggings {
    /// Index of the most probable instant of the identified position cycle; none for a mean.
    best: Option<usize>,
    /// Covariance of inertia, gravity and friction by the differences of the probable ways from the best one.
    spread: DMatrix<f64>,
}

impl MovingData {
    /// Returns the residuals of the samples, of the standstills and of the prior, A.
    fn residuals(&self, x: &[f64], measured: &[f64], (noise, ripple): (f64, Option<f64>)) -> DVector<f64> {
        let left = self.modeled(x).into_iter().zip(measured).map(|(model, measured)| model - measured);
        let prior = PRIOR.iter().zip(&x[3..]).enumerate().map(|(k, ((center, deviation), x))| {
            let deviation = if k == RIPPLE_PRIOR { ripple.unwrap_or(*deviation) } else { *deviation };
            noise * (x - center) / deviation
        });
        let rows = measured.len() + self.standstills.len() + PRIOR.len();
        DVector::from_iterator(rows, left.chain(self.excesses(x)).chain(prior))
    }

    /// Returns the noise of the residuals of the samples, which counts with the correlation of neighbors, A.
    fn noise(left: &[f64], largest: f64) -> Option<f64> {
        let count = left.len() as f64;
        let freedom = (count / (count - DETERMINED).max(1.0)).sqrt();
        let noise = freedom * rms(left.iter().copied())? * correlation_inflation(left).sqrt();
        Some(noise.max(LEAST_NOISE * largest))
    }

    /// Fits the current `measured` with the ripple of the samples, whose relative standard error is `ripple`.
    fn fit(&self, measured: &[f64], ripple: Option<f64>, has_gravity: bool) -> Option<CurrentFit> {
        let largest = largest(measured);
        let fastest = self.samples.iter().fold(0.0_f64, |most, s| most.max(s.acceleration.abs()));
        let bounded = |start: f64, low: f64, high: f64| BoundedParameter {
            start: start.clamp(low, high),
            low,
            high,
            step: 1e-5 * (high - low),
        };
        let factor = 3.0 * largest / fastest.max(f64::MIN_POSITIVE);
        let prior_of = |k: usize| {
            let ((center, _), (low, high)) = (PRIOR[k], BOUNDS[k]);
            // Without ripple its factor is nothing.
            if k == RIPPLE_PRIOR && ripple.is_none() {
                bounded(0.0, -1e-9, 1e-9)
            } else {
                bounded(center, low, high)
            }
        };
        let mut parameters = vec![
            bounded(0.3 * factor, 0.0, factor),
            if has_gravity { bounded(0.0, -2.0 * largest, 2.0 * largest) } else { bounded(0.0, -1e-9, 1e-9) },
            bounded(0.2 * largest, 0.0, 3.0 * largest),
        ];
        parameters.extend((0..PRIOR.len()).map(prior_of));
        let mut noise = NOISE * largest;
        let mut values: Vec<f64> = Vec::new();
        for _ in 0..2 {
            let residuals = |x: &[f64]| Some(self.residuals(x, measured, (noise, ripple)));
            (values, _) = descend(&parameters, Effort::Formula, residuals)?;
            let left = self.residuals(&values, measured, (noise, ripple));
            noise = Self::noise(left.as_slice().get(..measured.len())?, largest)?;
            parameters.iter_mut().zip(&values).for_each(|(parameter, value)| parameter.start = *value);
        }
        Some(CurrentFit { parameters, values, noise, ripple })
    }

    /// Returns the filtered ripple of the acceleration at each sample, m/s² or rad/s²; `per_current` is Kt r.
    fn ripple_of(&self, recordings: &[&Signals], instant: &LoggedInstant, per_current: f64) -> Vec<f64> {
        let filters: Vec<GaussianFilter> =
            recordings.iter().map(|signals| GaussianFilter::new(signals.cutoff, signals.period)).collect();
        let scale = per_current / instant.inertia;
        let at = |sample: &Sample| {
            let ripple = instant.ripple.get(sample.recording)?.get(sample.number)?;
            // Close to the ends of the simulation the filter lacks values.
            let smooth =
                filters[sample.recording].value_at(ripple, sample.index).filter(|value| value.is_finite());
            smooth.or_else(|| ripple.get(sample.index).copied()).map(|value| scale * value)
        };
        self.samples.iter().map(|sample| at(sample).unwrap_or(0.0)).collect()
    }

    /// Compares the ways in which the control can log the current by linear least squares around `fit`, that of a mean.
    /// `columns` are the ripples of the instants.
    fn compare(
        &self,
        measured: &[f64],
        (fit, has_gravity): (&CurrentFit, bool),
        (loggings, columns): (&CurrentLoggings, &[Vec<f64>]),
    ) -> ComparedLoggings {
        let x = &fit.values;
        let friction = |x: &[f64]| DVector::from_vec(self.friction(&law_of(x)));
        let mut right = DVector::from_column_slice(measured) - friction(x);
        let mut design =
            vec![DVector::from_iterator(measured.len(), self.samples.iter().map(|s| s.acceleration))];
        design.push(DVector::from_element(measured.len(), if has_gravity { 1.0 } else { 0.0 }));
        for k in 2..RIPPLE {
            let (step, mut moved) = (fit.parameters[k].step, x.clone());
            moved[k] = x[k] + step;
            let above = friction(&moved);
            moved[k] = x[k] - step;
            let column = (above - friction(&moved)) / (2.0 * step);
            right.axpy(x[k], &column, 1.0);
            design.push(column);
        }
        design.push(DVector::from_iterator(measured.len(), self.samples.iter().map(|s| -s.slope)));
        let design = DMatrix::from_columns(&design);
        let size = design.ncols();
        let (gram, projected, square) = (design.tr_mul(&design), design.tr_mul(&right), right.norm_squared());
        // Solutions: values, and cost without that of the mean; none for a mean.
        let solve = |ripple: Option<&Vec<f64>>, noise: f64| -> Option<(DVector<f64>, f64)> {
            let mut full = gram.clone().resize(size + 1, size + 1, 0.0);
            let mut vector = projected.clone().resize_vertically(size + 1, 0.0);
            if let Some(ripple) = ripple {
                let ripple = DVector::from_column_slice(ripple);
                let with = design.tr_mul(&ripple);
                for k in 0..size {
                    full[(k, size)] = with[k];
                    full[(size, k)] = with[k];
                }
                full[(size, size)] = ripple.norm_squared();
                vector[size] = ripple.dot(&right);
            }
            let mut constant = square;
            for (k, (center, deviation)) in PRIOR.iter().enumerate().filter(|(k, _)| *k != RIPPLE_PRIOR) {
                let (at, weight) =
                    (if k < RIPPLE_PRIOR { k + 3 } else { size - 1 }, (noise / deviation).powi(2));
                full[(at, at)] += weight;
                vector[at] += weight * center;
                constant += weight * center * center;
            }
            if !has_gravity {
                full[(1, 1)] += 1.0;
            }
            if ripple.is_none() {
                full[(size, size)] = 1.0;
            }
            let mut inertia = x[0];
            let mut found = (DVector::zeros(size + 1), f64::INFINITY);
            for _ in 0..LINEAR_PASSES {
                let mut tied = full.clone();
                if ripple.is_some() {
                    // The coefficient of the ripple is that of the acceleration times a factor of about 1.
                    let weight = (noise / (loggings.error * inertia.max(f64::MIN_POSITIVE))).powi(2);
                    tied[(0, 0)] += weight;
                    tied[(size, size)] += weight;
                    tied[(0, size)] -= weight;
                    tied[(size, 0)] -= weight;
                }
                let solution = super::fit::inverse(&tied)? * &vector;
                let cost = constant - solution.dot(&vector);
                inertia = solution[0];
                found = (solution, cost);
            }
            (inertia > 0.0).then_some(found)
        };
        let largest = largest(measured);
        let mut noise = fit.noise;
        let mut compared: Vec<(Option<usize>, DVector<f64>, f64)> = Vec::new();
        for _ in 0..2 {
            let ways: Vec<Option<usize>> =
                std::iter::once(None).chain((0..columns.len()).map(Some)).collect();
            compared = ways
                .into_par_iter()
                .filter_map(|way| {
                    let (solution, cost) = solve(way.map(|k| &columns[k]), noise)?;
                    Some((way, solution, cost))
                })
                .collect();
            let Some((way, solution, _)) = compared.iter().min_by(|a, b| a.2.total_cmp(&b.2)) else { break };
            let mut left = &right - &design * solution.rows(0, size);
            if let Some(k) = way {
                left.axpy(-solution[size], &DVector::from_column_slice(&columns[*k]), 1.0);
            }
            noise = Self::noise(left.as_slice(), largest).unwrap_or(noise);
        }
        let least = compared.iter().map(|(_, _, cost)| *cost).fold(f64::INFINITY, f64::min);
        let of_instants: f64 = loggings.instants.iter().map(|instant| instant.prior).sum();
        let weight = |(way, _, cost): &(Option<usize>, DVector<f64>, f64)| {
            let prior = way.map_or(1.0 - of_instants, |k| loggings.instants[k].prior);
            let excess = if loggings.is_phase_known { cost - least } else { 0.0 };
            prior * (-0.5 * excess / (noise * noise)).exp()
        };
        let sum: f64 = compared.iter().map(weight).sum();
        let best = compared
            .iter()
            .filter(|(way, _, _)| way.is_none_or(|k| loggings.instants[k].is_identified))
            .max_by(|a, b| weight(a).total_cmp(&weight(b)));
        let mut spread = DMatrix::zeros(x.len(), x.len());
        if let Some((_, center, _)) = best.filter(|_| sum > 0.0) {
            for way in &compared {
                let mut change = DVector::zeros(x.len());
                change.rows_mut(0, RIPPLE).copy_from(&(&way.1 - center).rows(0, RIPPLE));
                spread += &change * change.transpose() * (weight(way) / sum);
            }
        }
        ComparedLoggings { best: best.and_then(|(way, _, _)| *way), spread }
    }
}

/// Returns the largest current, A.
fn largest(measured: &[f64]) -> f64 {
    measured.iter().fold(0.0_f64, |most, i| most.max(i.abs())).max(f64::MIN_POSITIVE)
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
    x: &[f64],
    (mut covariance, spread): (DMatrix<f64>, Option<DMatrix<f64>>),
) -> PlantRegression {
    let mut collinear = Vec::new();
    for j in 0..NAMES.len() {
        for k in 0..j {
            let rho = covariance[(j, k)] / (covariance[(j, j)] * covariance[(k, k)]).sqrt();
            if rho.abs() > COLLINEAR {
                collinear.push((NAMES[k], NAMES[j], rho));
            }
        }
    }
    if let Some(spread) = spread {
        covariance += spread;
    }
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
        logging: None,
        collinear,
    }
}
