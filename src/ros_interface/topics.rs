//! Topics of the node.

use virtual_axes_core::config::QosConfig;
use virtual_axes_io::messages::{CONTROL_PACKAGE, PACKAGE};

use super::description::TopicDirection::{self, In, Out};
use super::description::{Topic, TopicQos};

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

/// Defines a constant for each topic: direction, name, message, rate, other fields and content; and the list of all.
macro_rules! topics {
    ($(
        $(#[$meta:meta])*
        $const:ident: $direction:ident $name:literal, ($package:expr, $message:literal), $rate:expr
            $(, $field:ident: $value:expr)*, $content:literal;
    )*) => {
        $(
            $(#[$meta])*
            pub const $const: Topic = Topic {
                $($field: $value,)*
                ..topic($direction, $name, ($package, $message), $content, $rate)
            };
        )*

        /// All topics, those of the action and of the lifecycle excluded.
        pub const TOPICS: &[Topic] = &[$($const),*];
    };
}

topics! {
    /// Trajectories.
    PSEC: In "psec", ("trajectory_msgs", "JointTrajectory"), "any",
        "trajectory of setpoints, m or rad; an invalid one is rejected as a whole";
    /// Streamed setpoints.
    PSEC_STREAM: In "psec_stream", ("sensor_msgs", "JointState"), "any; of several in one position cycle the last counts",
        "`position`: one setpoint per joint, m or rad, for joints that no trajectory moves; NaN or no entry \
         does not affect a joint";
    /// Feed override of trajectories.
    SPEED_SCALING_INPUT: In "~/speed_scaling_input", (CONTROL_PACKAGE, "SpeedScalingFactor"), "any; the last one counts",
        "feed override of trajectories, 0 to 2 (200 %), within the limits of the axes and on the path; another \
         value is ignored with a warning. A transient-local publisher need not wait for the node: its last value is \
         received";
    /// External loads.
    LOAD: In "load", ("sensor_msgs", "JointState"), "any",
        "`effort`: external force or torque per axis, N or N·m, up to 1e6, positive towards plus; held for \
         `load_timeout` per axis";
    /// Clock that the node follows.
    CLOCK_INPUT: In "/clock", ("rosgraph_msgs", "Clock"), "any",
        qos: TopicQos::Constant(CLOCK_INPUT_QOS), conditions: &[("use_sim_time", "true")],
        "time that the axes follow";
    /// Positions and velocities.
    JOINT_STATES: Out "joint_states", ("sensor_msgs", "JointState"), CYCLE_RATE,
        "position, m or rad; velocity, m/s or rad/s; `effort`: motor force or torque at the axis, N or N·m, \
         Kt·i/r, before friction";
    /// Motor currents.
    MOTOR_CURRENTS: Out "~/motor_currents", (PACKAGE, "MotorCurrents"), CYCLE_RATE,
        "current, setpoint, its friction, gravity and load parts, A; saturated or not";
    /// Setpoints, errors and controller outputs.
    DRIVE_STATES: Out "~/drive_states", (PACKAGE, "DriveStates"), CYCLE_RATE,
        "setpoint, position, following error (`tracking_error`), delay-compensated following error \
         (`synchronized_tracking_error`), m or rad; velocity; controller outputs";
    /// Reference, feedback and error of joint_trajectory_controller.
    CONTROLLER_STATE: Out "~/controller_state", (CONTROL_PACKAGE, "JointTrajectoryControllerState"), CYCLE_RATE,
        "reference (setpoints delayed by α), feedback, error, output, as of joint_trajectory_controller; \
         `speed_scaling_factor`: feed override in effect";
    /// Tool poses.
    TOOL_POSE: Out "~/tool_pose", ("geometry_msgs", "PoseStamped"), CYCLE_RATE,
        "tool tip, m, and tool frame (Z towards the spindle) in `workpiece_frame`; not on a machine without x, \
         y, z, a and c";
    /// Path of the tool tip.
    TOOL_PATH: Out "~/tool_path", ("nav_msgs", "Path"), "`tool_path_rate` while it moves, else every 2 s",
        "newest `tool_path_length` poses of the tool, m, at least 0.1 mm or 1 mrad apart; exists with \
         `~/tool_pose`";
    /// Path of the setpoints of the tool tip.
    TOOL_PATH_SETPOINT: Out "~/tool_path_setpoint", ("nav_msgs", "Path"), "as `~/tool_path`",
        "tool path of the setpoints (delayed by α), pose by pose, m; exists with `~/tool_pose`";
    /// Results of trajectories.
    TRAJECTORY_RESULT: Out "~/trajectory_result", (PACKAGE, "TrajectoryResult"), "two per trajectory or goal, one if it is rejected; one when a stream is preempted",
        "accepted or rejected, with the reason; at the end errors, peak currents, saturation";
    /// Diagnostics.
    DIAGNOSTICS: Out "/diagnostics", ("diagnostic_msgs", "DiagnosticArray"), "1 Hz",
        "running, settling or holding; limits reached; late and unpublished cycles; dropped samples; memory";
    /// Clock of the node.
    CLOCK: Out "/clock", ("rosgraph_msgs", "Clock"), "every position cycle", conditions: &[("time", "fast")],
        "time of the axes; a second publisher in the domain is an error";
    /// Log.
    ROSOUT: Out "/rosout", ("rcl_interfaces", "Log"), "any",
        qos: TopicQos::Constant(ROSOUT_QOS),
        "log with ROS levels and logger names; not with `--disable-rosout-logs`";
    /// Changes of parameters.
    PARAMETER_EVENTS: Out "/parameter_events", ("rcl_interfaces", "ParameterEvent"), "any",
        qos: TopicQos::Constant(PARAMETER_EVENTS_QOS),
        "changed parameters";
}

/// Creates a topic with QoS parameters that always exists.
const fn topic(
    direction: TopicDirection,
    name: &'static str,
    (package, message): (&'static str, &'static str),
    content: &'static str,
    rate: &'static str,
) -> Topic {
    Topic { direction, name, package, message, content, qos: TopicQos::Parameters, rate, conditions: &[] }
}

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
