//! Goals of `~/follow_joint_trajectory`: validation, submission, results.

use std::sync::Arc;
use std::sync::atomic::AtomicU64;

use tokio::sync::{mpsc, watch};

use super::feedback::RunningGoal;
use super::goals::{GoalState, MAX_ACTIVE_GOALS};
use super::outcome;
use super::server::{GoalHandler, GoalUpdate};
use super::{GoalId, GoalValidator};
use crate::interface::{FOLLOW_JOINT_TRAJECTORY, NodeAction};
use crate::ros::axes_interface::Command;
use crate::ros::goal_event::GoalEvent;
use crate::ros::inputs::next_motion_id;
use crate::ros::results::{Origin, TrajectoryResults};
use virtual_axes_core::trajectory::{MotionId, Rejection, RejectionCode};
use virtual_axes_core::units::Nanoseconds;
use virtual_axes_io::messages::{
    FollowJointTrajectoryFeedback, FollowJointTrajectoryGoal, FollowJointTrajectoryResult,
};

/// Execution of the goals of `~/follow_joint_trajectory`.
pub struct TrajectoryGoals {
    /// Validator of goals, independent of the state of the axes.
    pub validator: GoalValidator,
    /// Sender of commands to the simulation.
    pub commands: mpsc::Sender<Command>,
    /// Results of the trajectories.
    pub results: Arc<TrajectoryResults>,
    /// Counter of motion ids.
    pub ids: Arc<AtomicU64>,
    /// Goals that have feedback, including some that have ended.
    pub running: Vec<RunningGoal>,
    /// Sender of `running`.
    pub running_out: watch::Sender<Arc<[RunningGoal]>>,
}

impl GoalHandler for TrajectoryGoals {
    type Goal = FollowJointTrajectoryGoal;
    type Result = FollowJointTrajectoryResult;
    type Feedback = FollowJointTrajectoryFeedback;
    type Event = GoalEvent;

    const ACTION: NodeAction = FOLLOW_JOINT_TRAJECTORY;

    async fn submit(
        &mut self,
        id: GoalId,
        goal: FollowJointTrajectoryGoal,
        now: Nanoseconds,
        active: &[GoalId],
    ) -> Result<MotionId, FollowJointTrajectoryResult> {
        let origin = Origin::Action { stamp: goal.trajectory.header.stamp.clone(), goal_id: id };
        let validated = if active.len() < MAX_ACTIVE_GOALS {
            // Validation of a large trajectory takes long; other tasks continue meanwhile.
            tokio::task::block_in_place(|| self.validator.validate(&goal))
                .and_then(|(trajectory, tolerances)| Ok((self.results.admit(trajectory)?, tolerances)))
        } else {
            let text = format!("{} goals are active; at most {MAX_ACTIVE_GOALS} are allowed", active.len());
            Err(Rejection::new(RejectionCode::TooManyGoals, text)
                .numbers(active.len() as f64, MAX_ACTIVE_GOALS as f64))
        };
        drop(goal);
        match validated {
            Ok((trajectory, tolerances)) => {
                let motion = next_motion_id(&self.ids);
                // The goal is listed before it is submitted and until after its end, so that its first and last
                // frames find it. Each frame contains the motions that it belongs to.
                self.running.retain(|running| active.contains(&running.id));
                self.running.push(RunningGoal { id, motion, indices: trajectory.joints().to_vec() });
                // The receiver is dropped only at shutdown.
                let _ = self.running_out.send(self.running.as_slice().into());
                self.results.register(motion, origin, Some(Arc::clone(&trajectory))).await;
                let submit =
                    Command::Submit { id: motion, trajectory, tolerances: Some(Box::new(tolerances)) };
                // The channel is closed only at shutdown.
                let _ = self.commands.send(submit).await;
                Ok(motion)
            }
            Err(rejection) => {
                self.results.publish_rejection(&origin, now, &rejection).await;
                Err(outcome::rejected(&rejection))
            }
        }
    }

    fn update(&mut self, event: GoalEvent) -> GoalUpdate<FollowJointTrajectoryResult> {
        match event {
            GoalEvent::Started(id) => GoalUpdate::Started(id),
            GoalEvent::Rejected(id, rejection) => {
                GoalUpdate::Ended(id, GoalState::Aborted, outcome::rejected(&rejection))
            }
            GoalEvent::Ended(id, outcome, text) => {
                let (state, result) = outcome::ended(&outcome, text);
                GoalUpdate::Ended(id, state, result)
            }
        }
    }

    fn shut_down(&self, text: &str) -> FollowJointTrajectoryResult {
        outcome::aborted(text.to_owned())
    }
}
