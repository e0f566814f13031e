//! Definition, ticks, outcome and errors of a trial.

use std::io;
use std::sync::Arc;

use crate::assess::SignalRecording;
use crate::config::MachineConfig;
use crate::machine::Machine;
use crate::path::Program;
use crate::simulation::SimulationError;
use crate::trajectory::Rejection;
use crate::units::Nanoseconds;

use super::figures::Figures;
use super::setpoints::SourceError;

/// Definition of a trial, without its setpoints.
#[derive(Debug, Clone)]
pub struct Trial<'a> {
    /// Machine to simulate.
    pub machine: &'a MachineConfig,
    /// Program that the setpoints are sampled from, if known. Contour errors are measured against its path,
    /// otherwise against the polyline through the setpoints.
    pub program: Option<Arc<Program>>,
    /// True if trajectories may end with a velocity different from 0.
    pub allow_nonzero_end_velocity: bool,
    /// True if a [`SignalRecording`] is kept.
    pub record: bool,
    /// Figures beyond those of the axes.
    pub measures: Measures,
}

/// Choice of the figures that a trial computes beyond those of the axes.
///
/// Figures of the axes need one sample per position cycle and little time. Energy needs the voltage at every tick, the
/// others the tool pose:
/// with all of them a trial takes several times as long as the machine alone.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Measures {
    /// Contour and orientation error, and the errors at corners.
    pub contour: bool,
    /// Circularity of circles (ISO 230-4).
    pub circles: bool,
    /// Electrical energy and mechanical work of the axes.
    pub energy: bool,
}

impl Measures {
    /// All figures.
    pub const ALL: Measures = Measures { contour: true, circles: true, energy: true };
    /// Figures of the axes only.
    pub const AXES: Measures = Measures { contour: false, circles: false, energy: false };
    /// Contour and orientation error without circles, each of which needs more time and memory than the rest, and without
    /// energy.
    pub const WITHOUT_CIRCLES: Measures = Measures { contour: true, circles: false, energy: false };
}

impl Default for Measures {
    /// Returns [`Measures::ALL`].
    fn default() -> Self {
        Measures::ALL
    }
}

/// Outcome of a trial.
#[derive(Debug, Clone, PartialEq)]
pub struct TrialOutcome {
    /// Errors, currents, saturation.
    pub figures: Figures,
    /// Recorded signals, if [`Trial::record`] is set.
    pub recording: Option<SignalRecording>,
}

/// A current cycle of a trial, after the controllers and before the drives are advanced.
#[derive(Debug, Clone, Copy)]
pub struct Tick<'a> {
    /// Time from the start, ns.
    pub time: Nanoseconds,
    /// True for the first tick of a position cycle.
    pub position_instant: bool,
    /// Simulated machine.
    pub machine: &'a Machine,
}

/// An error that ends a trial.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TrialError {
    /// Setpoints that cannot be read or are invalid.
    #[error(transparent)]
    Source(SourceError),
    /// Trajectory rejected by the simulation.
    #[error("at {time} s: {rejection}")]
    Rejected {
        /// Time from the start, s.
        time: f64,
        /// Reason.
        rejection: Rejection,
    },
    /// Machine that cannot be simulated.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    /// Error returned by the caller's callback, for instance while writing a trace.
    #[error(transparent)]
    Callback(io::Error),
}
