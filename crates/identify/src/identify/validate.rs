//! Validation of a model against a recording: closed-loop simulation with PSEC, inverse dynamics with
//! current.

use serde::Serialize;

use super::closed_loop::{Experiment, SimulatedExperiment, find_experiments, simulate_all};
use super::feedforward_mode::FeedforwardMode;
use super::fit::r_squared;
use super::friction::{friction_current, speed_unit};
use super::options::IdentificationInput;
use super::segments::{MotionSegment, SegmentKind, find_segments};
use crate::recording::Signals;
use virtual_axes_core::config::{AxisConfig, Periods};
use virtual_axes_core::drive::Gravity;
use virtual_axes_core::machine::MachineError;

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
    let mode = input.feedforward.unwrap_or(FeedforwardMode::Both);
    let experiments = find_experiments(input.signals, 0, axis, periods, mode);
    compute_agreement(input.signals, find_segments(input.signals), experiments, axis, periods)
}

/// Computes the agreement of an axis with the experiments of a recording.
pub(super) fn compute_agreement(
    signals: &Signals,
    segments: Vec<MotionSegment>,
    experiments: Vec<Experiment>,
    axis: &AxisConfig,
    periods: &Periods,
) -> Result<Agreement, MachineError> {
    let simulated = simulate_all(axis, periods, &experiments)?;
    let comparisons = experiments.iter().zip(&simulated).map(|(e, s)| compare(e, s, &segments)).collect();
    let inverse = inverse_dynamics(signals, &segments, axis);
    Ok(Agreement { segments, experiments, simulated, comparisons, inverse })
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
    let (kt, r, unit) = (axis.motor.torque_constant, axis.transmission_ratio, speed_unit(axis));
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
