//! Messages of `control_msgs` as ROS 2 Jazzy has them (5.x), field by field, and those that its action
//! `FollowJointTrajectory` is made of on the wire.

use ros2_interfaces_jazzy_serde::builtin_interfaces::msg::{Duration, Time};
use ros2_interfaces_jazzy_serde::std_msgs::msg::Header;
use ros2_interfaces_jazzy_serde::trajectory_msgs::msg::{
    JointTrajectory, JointTrajectoryPoint, MultiDOFJointTrajectory, MultiDOFJointTrajectoryPoint,
};
use ros2_interfaces_jazzy_serde::unique_identifier_msgs::msg::UUID;
use serde::{Deserialize, Serialize};

/// Name of the package.
pub const CONTROL_PACKAGE: &str = "control_msgs";

/// Largest errors of a joint: 0 is the server's default, −1 none.
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

/// Largest errors of one component of a joint with several degrees of freedom.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct JointComponentTolerance {
    /// The joint.
    pub joint_name: String,
    /// An axis (1, 2, 3), the translation (4) or the rotation (5).
    pub component: u16,
    /// m or rad.
    pub position: f64,
    /// m/s or rad/s.
    pub velocity: f64,
    /// m/s² or rad/s².
    pub acceleration: f64,
}

/// A goal of `FollowJointTrajectory`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct FollowJointTrajectoryGoal {
    /// What to follow.
    pub trajectory: JointTrajectory,
    /// Likewise for joints with several degrees of freedom.
    pub multi_dof_trajectory: MultiDOFJointTrajectory,
    /// On the way.
    pub path_tolerance: Vec<JointTolerance>,
    /// Likewise for joints with several degrees of freedom.
    pub component_path_tolerance: Vec<JointComponentTolerance>,
    /// At the end.
    pub goal_tolerance: Vec<JointTolerance>,
    /// Likewise for joints with several degrees of freedom.
    pub component_goal_tolerance: Vec<JointComponentTolerance>,
    /// How much later than its end the goal may be reached: 0 is the server's default, negative any time.
    pub goal_time_tolerance: Duration,
}

/// `error_code` of a [`FollowJointTrajectoryResult`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(i32)]
pub enum ErrorCode {
    /// Followed to its end.
    Successful = 0,
    /// Cannot be followed, or was not followed to its end.
    InvalidGoal = -1,
    /// Joints that the machine does not have, or twice.
    InvalidJoints = -2,
    /// Ended before it came.
    OldHeaderTimestamp = -3,
    /// An error on the way was larger than allowed.
    PathToleranceViolated = -4,
    /// An error at the end was larger than allowed.
    GoalToleranceViolated = -5,
}

/// The result of a goal.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct FollowJointTrajectoryResult {
    /// An [`ErrorCode`].
    pub error_code: i32,
    /// For people.
    pub error_string: String,
}

/// How a goal fares.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct FollowJointTrajectoryFeedback {
    /// Stamp: when it was so.
    pub header: Header,
    /// Joints of the points below.
    pub joint_names: Vec<String>,
    /// What is asked for.
    pub desired: JointTrajectoryPoint,
    /// What is.
    pub actual: JointTrajectoryPoint,
    /// `desired` less `actual`.
    pub error: JointTrajectoryPoint,
    /// Joints with several degrees of freedom.
    pub multi_dof_joint_names: Vec<String>,
    /// What is asked of those.
    pub multi_dof_desired: MultiDOFJointTrajectoryPoint,
    /// What is of those.
    pub multi_dof_actual: MultiDOFJointTrajectoryPoint,
    /// The difference.
    pub multi_dof_error: MultiDOFJointTrajectoryPoint,
}

/// What a trajectory controller is doing.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct JointTrajectoryControllerState {
    /// Stamp: when it was so.
    pub header: Header,
    /// Joints of the points below.
    pub joint_names: Vec<String>,
    /// The setpoint.
    pub reference: JointTrajectoryPoint,
    /// What is measured.
    pub feedback: JointTrajectoryPoint,
    /// `reference` less `feedback`.
    pub error: JointTrajectoryPoint,
    /// What the controller puts out.
    pub output: JointTrajectoryPoint,
    /// Joints with several degrees of freedom.
    pub multi_dof_joint_names: Vec<String>,
    /// What is asked of those.
    pub multi_dof_reference: MultiDOFJointTrajectoryPoint,
    /// What is measured of those.
    pub multi_dof_feedback: MultiDOFJointTrajectoryPoint,
    /// The difference.
    pub multi_dof_error: MultiDOFJointTrajectoryPoint,
    /// What the controller puts out for those.
    pub multi_dof_output: MultiDOFJointTrajectoryPoint,
    /// 1: as fast as the trajectory says.
    pub speed_scaling_factor: f64,
}

/// Request of the service `_action/send_goal`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct SendGoalRequest {
    /// Chosen by the client.
    pub goal_id: UUID,
    /// What it asks for.
    pub goal: FollowJointTrajectoryGoal,
}

/// Response of the service `_action/send_goal`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct SendGoalResponse {
    /// Whether there will be a result.
    pub accepted: bool,
    /// When it was accepted.
    pub stamp: Time,
}

/// Request of the service `_action/get_result`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct GetResultRequest {
    /// Whose result.
    pub goal_id: UUID,
}

/// Response of the service `_action/get_result`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct GetResultResponse {
    /// As in `action_msgs/GoalStatus`.
    pub status: i8,
    /// The result.
    pub result: FollowJointTrajectoryResult,
}

/// Message of the topic `_action/feedback`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct FeedbackMessage {
    /// Whose feedback.
    pub goal_id: UUID,
    /// The feedback.
    pub feedback: FollowJointTrajectoryFeedback,
}
