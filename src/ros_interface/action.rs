//! Action of the node and its error codes.

use virtual_axes_io::messages::{CONTROL_PACKAGE, ErrorCode, PACKAGE};

use super::description::{ActionErrorCode, NodeAction};

/// Action that executes a trajectory with tolerances.
pub const FOLLOW_JOINT_TRAJECTORY: NodeAction = NodeAction {
    name: "~/follow_joint_trajectory",
    package: CONTROL_PACKAGE,
    action: "FollowJointTrajectory",
    content: "a trajectory with tolerances, feedback and canceling",
    rate: "feedback at `action_monitor_rate`",
};

/// Action that runs a part program.
pub const RUN_PROGRAM: NodeAction = NodeAction {
    name: "~/run_program",
    package: PACKAGE,
    action: "RunProgram",
    content: "a part program from a file or a text, with feedback and canceling",
    rate: "feedback at `action_monitor_rate`",
};

/// All actions.
pub const ACTIONS: &[NodeAction] = &[FOLLOW_JOINT_TRAJECTORY, RUN_PROGRAM];

/// Creates an error code.
const fn code(code: ErrorCode, name: &'static str, meaning: &'static str) -> ActionErrorCode {
    ActionErrorCode { code: code as i32, name, meaning }
}

/// Values of `error_code` in the result of `~/follow_joint_trajectory`.
pub const ACTION_ERROR_CODES: &[ActionErrorCode] = &[
    code(
        ErrorCode::Successful,
        "SUCCESSFUL",
        "the goal is reached; also of a canceled goal, with status CANCELED",
    ),
    code(
        ErrorCode::InvalidGoal,
        "INVALID_GOAL",
        "any other rejection; preempted, stopped, reset, clock jump",
    ),
    code(ErrorCode::InvalidJoints, "INVALID_JOINTS", "unknown or duplicate joint"),
    code(ErrorCode::OldHeaderTimestamp, "OLD_HEADER_TIMESTAMP", "its last point is in the past"),
    code(
        ErrorCode::PathToleranceViolated,
        "PATH_TOLERANCE_VIOLATED",
        "an axis exceeded `path_tolerance` during the motion; the motion is ended by a controlled stop",
    ),
    code(
        ErrorCode::GoalToleranceViolated,
        "GOAL_TOLERANCE_VIOLATED",
        "an axis was not within `goal_tolerance` in time",
    ),
];
