//! The parameters of the node itself, typed.

use std::path::PathBuf;

use super::check::to_ns;
use super::parameters::Parameters;
use super::value::Value;
use crate::units::{DEGREE, MILLIMETER, Nanoseconds, SECOND_NS};

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
    /// Rate of the action's feedback, Hz.
    pub action_monitor_rate: f64,
    /// What is published of the tool.
    pub tool: ToolConfig,
    /// The file that the topics are recorded in.
    pub record: Option<PathBuf>,
    /// The most that it may become, bytes.
    pub record_max: u64,
}

/// Tolerances of action goals that name none themselves.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct GoalDefaults {
    /// Largest error of each axis on the way, m or rad; `None` is any.
    pub path: Vec<Option<f64>>,
    /// Likewise at the end.
    pub goal: Vec<Option<f64>>,
    /// How much later than its end a goal may be reached, ns; `None` is any time.
    pub goal_time: Option<Nanoseconds>,
}

/// What the node publishes of the tool.
#[derive(Debug, Clone, PartialEq)]
pub struct ToolConfig {
    /// Frame that poses and paths are given in.
    pub frame: String,
    /// Rate of the paths, Hz; `None` is never.
    pub path_rate: Option<f64>,
    /// Most poses of a path.
    pub path_length: usize,
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
        let count = |key: &str| match self.get(key) {
            Some(Value::Integer(count)) => usize::try_from(count).unwrap_or(usize::MAX),
            _ => usize::MAX,
        };
        let path_rate = number("tool_path_rate");
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
            max_points: count("max_points"),
            allow_nonzero_velocity_at_trajectory_end: self.flag("allow_nonzero_velocity_at_trajectory_end"),
            action_monitor_rate: number("action_monitor_rate"),
            tool: ToolConfig {
                frame: self.text("workpiece_frame"),
                path_rate: (path_rate > 0.0).then_some(path_rate),
                path_length: count("tool_path_length"),
            },
            record: (!record.is_empty()).then(|| PathBuf::from(record)),
            record_max,
        }
    }

    /// Tolerances of action goals that name none themselves, for the axes in the order of `joints`.
    pub fn goal_defaults(&self) -> GoalDefaults {
        // 0 and a key that an axis of this kind does not have are no tolerance.
        let positive = |key: &str| self.number(key).ok().filter(|&value| value > 0.0);
        let column = |what: &str| {
            let tolerance = |joint: &String| {
                let key = |unit: &str| format!("{joint}.tolerances.{what}_{unit}");
                let linear = positive(&key("mm")).map(|value| value * MILLIMETER);
                linear.or_else(|| positive(&key("deg")).map(|value| value * DEGREE))
            };
            match self.get("joints") {
                Some(Value::TextList(joints)) => joints.iter().map(tolerance).collect(),
                _ => Vec::new(),
            }
        };
        GoalDefaults {
            path: column("path"),
            goal: column("goal"),
            goal_time: positive("goal_time_tolerance").map(|value| to_ns(value, SECOND_NS)),
        }
    }
}
