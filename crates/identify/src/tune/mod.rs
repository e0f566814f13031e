//! Search of position controller tunings with a low cost on a path; no search guarantees the global minimum.
//!
//! A [`TuningProblem`] combines a machine, a [`Workload`] and a [`Cost`]; it simulates tunings and returns
//! their cost and the stability margins of the worst axis. [`tune_gpc`] searches tunings of a predictive
//! controller, [`tune_cascade`] gains of the cascade, [`tune_contour_gain`] the gain of cross-coupled control. They accept only tunings within the [`MarginLimits`]
//! that never saturate. Simulations run in parallel on all cores; the result does not depend on the number of
//! cores.

mod cascade;
mod contour_gain;
mod contrast;
mod cost;
mod error;
mod gpc;
mod margin_limits;
mod pareto;
mod path_tuning;
mod problem;
mod progress;
mod robustness;
mod tuning;
mod workload;

pub use cascade::tune_cascade;
pub use contour_gain::tune_contour_gain;
pub use contrast::{Contrast, find_contrasts};
pub(crate) use cost::has_contour;
pub use cost::{Cost, CostError, CostTerm};
pub use error::TuneError;
pub use gpc::{GRID_LAMBDA, GRID_N2, GRID_NU, design_grid, fine_design_grid, tune_gpc, tune_gpc_from};
pub use margin_limits::MarginLimits;
pub use pareto::pareto_front;
pub use path_tuning::{ComparedPath, TuningResult, TuningSearch};
pub use problem::{SearchResult, TuningCandidate, TuningProblem};
pub use progress::{NoProgress, Progress};
pub use robustness::{DeviatingRun, PlantDeviation, Robustness, analyze_robustness, deviating_machine};
pub use tuning::{AxisGains, Tuning};
pub use workload::Workload;
