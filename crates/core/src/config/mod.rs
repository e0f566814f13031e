//! Machine files and parameters: one schema, one way in.
//!
//! [`Parameters`] holds the values in the units of the files, each checked; from it come the typed
//! [`MachineConfig`] and [`NodeConfig`] in SI units.
//!
//! ```
//! use virtual_axes_core::config::{Parameters, ValueSource};
//!
//! let mut parameters = Parameters::embedded_default()?;
//! parameters.set_text("x.velocity_loop.gain=4.5", &ValueSource::named("--set"))?;
//! assert_eq!(parameters.machine_config()?.axes()[0].name(), "x");
//! # Ok::<(), virtual_axes_core::config::ConfigError>(())
//! ```

mod aliases;
mod build;
mod check;
mod coupling;
mod coupling_check;
mod definition;
mod error;
mod layout;
pub mod listing;
mod machine;
mod node;
mod node_schema;
mod parameter_file;
mod parameters;
mod plant;
mod plant_check;
mod plant_keys;
mod plant_schema;
mod schema;
mod value;
mod writer;
mod yaml_tree;

#[cfg(test)]
mod tests;

pub use aliases::ParameterAlias;
pub use coupling::{GantryConfig, WorkpieceConfig};
pub use definition::{DefaultValue, MotorKind, ParameterDefinition, ParameterKind, Presence, Scope};
pub use error::{ConfigError, ValueSource};
pub use machine::*;
pub use node::{GoalDefaults, NodeConfig, QosConfig, TimeMode, ToolConfig};
pub use parameter_file::{Assignment, parse_assignment};
pub use parameters::{DEFAULT_MACHINE, OverlayReport, Parameters};
pub use plant::*;
pub use schema::{DEFINITIONS, MAX_HORIZON, MAX_RST_TERMS};
pub use value::Value;
