//! How goals end, in the words of control_msgs/FollowJointTrajectory.

use super::GoalId;
use super::goals::State;
use virtual_axes_core::simulation::MotionOutcome;
use virtual_axes_core::trajectory::{Rejection, RejectionCode};
use virtual_axes_io::messages::{ErrorCode, FollowJointTrajectoryResult};

/// What became of a goal that was handed to the simulation.
#[derive(Debug)]
pub enum GoalEvent {
    /// The axes follow it.
    Started(GoalId),
    /// The axes cannot follow it.
    Refused(GoalId, Rejection),
    /// It has ended; the text says how.
    Ended(GoalId, MotionOutcome, String),
}

fn result(code: ErrorCode, text: String) -> FollowJointTrajectoryResult {
    FollowJointTrajectoryResult { error_code: code as i32, error_string: text }
}

/// The result of a goal that cannot be run.
pub(super) fn refused(rejection: &Rejection) -> FollowJointTrajectoryResult {
    let code = match rejection.code {
        RejectionCode::UnknownJoint | RejectionCode::DuplicateJoint => ErrorCode::InvalidJoints,
        RejectionCode::EndedInThePast => ErrorCode::OldHeaderTimestamp,
        _ => ErrorCode::InvalidGoal,
    };
    result(code, format!("{}: {rejection}", rejection.code.name()))
}

/// The result of a goal that something else than its own motion ended. control_msgs has no code for
/// that; joint_trajectory_controller too says `INVALID_GOAL` of a goal that another one displaced.
pub(super) fn aborted(text: String) -> FollowJointTrajectoryResult {
    result(ErrorCode::InvalidGoal, text)
}

/// State and result of a goal that has ended like this.
pub(super) fn ended(outcome: &MotionOutcome, text: String) -> (State, FollowJointTrajectoryResult) {
    match outcome {
        MotionOutcome::Completed => (State::Succeeded, result(ErrorCode::Successful, text)),
        MotionOutcome::Canceled => (State::Canceled, result(ErrorCode::Successful, text)),
        MotionOutcome::PathTolerance(_) => (State::Aborted, result(ErrorCode::PathToleranceViolated, text)),
        MotionOutcome::GoalTolerance(_) => (State::Aborted, result(ErrorCode::GoalToleranceViolated, text)),
        MotionOutcome::Preempted { .. } | MotionOutcome::Stopped | MotionOutcome::Aborted(_) => {
            (State::Aborted, aborted(text))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_refusal_has_the_code_that_clients_know_and_the_name_that_we_have() {
        for (code, number, name) in [
            (RejectionCode::UnknownJoint, -2, "UNKNOWN_JOINT: why"),
            (RejectionCode::DuplicateJoint, -2, "DUPLICATE_JOINT: why"),
            (RejectionCode::EndedInThePast, -3, "ENDED_IN_THE_PAST: why"),
            (RejectionCode::Speed, -1, "SPEED: why"),
        ] {
            let found = refused(&Rejection::new(code, "why"));
            assert_eq!((found.error_code, found.error_string.as_str()), (number, name));
        }
    }
}
