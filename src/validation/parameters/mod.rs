//! ROS parameters of the node: values, descriptors, messages, validation, storage.

mod list_parameters;
mod store;
mod types;
mod wire;

pub use list_parameters::list_parameters;
pub use store::{LiveNodeParameters, ParameterStore, check_count};
pub use types::{ParameterDescriptor, ParameterHost, ParameterRange, ParameterType, ParameterValue};
pub use wire::{descriptor_to_wire, parameter_from_wire, result_to_wire, type_number, value_to_wire};
