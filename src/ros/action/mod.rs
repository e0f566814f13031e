//! Servers of actions, and the action `~/follow_joint_trajectory` (control_msgs/FollowJointTrajectory).
//!
//! A server uses [`super::service`], because the `ActionServer` of ros2-client sends a response before the client's response
//! reader is discovered, and the response is lost. A goal passes the same checks as a trajectory on `psec`. A rejected
//! goal is accepted and aborted at once, because only an accepted goal has a result that contains the reason.

mod feedback;
mod goals;
mod outcome;
mod server;
mod trajectory_goals;

pub use crate::ingress::{GoalId, GoalValidator};
pub use feedback::{FeedbackOutput, RunningGoal, feedback_period};
pub use goals::GoalState;
pub use server::{ActionChannels, ActionServer, ActionTopics, GoalHandler, GoalUpdate, ShutdownHandle};
pub use trajectory_goals::TrajectoryGoals;

use virtual_axes_io::messages::unique_identifier_msgs::msg::UUID;

fn uuid(id: GoalId) -> UUID {
    UUID { uuid: id }
}
