//! Runs one machine on the setpoints of a trial.

use std::io;

use crate::assess::PathDeviations;
use crate::simulation::{Simulation, joint_limits};

use super::cycle::PositionCycle;
use super::definition::{Tick, Trial, TrialError, TrialOutcome};
use super::observer::Observer;
use super::setpoints::SetpointSource;
use super::submitter::TrajectorySubmitter;

/// Inputs and outputs of a run beyond its setpoints and figures.
#[derive(Default)]
pub struct RunOptions<'a> {
    /// True if the callback is called at every tick, false if at every position cycle.
    pub every_tick: bool,
    /// External loads from time 0, N or N·m: a row of all axes per position cycle, of which the last one holds; empty for
    /// none.
    pub loads: &'a [f64],
    /// Receiver of the deviations of the tool at the ticks of each position cycle, if contour errors are evaluated.
    pub on_deviations: Option<&'a mut dyn FnMut(&PathDeviations)>,
    /// Programmed setpoints that contour errors are measured against without a known path, as for [`run_compensated`].
    pub programmed: Option<&'a [f64]>,
}

/// Runs `setpoints` until the axes have settled and calls `callback` at every position cycle.
///
/// The machine starts at rest at the first setpoint. If the first point of a trajectory is later than 0, the machine
/// approaches it from the home position. After the last setpoint the setpoints hold, and the run ends with the first
/// position cycle that is 1 s later: N setpoints with Tsp = 6 ms give N + 167 cycles.
///
/// # Errors
/// Returns [`TrialError`] if setpoints are invalid or rejected, the machine cannot be simulated, or `callback` fails.
pub fn run(
    trial: &Trial<'_>,
    setpoints: SetpointSource<'_>,
    callback: impl FnMut(Tick<'_>) -> io::Result<()>,
) -> Result<TrialOutcome, TrialError> {
    run_with_options(trial, setpoints, RunOptions::default(), callback)
}

/// Runs compensated `setpoints` as [`run`] does and measures contour errors against the `programmed` ones where the path
/// is not known.
///
/// `programmed` has a row of all axes per position cycle from time 0, m or rad; the last row holds. The following errors
/// of the axes are those against the compensated setpoints.
///
/// # Errors
/// Returns [`TrialError`] as [`run`] does.
pub fn run_compensated(
    trial: &Trial<'_>,
    setpoints: SetpointSource<'_>,
    programmed: &[f64],
    callback: impl FnMut(Tick<'_>) -> io::Result<()>,
) -> Result<TrialOutcome, TrialError> {
    let options = RunOptions { programmed: Some(programmed), ..RunOptions::default() };
    run_with_options(trial, setpoints, options, callback)
}

/// Runs `setpoints` as [`run`] does, with further inputs and outputs.
///
/// # Errors
/// Returns [`TrialError`] as [`run`] does.
pub fn run_with_options(
    trial: &Trial<'_>,
    setpoints: SetpointSource<'_>,
    options: RunOptions<'_>,
    callback: impl FnMut(Tick<'_>) -> io::Result<()>,
) -> Result<TrialOutcome, TrialError> {
    match options.every_tick {
        true => run_with(trial, setpoints, options, tick_step(trial, callback)),
        false => run_with(trial, setpoints, options, cycle_step(callback)),
    }
}

/// Returns a step of one position cycle that calls `callback`.
fn cycle_step(
    mut callback: impl FnMut(Tick<'_>) -> io::Result<()>,
) -> impl FnMut(&mut Simulation) -> io::Result<bool> {
    move |simulation| {
        let time = simulation.time_of(simulation.next_instant());
        let ran = simulation.step();
        let machine = simulation.machine();
        if ran { callback(Tick { time, position_instant: true, machine }).map(|()| ran) } else { Ok(ran) }
    }
}

/// Runs `setpoints` as [`run`] does and calls `callback` at every tick.
///
/// # Errors
/// Returns [`TrialError`] as [`run`] does.
pub fn trace(
    trial: &Trial<'_>,
    setpoints: SetpointSource<'_>,
    callback: impl FnMut(Tick<'_>) -> io::Result<()>,
) -> Result<TrialOutcome, TrialError> {
    run_with_options(trial, setpoints, RunOptions { every_tick: true, ..RunOptions::default() }, callback)
}

/// Returns a step of one position cycle that calls `callback` at every tick.
fn tick_step(
    trial: &Trial<'_>,
    mut callback: impl FnMut(Tick<'_>) -> io::Result<()>,
) -> impl FnMut(&mut Simulation) -> io::Result<bool> {
    let tick = trial.machine.periods().current;
    move |simulation| {
        let mut time = simulation.time_of(simulation.next_instant());
        let mut result = Ok(());
        let ran = simulation.step_with(|machine, position_instant| {
            if result.is_ok() {
                result = callback(Tick { time, position_instant, machine });
            }
            time += tick;
        });
        result.map(|()| ran)
    }
}

/// Runs `setpoints`; `step` computes a position cycle and returns true if the machine advanced.
fn run_with(
    trial: &Trial<'_>,
    setpoints: SetpointSource<'_>,
    mut options: RunOptions<'_>,
    mut step: impl FnMut(&mut Simulation) -> io::Result<bool>,
) -> Result<TrialOutcome, TrialError> {
    let (mut simulation, mut submitter, start) = start(trial, setpoints)?;
    let mut observer = Observer::new(trial, &start);
    let mut loads = options.loads.chunks_exact(start.len().max(1));
    if let Some(rows) = options.programmed {
        observer.set_programmed(rows);
    }
    let mut cycle = PositionCycle::new(trial.machine.periods(), start.len());
    loop {
        submitter.submit_due(&mut simulation)?;
        if !simulation.is_busy() && submitter.is_empty() {
            break;
        }
        let is_moving = simulation.has_active_commands();
        observer.push_preview(&simulation, |instant| submitter.is_rapid(instant));
        for (axis, &load) in loads.next().into_iter().flatten().enumerate() {
            simulation.set_lasting_load(axis, load);
        }
        let time = simulation.time_of(simulation.next_instant());
        if step(&mut simulation).map_err(TrialError::Callback)? {
            let machine = simulation.machine();
            cycle.begin(time, is_moving);
            if observer.needs_positions() {
                (0..start.len()).for_each(|index| cycle.store_positions(index, machine, index));
            }
            observer.observe(|index| (machine, index), &mut cycle);
            if let (Some(on_deviations), Some(deviations)) =
                (&mut options.on_deviations, observer.deviations())
            {
                on_deviations(deviations);
            }
        }
    }
    Ok(observer.finish())
}

/// Returns the trial's machine at rest at the first setpoints, the submitter, and that position, m or rad.
pub(super) fn start<'a>(
    trial: &Trial<'_>,
    setpoints: SetpointSource<'a>,
) -> Result<(Simulation, TrajectorySubmitter<'a>, Vec<f64>), TrialError> {
    let limits = joint_limits(trial.machine, "");
    let mut simulation = Simulation::new(trial.machine, limits.clone(), 0)?;
    // The observer computes the figures.
    simulation.set_assessing(false);
    simulation.record_every_tick(trial.measures.energy);
    let submitter = TrajectorySubmitter::new(setpoints, &limits, trial)?;
    let home = vec![0.0; limits.len()];
    let start = submitter.start().unwrap_or(&home).to_vec();
    simulation.reset_to(&start).map_err(|rejection| TrialError::Rejected { time: 0.0, rejection })?;
    Ok((simulation, submitter, start))
}
