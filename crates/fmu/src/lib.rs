//! Virtual axes as an FMU: FMI 2.0 co-simulation.
//!
//! The importer loads this library from the archive that `virtual_axes fmu` writes. `resources/machine.yaml` of the
//! archive has the machine.
//!
//! - [`FmuVariables`] lists the variables of a machine, for the library and for [`model_description`] alike: an index is
//!   the value reference.
//! - A step is any multiple of the current cycle Tsi. The drives read the setpoints at the start of each position cycle Tsp
//!   and hold them in between.
//! - An instance is used by one thread at a time; instances are independent.
//! - A call that is not allowed or has invalid arguments returns `fmi2Error`, sends its reason to the logger and changes
//!   nothing. No panic crosses the border: `fmi2Fatal`.
//!
//! This crate contains unsafe code, since pointers of a caller cannot be checked for more than null. Each block says what
//! the caller promises.

#![allow(non_snake_case)]

mod archive;
mod border;
mod description;
mod documentation;
mod functions;
mod instance;
mod resources;
mod signals;
mod slave;
mod slave_bytes;
mod state_functions;
mod units;
mod value_functions;
mod variables;

pub use archive::fmu_archive;
pub use border::{Fmi2Callbacks, Fmi2Logger, Fmi2Status};
pub use description::{MODEL_IDENTIFIER, guid, model_description};
pub use documentation::documentation;
pub use functions::*;
pub use instance::FmuInstance;
pub use resources::MACHINE_FILE;
pub use signals::{FmuSignal, SIGNALS};
pub use state_functions::*;
pub use value_functions::*;
pub use variables::{Causality, FmuType, FmuVariable, FmuVariables, VariableRole};
