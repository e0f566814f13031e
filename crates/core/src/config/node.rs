//! Node configuration: clock, topics, action, recording and quality of service.

use std::path::PathBuf;
use std::slice;

use super::axis::ToleranceConfig;
use super::declaration::{CheckedValues, Definitions, Field, ParameterGroup, parameters};
use super::definition::DefaultValue::{Flag, Integer, Number, Text};
use super::definition::{ParameterDefinition, Scope, choice, flag, integer, number, text};
use super::value::Value;
use crate::units::{Nanoseconds, SECOND_NS};

/// Bytes in a megabyte.
const MEGABYTE: f64 = 1e6;

/// Defines a default tolerance of action goals.
const fn tolerance(key: &'static str, unit: &'static str) -> ParameterDefinition {
    number(key, unit, 0.0, 1e6).zero().live()
}

parameters! {
    /// Parameters of the node itself.
    #[derive(Debug, Clone, Default, PartialEq)]
    pub struct NodeConfig of Node {
        /// Time source: wall clock, or simulated time as fast as possible, published on /clock.
        pub time: TimeMode = choice("time", &["real", "fast"]).default(Text("real")) => time_mode;
        /// Publication rate of joint_states, motor currents, drive states, controller state and tool pose, at most one
        /// message per position cycle; 0 publishes in every position cycle.
        pub publish_rate: Option<f64> = number("publish_rate", "Hz", 0.0, 1e6).zero();
        /// Prefix of the joint names in messages.
        pub joint_prefix: String = text("joint_prefix").default(Text(""));
        /// Timeout after which an external load returns to zero.
        pub load_timeout: Nanoseconds = number("load_timeout", "s", 1e-3, 3600.0).default(Number(0.1)).si(SECOND_NS as f64);
        /// Maximum number of points of a trajectory.
        pub max_points: usize = integer("max_points", "", 1, 100_000_000).default(Integer(1_000_000));
        /// Accept trajectories with a nonzero velocity at the last point.
        pub allow_nonzero_velocity_at_trajectory_end: bool =
            flag("allow_nonzero_velocity_at_trajectory_end").default(Flag(false)).live();
        /// Tool pose and tool path topics.
        pub tool: ToolConfig;
        /// Rate of the action feedback in node time, at most one message per position cycle.
        pub action_monitor_rate: f64 = number("action_monitor_rate", "Hz", 0.1, 1e6).default(Number(20.0));
        /// Default tolerances of action goals.
        pub goals: GoalDefaults;
        /// Interpolation of trajectories between points: by the fields of the points, or none: the setpoint is the next
        /// point, within the velocity limits.
        pub interpolates: bool = choice("interpolation_method", &["splines", "none"]).default(Text("splines"))
            => |values, rows| Some(String::read(values, rows)? == "splines");
        /// Use the time of the topic /clock.
        pub use_sim_time: bool = flag("use_sim_time").default(Flag(false)).live();
        /// Folder of the part programs that ~/run_program runs by their path, with its subfolders; empty: built-in programs and
        /// texts only. It is set at the start, also of a managed node.
        pub program_folder: Option<PathBuf> = text("program_folder").default(Text(""));
        /// MCAP file for recording all topics of the node; it must not exist; empty disables recording.
        pub record: Option<PathBuf> = text("record").default(Text(""));
        /// Maximum size of the recording, which is closed there; the axes continue.
        pub record_max: u64 = integer("record_max_mb", "MB", 1, 1_000_000).default(Integer(1024)).si(MEGABYTE);
        use TopicQos;
    }
}

parameters! {
    /// Default tolerances of action goals.
    #[derive(Debug, Clone, Default, PartialEq)]
    pub struct GoalDefaults of Node {
        /// Path tolerance of each axis, m or rad; `None` disables it.
        pub path: Vec<Option<f64>> => |values, _| of_axes(values, |axis| axis.path);
        /// Goal tolerance of each axis, m or rad; `None` disables it.
        pub goal: Vec<Option<f64>> => |values, _| of_axes(values, |axis| axis.goal);
        /// Default goal time tolerance of action goals; 0 disables it.
        pub goal_time: Option<Nanoseconds> = tolerance("goal_time_tolerance", "s").si(SECOND_NS as f64);
        /// Default goal tolerance of the velocity of action goals, on the velocity error at the end of the trajectory;
        /// 0 disables it.
        pub stopped_velocity: Option<f64> = tolerance("stopped_velocity_tolerance", "m/s or rad/s");
        /// Timeout after the end of a trajectory for action goals without a goal time tolerance, which abort then; 0
        /// disables it.
        pub timeout: Option<Nanoseconds> = tolerance("cmd_timeout", "s").si(SECOND_NS as f64);
    }
}

parameters! {
    /// Tool pose and tool path topics.
    #[derive(Debug, Clone, Default, PartialEq)]
    pub struct ToolConfig of Node {
        /// Frame id of tool poses and paths.
        pub frame: String = text("workpiece_frame").default(Text("workpiece"));
        /// Publication rate of the tool paths during motion; 0 disables them.
        pub path_rate: Option<f64> = number("tool_path_rate", "Hz", 0.0, 100.0).default(Number(2.0));
        /// Maximum number of poses of a tool path; the oldest are removed.
        pub path_length: usize = integer("tool_path_length", "", 2, 100_000).default(Integer(2000));
    }
}

/// Time source of the node.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum TimeMode {
    /// Wall-clock time.
    #[default]
    Real,
    /// Simulated time, as fast as the computer and the subscribers permit; the node publishes `/clock`.
    Fast,
    /// Time from the topic `/clock` (`use_sim_time`).
    SimTime,
}

fn time_mode(values: &CheckedValues<'_>, rows: Definitions) -> Option<TimeMode> {
    let uses_clock = values.entries.get("use_sim_time").is_some_and(|entry| entry.value == Value::Bool(true));
    Some(match String::read(values, rows)?.as_str() {
        _ if uses_clock => TimeMode::SimTime,
        "fast" => TimeMode::Fast,
        _ => TimeMode::Real,
    })
}

/// Returns a tolerance of each axis.
fn of_axes(
    values: &CheckedValues<'_>,
    tolerance: fn(ToleranceConfig) -> Option<f64>,
) -> Option<Vec<Option<f64>>> {
    Some(values.of_axes()?.into_iter().map(tolerance).collect())
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

/// Defines the QoS parameters of topics: reliability, durability and depth.
macro_rules! qos {
    ($($topic:literal: $reliability:literal, $durability:literal, $depth:literal;)+) => {
        &[$([
            choice(concat!("qos.", $topic, ".reliability"), &["reliable", "best_effort"])
                .default(Text($reliability))
                .described(Scope::Node, "Reliability QoS policy of the topic."),
            choice(concat!("qos.", $topic, ".durability"), &["volatile", "transient_local"])
                .default(Text($durability))
                .described(Scope::Node, "Durability QoS policy of the topic."),
            integer(concat!("qos.", $topic, ".depth"), "", 1, 100_000)
                .default(Integer($depth))
                .described(Scope::Node, "History depth of the topic (keep last)."),
        ],)+]
    };
}

/// QoS parameters of each topic. Those of `psec_stream` match the publisher of ros2_control's topic-based hardware, which
/// sends the last setpoint of a move only once.
const QOS: &[[ParameterDefinition; 3]] = qos! {
    "psec": "reliable", "volatile", 64;
    "psec_stream": "reliable", "volatile", 10;
    "speed_scaling_input": "reliable", "volatile", 10;
    "load": "best_effort", "volatile", 10;
    "joint_states": "reliable", "volatile", 10;
    "motor_currents": "reliable", "volatile", 10;
    "drive_states": "reliable", "volatile", 10;
    "controller_state": "reliable", "volatile", 10;
    "tool_pose": "reliable", "volatile", 10;
    "tool_path": "reliable", "volatile", 1;
    "tool_path_setpoint": "reliable", "volatile", 1;
    "trajectory_result": "reliable", "transient_local", 50;
    "diagnostics": "reliable", "volatile", 10;
    "clock": "reliable", "volatile", 10;
};

/// QoS parameters of all topics, which [`qos`] reads.
struct TopicQos;

impl ParameterGroup for TopicQos {
    fn define(out: &mut Vec<ParameterDefinition>) {
        out.extend_from_slice(QOS.as_flattened());
    }

    fn read(_: &CheckedValues<'_>) -> Option<Self> {
        Some(TopicQos)
    }
}

/// Returns the quality of service of a topic; `None` for a topic without parameters.
pub(super) fn qos(values: &CheckedValues<'_>, topic: &str) -> Option<QosConfig> {
    let key = format!("qos.{topic}.reliability");
    let [reliability, durability, depth] = QOS.iter().find(|rows| rows[0].key == key)?;
    Some(QosConfig {
        is_reliable: String::read(values, slice::from_ref(reliability))? == "reliable",
        is_transient_local: String::read(values, slice::from_ref(durability))? == "transient_local",
        depth: usize::read(values, slice::from_ref(depth))?,
    })
}
