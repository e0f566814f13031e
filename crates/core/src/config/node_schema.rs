//! Schema of the node parameters: clock, topics, action, recording and quality of service.

use super::definition::DefaultValue::{Flag, Integer, Number, Text};
use super::definition::{ParameterDefinition, ParameterKind};

/// Defines the reliability QoS policy of a topic.
const fn qos_reliability(key: &'static str, default: &'static str) -> ParameterDefinition {
    ParameterDefinition::new(key, "", ParameterKind::Choice(&["reliable", "best_effort"]))
        .of_node()
        .default(Text(default))
        .describe("Reliability QoS policy of the topic.")
}

/// Defines the durability QoS policy of a topic.
const fn qos_durability(key: &'static str, default: &'static str) -> ParameterDefinition {
    ParameterDefinition::new(key, "", ParameterKind::Choice(&["volatile", "transient_local"]))
        .of_node()
        .default(Text(default))
        .describe("Durability QoS policy of the topic.")
}

/// Defines the history depth of a topic.
const fn qos_depth(key: &'static str, default: i64) -> ParameterDefinition {
    ParameterDefinition::new(key, "", ParameterKind::Integer { min: 1, max: 100_000 })
        .of_node()
        .default(Integer(default))
        .describe("History depth of the topic (keep last).")
}

/// Definitions of the node parameters.
pub(super) const NODE: &[ParameterDefinition] = &[
    ParameterDefinition::new("time", "", ParameterKind::Choice(&["real", "fast"]))
        .of_node()
        .default(Text("real"))
        .describe("Time source: wall clock, or simulated time as fast as possible, published on /clock."),
    ParameterDefinition::number("publish_rate", "Hz", 0.0, 1e6)
        .of_node()
        .default(Number(0.0))
        .describe("Publication rate of joint_states, motor currents, drive states, controller state and tool pose, at most one message per position cycle; 0 publishes in every position cycle."),
    ParameterDefinition::new("joint_prefix", "", ParameterKind::Text)
        .of_node()
        .default(Text(""))
        .describe("Prefix of the joint names in messages."),
    ParameterDefinition::number("load_timeout", "s", 1e-3, 3600.0)
        .of_node()
        .default(Number(0.1))
        .describe("Timeout after which an external load returns to zero."),
    ParameterDefinition::new("max_points", "", ParameterKind::Integer { min: 1, max: 100_000_000 })
        .of_node()
        .default(Integer(1_000_000))
        .describe("Maximum number of points of a trajectory."),
    ParameterDefinition::new("allow_nonzero_velocity_at_trajectory_end", "", ParameterKind::Flag)
        .of_node()
        .default(Flag(false))
        .live()
        .describe("Accept trajectories with a nonzero velocity at the last point."),
    ParameterDefinition::new("workpiece_frame", "", ParameterKind::Text)
        .of_node()
        .default(Text("workpiece"))
        .describe("Frame id of tool poses and paths."),
    ParameterDefinition::number("tool_path_rate", "Hz", 0.0, 100.0)
        .of_node()
        .default(Number(2.0))
        .describe("Publication rate of the tool paths during motion; 0 disables them."),
    ParameterDefinition::new("tool_path_length", "", ParameterKind::Integer { min: 2, max: 100_000 })
        .of_node()
        .default(Integer(2000))
        .describe("Maximum number of poses of a tool path; the oldest are removed."),
    ParameterDefinition::number("action_monitor_rate", "Hz", 0.1, 1e6)
        .of_node()
        .default(Number(20.0))
        .describe("Rate of the action feedback in node time, at most one message per position cycle."),
    ParameterDefinition::number("goal_time_tolerance", "s", 0.0, 1e6)
        .of_node()
        .default(Number(0.0))
        .live()
        .describe("Default goal time tolerance of action goals; 0 disables it."),
    ParameterDefinition::number("stopped_velocity_tolerance", "m/s or rad/s", 0.0, 1e6)
        .of_node()
        .default(Number(0.0))
        .live()
        .describe("Default goal tolerance of the velocity of action goals, on the velocity error at the end of the trajectory; 0 disables it."),
    ParameterDefinition::number("cmd_timeout", "s", 0.0, 1e6)
        .of_node()
        .default(Number(0.0))
        .live()
        .describe("Timeout after the end of a trajectory for action goals without a goal time tolerance, which abort then; 0 disables it."),
    ParameterDefinition::new("interpolation_method", "", ParameterKind::Choice(&["splines", "none"]))
        .of_node()
        .default(Text("splines"))
        .describe("Interpolation of trajectories between points: by the fields of the points, or none: the setpoint is the next point, within the velocity limits."),
    ParameterDefinition::new("use_sim_time", "", ParameterKind::Flag).of_node().default(Flag(false)).describe("Use the time of the topic /clock."),
    ParameterDefinition::new("record", "", ParameterKind::Text)
        .of_node()
        .default(Text(""))
        .describe("MCAP file for recording all topics of the node; it must not exist; empty disables recording."),
    ParameterDefinition::new("record_max_mb", "MB", ParameterKind::Integer { min: 1, max: 1_000_000 })
        .of_node()
        .default(Integer(1024))
        .describe("Maximum size of the recording, which is closed there; the axes continue."),
    ParameterDefinition::new("renewal_endpoints", "", ParameterKind::Integer { min: 0, max: 1_000_000_000 })
        .of_node()
        .default(Integer(100_000))
        .describe("Number of departed remote endpoints after which the node renews its DDS participant at rest, which releases their memory; 0 disables it. Not in fast and not with DDS Security."),
    // Quality of service.
    qos_reliability("qos.psec.reliability", "reliable"),
    qos_durability("qos.psec.durability", "volatile"),
    qos_depth("qos.psec.depth", 64),
    // Matches the publisher of ros2_control's topic-based hardware, which sends the last setpoint of a move only once.
    qos_reliability("qos.psec_stream.reliability", "reliable"),
    qos_durability("qos.psec_stream.durability", "volatile"),
    qos_depth("qos.psec_stream.depth", 10),
    qos_reliability("qos.speed_scaling_input.reliability", "reliable"),
    qos_durability("qos.speed_scaling_input.durability", "volatile"),
    qos_depth("qos.speed_scaling_input.depth", 10),
    qos_reliability("qos.load.reliability", "best_effort"),
    qos_durability("qos.load.durability", "volatile"),
    qos_depth("qos.load.depth", 10),
    qos_reliability("qos.joint_states.reliability", "reliable"),
    qos_durability("qos.joint_states.durability", "volatile"),
    qos_depth("qos.joint_states.depth", 10),
    qos_reliability("qos.motor_currents.reliability", "reliable"),
    qos_durability("qos.motor_currents.durability", "volatile"),
    qos_depth("qos.motor_currents.depth", 10),
    qos_reliability("qos.drive_states.reliability", "reliable"),
    qos_durability("qos.drive_states.durability", "volatile"),
    qos_depth("qos.drive_states.depth", 10),
    qos_reliability("qos.controller_state.reliability", "reliable"),
    qos_durability("qos.controller_state.durability", "volatile"),
    qos_depth("qos.controller_state.depth", 10),
    qos_reliability("qos.tool_pose.reliability", "reliable"),
    qos_durability("qos.tool_pose.durability", "volatile"),
    qos_depth("qos.tool_pose.depth", 10),
    qos_reliability("qos.tool_path.reliability", "reliable"),
    qos_durability("qos.tool_path.durability", "volatile"),
    qos_depth("qos.tool_path.depth", 1),
    qos_reliability("qos.tool_path_setpoint.reliability", "reliable"),
    qos_durability("qos.tool_path_setpoint.durability", "volatile"),
    qos_depth("qos.tool_path_setpoint.depth", 1),
    qos_reliability("qos.trajectory_result.reliability", "reliable"),
    qos_durability("qos.trajectory_result.durability", "transient_local"),
    qos_depth("qos.trajectory_result.depth", 50),
    qos_reliability("qos.diagnostics.reliability", "reliable"),
    qos_durability("qos.diagnostics.durability", "volatile"),
    qos_depth("qos.diagnostics.depth", 10),
    qos_reliability("qos.clock.reliability", "reliable"),
    qos_durability("qos.clock.durability", "volatile"),
    qos_depth("qos.clock.depth", 10),
];
