//! One trial, offline: setpoints through the simulation, its figures and its recording.
//!
//! The trial gives the [`Simulation`] its setpoints piece by piece and
//! looks at every tick, so that its memory does not grow with its length.

mod circle;
mod corner;
mod figures;
mod observer;
mod period;
mod recorder;
mod setpoints;
mod supply;
mod together;
mod windows;

use std::io;
use std::sync::Arc;

use crate::assess::Recording;
use crate::config::MachineConfig;
use crate::machine::Machine;
use crate::path::Program;
use crate::simulation::{Simulation, SimulationError, joints};
use crate::trajectory::Rejection;
use crate::units::Nanoseconds;

pub use figures::{
    AxisFigures, BidirectionalFigures, CircleFigures, ContourFigures, CornerFigures, Figures,
    OrientationFigures, Reference,
};
pub use setpoints::{GridSource, ProgramSource, Requests, Setpoints, SourceError, UnreachableError};
pub use together::run_together;

use observer::{Measures, Observer};
use period::Period;
use supply::Supply;

/// What is to be run, besides the setpoints.
#[derive(Debug, Clone)]
pub struct Trial<'a> {
    /// The machine.
    pub machine: &'a MachineConfig,
    /// Path and law of time that the setpoints come from, if these are known: contour errors are
    /// measured against the path then, otherwise against the polyline through the setpoints.
    pub program: Option<Arc<Program>>,
    /// Accept trajectories whose last point has a velocity.
    pub allow_nonzero_end_velocity: bool,
    /// Whether to keep a [`Recording`].
    pub record: bool,
}

/// What came out.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// Errors, currents, saturation.
    pub figures: Figures,
    /// Signals, if they were asked for.
    pub recording: Option<Recording>,
}

/// A tick of a trial, after the controllers have acted and before the plants move.
#[derive(Debug, Clone, Copy)]
pub struct Tick<'a> {
    /// Time from the start, ns.
    pub time: Nanoseconds,
    /// Whether it is the first of a position period.
    pub position_instant: bool,
    /// The machine.
    pub machine: &'a Machine,
}

/// Why a trial did not come to its end.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TrialError {
    /// The setpoints cannot be read, or are wrong.
    #[error(transparent)]
    Source(SourceError),
    /// The machine cannot do what is asked.
    #[error("at {time} s: {rejection}")]
    Rejected {
        /// Time from the start, s.
        time: f64,
        /// Why.
        rejection: Rejection,
    },
    /// There is no simulation of the machine.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    /// Who watches cannot go on (a trace that cannot be written).
    #[error(transparent)]
    Watch(io::Error),
}

/// Runs `setpoints` until the axes have settled, and shows every position instant to `watch`.
///
/// The machine starts at rest at the first setpoint; a trajectory whose first point is later than 0
/// is approached from home.
///
/// # Errors
/// [`TrialError`].
pub fn run(
    trial: &Trial<'_>,
    setpoints: Setpoints<'_>,
    mut watch: impl FnMut(Tick<'_>) -> io::Result<()>,
) -> Result<Outcome, TrialError> {
    run_by(trial, setpoints, |simulation| {
        let time = simulation.time_of(simulation.next_instant());
        let ran = simulation.step();
        let machine = simulation.machine();
        if ran { watch(Tick { time, position_instant: true, machine }).map(|()| ran) } else { Ok(ran) }
    })
}

/// As [`run`], but shows every tick to `watch`.
///
/// # Errors
/// [`TrialError`].
pub fn trace(
    trial: &Trial<'_>,
    setpoints: Setpoints<'_>,
    mut watch: impl FnMut(Tick<'_>) -> io::Result<()>,
) -> Result<Outcome, TrialError> {
    let tick = trial.machine.periods().current;
    run_by(trial, setpoints, |simulation| {
        let mut time = simulation.time_of(simulation.next_instant());
        let mut watched = Ok(());
        let ran = simulation.step_with(|machine, position_instant| {
            if watched.is_ok() {
                watched = watch(Tick { time, position_instant, machine });
            }
            time += tick;
        });
        watched.map(|()| ran)
    })
}

/// Runs `setpoints`; `step` computes a position period and says whether the machine ran.
fn run_by(
    trial: &Trial<'_>,
    setpoints: Setpoints<'_>,
    mut step: impl FnMut(&mut Simulation) -> io::Result<bool>,
) -> Result<Outcome, TrialError> {
    let (mut simulation, mut supply, start) = begin(trial, setpoints)?;
    let mut observer = Observer::new(trial, &start, Measures::All);
    let mut period = Period::new(trial.machine.periods(), start.len());
    loop {
        supply.offer_due(&mut simulation)?;
        if !simulation.is_busy() && supply.is_empty() {
            break;
        }
        let moving = simulation.is_asked();
        observer.look_ahead(&simulation);
        let time = simulation.time_of(simulation.next_instant());
        if step(&mut simulation).map_err(TrialError::Watch)? {
            let machine = simulation.machine();
            period.begin(time, moving);
            (0..start.len()).for_each(|place| period.put(place, machine, place));
            observer.observe(|place| (machine, place), &mut period);
        }
    }
    Ok(observer.finish())
}

/// The trial's machine at rest where the setpoints begin, those, and that place, m or rad.
fn begin<'a>(
    trial: &Trial<'_>,
    setpoints: Setpoints<'a>,
) -> Result<(Simulation, Supply<'a>, Vec<f64>), TrialError> {
    let limits = joints(trial.machine, "");
    let mut simulation = Simulation::new(trial.machine, limits.clone(), 0)?;
    // The observer measures.
    simulation.set_assessing(false);
    let supply = Supply::new(setpoints, &limits, trial)?;
    let home = vec![0.0; limits.len()];
    let start = supply.start().unwrap_or(&home).to_vec();
    simulation.reset_to(&start).map_err(|rejection| TrialError::Rejected { time: 0.0, rejection })?;
    Ok((simulation, supply, start))
}
