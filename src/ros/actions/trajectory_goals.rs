//! Goals of `~/follow_joint_trajectory`: validation, submission, results.

use std::sync::Arc;

use tokio::sync::{mpsc, watch};

use super::goals::{GoalState, MAX_ACTIVE_GOALS};
use super::server::GoalHandler;
use crate::ros::axes::{Command, MotionIds, ProgramRunFigures};
use crate::ros::publication::RunningGoal;
use crate::ros::results::{Origin, TrajectoryResults};
use crate::ros_interface::{FOLLOW_JOINT_TRAJECTORY, NodeAction};
use crate::validation::{GoalId, GoalValidator};
use virtual_axes_core::simulation::{MotionEnd, MotionOutcome};
use virtual_axes_core::trajectory::{MotionId, Rejection, RejectionCode};
use virtual_axes_core::units::Nanoseconds;
use virtual_axes_io::messages::{
    ErrorCode, FollowJointTrajectoryFeedback, FollowJointTrajectoryGoal, FollowJointTrajectoryResult,
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
    pub ids: MotionIds,
    /// Goals that have feedback, including some that have ended.
    pub running: Vec<RunningGoal>,
    /// Sender of `running`.
    pub running_out: watch::Sender<Arc<[RunningGoal]>>,
}

impl GoalHandler for TrajectoryGoals {
    type Goal = FollowJointTrajectoryGoal;
    type Result = FollowJointTrajectoryResult;
    type Feedback = FollowJointTrajectoryFeedback;

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
                let motion = self.ids.next();
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
                Err(rejected(&rejection))
            }
        }
    }

    fn rejected(&mut self, _: &GoalId, rejection: &Rejection) -> FollowJointTrajectoryResult {
        rejected(rejection)
    }

    fn ended(
        &mut self,
        _: &GoalId,
        end: MotionEnd,
        _: ProgramRunFigures,
        text: String,
    ) -> (GoalState, FollowJointTrajectoryResult) {
        ended(&end.outcome, text)
    }

    fn shut_down(&self, text: &str) -> FollowJointTrajectoryResult {
        aborted(text.to_owned())
    }
}

fn result(code: ErrorCode, text: String) -> FollowJointTrajectoryResult {
    FollowJointTrajectoryResult { error_code: code as i32, error_string: text }
}

/// Returns the result of a rejected goal.
fn rejected(rejection: &Rejection) -> FollowJointTrajectoryResult {
    let code = match rejection.code {
        RejectionCode::UnknownJoint | RejectionCode::DuplicateJoint => ErrorCode::InvalidJoints,
        RejectionCode::EndedInThePast => ErrorCode::OldHeaderTimestamp,
        _ => ErrorCode::InvalidGoal,
    };
    result(code, format!("{}: {rejection}", rejection.code.name()))
}

/// Returns the result of a goal that was ended from outside its motion, with the code `INVALID_GOAL`.
///
/// control_msgs has no code for this. joint_trajectory_controller also uses `INVALID_GOAL` for a preempted goal.
fn aborted(text: String) -> FollowJointTrajectoryResult {
    result(ErrorCode::InvalidGoal, text)
}

/// Returns the final state and the result of a goal whose motion ended with `outcome`.
fn ended(outcome: &MotionOutcome, text: String) -> (GoalState, FollowJointTrajectoryResult) {
    match outcome {
        MotionOutcome::Completed => (GoalState::Succeeded, result(ErrorCode::Successful, text)),
        MotionOutcome::Canceled => (GoalState::Canceled, result(ErrorCode::Successful, text)),
        MotionOutcome::PathTolerance(_) => {
            (GoalState::Aborted, result(ErrorCode::PathToleranceViolated, text))
        }
        MotionOutcome::GoalTolerance(_) => {
            (GoalState::Aborted, result(ErrorCode::GoalToleranceViolated, text))
        }
        MotionOutcome::Preempted { .. } | MotionOutcome::Stopped | MotionOutcome::Aborted(_) => {
            (GoalState::Aborted, aborted(text))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rejection_has_the_standard_error_code_and_our_code_name() {
        for (code, number, name) in [
            (RejectionCode::UnknownJoint, -2, "UNKNOWN_JOINT: why"),
            (RejectionCode::DuplicateJoint, -2, "DUPLICATE_JOINT: why"),
            (RejectionCode::EndedInThePast, -3, "ENDED_IN_THE_PAST: why"),
            (RejectionCode::Speed, -1, "SPEED: why"),
        ] {
            let found = rejected(&Rejection::new(code, "why"));
            assert_eq!((found.error_code, found.error_string.as_str()), (number, name));
        }
    }
}
