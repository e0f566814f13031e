//! Machine files and parameters: one schema, one way in.
//!
//! [`Parameters`] holds the values in the units of the files, each checked; from it come the typed
//! [`MachineConfig`] and [`NodeConfig`] in SI units.
//!
//! ```
//! use virtual_axes::config::{Parameters, Source};
//!
//! let mut parameters = Parameters::embedded_default()?;
//! parameters.set_text("x.velocity_loop.gain=4.5", &Source::named("--set"))?;
//! assert_eq!(parameters.machine_config()?.axes()[0].name(), "x");
//! # Ok::<(), virtual_axes::config::ConfigError>(())
//! ```

mod build;
mod check;
mod definition;
mod error;
mod layout;
pub mod listing;
mod machine;
mod node;
mod node_schema;
mod parameter_file;
mod parameters;
mod schema;
mod value;
mod writer;
mod yaml;

#[cfg(test)]
mod tests;

pub use definition::{DefaultValue, Definition, Kind, MotorKind, Presence, Scope};
pub use error::{ConfigError, Source};
pub use error::{breaks_line, shortened};
pub use machine::*;
pub use node::{GoalDefaults, NodeConfig, QosConfig, TimeMode, ToolConfig};
pub use parameter_file::{Assignment, parse_assignment};
pub use parameters::{DEFAULT_MACHINE, Overlay, Parameters};
pub use schema::{DEFINITIONS, MAX_HORIZON, RST_TERMS};
pub use value::Value;
