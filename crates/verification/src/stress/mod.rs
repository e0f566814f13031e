//! Stress test: random trajectories through the library, each checked at every tick.
//!
//! A trajectory depends on a seed and its number only ([`TestPlan`]). A [`TrajectoryTest`] runs it through the validation and the
//! simulation of the library and checks every tick: all signals are finite, limits hold and are reported, friction
//! brakes, energy is conserved, and, where no limit acts, the delay-compensated following error is within the bound
//! of the impulse responses of the linear loop. These references are computed by matrices of this module, not by the
//! library's step. [`run`] runs many trajectories on several threads and returns one digest of their results.

mod check;
mod curve;
mod drive_checker;
mod energy;
mod exponential;
mod invariants;
mod linear_axis;
mod plan;
mod response;
mod runs;
mod shape;
mod summary;
mod test_machines;
mod trajectory_test;

pub use check::{Check, Violation};
pub use invariants::AxisObservation;
pub use plan::{LoadStep, TestCommand, TestPlan, TrajectoryKind};
pub use runs::{StressOptions, run};
pub use summary::StressSummary;
pub use test_machines::{MachineVariant, TestMachines, TestMachinesError};
pub use trajectory_test::{TestRecord, TrajectoryTest};
