//! Table of the goals: active ones, and ended ones whose results are kept.

use std::time::{Duration, Instant};

use crate::validation::{CancelCandidate, GoalId, select_goals_to_cancel};
use virtual_axes_core::trajectory::MotionId;
use virtual_axes_core::units::{Nanoseconds, SECOND_NS};
use virtual_axes_dds::RequestId;
use virtual_axes_io::messages::action_msgs::msg::{GoalInfo, GoalStatus, GoalStatusArray};
use virtual_axes_io::messages::action_msgs::srv::{CancelGoalRequest, CancelGoalResponse};
use virtual_axes_io::messages::unique_identifier_msgs::msg::UUID;
use virtual_axes_io::messages::{GetResultResponse, stamp};

/// Largest number of active goals; each owns its trajectory.
pub(super) const MAX_ACTIVE_GOALS: usize = 1024;
/// Largest number of kept results; each status message contains all of them.
const MAX_KEPT_RESULTS: usize = 256;
/// Time for which a result is kept (`result_timeout` of rcl_action).
const RESULT_TIMEOUT: Duration = Duration::from_secs(15 * 60);
/// Largest number of waiting result requests of all goals. All may be answered at once, when the goals end together.
const MAX_RESULT_REQUESTS: usize = 4096;

/// State of a goal, with the numbers of action_msgs/GoalStatus.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(i8)]
pub enum GoalState {
    /// Accepted by the server; the simulation has not decided yet.
    Accepted = GoalStatus::STATUS_ACCEPTED,
    /// Accepted by the simulation.
    Executing = GoalStatus::STATUS_EXECUTING,
    /// Stopping at the request of a client.
    Canceling = GoalStatus::STATUS_CANCELING,
    /// Completed within its tolerances.
    Succeeded = GoalStatus::STATUS_SUCCEEDED,
    /// Stopped at the request of a client.
    Canceled = GoalStatus::STATUS_CANCELED,
    /// Ended for another reason.
    Aborted = GoalStatus::STATUS_ABORTED,
}

#[derive(Debug)]
struct Goal<R> {
    id: GoalId,
    stamp: Nanoseconds,
    state: GoalState,
    motion: Option<MotionId>,
    waiting: Vec<RequestId>,
    /// Result and its time.
    ended: Option<(R, Instant)>,
}

impl<R> Goal<R> {
    fn info(&self) -> GoalInfo {
        GoalInfo { goal_id: UUID { uuid: self.id }, stamp: stamp(self.stamp) }
    }
}

/// Reply to a result request.
#[derive(Debug, PartialEq)]
pub(super) enum ResultReply<R> {
    /// Response to be sent at once.
    Ready(GetResultResponse<R>),
    /// Deferred until the goal ends.
    Pending,
}

/// Table of goals in the order of acceptance.
#[derive(Debug)]
pub(super) struct GoalTable<R> {
    list: Vec<Goal<R>>,
}

impl<R> Default for GoalTable<R> {
    fn default() -> Self {
        Self { list: Vec::new() }
    }
}

impl<R: Clone + Default> GoalTable<R> {
    /// Returns true if the id is in use.
    pub fn contains(&self, id: &GoalId) -> bool {
        self.list.iter().any(|goal| goal.id == *id)
    }

    /// Returns the ids of the active goals.
    pub fn active_ids(&self) -> Vec<GoalId> {
        self.list.iter().filter(|goal| goal.ended.is_none()).map(|goal| goal.id).collect()
    }

    fn find(&mut self, id: &GoalId) -> Option<&mut Goal<R>> {
        self.list.iter_mut().find(|goal| goal.id == *id)
    }

    /// Adds a goal accepted at `stamp`, ns of the node's clock.
    pub fn accept(&mut self, id: GoalId, stamp: Nanoseconds) {
        let goal =
            Goal { id, stamp, state: GoalState::Accepted, motion: None, waiting: Vec::new(), ended: None };
        self.list.push(goal);
    }

    /// Sets the motion of a goal.
    pub fn set_motion(&mut self, id: &GoalId, motion: MotionId) {
        if let Some(goal) = self.find(id) {
            goal.motion = Some(motion);
        }
    }

    /// Changes an accepted goal to executing.
    pub fn start(&mut self, id: &GoalId) {
        if let Some(goal) = self.find(id)
            && goal.state == GoalState::Accepted
        {
            goal.state = GoalState::Executing;
        }
    }

    /// Ends a goal. Returns the waiting result requests and their response. Further ends of the goal have no effect.
    pub fn end(
        &mut self,
        id: &GoalId,
        state: GoalState,
        result: R,
        now: Instant,
    ) -> (Vec<RequestId>, GetResultResponse<R>) {
        let response = GetResultResponse { status: state as i8, result: result.clone() };
        let waiting = match self.find(id) {
            Some(goal) if goal.ended.is_none() => {
                goal.state = state;
                goal.ended = Some((result, now));
                std::mem::take(&mut goal.waiting)
            }
            _ => Vec::new(),
        };
        self.remove_old_results(now);
        (waiting, response)
    }

    /// Returns the reply to a result request; a deferred request is added to the goal.
    pub fn request_result(&mut self, id: &GoalId, request: RequestId) -> ResultReply<R> {
        let waiting = self.list.iter().map(|goal| goal.waiting.len()).sum::<usize>();
        match self.find(id) {
            Some(Goal { state, ended: Some((result, _)), .. }) => {
                ResultReply::Ready(GetResultResponse { status: *state as i8, result: result.clone() })
            }
            Some(goal) if waiting < MAX_RESULT_REQUESTS => {
                goal.waiting.push(request);
                ResultReply::Pending
            }
            // The default status is UNKNOWN.
            _ => ResultReply::Ready(GetResultResponse::default()),
        }
    }

    /// Changes the selected goals to canceling. Returns the response and the motions to be canceled.
    pub fn cancel(&mut self, request: &CancelGoalRequest) -> (CancelGoalResponse, Vec<MotionId>) {
        let selected = &request.goal_info;
        let time = i64::from(selected.stamp.sec) * SECOND_NS + i64::from(selected.stamp.nanosec);
        let candidates = self.list.iter().map(|goal| CancelCandidate {
            id: goal.id,
            stamp: goal.stamp,
            is_cancelable: matches!(goal.state, GoalState::Accepted | GoalState::Executing),
        });
        let mut response = CancelGoalResponse::default();
        let mut motions = Vec::new();
        match select_goals_to_cancel(&selected.goal_id.uuid, time, candidates) {
            Ok(ids) => {
                for goal in self.list.iter_mut().filter(|goal| ids.contains(&goal.id)) {
                    goal.state = GoalState::Canceling;
                    response.goals_canceling.push(goal.info());
                    motions.extend(goal.motion);
                }
            }
            Err(code) => response.return_code = code,
        }
        (response, motions)
    }

    /// Returns the message of the status topic.
    pub fn status_message(&self) -> GoalStatusArray {
        let status = |goal: &Goal<R>| GoalStatus { goal_info: goal.info(), status: goal.state as i8 };
        GoalStatusArray { status_list: self.list.iter().map(status).collect() }
    }

    /// Removes expired results, and the oldest ones if there are too many.
    fn remove_old_results(&mut self, now: Instant) {
        let ended = self.list.iter().filter(|goal| goal.ended.is_some()).count();
        let mut surplus = ended.saturating_sub(MAX_KEPT_RESULTS);
        self.list.retain(|goal| match &goal.ended {
            Some((_, since)) if surplus > 0 || now.duration_since(*since) > RESULT_TIMEOUT => {
                surplus = surplus.saturating_sub(1);
                false
            }
            _ => true,
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use virtual_axes_io::messages::FollowJointTrajectoryResult;

    type GoalTable = super::GoalTable<FollowJointTrajectoryResult>;
    type ResultReply = super::ResultReply<FollowJointTrajectoryResult>;

    fn id(number: u16) -> GoalId {
        let mut id = [7; 16];
        id[..2].copy_from_slice(&number.to_le_bytes());
        id
    }

    fn response(goals: &mut GoalTable, number: u16) -> ResultReply {
        goals.request_result(&id(number), RequestId::default())
    }

    #[test]
    fn result_requests_before_and_after_the_end_are_answered() {
        let mut goals = GoalTable::default();
        goals.accept(id(1), 5);
        assert_eq!(response(&mut goals, 1), ResultReply::Pending);
        assert_eq!(response(&mut goals, 1), ResultReply::Pending);
        let result = FollowJointTrajectoryResult { error_code: -5, error_string: "far".into() };
        let (waiting, answer) = goals.end(&id(1), GoalState::Aborted, result, Instant::now());
        assert_eq!((waiting.len(), answer.status, answer.result.error_code), (2, 6, -5));
        assert_eq!(response(&mut goals, 1), ResultReply::Ready(answer));
        assert_eq!(response(&mut goals, 2), ResultReply::Ready(GetResultResponse::default()));
    }

    /// A reset ends all goals, and all their result requests are answered at once.
    #[test]
    fn result_requests_are_bounded_over_all_goals() {
        let mut goals = GoalTable::default();
        for number in 1..=2 {
            goals.accept(id(number), 5);
        }
        for _ in 0..MAX_RESULT_REQUESTS / 2 {
            assert_eq!(response(&mut goals, 1), ResultReply::Pending);
            assert_eq!(response(&mut goals, 2), ResultReply::Pending);
        }
        for number in 1..=2 {
            assert_eq!(response(&mut goals, number), ResultReply::Ready(GetResultResponse::default()));
        }
        goals.end(&id(1), GoalState::Succeeded, FollowJointTrajectoryResult::default(), Instant::now());
        assert_eq!(response(&mut goals, 2), ResultReply::Pending);
    }

    #[test]
    fn the_first_end_of_a_goal_counts() {
        let mut goals = GoalTable::default();
        goals.accept(id(1), 5);
        let now = Instant::now();
        goals.end(&id(1), GoalState::Succeeded, FollowJointTrajectoryResult::default(), now);
        goals.end(&id(1), GoalState::Aborted, FollowJointTrajectoryResult::default(), now);
        assert_eq!(goals.status_message().status_list[0].status, GoalState::Succeeded as i8);
    }

    #[test]
    fn old_and_surplus_results_are_dropped_but_no_active_goal() {
        let mut goals = GoalTable::default();
        goals.accept(id(0), 0);
        let begin = Instant::now();
        let most = MAX_KEPT_RESULTS as u16;
        for number in 1..=most + 2 {
            goals.accept(id(number), 0);
            goals.end(&id(number), GoalState::Succeeded, FollowJointTrajectoryResult::default(), begin);
        }
        assert_eq!(goals.list.len(), MAX_KEPT_RESULTS + 1);
        assert!(goals.contains(&id(0)) && !goals.contains(&id(2)) && goals.contains(&id(3)));
        let later = begin + RESULT_TIMEOUT + Duration::from_secs(1);
        goals.accept(id(9999), 0);
        goals.end(&id(9999), GoalState::Succeeded, FollowJointTrajectoryResult::default(), later);
        assert_eq!(goals.active_ids(), [id(0)]);
        assert_eq!(goals.list.len(), 2);
    }

    #[test]
    fn motions_are_canceled_only_once() {
        let mut goals = GoalTable::default();
        for number in [1, 2] {
            goals.accept(id(number), SECOND_NS);
            goals.set_motion(&id(number), MotionId(number.into()));
            goals.start(&id(number));
        }
        let (response, motions) = goals.cancel(&CancelGoalRequest::default());
        assert_eq!((response.return_code, motions), (0, vec![MotionId(1), MotionId(2)]));
        assert_eq!(response.goals_canceling[0].stamp.sec, 1);
        let (response, motions) = goals.cancel(&CancelGoalRequest::default());
        assert!(motions.is_empty() && response.goals_canceling.is_empty());
    }
}
