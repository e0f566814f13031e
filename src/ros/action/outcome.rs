//! Final states and results of goals, with the error codes of control_msgs/FollowJointTrajectory.

use super::goals::GoalState;
use virtual_axes_core::simulation::MotionOutcome;
use virtual_axes_core::trajectory::{Rejection, RejectionCode};
use virtual_axes_io::messages::{ErrorCode, FollowJointTrajectoryResult};

fn result(code: ErrorCode, text: String) -> FollowJointTrajectoryResult {
    FollowJointTrajectoryResult { error_code: code as i32, error_string: text }
}

/// Returns the result of a rejected goal.
pub(super) fn rejected(rejection: &Rejection) -> FollowJointTrajectoryResult {
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
pub(super) fn aborted(text: String) -> FollowJointTrajectoryResult {
    result(ErrorCode::InvalidGoal, text)
}

/// Returns the final state and the result of a goal whose motion ended with `outcome`.
pub(super) fn ended(outcome: &MotionOutcome, text: String) -> (GoalState, FollowJointTrajectoryResult) {
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
