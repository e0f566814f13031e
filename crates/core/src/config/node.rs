//! Node configuration: clock, topics, recording and quality of service.

use std::path::PathBuf;

use super::check::to_ns;
use super::parameters::Parameters;
use super::value::Value;
use crate::units::{DEGREE, MILLIMETER, Nanoseconds, SECOND_NS};

/// Bytes in a megabyte.
const MEGABYTE: u64 = 1_000_000;

/// Time source of the node.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TimeMode {
    /// Wall-clock time.
    Real,
    /// Simulated time, as fast as the computer and the subscribers permit; the node publishes `/clock`.
    Fast,
    /// Time from the topic `/clock` (`use_sim_time`).
    SimTime,
}

/// Quality of service of a topic.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct QosConfig {
    /// True for reliable, false for best effort.
    pub is_reliable: bool,
    /// True for transient local, false for volatile.
    pub is_transient_local: bool,
    /// Depth of the history (keep last).
    pub depth: usize,
}

/// Parameters of the node itself.
#[derive(Debug, Clone, PartialEq)]
pub struct NodeConfig {
    /// Time source.
    pub time: TimeMode,
    /// Publication rate of `joint_states`, Hz; `None` publishes in every position cycle.
    pub publish_rate: Option<f64>,
    /// Prefix of the joint names in messages.
    pub joint_prefix: String,
    /// Timeout after which an external load returns to zero, ns.
    pub load_timeout: Nanoseconds,
    /// Maximum number of points of a trajectory.
    pub max_points: usize,
    /// True if trajectories are interpolated between their points.
    pub interpolates: bool,
    /// True if the last point of a trajectory may have a nonzero velocity.
    pub allow_nonzero_velocity_at_trajectory_end: bool,
    /// Rate of the action feedback, Hz.
    pub action_monitor_rate: f64,
    /// Tool pose and tool path topics.
    pub tool: ToolConfig,
    /// File for recording the topics; `None` disables recording.
    pub record: Option<PathBuf>,
    /// Maximum size of the recording, bytes.
    pub record_max: u64,
    /// Number of departed remote endpoints after which the DDS participant is renewed; `None` disables it.
    pub renewal_endpoints: Option<u64>,
}

/// Default tolerances of action goals.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct GoalDefaults {
    /// Path tolerance of each axis, m or rad; `None` disables it.
    pub path: Vec<Option<f64>>,
    /// Goal tolerance of each axis, m or rad; `None` disables it.
    pub goal: Vec<Option<f64>>,
    /// Goal tolerance of the velocity of all axes, m/s or rad/s; `None` disables it.
    pub stopped_velocity: Option<f64>,
    /// Goal time tolerance, ns; `None` disables it.
    pub goal_time: Option<Nanoseconds>,
    /// Goal time tolerance of goals that have none, ns; `None` disables it.
    pub timeout: Option<Nanoseconds>,
}

/// Tool pose and tool path topics.
#[derive(Debug, Clone, PartialEq)]
pub struct ToolConfig {
    /// Frame id of tool poses and paths.
    pub frame: String,
    /// Publication rate of the tool paths, Hz; `None` disables them.
    pub path_rate: Option<f64>,
    /// Maximum number of poses of a tool path.
    pub path_length: usize,
}

impl Parameters {
    /// Returns the quality of service of a topic, such as `psec` or `motor_currents`; none for a topic that is not in the
    /// schema.
    pub fn qos(&self, topic: &str) -> Option<QosConfig> {
        let Some(Value::Integer(depth)) = self.get(&format!("qos.{topic}.depth")) else { return None };
        Some(QosConfig {
            is_reliable: self.text(&format!("qos.{topic}.reliability")) == "reliable",
            is_transient_local: self.text(&format!("qos.{topic}.durability")) == "transient_local",
            depth: usize::try_from(depth).unwrap_or(1),
        })
    }

    /// Returns the node configuration.
    pub fn node_config(&self) -> NodeConfig {
        let time = if self.flag("use_sim_time") {
            TimeMode::SimTime
        } else if self.text("time") == "fast" {
            TimeMode::Fast
        } else {
            TimeMode::Real
        };
        // All of these parameters have defaults; the fallbacks here are unused.
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
        let renewal_endpoints = match self.get("renewal_endpoints") {
            Some(Value::Integer(count)) => u64::try_from(count).ok().filter(|&count| count > 0),
            _ => None,
        };
        NodeConfig {
            time,
            publish_rate: (rate > 0.0).then_some(rate),
            joint_prefix: self.text("joint_prefix"),
            load_timeout: to_ns(number("load_timeout"), SECOND_NS),
            max_points: count("max_points"),
            interpolates: self.text("interpolation_method") == "splines",
            allow_nonzero_velocity_at_trajectory_end: self.flag("allow_nonzero_velocity_at_trajectory_end"),
            action_monitor_rate: number("action_monitor_rate"),
            tool: ToolConfig {
                frame: self.text("workpiece_frame"),
                path_rate: (path_rate > 0.0).then_some(path_rate),
                path_length: count("tool_path_length"),
            },
            record: (!record.is_empty()).then(|| PathBuf::from(record)),
            record_max,
            renewal_endpoints,
        }
    }

    /// Returns the default tolerances of action goals, for the axes in the order of `joints`.
    pub fn goal_defaults(&self) -> GoalDefaults {
        // 0, or a key that does not apply to this type of axis, is no tolerance.
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
            stopped_velocity: positive("stopped_velocity_tolerance"),
            goal_time: positive("goal_time_tolerance").map(|value| to_ns(value, SECOND_NS)),
            timeout: positive("cmd_timeout").map(|value| to_ns(value, SECOND_NS)),
        }
    }
}
