//! Topics of the node.

use virtual_axes_core::config::QosConfig;
use virtual_axes_io::messages::{CONTROL_PACKAGE, PACKAGE};

use super::TopicDirection::{In, Out};
use super::{Topic, TopicQos};

/// Rate of the topics of a position cycle.
const CYCLE_RATE: &str = "every position cycle, or `publish_rate`";

/// QoS of the `/clock` subscription. Best effort matches reliable and best-effort publishers; the depth allows for
/// several publishers.
pub const CLOCK_INPUT_QOS: QosConfig = QosConfig { is_reliable: false, is_transient_local: false, depth: 10 };
/// QoS of rcl's `/rosout` publisher (`rcl_qos_profile_rosout_default`).
pub const ROSOUT_QOS: QosConfig = QosConfig { is_reliable: true, is_transient_local: true, depth: 1000 };
/// QoS of `/parameter_events`.
pub const PARAMETER_EVENTS_QOS: QosConfig =
    QosConfig { is_reliable: true, is_transient_local: false, depth: 1 };

/// QoS of rcl's `~/transition_event`.
pub const TRANSITION_EVENT_QOS: QosConfig =
    QosConfig { is_reliable: true, is_transient_local: false, depth: 10 };

/// Creates a topic with QoS parameters that always exists.
const fn topic(
    direction: super::TopicDirection,
    name: &'static str,
    (package, message): (&'static str, &'static str),
    content: &'static str,
    rate: &'static str,
) -> Topic {
    Topic { direction, name, package, message, content, qos: TopicQos::Parameters, rate, conditions: &[] }
}

/// Trajectories.
pub const PSEC: Topic = topic(
    In,
    "psec",
    ("trajectory_msgs", "JointTrajectory"),
    "trajectory of setpoints, m or rad; an invalid one is rejected as a whole",
    "any",
);

/// Streamed setpoints.
pub const PSEC_STREAM: Topic = topic(
    In,
    "psec_stream",
    ("sensor_msgs", "JointState"),
    "`position`: one setpoint per joint, m or rad, for joints that no trajectory moves; NaN or no entry does not affect \
     a joint",
    "any; of several in one position cycle the last counts",
);

/// Feed override of trajectories.
pub const SPEED_SCALING_INPUT: Topic = topic(
    In,
    "~/speed_scaling_input",
    (CONTROL_PACKAGE, "SpeedScalingFactor"),
    "feed override of trajectories, 0 to 2 (200 %), within the limits of the axes and on the path; another value is \
     ignored with a warning",
    "any; the last one counts",
);

/// External loads.
pub const LOAD: Topic = topic(
    In,
    "load",
    ("sensor_msgs", "JointState"),
    "`effort`: external force or torque per axis, N or N·m, up to 1e6, positive towards plus; held for `load_timeout` \
     per axis",
    "any",
);

/// Clock that the node follows.
pub const CLOCK_INPUT: Topic = Topic {
    qos: TopicQos::Constant(CLOCK_INPUT_QOS),
    conditions: &[("use_sim_time", "true"), ("time", "fast")],
    ..topic(
        In,
        "/clock",
        ("rosgraph_msgs", "Clock"),
        "time that the axes follow; with `time: fast` the clock of another publisher, if there is one",
        "any",
    )
};

/// Positions and velocities.
pub const JOINT_STATES: Topic = topic(
    Out,
    "joint_states",
    ("sensor_msgs", "JointState"),
    "position, m or rad; velocity, m/s or rad/s; `effort`: motor force or torque at the axis, N or N·m, Kt·i/r, before \
     friction",
    CYCLE_RATE,
);

/// Motor currents.
pub const MOTOR_CURRENTS: Topic = topic(
    Out,
    "~/motor_currents",
    (PACKAGE, "MotorCurrents"),
    "current, setpoint, its friction, gravity and load parts, A; saturated or not",
    CYCLE_RATE,
);

/// Setpoints, errors and controller outputs.
pub const DRIVE_STATES: Topic = topic(
    Out,
    "~/drive_states",
    (PACKAGE, "DriveStates"),
    "setpoint, position, following error (`tracking_error`), delay-compensated following error \
     (`synchronized_tracking_error`), m or rad; velocity; controller outputs",
    CYCLE_RATE,
);

/// Reference, feedback and error of joint_trajectory_controller.
pub const CONTROLLER_STATE: Topic = topic(
    Out,
    "~/controller_state",
    (CONTROL_PACKAGE, "JointTrajectoryControllerState"),
    "reference (setpoints delayed by α), feedback, error, output, as of joint_trajectory_controller; \
     `speed_scaling_factor`: feed override in effect",
    CYCLE_RATE,
);

/// Tool poses.
pub const TOOL_POSE: Topic = topic(
    Out,
    "~/tool_pose",
    ("geometry_msgs", "PoseStamped"),
    "tool tip, m, and tool frame (Z towards the spindle) in `workpiece_frame`; not on a machine without x, y, z, a \
     and c",
    CYCLE_RATE,
);

/// Path of the tool tip.
pub const TOOL_PATH: Topic = topic(
    Out,
    "~/tool_path",
    ("nav_msgs", "Path"),
    "newest `tool_path_length` poses of the tool, m, at least 0.1 mm or 1 mrad apart; exists with `~/tool_pose`",
    "`tool_path_rate` while it moves, else every 2 s",
);

/// Path of the setpoints of the tool tip.
pub const TOOL_PATH_SETPOINT: Topic = topic(
    Out,
    "~/tool_path_setpoint",
    ("nav_msgs", "Path"),
    "tool path of the setpoints (delayed by α), pose by pose, m; exists with `~/tool_pose`",
    "as `~/tool_path`",
);

/// Results of trajectories.
pub const TRAJECTORY_RESULT: Topic = topic(
    Out,
    "~/trajectory_result",
    (PACKAGE, "TrajectoryResult"),
    "accepted or rejected, with the reason; at the end errors, peak currents, saturation",
    "two per trajectory or goal, one if it is rejected; one when a stream is preempted",
);

/// Diagnostics.
pub const DIAGNOSTICS: Topic = topic(
    Out,
    "/diagnostics",
    ("diagnostic_msgs", "DiagnosticArray"),
    "running, settling or holding; limits reached; late and unpublished cycles; dropped samples; memory",
    "1 Hz",
);

/// Clock of the node.
pub const CLOCK: Topic = Topic {
    conditions: &[("time", "fast")],
    ..topic(
        Out,
        "/clock",
        ("rosgraph_msgs", "Clock"),
        "time of the axes, from one machine of a domain, while there is no other publisher",
        "every position cycle",
    )
};

/// Log.
pub const ROSOUT: Topic = Topic {
    qos: TopicQos::Constant(ROSOUT_QOS),
    ..topic(
        Out,
        "/rosout",
        ("rcl_interfaces", "Log"),
        "log with ROS levels and logger names; not with `--disable-rosout-logs`",
        "any",
    )
};

/// Changes of parameters.
pub const PARAMETER_EVENTS: Topic = Topic {
    qos: TopicQos::Constant(PARAMETER_EVENTS_QOS),
    ..topic(Out, "/parameter_events", ("rcl_interfaces", "ParameterEvent"), "changed parameters", "any")
};

/// Beginnings and ends of transitions of a managed node.
pub const TRANSITION_EVENT: Topic = Topic {
    qos: TopicQos::Constant(TRANSITION_EVENT_QOS),
    ..topic(
        Out,
        "~/transition_event",
        ("lifecycle_msgs", "TransitionEvent"),
        "beginnings and ends of transitions of a managed node (`--lifecycle`)",
        "any",
    )
};

/// All topics, those of the action and of the lifecycle excluded.
pub const TOPICS: &[Topic] = &[
    PSEC,
    PSEC_STREAM,
    SPEED_SCALING_INPUT,
    LOAD,
    CLOCK_INPUT,
    JOINT_STATES,
    MOTOR_CURRENTS,
    DRIVE_STATES,
    CONTROLLER_STATE,
    TOOL_POSE,
    TOOL_PATH,
    TOOL_PATH_SETPOINT,
    TRAJECTORY_RESULT,
    DIAGNOSTICS,
    CLOCK,
    ROSOUT,
    PARAMETER_EVENTS,
];
