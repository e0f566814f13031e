//! Offline trials: runs setpoints through the simulation and returns figures and a signal recording.
//!
//! Setpoints are submitted to the [`Simulation`](crate::simulation::Simulation) piece by piece, and every tick is
//! evaluated as it is computed, so that the memory does not grow with the duration.

mod circle;
mod corner;
mod cycle;
mod definition;
mod energy;
mod figures;
mod observer;
mod path_features;
mod recorder;
mod run;
mod setpoints;
mod submitter;
mod variants;

pub use definition::{Measures, Tick, Trial, TrialError, TrialOutcome};
pub use figures::{
    AxisEnergy, AxisFigures, BidirectionalFigures, CircleFigures, ContourFigures, CornerFigures,
    DcLinkEnergy, Figures, OrientationFigures, RapidFigures, Reference,
};
pub use run::{RunOptions, run, run_compensated, run_with_options, trace};
pub use setpoints::{
    GridRows, GridSource, ProgramSource, Requests, SetpointSource, SourceError, UnreachableError,
};
pub use variants::run_variants;
