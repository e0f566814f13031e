//! Random trajectories through the library, each of which is checked tick by tick.
//!
//! What a trajectory is follows from a seed and its number alone ([`Plan`]); a [`Bench`] runs it through the checks and the
//! simulation that everybody uses and looks at every tick. It checks that all signals are finite, that limits hold and are reported,
//! that friction brakes and energy does not come from nowhere, and that the error is what the
//! impulse responses of the linear loop allow wherever no limit acts: by matrices of its own, not by the library's step.
//! [`run`] does that many times, over all cores, and makes one digest of all that came out.

mod bench;
mod curve;
mod drive;
mod energy;
mod exponential;
mod fault;
mod fleet;
mod linear;
mod plan;
mod random;
mod response;
mod runs;
mod shape;
mod summary;
mod watch;

pub use bench::{Bench, Record};
pub use fault::{Check, Fault};
pub use fleet::{Fleet, FleetError, Variant};
pub use plan::{Ask, Kind, Load, Plan};
pub use runs::{Options, StressError, run};
pub use summary::Summary;
pub use watch::AxisFigures;
