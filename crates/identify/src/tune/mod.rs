//! Search for the tuning of the position controllers that suits a path best.
//!
//! A [`Bench`] is a machine on a [`Course`] with a [`Cost`]: it runs what it is given and says what that
//! costs, with the stability margins of the worst axis. [`tune_gpc`] searches the tunings of a predictive
//! controller, [`tune_cascade`] the gains of the cascade; both take only tunings that keep the
//! [`MarginLimits`] and never saturate. Runs go over all cores; the same search gives the same tuning
//! whatever their number.

mod bench;
mod cascade;
mod contrast;
mod cost;
mod course;
mod gpc;
mod loops;
mod pareto;
mod robustness;
mod tuning;

use std::io;

use virtual_axes_core::config::ConfigError;
use virtual_axes_core::machine::MachineError;
use virtual_axes_core::trial::TrialError;

pub use bench::{Bench, Candidate, Search};
pub use cascade::tune_cascade;
pub use contrast::{Contrast, contrast};
pub use cost::{Cost, CostError, Term};
pub use course::Course;
pub use gpc::{GRID_LAMBDA, GRID_N2, GRID_NU, fine_grid, grid, tune_gpc, tune_gpc_from};
pub use loops::MarginLimits;
pub use pareto::front;
pub use robustness::{Deviated, Deviation, Robustness, robustness};
pub use tuning::{AxisGains, Tuning};

/// Who looks on while a search goes on, from any thread.
pub trait Watch: Sync {
    /// A part of the work begins: its name, and how many runs it takes at most.
    fn begin(&self, _part: &'static str, _runs: usize) {}

    /// A run has ended.
    fn done(&self) {}

    /// Asked at every position period of every run.
    ///
    /// # Errors
    /// What ends the search.
    fn go_on(&self) -> io::Result<()> {
        Ok(())
    }
}

/// Nobody.
#[derive(Debug, Clone, Copy, Default)]
pub struct Unwatched;

impl Watch for Unwatched {}

/// Why there is no tuning.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TuneError {
    /// A run did not come to its end.
    #[error(transparent)]
    Trial(#[from] TrialError),
    /// A value that the machine does not take.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// An axis has no prediction model.
    #[error(transparent)]
    Machine(#[from] MachineError),
    /// The path asks nothing of any axis.
    #[error("no axis moves: there is nothing to tune")]
    NothingMoves,
    /// No design keeps the margins.
    #[error(
        "none of {designs} designs keeps a modulus margin of {} and a delay margin of {} ms on its worst axis; \
         the largest modulus margin is {modulus:.3}, that design's delay margin {:.2} ms",
        limits.modulus, limits.delay * 1e3, delay * 1e3
    )]
    NoMargins {
        /// How many were looked at.
        designs: usize,
        /// What was asked for.
        limits: MarginLimits,
        /// Largest modulus margin of a design.
        modulus: f64,
        /// Delay margin of that design, s.
        delay: f64,
    },
    /// No design is stable.
    #[error("none of {designs} designs is stable on every axis that moves")]
    NoneStable {
        /// How many were looked at.
        designs: usize,
    },
    /// Every design that keeps the margins saturates.
    #[error(
        "each of the {runs} tunings that keep the margins saturates an axis on this path; lower its feed"
    )]
    Saturated {
        /// How many were run.
        runs: usize,
    },
}
