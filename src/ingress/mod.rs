//! The door: what comes in from a graph or on the command line of a node, as values that have been
//! checked. It knows no network: the room `ros` receives, and hands over here.

pub mod args;
mod cancel;
mod checks;
mod goal;
mod held;
mod loads;
pub mod names;
pub mod parameters;
mod stream;

pub use cancel::{Candidate, select};
pub use checks::Checks;
pub use goal::GoalChecks;
pub use held::Held;
pub use loads::loads;
pub use stream::{Order, Setpoints};

/// Names a goal; its client chose it.
pub type GoalId = [u8; 16];
