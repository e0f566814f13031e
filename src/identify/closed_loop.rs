//! The whole axis, simulated on the set-points of a recording.

use std::sync::Arc;

use nalgebra::DVector;
use rayon::prelude::*;

use super::recording::Signals;
use super::setpoints::{Setpoints, interpolated};
use crate::config::{AxisConfig, KinematicsConfig, MachineConfig, Periods};
use crate::machine::{Machine, MachineError, MachineParameters};
use crate::units::seconds;

/// How long PSEC must stand, s, before an axis is taken for at rest.
const AT_REST: f64 = 0.1;

/// What feedforward an axis was recorded with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum FeedforwardMode {
    /// None.
    Off,
    /// Velocity feedforward.
    Velocity,
    /// Velocity and torque feedforward.
    Both,
}

impl FeedforwardMode {
    /// As on the command line.
    pub fn name(self) -> &'static str {
        match self {
            FeedforwardMode::Off => "off",
            FeedforwardMode::Velocity => "velocity",
            FeedforwardMode::Both => "both",
        }
    }

    /// An axis with this much of its feedforward.
    pub(super) fn of(self, axis: &AxisConfig) -> AxisConfig {
        let mut axis = axis.clone();
        if self == FeedforwardMode::Off {
            axis.feedforward.velocity = 0.0;
        }
        if self != FeedforwardMode::Both {
            axis.feedforward.torque = 0.0;
        }
        axis
    }
}

/// A part of a recording that begins at rest, and can be simulated.
#[derive(Debug, Clone, PartialEq)]
pub struct Experiment {
    /// Number of the recording.
    pub recording: usize,
    /// What feedforward acted.
    pub mode: FeedforwardMode,
    /// PSEC at the position instants from the first one on, m or rad.
    psec: Vec<f64>,
    /// Time of the first sample behind the first instant, s, and from sample to sample.
    first: f64,
    period: f64,
    /// Time of the first sample in the recording, s.
    pub start: f64,
    /// Recorded position, m or rad.
    pub position: Vec<f64>,
    /// Recorded velocity, or that of the filtered position, m/s or rad/s.
    pub velocity: Vec<f64>,
    /// Recorded current, A.
    pub current: Option<Vec<f64>>,
}

/// An axis at the samples of an experiment.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Simulated {
    /// SP, m or rad.
    pub position: Vec<f64>,
    /// SV, m/s or rad/s.
    pub velocity: Vec<f64>,
    /// SMC, A.
    pub current: Vec<f64>,
}

impl Experiment {
    /// Sampling period, s.
    pub fn period(&self) -> f64 {
        self.period
    }

    /// PSEC under sample i as the staircase shows it, m or rad.
    pub fn psec_at(&self, i: usize, tsp: f64) -> f64 {
        let instant = ((self.first + i as f64 * self.period) / tsp + 1e-9).floor().max(0.0) as usize;
        self.psec.get(instant.min(self.psec.len().saturating_sub(1))).copied().unwrap_or(f64::NAN)
    }
}

/// The parts of a recording that begin at rest; none without PSEC.
///
/// `mode` says what feedforward acted where the recording itself does not.
pub fn experiments(signals: &Signals, recording: usize, tsp: f64, mode: FeedforwardMode) -> Vec<Experiment> {
    let mut found = Vec::new();
    for span in &signals.spans {
        let Some(setpoints) = Setpoints::of(span, signals.period, tsp) else { continue };
        let instants = (AT_REST / tsp).ceil() as usize;
        let Some(begin) = rest_from(&setpoints.values, instants) else { continue };
        let time = setpoints.first + begin as f64 * tsp;
        let sample = (time / signals.period - 1e-6).ceil() as usize;
        let of = |channel: &[f64]| channel.get(sample..).unwrap_or_default().to_vec();
        found.push(Experiment {
            recording,
            mode,
            psec: setpoints.values[begin..].to_vec(),
            first: sample as f64 * signals.period - time,
            period: signals.period,
            start: span.start + sample as f64 * signals.period,
            position: of(&span.position),
            velocity: of(span.recorded_velocity.as_ref().unwrap_or(&span.velocity)),
            current: span.current.as_deref().map(of),
        });
    }
    found
}

/// The first instant from which PSEC stands for `count` instants.
fn rest_from(psec: &[f64], count: usize) -> Option<usize> {
    psec.windows(count.max(1)).position(|window| window.iter().all(|value| *value == window[0]))
}

/// Simulates an axis on an experiment.
///
/// # Errors
/// [`MachineError`] if there is no such axis.
pub fn simulate(
    axis: &AxisConfig,
    periods: &Periods,
    experiment: &Experiment,
) -> Result<Simulated, MachineError> {
    let config = MachineConfig {
        name: String::new(),
        periods: *periods,
        kinematics: KinematicsConfig::default(),
        axes: vec![experiment.mode.of(axis)],
    };
    let mut machine = Machine::new(Arc::new(MachineParameters::new(&config)?));
    let Some(first) = experiment.psec.first() else { return Ok(Simulated::default()) };
    machine.reset(&[*first]);
    let tick = seconds(periods.current);
    let (count, mut next) = (experiment.position.len(), 0);
    let mut simulated = Simulated::default();
    let mut before = [0.0; 3];
    // Time in ticks; samples between two ticks are interpolated.
    let time_of = |i: usize| (experiment.first + i as f64 * experiment.period) / tick;
    let mut due = time_of(0);
    let mut now = 0_u64;
    for psec in &experiment.psec {
        machine.advance_with(&[*psec], &[], |machine| {
            let s = machine.axis(0).sample();
            let here = [s.position, s.velocity, s.current];
            while next < count && due <= now as f64 + 1e-6 {
                let part = (now as f64 - due).clamp(0.0, 1.0);
                let at = |k: usize| here[k] + (before[k] - here[k]) * if part < 1e-6 { 0.0 } else { part };
                simulated.position.push(at(0));
                simulated.velocity.push(at(1));
                simulated.current.push(at(2));
                next += 1;
                due = time_of(next);
            }
            before = here;
            now += 1;
        });
    }
    Ok(simulated)
}

/// Simulates all of several experiments, over all cores.
///
/// # Errors
/// As [`simulate`].
pub fn simulate_all(
    axis: &AxisConfig,
    periods: &Periods,
    experiments: &[Experiment],
) -> Result<Vec<Simulated>, MachineError> {
    experiments.par_iter().map(|experiment| simulate(axis, periods, experiment)).collect()
}

/// Simulated minus recorded position at every sample of every experiment, m or rad.
pub(super) fn deviations(
    axis: &AxisConfig,
    periods: &Periods,
    experiments: &[Experiment],
) -> Option<DVector<f64>> {
    let simulated = simulate_all(axis, periods, experiments).ok()?;
    let pairs = experiments.iter().zip(&simulated);
    let all = pairs.flat_map(|(e, s)| s.position.iter().zip(&e.position).map(|(s, r)| s - r));
    let all: Vec<f64> = all.collect();
    all.iter().all(|d| d.is_finite()).then(|| DVector::from_vec(all))
}
