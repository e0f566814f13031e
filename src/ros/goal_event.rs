//! Events of action goals, sent by the trajectory results to the action server.

pub use crate::ingress::GoalId;
use virtual_axes_core::simulation::MotionOutcome;
use virtual_axes_core::trajectory::Rejection;

/// Event of a goal that was submitted to the simulation.
#[derive(Debug)]
pub enum GoalEvent {
    /// The simulation accepted the goal's trajectory.
    Started(GoalId),
    /// The simulation rejected the goal's trajectory.
    Rejected(GoalId, Rejection),
    /// The goal's motion ended, with its outcome and a description.
    Ended(GoalId, MotionOutcome, String),
}

/// Returns the name of a goal in messages: `goal` and its UUID in hexadecimal digits.
pub fn goal_name(id: &GoalId) -> String {
    let hex: String = id.iter().map(|octet| format!("{octet:02x}")).collect();
    format!("goal {hex}")
}
