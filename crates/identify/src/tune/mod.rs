//! Search of position controller tunings that minimize a cost on a path.
//!
//! A [`TuningProblem`] combines a machine, a [`Workload`] and a [`Cost`]; it simulates tunings and returns
//! their cost and the stability margins of the worst axis. [`tune_gpc`] searches tunings of a predictive
//! controller, [`tune_cascade`] gains of the cascade. Both accept only tunings within the [`MarginLimits`]
//! that never saturate. Simulations run in parallel on all cores; the result does not depend on the number of
//! cores.

mod cascade;
mod contrast;
mod cost;
mod gpc;
mod margin_limits;
mod pareto;
mod problem;
mod robustness;
mod tuning;
mod workload;

use std::io;

use virtual_axes_core::config::ConfigError;
use virtual_axes_core::machine::MachineError;
use virtual_axes_core::trial::TrialError;
use virtual_axes_core::units::Rounded;

pub use cascade::tune_cascade;
pub use contrast::{Contrast, find_contrasts};
pub use cost::{Cost, CostError, CostTerm};
pub use gpc::{GRID_LAMBDA, GRID_N2, GRID_NU, design_grid, fine_design_grid, tune_gpc, tune_gpc_from};
pub use margin_limits::MarginLimits;
pub use pareto::pareto_front;
pub use problem::{SearchResult, TuningCandidate, TuningProblem};
pub use robustness::{DeviatingRun, PlantDeviation, Robustness, analyze_robustness};
pub use tuning::{AxisGains, Tuning};
pub use workload::Workload;

/// Receiver of progress reports and source of interrupts, called from any thread.
pub trait Progress: Sync {
    /// Starts a part of the search with its name and the largest number of runs.
    fn begin(&self, _part: &'static str, _runs: usize) {}

    /// Counts a finished run.
    fn finish_run(&self) {}

    /// Checks for an interrupt; called in every position cycle of every run.
    ///
    /// # Errors
    /// Error that ends the search.
    fn check_interrupt(&self) -> io::Result<()> {
        Ok(())
    }
}

/// Progress receiver without output that never interrupts.
#[derive(Debug, Clone, Copy, Default)]
pub struct NoProgress;

impl Progress for NoProgress {}

/// Error of a tuning search.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TuneError {
    /// Simulation run that failed.
    #[error(transparent)]
    Trial(#[from] TrialError),
    /// Parameter value that the schema rejects.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// Axis without prediction model.
    #[error(transparent)]
    Machine(#[from] MachineError),
    /// Path without motion of any axis.
    #[error("no axis moves: there is nothing to tune")]
    NothingMoves,
    /// No design within the margin limits.
    #[error(
        "none of {designs} designs has a modulus margin of {} and a delay margin of {} ms on its worst axis; \
         the largest modulus margin is {modulus:.3}, with a delay margin of {:.2} ms",
        Rounded(limits.modulus), Rounded(limits.delay * 1e3), delay * 1e3
    )]
    NoMargins {
        /// Number of designs.
        designs: usize,
        /// Margin limits.
        limits: MarginLimits,
        /// Largest modulus margin of a design.
        modulus: f64,
        /// Delay margin of that design, s.
        delay: f64,
    },
    /// No stable design.
    #[error("none of {designs} designs is stable on every moving axis")]
    NoneStable {
        /// Number of designs.
        designs: usize,
    },
    /// Saturation of every design within the margin limits.
    #[error("each of the {runs} tunings within the margins saturates an axis on this path; reduce the feed")]
    Saturated {
        /// Number of runs.
        runs: usize,
    },
}
