//! The action `~/follow_joint_trajectory` (control_msgs/FollowJointTrajectory).
//!
//! It stands on [`super::service`], because the crate's own `ActionServer` sends a response before the
//! client that asked is known, and so loses it. A goal passes the same checks as a trajectory on
//! `psec`; one that cannot be run is accepted and aborted at once, since only a goal that was accepted
//! has a result that can say why.

mod feedback;
mod goals;
mod outcome;
mod server;

pub use crate::ingress::{GoalId, GoalValidator};
pub use feedback::{Feedback, feedback_period};
pub use outcome::GoalEvent;
pub use server::{ActionServer, ServerContext, ShutdownHandle, Work};

use virtual_axes_io::messages::unique_identifier_msgs::msg::UUID;

fn uuid(id: GoalId) -> UUID {
    UUID { uuid: id }
}

/// How texts name a goal.
pub fn goal_name(id: &GoalId) -> String {
    let hex: String = id.iter().map(|octet| format!("{octet:02x}")).collect();
    format!("goal {hex}")
}
