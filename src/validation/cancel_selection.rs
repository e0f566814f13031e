//! Selection of the goals that a cancel request matches (`action_msgs/CancelGoal`).

use virtual_axes_core::units::Nanoseconds;
use virtual_axes_io::messages::action_msgs::srv::CancelGoalResponse;

/// Identifier of an action goal (UUID), chosen by its client.
pub type GoalId = [u8; 16];

/// Goal that a cancel request can match.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CancelCandidate {
    /// Goal id.
    pub id: GoalId,
    /// Time of acceptance, ns.
    pub stamp: Nanoseconds,
    /// True if the goal has neither ended nor been canceled.
    pub is_cancelable: bool,
}

/// Selects the goals that a cancel request with `id` and `stamp` (ns) matches.
///
/// - Neither id nor stamp: all goals.
/// - Id only: the goal with this id.
/// - Stamp: all goals accepted at or before it, and the goal with the id, if any.
///
/// # Errors
/// Error code of `action_msgs/CancelGoal`: unknown goal id, or goal already terminated.
pub fn select_goals_to_cancel(
    id: &GoalId,
    stamp: Nanoseconds,
    goals: impl Iterator<Item = CancelCandidate>,
) -> Result<Vec<GoalId>, i8> {
    let has_id = *id != GoalId::default();
    if has_id && stamp == 0 {
        let mut goals = goals;
        return match goals.find(|goal| goal.id == *id) {
            None => Err(CancelGoalResponse::ERROR_UNKNOWN_GOAL_ID),
            Some(goal) if goal.is_cancelable => Ok(vec![goal.id]),
            Some(_) => Err(CancelGoalResponse::ERROR_GOAL_TERMINATED),
        };
    }
    let matches =
        |goal: &CancelCandidate| (has_id && goal.id == *id) || (!has_id && stamp == 0) || goal.stamp <= stamp;
    Ok(goals.filter(|goal| goal.is_cancelable && matches(goal)).map(|goal| goal.id).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    const NO_ID: GoalId = [0; 16];

    fn selected(id: GoalId, stamp: Nanoseconds) -> Result<Vec<u8>, i8> {
        // Accepted at 10, 20, 30 and 40 ns; the second one has ended.
        let goals =
            (1..=4).map(|n| CancelCandidate { id: [n; 16], stamp: 10 * i64::from(n), is_cancelable: n != 2 });
        select_goals_to_cancel(&id, stamp, goals).map(|ids| ids.iter().map(|id| id[0]).collect())
    }

    #[test]
    fn without_id_and_stamp_all_active_goals_match() {
        assert_eq!(selected(NO_ID, 0), Ok(vec![1, 3, 4]));
    }

    #[test]
    fn an_id_matches_its_goal_or_returns_an_error_code() {
        assert_eq!(selected([3; 16], 0), Ok(vec![3]));
        assert_eq!(selected([2; 16], 0), Err(CancelGoalResponse::ERROR_GOAL_TERMINATED));
        assert_eq!(selected([9; 16], 0), Err(CancelGoalResponse::ERROR_UNKNOWN_GOAL_ID));
    }

    #[test]
    fn a_stamp_matches_goals_accepted_at_or_before_it_and_the_id() {
        assert_eq!(selected(NO_ID, 30), Ok(vec![1, 3]));
        assert_eq!(selected([4; 16], 10), Ok(vec![1, 4]));
        assert_eq!(selected(NO_ID, 9), Ok(vec![]));
    }
}
