//! ROS messages as plain structs, their conversion from and to the types of the core, and their definitions (schemas).

mod control;
mod own;
mod pose;
mod program;
mod recorded;
mod schema;
mod state;
mod time;
mod trajectory;

pub use control::{
    CONTROL_PACKAGE, ErrorCode, FeedbackMessage, FollowJointTrajectoryFeedback, FollowJointTrajectoryGoal,
    FollowJointTrajectoryResult, GetResultRequest, GetResultResponse, JointComponentTolerance,
    JointTolerance, JointTrajectoryControllerState, QueryTrajectoryStateRequest,
    QueryTrajectoryStateResponse, SendGoalRequest, SendGoalResponse, SpeedScalingFactor,
};
pub use own::{DriveStates, MotorCurrents, PACKAGE, Source, Status, TrajectoryResult};
pub use pose::{path, pose_stamped};
pub use program::{ProgramErrorCode, RunProgramFeedback, RunProgramGoal, RunProgramResult};
pub use recorded::Recorded;
pub use ros2_interfaces_jazzy_serde::{
    action_msgs, builtin_interfaces, diagnostic_msgs, geometry_msgs, nav_msgs, rcl_interfaces, rosgraph_msgs,
    sensor_msgs, std_msgs, std_srvs, trajectory_msgs, unique_identifier_msgs,
};
pub use schema::Schema;
pub use state::Sampled;
pub use time::{duration, header, nanoseconds, parts, stamp};
pub use trajectory::{joint_trajectory, point, request};
