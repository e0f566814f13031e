//! Validation of a model against a recording: closed-loop simulation with PSEC, inverse dynamics with
//! current.

use serde::Serialize;

use super::closed_loop::{find_experiments, simulate_all};
use super::experiment::{CurrentLogging, Experiment, SimulatedExperiment};
use super::feedforward_mode::FeedforwardMode;
use super::fit::r_squared;
use super::friction::friction_current;
use super::moving_data::moving_current;
use super::options::IdentificationInput;
use super::resample::BandLimitedSpline;
use super::segments::{MotionSegment, SegmentKind, find_segments};
use super::setpoints::stride;
use super::trace_experiments::trace_experiments;
use crate::recording::Signals;
use virtual_axes_core::config::{AxisConfig, Periods};
use virtual_axes_core::drive::Gravity;
use virtual_axes_core::machine::MachineError;
use virtual_axes_core::statistics::rms;
use virtual_axes_core::units::seconds;

/// Largest and RMS residual.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ResidualStatistics {
    /// Largest magnitude.
    pub max: f64,
    /// Root mean square.
    pub rms: f64,
}

/// Residuals of a closed-loop simulation.
#[derive(Debug, Clone, PartialEq)]
pub struct ExperimentComparison {
    /// Position residual at constant velocity, m or rad; none without constant velocity.
    pub constant_velocity: Option<ResidualStatistics>,
    /// Position residual elsewhere, m or rad.
    pub elsewhere: Option<ResidualStatistics>,
    /// Velocity residual, m/s or rad/s.
    pub velocity: Option<ResidualStatistics>,
    /// Current residual, A.
    pub current: Option<ResidualStatistics>,
    /// R² of the unfiltered current.
    pub current_r_squared: Option<f64>,
}

/// Motor current by inverse dynamics compared with the recorded current.
#[derive(Debug, Clone, PartialEq)]
pub struct InverseDynamics {
    /// R² of the unfiltered current.
    pub r_squared: f64,
    /// Current residual, A.
    pub current: ResidualStatistics,
    /// Index of the span and modeled current at each of its samples, A.
    pub modeled: Vec<(usize, Vec<f64>)>,
}

/// RMS differences of simple predictions of the position from PSEC, to which a model is compared.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Baseline {
    /// Difference from PSEC itself, m or rad.
    pub command: f64,
    /// Constant lag that fits best, s.
    pub lag: f64,
    /// Difference from PSEC delayed by this lag, m or rad.
    pub delayed: f64,
    /// Difference from the simulation of the model, m or rad.
    pub model: f64,
    /// Largest difference from the delayed PSEC, m or rad.
    pub delayed_max: f64,
    /// Largest difference from the simulation of the model, m or rad.
    pub model_max: f64,
}

/// Agreement of an axis model with a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Agreement {
    /// Segments of the recording.
    pub segments: Vec<MotionSegment>,
    /// Simulated sections of the recording; empty without PSEC.
    pub experiments: Vec<Experiment>,
    /// Simulation of each experiment.
    pub simulated: Vec<SimulatedExperiment>,
    /// Residuals of each experiment.
    pub comparisons: Vec<ExperimentComparison>,
    /// Comparison by inverse dynamics; none without current.
    pub inverse: Option<InverseDynamics>,
    /// Simple predictions of the position; none without simulation.
    pub baseline: Option<Baseline>,
}

impl Agreement {
    /// Returns the R² of the unfiltered current: the lowest of the simulations, otherwise that of inverse
    /// dynamics.
    pub fn current_r_squared(&self) -> Option<f64> {
        let simulated = self.comparisons.iter().filter_map(|c| c.current_r_squared).reduce(f64::min);
        simulated.or(self.inverse.as_ref().map(|inverse| inverse.r_squared))
    }
}

/// Simulates `axis` on a recording that was not used for the identification, and computes the residuals.
///
/// # Errors
/// [`MachineError`] if the axis cannot be simulated.
pub fn validate(
    input: &IdentificationInput<'_>,
    axis: &AxisConfig,
    periods: &Periods,
) -> Result<Agreement, MachineError> {
    validate_with(input, (axis, periods), None)
}

/// Validates as [`validate`]; `joint` is the logging of the recorded current, if the axis was identified by the joint fit, whose recordings can begin in motion.
pub(super) fn validate_with(
    input: &IdentificationInput<'_>,
    (axis, periods): (&AxisConfig, &Periods),
    joint: Option<CurrentLogging>,
) -> Result<Agreement, MachineError> {
    let mode = input.feedforward.unwrap_or(FeedforwardMode::Both);
    let on_grid = stride(input.signals.period, seconds(periods.position)).is_some();
    let mut experiments = match on_grid && joint.is_none() {
        true => find_experiments(input.signals, 0, axis, periods, mode),
        false => Vec::new(),
    };
    if experiments.is_empty() {
        let is_instant = input.signals.period <= seconds(periods.position);
        let usual = if is_instant { CurrentLogging::INSTANT } else { CurrentLogging::MEAN };
        let logging = joint.unwrap_or(usual);
        experiments = trace_experiments(input.signals, 0, periods, (mode, 0.0, logging));
    }
    let signals = (input.signals, joint.is_some() || !on_grid);
    compute_agreement(signals, find_segments(input.signals), experiments, axis, periods)
}

/// Computes the agreement of an axis with the experiments of a recording, whose current is filtered if `is_filtered`.
pub(super) fn compute_agreement(
    (signals, is_filtered): (&Signals, bool),
    segments: Vec<MotionSegment>,
    experiments: Vec<Experiment>,
    axis: &AxisConfig,
    periods: &Periods,
) -> Result<Agreement, MachineError> {
    let simulated = simulate_all(axis, periods, &experiments)?;
    let comparisons = experiments.iter().zip(&simulated).map(|(e, s)| compare(e, s, &segments)).collect();
    let filtered = if is_filtered { filtered_inverse_dynamics(signals, axis) } else { None };
    let inverse = filtered.or_else(|| inverse_dynamics(signals, &segments, axis));
    let baseline = baseline(signals, &experiments, &simulated);
    Ok(Agreement { segments, experiments, simulated, comparisons, inverse, baseline })
}

/// Compares the filtered currents in motion, for recordings with fast currents of elastic parts, or too coarse for a friction
/// that changes its sign within a sample; none without motion.
fn filtered_inverse_dynamics(signals: &Signals, axis: &AxisConfig) -> Option<InverseDynamics> {
    let moving = moving_current(signals, axis);
    let current = residual_statistics(moving.iter().map(|m| m.modeled - m.recorded))?;
    let mut modeled: Vec<(usize, Vec<f64>)> = Vec::new();
    for (number, span) in signals.spans.iter().enumerate() {
        let mut values = span.smooth_current.clone()?;
        for m in moving.iter().filter(|m| m.span == number) {
            if let Some(value) = values.get_mut(m.index) {
                *value = m.modeled;
            }
        }
        modeled.push((number, values));
    }
    let r_squared = r_squared(moving.iter().map(|m| (m.recorded, m.modeled)));
    Some(InverseDynamics { r_squared, current, modeled })
}

/// Computes the differences of simple predictions; none without simulation.
fn baseline(
    signals: &Signals,
    experiments: &[Experiment],
    simulated: &[SimulatedExperiment],
) -> Option<Baseline> {
    let pairs = experiments.iter().zip(simulated);
    let differences =
        || pairs.clone().flat_map(|(e, s)| e.position.iter().zip(&s.position).map(|(a, b)| a - b));
    let largest = |differences: &mut dyn Iterator<Item = f64>| differences.map(f64::abs).fold(0.0, f64::max);
    let model = rms(differences())?;
    let spans = || signals.spans.iter().filter_map(|span| Some((span.psec.as_ref()?, &span.position)));
    let command = rms(spans().flat_map(|(psec, position)| psec.iter().zip(position).map(|(a, b)| a - b)))?;
    let (lag, delayed) = constant_lag(signals)?;
    let delayed_max = spans().map(|(psec, position)| {
        let (spline, first) =
            (BandLimitedSpline::new(psec, signals.period), (lag / signals.period).ceil() as usize);
        let at = |i: usize| spline.at(i as f64 * signals.period - lag)[0] - position[i];
        largest(&mut (first..position.len()).map(at))
    });
    let (delayed_max, model_max) = (delayed_max.fold(0.0, f64::max), largest(&mut differences()));
    Some(Baseline { command, lag, delayed, model, delayed_max, model_max })
}

/// Returns the constant lag, s, with which the delayed PSEC fits the position best, and the RMS difference, m or rad;
/// none without PSEC.
pub fn constant_lag(signals: &Signals) -> Option<(f64, f64)> {
    /// Largest number of compared samples per span.
    const SAMPLES: usize = 5000;
    /// Steps of the search, s, and longest lag in first steps.
    const STEPS: [f64; 3] = [2e-3, 2e-4, 2e-5];
    const LONGEST: i32 = 75;
    let spans: Vec<(BandLimitedSpline, &[f64])> = signals
        .spans
        .iter()
        .filter_map(|span| {
            Some((BandLimitedSpline::new(span.psec.as_ref()?, signals.period), span.position.as_slice()))
        })
        .collect();
    let rms_at = |lag: f64| {
        let differences = spans.iter().flat_map(|(psec, position)| {
            let step = position.len().div_ceil(SAMPLES).max(1);
            let first = (lag / signals.period).ceil() as usize;
            let at = move |i: usize| psec.at(i as f64 * signals.period - lag)[0] - position[i];
            (first..position.len()).step_by(step).map(at)
        });
        rms(differences)
    };
    let mut best = (0.0, rms_at(0.0)?);
    for step in STEPS {
        let (center, reach) = (best.0, if step == STEPS[0] { LONGEST } else { 10 });
        for k in -reach..=reach {
            let lag = center + f64::from(k) * step;
            if let Some(found) = rms_at(lag.max(0.0)).filter(|found| lag >= 0.0 && *found < best.1) {
                best = (lag, found);
            }
        }
    }
    Some(best)
}

fn residual_statistics(differences: impl Iterator<Item = f64>) -> Option<ResidualStatistics> {
    let (mut count, mut squares, mut max) = (0_usize, 0.0, 0.0_f64);
    for d in differences.filter(|d| !d.is_nan()) {
        (count, squares, max) = (count + 1, squares + d * d, max.max(d.abs()));
    }
    (count > 0).then(|| ResidualStatistics { max, rms: (squares / count as f64).sqrt() })
}

/// Computes the residuals of an experiment.
fn compare(
    experiment: &Experiment,
    simulated: &SimulatedExperiment,
    segments: &[MotionSegment],
) -> ExperimentComparison {
    let mut constant = vec![false; experiment.position.len()];
    let of_it =
        segments.iter().filter(|s| s.span == experiment.span && s.kind == SegmentKind::ConstantVelocity);
    for segment in of_it {
        let (from, to) = (segment.samples.start, segment.samples.end);
        let range = from.saturating_sub(experiment.sample)..to.saturating_sub(experiment.sample);
        let range = range.start.min(constant.len())..range.end.min(constant.len());
        constant[range].fill(true);
    }
    let position = |wanted: bool| {
        let pairs = simulated.position.iter().zip(&experiment.position).zip(&constant);
        residual_statistics(pairs.filter(move |(_, c)| **c == wanted).map(|((s, r), _)| s - r))
    };
    let currents = || experiment.current.iter().flatten().copied().zip(simulated.current.iter().copied());
    let recorded = || currents().filter(|(r, _)| !r.is_nan());
    let r2 = r_squared(recorded());
    ExperimentComparison {
        constant_velocity: position(true),
        elsewhere: position(false),
        velocity: residual_statistics(
            simulated.velocity.iter().zip(&experiment.velocity).map(|(s, r)| s - r),
        ),
        current: residual_statistics(recorded().map(|(r, s)| s - r)),
        // At rest the variance is zero.
        current_r_squared: (experiment.moves() && r2.is_finite()).then_some(r2),
    }
}

/// Computes `i = (Jeq dω/dt + C_friction + C_gravity) / Kt` (Prévost eqs. 1 and 3) of the recorded motion;
/// none without current.
///
/// At rest friction holds the axis with any current within ±i0 around that of gravity; a recorded current
/// within this band counts as modeled.
fn inverse_dynamics(
    signals: &Signals,
    segments: &[MotionSegment],
    axis: &AxisConfig,
) -> Option<InverseDynamics> {
    let (kt, r, unit) = (axis.motor.torque_constant, axis.transmission_ratio, axis.units().speed);
    let gravity = Gravity::new(&axis.gravity, r);
    let mut modeled = Vec::new();
    let mut pairs = Vec::new();
    for (number, span) in signals.spans.iter().enumerate() {
        let Some(recorded) = &span.current else { continue };
        let mut at_rest = vec![false; recorded.len()];
        for s in segments.iter().filter(|s| s.span == number && s.kind == SegmentKind::Static) {
            at_rest[s.samples.clone()].fill(true);
        }
        let currents: Vec<f64> = (0..recorded.len())
            .map(|i| {
                let held = gravity.torque(span.position[i]) / kt;
                if at_rest[i] {
                    return held + (recorded[i] - held).clamp(-axis.friction.i0, axis.friction.i0);
                }
                let v = span.velocity[i] / unit;
                axis.motor.inertia * span.acceleration[i] / (r * kt)
                    + friction_current(&axis.friction, v)
                    + held
            })
            .collect();
        pairs.extend(recorded.iter().copied().zip(currents.iter().copied()).filter(|(r, _)| !r.is_nan()));
        modeled.push((number, currents));
    }
    let current = residual_statistics(pairs.iter().map(|(r, m)| m - r))?;
    let determination = r_squared(pairs.iter().copied());
    Some(InverseDynamics { r_squared: determination, current, modeled })
}
