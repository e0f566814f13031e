//! A model against a recording: in closed loop where PSEC was recorded, by inverse dynamics where the current was.

use super::closed_loop::{Experiment, Simulated, experiments, simulate_all};
use super::fit::determination;
use super::friction::{current, speed_unit};
use super::identification::Input;
use super::mode::FeedforwardMode;
use super::segments::{Segment, SegmentKind, segments};
use crate::recording::Signals;
use virtual_axes_core::config::{AxisConfig, Periods};
use virtual_axes_core::drive::Gravity;
use virtual_axes_core::machine::MachineError;

/// Largest and RMS deviation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Deviation {
    /// Largest magnitude.
    pub max: f64,
    /// Root of the mean square.
    pub rms: f64,
}

/// Simulated against recorded signals.
#[derive(Debug, Clone, PartialEq)]
pub struct Comparison {
    /// Position where the velocity is constant, m or rad; none if it never is.
    pub constant_velocity: Option<Deviation>,
    /// Position everywhere else, m or rad.
    pub elsewhere: Option<Deviation>,
    /// Velocity, m/s or rad/s.
    pub velocity: Option<Deviation>,
    /// Current, A.
    pub current: Option<Deviation>,
    /// R² of the current as recorded.
    pub current_determination: Option<f64>,
}

/// Currents that the recorded motion asks for against those recorded.
#[derive(Debug, Clone, PartialEq)]
pub struct InverseDynamics {
    /// R² of the current as recorded, unfiltered.
    pub determination: f64,
    /// Deviation of the current, A.
    pub current: Deviation,
    /// Number of the span, and the current that the model asks for at each of its samples, A.
    pub modeled: Vec<(usize, Vec<f64>)>,
}

/// How an axis agrees with a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Agreement {
    /// What the recorded axis does when.
    pub segments: Vec<Segment>,
    /// Parts of the recording that were simulated; none without PSEC.
    pub experiments: Vec<Experiment>,
    /// Their simulations.
    pub simulated: Vec<Simulated>,
    /// How the two agree.
    pub comparisons: Vec<Comparison>,
    /// What the recorded motion asks for against the recorded current; none without one.
    pub inverse: Option<InverseDynamics>,
}

impl Agreement {
    /// R² of the current as recorded: the lowest of the simulated parts, else that of inverse dynamics.
    pub fn current_determination(&self) -> Option<f64> {
        let simulated = self.comparisons.iter().filter_map(|c| c.current_determination).reduce(f64::min);
        simulated.or(self.inverse.as_ref().map(|inverse| inverse.determination))
    }
}

/// Simulates `axis` on a recording that it was not identified from, and compares.
///
/// # Errors
/// [`MachineError`] if the axis cannot be simulated.
pub fn validate(input: &Input<'_>, axis: &AxisConfig, periods: &Periods) -> Result<Agreement, MachineError> {
    let mode = input.feedforward.unwrap_or(FeedforwardMode::Both);
    let experiments = experiments(input.signals, 0, axis, periods, mode);
    agreement(input.signals, segments(input.signals), experiments, axis, periods)
}

/// The agreement of an axis with the parts of a recording.
pub(super) fn agreement(
    signals: &Signals,
    segments: Vec<Segment>,
    experiments: Vec<Experiment>,
    axis: &AxisConfig,
    periods: &Periods,
) -> Result<Agreement, MachineError> {
    let simulated = simulate_all(axis, periods, &experiments)?;
    let comparisons = experiments.iter().zip(&simulated).map(|(e, s)| compare(e, s, &segments)).collect();
    let inverse = inverse_dynamics(signals, &segments, axis);
    Ok(Agreement { segments, experiments, simulated, comparisons, inverse })
}

fn deviation(differences: impl Iterator<Item = f64>) -> Option<Deviation> {
    let (mut count, mut squares, mut max) = (0_usize, 0.0, 0.0_f64);
    for d in differences.filter(|d| !d.is_nan()) {
        (count, squares, max) = (count + 1, squares + d * d, max.max(d.abs()));
    }
    (count > 0).then(|| Deviation { max, rms: (squares / count as f64).sqrt() })
}

/// Compares an experiment with its simulation.
fn compare(experiment: &Experiment, simulated: &Simulated, segments: &[Segment]) -> Comparison {
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
        deviation(pairs.filter(move |(_, c)| **c == wanted).map(|((s, r), _)| s - r))
    };
    let currents = || experiment.current.iter().flatten().copied().zip(simulated.current.iter().copied());
    let recorded = || currents().filter(|(r, _)| !r.is_nan());
    let r2 = determination(recorded());
    Comparison {
        constant_velocity: position(true),
        elsewhere: position(false),
        velocity: deviation(simulated.velocity.iter().zip(&experiment.velocity).map(|(s, r)| s - r)),
        current: deviation(recorded().map(|(r, s)| s - r)),
        // At rest there is nothing to explain.
        current_determination: (experiment.moves() && r2.is_finite()).then_some(r2),
    }
}

/// (Prévost eqs. 1 and 3) `i = (Jeq dω/dt + C_friction + C_gravity) / Kt` of the recorded motion; none
/// without a current.
///
/// At rest any friction within ±i0 holds an axis: of the current what is within that of gravity is taken for it.
fn inverse_dynamics(signals: &Signals, segments: &[Segment], axis: &AxisConfig) -> Option<InverseDynamics> {
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
                axis.motor.inertia * span.acceleration[i] / (r * kt) + current(&axis.friction, v) + held
            })
            .collect();
        pairs.extend(recorded.iter().copied().zip(currents.iter().copied()).filter(|(r, _)| !r.is_nan()));
        modeled.push((number, currents));
    }
    let current = deviation(pairs.iter().map(|(r, m)| m - r))?;
    let determination = determination(pairs.iter().copied());
    Some(InverseDynamics { determination, current, modeled })
}
