//! The parameters of the node itself, typed.

use std::path::PathBuf;

use super::check::to_ns;
use super::parameters::Parameters;
use super::value::Value;
use crate::units::{Nanoseconds, SECOND_NS};

/// A megabyte, bytes.
const MEGABYTE: u64 = 1_000_000;

/// What the node's clock follows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TimeMode {
    /// Real time.
    Real,
    /// As fast as the machine and its subscribers can take it; publishes `/clock`.
    Fast,
    /// `/clock` of somebody else (`use_sim_time`).
    SimTime,
}

/// Quality of service of a topic.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct QosConfig {
    /// Lost samples are sent again.
    pub reliable: bool,
    /// Late joiners get the last samples.
    pub transient_local: bool,
    /// Samples that are kept.
    pub depth: usize,
}

/// Parameters of the node itself.
#[derive(Debug, Clone, PartialEq)]
pub struct NodeConfig {
    /// What the clock follows.
    pub time: TimeMode,
    /// Rate of `joint_states`, Hz; `None` is every position period.
    pub publish_rate: Option<f64>,
    /// Text before the joint names in messages.
    pub joint_prefix: String,
    /// Time after which a load that is not renewed is zero again, ns.
    pub load_timeout: Nanoseconds,
    /// Largest number of points of a trajectory.
    pub max_points: usize,
    /// Whether a trajectory may end with a velocity.
    pub allow_nonzero_velocity_at_trajectory_end: bool,
    /// The file that the topics are recorded in.
    pub record: Option<PathBuf>,
    /// The most that it may become, bytes.
    pub record_max: u64,
}

impl Parameters {
    /// Quality of service of a topic, by its own name: `psec`, `motor_currents`; `None` for one that
    /// the schema does not have.
    pub fn qos(&self, topic: &str) -> Option<QosConfig> {
        let Some(Value::Integer(depth)) = self.get(&format!("qos.{topic}.depth")) else { return None };
        Some(QosConfig {
            reliable: self.text(&format!("qos.{topic}.reliability")) == "reliable",
            transient_local: self.text(&format!("qos.{topic}.durability")) == "transient_local",
            depth: usize::try_from(depth).unwrap_or(1),
        })
    }

    /// The parameters of the node itself.
    pub fn node_config(&self) -> NodeConfig {
        let time = if self.flag("use_sim_time") {
            TimeMode::SimTime
        } else if self.text("time") == "fast" {
            TimeMode::Fast
        } else {
            TimeMode::Real
        };
        // Each has a default, so that the fallbacks here are never used.
        let number = |key: &str| self.number(key).unwrap_or_default();
        let rate = number("publish_rate");
        let max_points = match self.get("max_points") {
            Some(Value::Integer(points)) => usize::try_from(points).unwrap_or(usize::MAX),
            _ => usize::MAX,
        };
        let record = self.text("record");
        let record_max = match self.get("record_max_mb") {
            Some(Value::Integer(size)) => u64::try_from(size).unwrap_or_default() * MEGABYTE,
            _ => u64::MAX,
        };
        NodeConfig {
            time,
            publish_rate: (rate > 0.0).then_some(rate),
            joint_prefix: self.text("joint_prefix"),
            load_timeout: to_ns(number("load_timeout"), SECOND_NS),
            max_points,
            allow_nonzero_velocity_at_trajectory_end: self.flag("allow_nonzero_velocity_at_trajectory_end"),
            record: (!record.is_empty()).then(|| PathBuf::from(record)),
            record_max,
        }
    }
}
