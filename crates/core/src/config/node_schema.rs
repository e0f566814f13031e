//! The part of the schema that is about the node: what it follows, publishes and takes in.

use super::definition::DefaultValue::{Flag, Integer, Number, Text};
use super::definition::{Definition, Kind};

/// Whether samples of a topic are repeated until they have arrived.
const fn qos_reliability(key: &'static str, default: &'static str) -> Definition {
    Definition::new(key, "", Kind::Choice(&["reliable", "best_effort"]))
        .of_node()
        .default(Text(default))
        .is("Whether lost samples of the topic are sent again.")
}

/// Whether a late joiner gets the last samples of a topic.
const fn qos_durability(key: &'static str, default: &'static str) -> Definition {
    Definition::new(key, "", Kind::Choice(&["volatile", "transient_local"]))
        .of_node()
        .default(Text(default))
        .is("Whether late joiners of the topic get its last samples.")
}

/// How many samples of a topic are kept.
const fn qos_depth(key: &'static str, default: i64) -> Definition {
    Definition::new(key, "", Kind::Integer { min: 1, max: 100_000 })
        .of_node()
        .default(Integer(default))
        .is("Samples of the topic that are kept (keep last).")
}

/// Parameters of the node.
pub(super) const NODE: &[Definition] = &[
    Definition::new("time", "", Kind::Choice(&["real", "fast"]))
        .of_node()
        .default(Text("real"))
        .is("Pace of the simulation: real time, or as fast as it goes with its own /clock."),
    Definition::number("publish_rate", "Hz", 0.0, 1e6)
        .of_node()
        .default(Number(0.0))
        .is("Rate of joint_states, at most one per position period; 0 is every position period."),
    Definition::new("joint_prefix", "", Kind::Text)
        .of_node()
        .default(Text(""))
        .is("Text before the joint names in messages."),
    Definition::number("load_timeout", "s", 1e-3, 3600.0)
        .of_node()
        .default(Number(0.1))
        .is("Time after which an external load that is not renewed is zero again."),
    Definition::new("max_points", "", Kind::Integer { min: 1, max: 100_000_000 })
        .of_node()
        .default(Integer(1_000_000))
        .is("Largest number of points of a trajectory."),
    Definition::new("allow_nonzero_velocity_at_trajectory_end", "", Kind::Flag)
        .of_node()
        .default(Flag(false))
        .live()
        .is("Accept trajectories whose last point has a velocity."),
    Definition::new("workpiece_frame", "", Kind::Text)
        .of_node()
        .default(Text("workpiece"))
        .is("Frame that tool poses and paths are given in."),
    Definition::number("tool_path_rate", "Hz", 0.0, 100.0)
        .of_node()
        .default(Number(2.0))
        .is("Rate of the paths of the tool tip while it moves; 0 is never."),
    Definition::new("tool_path_length", "", Kind::Integer { min: 2, max: 100_000 })
        .of_node()
        .default(Integer(2000))
        .is("Largest number of poses of a path of the tool tip; the oldest are left out."),
    Definition::number("action_monitor_rate", "Hz", 0.1, 1e6)
        .of_node()
        .default(Number(20.0))
        .is("Rate of the action's feedback by the node's clock, at most one per position period."),
    Definition::number("goal_time_tolerance", "s", 0.0, 1e6)
        .of_node()
        .default(Number(0.0))
        .live()
        .is("Time behind its end in which an action goal that names none is to be reached; 0 is any."),
    Definition::new("use_sim_time", "", Kind::Flag).of_node().default(Flag(false)).is("Follow /clock."),
    Definition::new("record", "", Kind::Text)
        .of_node()
        .default(Text(""))
        .is("MCAP file that all topics of the node are recorded in; it must not exist; empty is none."),
    Definition::new("record_max_mb", "MB", Kind::Integer { min: 1, max: 1_000_000 })
        .of_node()
        .default(Integer(1024))
        .is("Size at which the recording is closed; the axes go on."),
    // Quality of service.
    qos_reliability("qos.psec.reliability", "reliable"),
    qos_durability("qos.psec.durability", "volatile"),
    qos_depth("qos.psec.depth", 64),
    // As ros2_control's topic-based hardware publishes; it sends the last setpoint of a move once.
    qos_reliability("qos.psec_stream.reliability", "reliable"),
    qos_durability("qos.psec_stream.durability", "volatile"),
    qos_depth("qos.psec_stream.depth", 10),
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
