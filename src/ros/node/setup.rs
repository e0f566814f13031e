//! Settings of the node derived from its parameters.

use std::time::{SystemTime, UNIX_EPOCH};

use tokio::sync::watch;

use crate::ros::axes::{ClockSource, Health};
use crate::ros::topics::{OverflowPolicy, RecordError, TopicRecorder};
use virtual_axes_core::config::{ConfigError, MachineConfig, NodeConfig, Parameters, TimeMode};
use virtual_axes_core::simulation;
use virtual_axes_core::trajectory::JointLimits;
use virtual_axes_core::units::{Nanoseconds, seconds};

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

    /// Returns the number of position cycles between publications, at least 1.
    pub(super) fn publication_period(&self) -> i64 {
        let period = seconds(self.period);
        self.node_config.publish_rate.map_or(1, |rate| (1.0 / (rate * period)).round() as i64).max(1)
    }

    /// Creates the recording, with the times of the clock of the node.
    ///
    /// # Errors
    /// [`RecordError`] if the file cannot be created.
    pub(super) fn recorder(&self, health: &watch::Receiver<Health>) -> Result<TopicRecorder, RecordError> {
        let (mode, health) = (self.mode, health.clone());
        let now = move || {
            let health = health.borrow();
            let is_before_first_cycle = mode != TimeMode::SimTime && health.periods == 0;
            if health.clock.source == ClockSource::Wall || is_before_first_cycle {
                let since_epoch = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
                return u64::try_from(since_epoch.as_nanos()).unwrap_or(u64::MAX);
            }
            u64::try_from(health.time).unwrap_or(0)
        };
        TopicRecorder::open(&self.node_config, self.overflow != OverflowPolicy::Drop, Box::new(now))
    }
}
