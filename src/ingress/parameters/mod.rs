//! Parameters as their services speak of them: values, messages, and what is done with them.

mod list;
mod settings;
mod types;
mod wire;

pub use list::list;
pub use settings::{LiveNodeParameters, Settings, check_count};
pub use types::{Descriptor, ParameterHost, ParameterType, ParameterValue, Range};
pub use wire::{descriptor_to_wire, parameter_from_wire, result_to_wire, type_number, value_to_wire};
