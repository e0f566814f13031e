//! Parameter schema: the single table for validation, typed configuration, ROS descriptors and the reference.

use std::sync::LazyLock;

use super::axis::AxisConfig;
use super::declaration::ParameterGroup;
use super::definition::ParameterDefinition;
use super::machine::MachineConfig;
use super::node::NodeConfig;

/// Definitions of all parameters: machine, axes, node. A key has two definitions if its unit depends on the type of axis or
/// motor.
pub static DEFINITIONS: LazyLock<Vec<ParameterDefinition>> = LazyLock::new(|| {
    let mut definitions = Vec::new();
    MachineConfig::define(&mut definitions);
    AxisConfig::define(&mut definitions);
    NodeConfig::define(&mut definitions);
    definitions
});
