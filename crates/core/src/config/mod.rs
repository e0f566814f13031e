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
mod axis;
mod axis_units;
mod chain_check;
mod check;
mod control;
mod control_check;
mod controller;
mod coupling_check;
mod cross_check;
mod declaration;
mod definition;
mod error;
mod ignored;
mod layout;
pub mod listing;
mod machine;
mod node;
mod parameter_file;
mod parameters;
mod part_program;
mod plant;
mod plant_check;
mod rotary_chain;
mod schema;
mod value;
mod writer;
mod yaml_tree;

#[cfg(test)]
mod tests;

pub use aliases::ParameterAlias;
pub use axis::*;
pub use axis_units::AxisUnits;
pub use control::{ControlConfig, ControlProfile, CornerRule};
pub use definition::{
    AxisKind, DefaultValue, MotorKind, ParameterDefinition, ParameterKind, Presence, Scope,
};
pub use error::{ConfigError, ValueSource};
pub use machine::*;
pub use node::{GoalDefaults, NodeConfig, QosConfig, TimeMode, ToolConfig};
pub use parameter_file::{Assignment, parse_assignment};
pub use parameters::{DEFAULT_MACHINE, OverlayReport, Parameters};
pub use part_program::PartProgramConfig;
pub use plant::*;
pub use rotary_chain::{RotaryChain, RotaryName};
pub use schema::DEFINITIONS;
pub use value::Value;
