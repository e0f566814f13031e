//! Settings of the node derived from its parameters.

use crate::ros::overflow::OverflowPolicy;
use virtual_axes_core::config::{ConfigError, MachineConfig, NodeConfig, Parameters, TimeMode};
use virtual_axes_core::simulation;
use virtual_axes_core::trajectory::JointLimits;
use virtual_axes_core::units::Nanoseconds;

/// Settings of the node derived from its parameters.
pub(super) struct NodeSetup {
    pub(super) config: MachineConfig,
    pub(super) node_config: NodeConfig,
    pub(super) mode: TimeMode,
    pub(super) joint_limits: Vec<JointLimits>,
    /// Names of the joints, with prefix.
    pub(super) joints: Vec<String>,
    /// Position cycle Tsp, ns.
    pub(super) period: Nanoseconds,
    /// Overflow policy of the outputs of every position cycle.
    pub(super) overflow: OverflowPolicy,
    /// Overflow policy of results and goal status.
    pub(super) result_overflow: OverflowPolicy,
}

impl NodeSetup {
    /// Derives the settings from `parameters`.
    ///
    /// # Errors
    /// [`ConfigError`] if the parameters do not define a valid machine.
    pub(super) fn new(parameters: &Parameters) -> Result<Self, ConfigError> {
        let config = parameters.machine_config()?;
        let node_config = parameters.node_config();
        let mode = node_config.time;
        let joint_limits = simulation::joint_limits(&config, &node_config.joint_prefix);
        let joints = joint_limits.iter().map(|j| j.name.clone()).collect();
        let period = config.periods().position;
        let (overflow, result_overflow) = match mode {
            TimeMode::Real => (OverflowPolicy::Drop, OverflowPolicy::BlockWithTimeout),
            TimeMode::Fast | TimeMode::SimTime => (OverflowPolicy::Block, OverflowPolicy::Block),
        };
        Ok(NodeSetup { config, node_config, mode, joint_limits, joints, period, overflow, result_overflow })
    }
}
