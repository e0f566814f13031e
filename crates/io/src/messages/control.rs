//! Messages of `control_msgs` of ROS 2 Jazzy (5.x), and the services and topics of the action `FollowJointTrajectory`.

use ros2_interfaces_jazzy_serde::builtin_interfaces::msg::{Duration, Time};
use ros2_interfaces_jazzy_serde::std_msgs::msg::Header;
use ros2_interfaces_jazzy_serde::trajectory_msgs::msg::{
    JointTrajectory, JointTrajectoryPoint, MultiDOFJointTrajectory, MultiDOFJointTrajectoryPoint,
};
use ros2_interfaces_jazzy_serde::unique_identifier_msgs::msg::UUID;
use serde::{Deserialize, Serialize};

/// Name of the package.
pub const CONTROL_PACKAGE: &str = "control_msgs";

/// Tolerances of a joint: 0 selects the default of the server, −1 disables the tolerance.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct JointTolerance {
    /// The joint.
    pub name: String,
    /// m or rad.
    pub position: f64,
    /// m/s or rad/s.
    pub velocity: f64,
    /// m/s² or rad/s².
    pub acceleration: f64,
}

/// Tolerances of one component of a multi-DOF joint.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct JointComponentTolerance {
    /// The joint.
    pub joint_name: String,
    /// Component: X, Y or Z axis (1, 2, 3), translation (4) or rotation (5).
    pub component: u16,
    /// m or rad.
    pub position: f64,
    /// m/s or rad/s.
    pub velocity: f64,
    /// m/s² or rad/s².
    pub acceleration: f64,
}

/// Goal of the action `FollowJointTrajectory`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct FollowJointTrajectoryGoal {
    /// Trajectory to follow.
    pub trajectory: JointTrajectory,
    /// Trajectory of multi-DOF joints.
    pub multi_dof_trajectory: MultiDOFJointTrajectory,
    /// Tolerances during the motion.
    pub path_tolerance: Vec<JointTolerance>,
    /// Tolerances of multi-DOF joints during the motion.
    pub component_path_tolerance: Vec<JointComponentTolerance>,
    /// Tolerances at the goal.
    pub goal_tolerance: Vec<JointTolerance>,
    /// Tolerances of multi-DOF joints at the goal.
    pub component_goal_tolerance: Vec<JointComponentTolerance>,
    /// Time after the end of the trajectory in which the goal must be reached: 0 selects the default of the server, a
    /// negative value disables the limit.
    pub goal_time_tolerance: Duration,
}

/// `error_code` of a [`FollowJointTrajectoryResult`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(i32)]
pub enum ErrorCode {
    /// The trajectory was completed within its tolerances.
    Successful = 0,
    /// The goal was rejected, or the trajectory was not completed.
    InvalidGoal = -1,
    /// A joint is unknown or occurs more than once.
    InvalidJoints = -2,
    /// The trajectory ended before it arrived.
    OldHeaderTimestamp = -3,
    /// A path tolerance was violated.
    PathToleranceViolated = -4,
    /// A goal tolerance was violated.
    GoalToleranceViolated = -5,
}

/// Result of a goal.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct FollowJointTrajectoryResult {
    /// An [`ErrorCode`].
    pub error_code: i32,
    /// Human-readable reason.
    pub error_string: String,
}

/// Feedback of an active goal.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct FollowJointTrajectoryFeedback {
    /// Header with the time of the state as stamp.
    pub header: Header,
    /// Joints of the points below.
    pub joint_names: Vec<String>,
    /// Setpoint.
    pub desired: JointTrajectoryPoint,
    /// Simulated state.
    pub actual: JointTrajectoryPoint,
    /// Difference `desired` − `actual`.
    pub error: JointTrajectoryPoint,
    /// Names of multi-DOF joints.
    pub multi_dof_joint_names: Vec<String>,
    /// Setpoint of multi-DOF joints.
    pub multi_dof_desired: MultiDOFJointTrajectoryPoint,
    /// State of multi-DOF joints.
    pub multi_dof_actual: MultiDOFJointTrajectoryPoint,
    /// Difference of multi-DOF joints.
    pub multi_dof_error: MultiDOFJointTrajectoryPoint,
}

/// State of a joint trajectory controller.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct JointTrajectoryControllerState {
    /// Header with the time of the state as stamp.
    pub header: Header,
    /// Joints of the points below.
    pub joint_names: Vec<String>,
    /// Setpoint.
    pub reference: JointTrajectoryPoint,
    /// Measured state.
    pub feedback: JointTrajectoryPoint,
    /// Difference `reference` − `feedback`.
    pub error: JointTrajectoryPoint,
    /// Output of the controller.
    pub output: JointTrajectoryPoint,
    /// Names of multi-DOF joints.
    pub multi_dof_joint_names: Vec<String>,
    /// Setpoint of multi-DOF joints.
    pub multi_dof_reference: MultiDOFJointTrajectoryPoint,
    /// Measured state of multi-DOF joints.
    pub multi_dof_feedback: MultiDOFJointTrajectoryPoint,
    /// Difference of multi-DOF joints.
    pub multi_dof_error: MultiDOFJointTrajectoryPoint,
    /// Output of the controller for multi-DOF joints.
    pub multi_dof_output: MultiDOFJointTrajectoryPoint,
    /// Feed override factor: 1 is the programmed speed.
    pub speed_scaling_factor: f64,
}

/// Feed override of trajectories.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct SpeedScalingFactor {
    /// Feed override factor: 1 is the planned speed, 0 a full stop on the path.
    pub factor: f64,
}

/// Request of the service `QueryTrajectoryState`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct QueryTrajectoryStateRequest {
    /// Time of the setpoints.
    pub time: Time,
}

/// Response of the service `QueryTrajectoryState`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct QueryTrajectoryStateResponse {
    /// True if a trajectory commands the joints at that time.
    pub success: bool,
    /// Reason if not.
    pub message: String,
    /// Joints of the arrays below.
    pub name: Vec<String>,
    /// Setpoints, m or rad.
    pub position: Vec<f64>,
    /// Velocities of the setpoints, m/s or rad/s.
    pub velocity: Vec<f64>,
    /// Accelerations of the setpoints, m/s² or rad/s².
    pub acceleration: Vec<f64>,
}

/// Request of the service `_action/send_goal`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct SendGoalRequest<G = FollowJointTrajectoryGoal> {
    /// Goal id chosen by the client.
    pub goal_id: UUID,
    /// Goal.
    pub goal: G,
}

/// Response of the service `_action/send_goal`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct SendGoalResponse {
    /// True if the goal was accepted.
    pub accepted: bool,
    /// Time of acceptance.
    pub stamp: Time,
}

/// Request of the service `_action/get_result`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct GetResultRequest {
    /// Id of the goal.
    pub goal_id: UUID,
}

/// Response of the service `_action/get_result`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct GetResultResponse<R = FollowJointTrajectoryResult> {
    /// Status code of `action_msgs/GoalStatus`.
    pub status: i8,
    /// Result.
    pub result: R,
}

/// Message of the topic `_action/feedback`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct FeedbackMessage<F = FollowJointTrajectoryFeedback> {
    /// Id of the goal.
    pub goal_id: UUID,
    /// Feedback.
    pub feedback: F,
}
