//! Servers of actions: `~/follow_joint_trajectory` (control_msgs/FollowJointTrajectory) and `~/run_program`.
//!
//! A goal passes the same checks as a trajectory on `psec`. A rejected goal is accepted and aborted at once, because only an
//! accepted goal has a result that contains the reason. A part program is interpreted and planned in a thread of its own.

mod goals;
mod planning;
mod program_goals;
mod program_text;
mod server;
mod trajectory_goals;

pub use program_goals::ProgramGoals;
pub use server::{ActionChannels, ActionServer, GoalHandler, ShutdownHandle};
pub use trajectory_goals::TrajectoryGoals;
