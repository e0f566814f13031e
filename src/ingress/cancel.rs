//! Which goals a request to cancel means (action_msgs/CancelGoal).

use super::GoalId;
use virtual_axes_core::units::Nanoseconds;
use virtual_axes_io::messages::action_msgs::srv::CancelGoalResponse;

/// A goal as far as it matters here.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Candidate {
    /// Its name.
    pub id: GoalId,
    /// When it was accepted, ns.
    pub stamp: Nanoseconds,
    /// Whether it can be canceled: it has not ended and has not been canceled yet.
    pub cancelable: bool,
}

/// The goals that a request with `id` and `stamp` (ns) cancels, or the code that says why none.
///
/// Neither: all; an id alone: that goal; a stamp: those accepted at or before it, and the one with
/// the id.
///
/// # Errors
/// A code of action_msgs/CancelGoal.
pub fn select(
    id: &GoalId,
    stamp: Nanoseconds,
    goals: impl Iterator<Item = Candidate>,
) -> Result<Vec<GoalId>, i8> {
    let named = *id != GoalId::default();
    if named && stamp == 0 {
        let mut goals = goals;
        return match goals.find(|goal| goal.id == *id) {
            None => Err(CancelGoalResponse::ERROR_UNKNOWN_GOAL_ID),
            Some(goal) if goal.cancelable => Ok(vec![goal.id]),
            Some(_) => Err(CancelGoalResponse::ERROR_GOAL_TERMINATED),
        };
    }
    let meant = |goal: &Candidate| (named && goal.id == *id) || (!named && stamp == 0) || goal.stamp <= stamp;
    Ok(goals.filter(|goal| goal.cancelable && meant(goal)).map(|goal| goal.id).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOBODY: GoalId = [0; 16];

    fn selected(id: GoalId, stamp: Nanoseconds) -> Result<Vec<u8>, i8> {
        // Accepted at 10, 20, 30 and 40 ns; the second has ended.
        let goals = (1..=4).map(|n| Candidate { id: [n; 16], stamp: 10 * i64::from(n), cancelable: n != 2 });
        select(&id, stamp, goals).map(|ids| ids.iter().map(|id| id[0]).collect())
    }

    #[test]
    fn without_id_and_stamp_every_goal_under_way_is_meant() {
        assert_eq!(selected(NOBODY, 0), Ok(vec![1, 3, 4]));
    }

    #[test]
    fn an_id_means_that_goal_or_says_why_it_cannot_be() {
        assert_eq!(selected([3; 16], 0), Ok(vec![3]));
        assert_eq!(selected([2; 16], 0), Err(CancelGoalResponse::ERROR_GOAL_TERMINATED));
        assert_eq!(selected([9; 16], 0), Err(CancelGoalResponse::ERROR_UNKNOWN_GOAL_ID));
    }

    #[test]
    fn a_stamp_means_what_was_accepted_at_or_before_it_and_the_id() {
        assert_eq!(selected(NOBODY, 30), Ok(vec![1, 3]));
        assert_eq!(selected([4; 16], 10), Ok(vec![1, 4]));
        assert_eq!(selected(NOBODY, 9), Ok(vec![]));
    }
}
