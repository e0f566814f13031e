//! Closed-loop simulation of an axis on recorded setpoints.

use std::ops::Range;
use std::sync::Arc;

use nalgebra::DVector;
use rayon::prelude::*;

use super::experiment::{CurrentLogging, Experiment, SimulatedExperiment};
use super::feedforward_mode::FeedforwardMode;
use super::low_pass::LowPassFilter;
use super::setpoints::{SetpointGrid, stride};
use super::trace_experiments::trace_experiments;
use crate::recording::{SignalSpan, Signals};
use virtual_axes_core::config::{AxisConfig, AxisKind, MachineConfig, Periods};
use virtual_axes_core::machine::{Machine, MachineError, MachineParameters};
use virtual_axes_core::units::{DEGREE, seconds};

/// Duration of constant PSEC, s, after which an axis can be at rest.
const AT_REST: f64 = 0.1;
/// Largest motion at rest during that time, m and rad: a few encoder increments.
const RESTING: f64 = 5e-6;
const RESTING_ANGLE: f64 = 5e-3 * DEGREE;
/// Largest change of PSEC at rest, m and rad: noise and rounding of the recorded setpoints.
const STILL: f64 = 1e-7;
const STILL_ANGLE: f64 = 1e-4 * DEGREE;

/// Splits a recording into experiments that start at rest and have one feedforward mode; empty without PSEC.
///
/// `mode` is the active feedforward if the recording does not contain VFFWS and TFFWS.
pub fn find_experiments(
    signals: &Signals,
    recording: usize,
    axis: &AxisConfig,
    periods: &Periods,
    mode: FeedforwardMode,
) -> Vec<Experiment> {
    let tsp = seconds(periods.position);
    if stride(signals.period, tsp).is_none() {
        // A current recorded more coarsely than the position cycle counts as its mean.
        let logging = if signals.period > tsp { CurrentLogging::MEAN } else { CurrentLogging::INSTANT };
        return trace_experiments(signals, recording, periods, (mode, 0.0, logging));
    }
    let mut found = Vec::new();
    let (resting, still) = match axis.kind() {
        AxisKind::Linear => (RESTING, STILL),
        AxisKind::Rotary => (RESTING_ANGLE, STILL_ANGLE),
    };
    let instants = (AT_REST / tsp).ceil() as usize;
    for (number, span) in signals.spans.iter().enumerate() {
        let Some(setpoints) = SetpointGrid::of(span, signals.period, tsp) else { continue };
        for (mode, part) in split_by_feedforward(span, &setpoints, (signals.period, tsp, still), mode) {
            let (psec, end) = (&setpoints.values[part.clone()], part.end);
            let sample_of = |instant: usize| {
                let time = setpoints.first + instant as f64 * tsp;
                (time / signals.period - 1e-6).ceil().max(0.0) as usize
            };
            let position =
                |k: usize| span.position.get(sample_of(part.start + k)).copied().unwrap_or(f64::NAN);
            let Some(begin) = find_rest(psec, instants, (still, resting), position).map(|k| part.start + k)
            else {
                continue;
            };
            let sample = sample_of(begin);
            let last = if end == setpoints.values.len() { span.position.len() } else { sample_of(end) };
            let of = |channel: &[f64]| channel.get(sample..last).unwrap_or_default().to_vec();
            let time = setpoints.first + begin as f64 * tsp;
            found.push(Experiment {
                recording,
                span: number,
                sample,
                mode,
                cycle: tsp,
                psec: setpoints.values[begin..end].to_vec(),
                first: sample as f64 * signals.period - time,
                period: signals.period,
                trace_filter: signals.trace_filter,
                logging: CurrentLogging::INSTANT,
                start: span.start + sample as f64 * signals.period,
                position: of(&span.position),
                velocity: of(span.recorded_velocity.as_ref().unwrap_or(&span.velocity)),
                current: span.current.as_deref().map(of),
            });
        }
    }
    found
}

/// Splits the position cycles of a span by feedforward mode, at the standstill before a change. `period` and `tsp` are
/// the sampling period and the position cycle, s, `still` is the largest change of PSEC at rest.
fn split_by_feedforward(
    span: &SignalSpan,
    setpoints: &SetpointGrid,
    (period, tsp, still): (f64, f64, f64),
    given: FeedforwardMode,
) -> Vec<(FeedforwardMode, Range<usize>)> {
    let count = setpoints.values.len();
    let Some(velocity) = &span.velocity_feedforward else { return vec![(given, 0..count)] };
    let instants = (AT_REST / tsp).ceil() as usize;
    let acts = |channel: Option<&Vec<f64>>, from: usize, to: usize| {
        let sample = |k: usize| ((setpoints.first + k as f64 * tsp) / period) as usize;
        let end = channel.map_or(0, Vec::len).min(sample(to));
        channel.and_then(|c| c.get(sample(from).min(end)..end)).is_some_and(|c| c.iter().any(|v| *v != 0.0))
    };
    let mut found: Vec<(FeedforwardMode, Range<usize>)> = Vec::new();
    for (from, to) in find_moves(&setpoints.values, instants, still) {
        // The delays keep the feedforward active for some time after the setpoints.
        let to = (to + instants).min(count);
        let mode = match (acts(Some(velocity), from, to), acts(span.torque_feedforward.as_ref(), from, to)) {
            (false, _) => FeedforwardMode::Off,
            (true, true) => FeedforwardMode::Both,
            // Without the TFFWS channel the torque feedforward cannot be detected.
            (true, false) if span.torque_feedforward.is_none() && given == FeedforwardMode::Both => given,
            (true, false) => FeedforwardMode::Velocity,
        };
        match found.last_mut() {
            Some((last, range)) if *last == mode => range.end = to,
            Some((_, range)) => {
                let cut = from.saturating_sub(instants).max(range.end);
                range.end = cut;
                found.push((mode, cut..to));
            }
            None => found.push((mode, 0..to)),
        }
    }
    if let Some((_, range)) = found.last_mut() {
        range.end = count;
    }
    found
}

/// Returns start and end of each move of PSEC, which changes by more than `still` per cycle; pauses shorter than `rest`
/// cycles belong to a move.
fn find_moves(psec: &[f64], rest: usize, still: f64) -> Vec<(usize, usize)> {
    let mut found: Vec<(usize, usize)> = Vec::new();
    for (k, pair) in psec.windows(2).enumerate() {
        if (pair[1] - pair[0]).abs() <= still {
            continue;
        }
        match found.last_mut() {
            Some((_, to)) if k < *to + rest => *to = k + 1,
            _ => found.push((k, k + 1)),
        }
    }
    found
}

/// Returns the first position cycle from which PSEC varies by at most `still`, and the position by `resting`, for `count`
/// cycles.
fn find_rest(
    psec: &[f64],
    count: usize,
    (still, resting): (f64, f64),
    position: impl Fn(usize) -> f64,
) -> Option<usize> {
    let range = |window: &[f64]| {
        let (low, high) =
            window.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(*x), h.max(*x)));
        high - low
    };
    let stands = |k: usize| (position(k + count.saturating_sub(1)) - position(k)).abs() <= resting;
    let windows = psec.windows(count.max(1)).enumerate();
    windows.filter(|(_, window)| range(window) <= still).map(|(k, _)| k).find(|k| stands(*k))
}

/// Simulates an axis on an experiment.
///
/// # Errors
/// [`MachineError`] if the axis parameters are invalid.
pub fn simulate(
    axis: &AxisConfig,
    periods: &Periods,
    experiment: &Experiment,
) -> Result<SimulatedExperiment, MachineError> {
    let is_instant = experiment.logging == CurrentLogging::INSTANT;
    let (mut simulated, history) = simulate_ticks(axis, periods, experiment, !is_instant)?;
    if !is_instant {
        simulated.current = history.logged(experiment, experiment.logging);
    }
    Ok(simulated)
}

/// Simulated currents of an experiment at the current cycles.
pub(super) struct CurrentHistory {
    /// Sums of the currents before each cycle, A.
    sums: Vec<f64>,
    /// Current cycle, s.
    tick: f64,
    /// Position cycle, s.
    tsp: f64,
}

impl CurrentHistory {
    /// Simulates an axis on an experiment.
    ///
    /// # Errors
    /// [`MachineError`] if the axis parameters are invalid.
    pub fn new(axis: &AxisConfig, periods: &Periods, experiment: &Experiment) -> Result<Self, MachineError> {
        Ok(simulate_ticks(axis, periods, experiment, true)?.1)
    }

    /// Returns the current logged at each sample, A.
    pub fn logged(&self, experiment: &Experiment, logging: CurrentLogging) -> Vec<f64> {
        let times = (0..experiment.position.len()).map(|i| experiment.first + i as f64 * experiment.period);
        self.logged_at(times, logging)
    }

    /// Returns the current logged at each time of a sample, A; times are those behind the first setpoint, s.
    pub fn logged_at(&self, times: impl Iterator<Item = f64>, logging: CurrentLogging) -> Vec<f64> {
        let count = self.sums.len() - 1;
        if count == 0 {
            return Vec::new();
        }
        let value = |k: usize| self.sums[k.min(count - 1) + 1] - self.sums[k.min(count - 1)];
        let half = 0.5 * self.tsp / self.tick;
        let of = |time: f64| {
            let time = time / self.tick;
            let at = (time + logging.offset / self.tick + 1e-6).max(0.0);
            let (k, part) = (at as usize, (at.fract() - 1e-6).max(0.0));
            let instant = value(k) + (value(k + 1) - value(k)) * part;
            let (from, to) = ((time - half).max(0.0) as usize, ((time + half) as usize).min(count));
            if to <= from {
                return instant;
            }
            let mean = (self.sums[to] - self.sums[from]) / (to - from) as f64;
            mean + logging.ripple * (instant - mean)
        };
        times.map(of).collect()
    }
}

/// Simulates an axis on an experiment, with the current of all cycles if `has_history`.
fn simulate_ticks(
    axis: &AxisConfig,
    periods: &Periods,
    experiment: &Experiment,
    has_history: bool,
) -> Result<(SimulatedExperiment, CurrentHistory), MachineError> {
    let config = MachineConfig::from_axis(experiment.mode.of(axis), *periods);
    let mut machine = Machine::new(Arc::new(MachineParameters::new(&config)?));
    let tick = seconds(periods.current);
    let mut history = CurrentHistory { sums: vec![0.0], tick, tsp: seconds(periods.position) };
    let mut simulated = SimulatedExperiment::default();
    let Some(first) = experiment.psec.first() else { return Ok((simulated, history)) };
    machine.reset(&[*first]);
    let (count, mut next) = (experiment.position.len(), 0);
    let mut before = [0.0; 3];
    // Time in ticks; samples between two ticks are interpolated.
    let time_of = |i: usize| (experiment.first + i as f64 * experiment.period) / tick;
    let mut due = time_of(0);
    let mut now = 0_u64;
    let mut filters = experiment
        .trace_filter
        .map(|cutoff| [*first, 0.0, 0.0].map(|start| LowPassFilter::new(cutoff, tick, start)));
    // Without a filter or a history, only the ticks on either side of a sample are read.
    let needs_all = has_history || filters.is_some();
    let ticks = machine.ticks_per_period();
    for psec in &experiment.psec {
        machine.advance(&[*psec], &[]);
        for tick in 0..ticks {
            let is_due = next < count && due <= now as f64 + 1e-6;
            if !needs_all && !is_due {
                now += 1;
                continue;
            }
            if !needs_all && tick > 0 {
                before = machine.motion_at(0, tick - 1);
            }
            let mut here = machine.motion_at(0, tick);
            if let Some(filters) = &mut filters {
                for (value, filter) in here.iter_mut().zip(filters) {
                    *value = filter.next(*value);
                }
            }
            while next < count && due <= now as f64 + 1e-6 {
                let part = (now as f64 - due).clamp(0.0, 1.0);
                let at = |k: usize| here[k] + (before[k] - here[k]) * if part < 1e-6 { 0.0 } else { part };
                simulated.position.push(at(0));
                simulated.velocity.push(at(1));
                simulated.current.push(at(2));
                next += 1;
                due = time_of(next);
            }
            if has_history {
                history.sums.push(history.sums.last().copied().unwrap_or(0.0) + here[2]);
            }
            before = here;
            now += 1;
        }
        if !needs_all && ticks > 0 {
            before = machine.motion_at(0, ticks - 1);
        }
    }
    Ok((simulated, history))
}

/// Simulates an axis on several experiments in parallel.
///
/// # Errors
/// [`MachineError`] if the axis parameters are invalid.
pub fn simulate_all(
    axis: &AxisConfig,
    periods: &Periods,
    experiments: &[Experiment],
) -> Result<Vec<SimulatedExperiment>, MachineError> {
    experiments.par_iter().map(|experiment| simulate(axis, periods, experiment)).collect()
}

/// Returns simulated minus recorded position at every sample of every experiment, m or rad.
pub(super) fn position_residuals(
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
