//! The goals that are known: under way, or ended a while ago.

use std::time::{Duration, Instant};

use ros2_client::service::RmwRequestId;

use super::{GoalId, uuid};
use crate::ingress::{CancelCandidate, select_goals_to_cancel};
use virtual_axes_core::trajectory::MotionId;
use virtual_axes_core::units::{Nanoseconds, SECOND_NS};
use virtual_axes_io::messages::action_msgs::msg::{GoalInfo, GoalStatus, GoalStatusArray};
use virtual_axes_io::messages::action_msgs::srv::{CancelGoalRequest, CancelGoalResponse};
use virtual_axes_io::messages::{FollowJointTrajectoryResult, GetResultResponse, stamp};

/// Most goals under way at once; each holds its trajectory.
pub(super) const MOST_LIVE: usize = 1024;
/// Most results that are kept; each status message names all of them.
const MOST_ENDED: usize = 256;
/// How long a result is kept.
const RESULTS_KEPT: Duration = Duration::from_secs(15 * 60);
/// Most requests that wait for the results of all goals: each gets its response when the goals end, maybe at once.
const MOST_WAITING: usize = 4096;

/// Where a goal stands, as action_msgs/GoalStatus numbers it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(i8)]
pub(super) enum State {
    /// Nobody has decided yet.
    Accepted = GoalStatus::STATUS_ACCEPTED,
    /// The axes have it.
    Executing = GoalStatus::STATUS_EXECUTING,
    /// It is being stopped because its client asked for it.
    Canceling = GoalStatus::STATUS_CANCELING,
    /// Followed to its end.
    Succeeded = GoalStatus::STATUS_SUCCEEDED,
    /// Stopped because its client asked for it.
    Canceled = GoalStatus::STATUS_CANCELED,
    /// Ended otherwise.
    Aborted = GoalStatus::STATUS_ABORTED,
}

#[derive(Debug)]
struct Goal {
    id: GoalId,
    stamp: Nanoseconds,
    state: State,
    motion: Option<MotionId>,
    waiting: Vec<RmwRequestId>,
    /// The result, and when it came.
    ended: Option<(FollowJointTrajectoryResult, Instant)>,
}

impl Goal {
    fn info(&self) -> GoalInfo {
        GoalInfo { goal_id: uuid(self.id), stamp: stamp(self.stamp) }
    }
}

/// What a request for a result gets.
#[derive(Debug, PartialEq)]
pub(super) enum Answer {
    /// This, at once.
    Now(GetResultResponse),
    /// The result, when there is one.
    Later,
}

/// Goals in the order in which they were accepted.
#[derive(Debug, Default)]
pub(super) struct Goals {
    list: Vec<Goal>,
}

impl Goals {
    /// Whether the id is in use.
    pub fn knows(&self, id: &GoalId) -> bool {
        self.list.iter().any(|goal| goal.id == *id)
    }

    /// Goals that have not ended.
    pub fn live(&self) -> usize {
        self.list.iter().filter(|goal| goal.ended.is_none()).count()
    }

    /// Ids of the goals that have not ended.
    pub fn live_ids(&self) -> Vec<GoalId> {
        self.list.iter().filter(|goal| goal.ended.is_none()).map(|goal| goal.id).collect()
    }

    fn find(&mut self, id: &GoalId) -> Option<&mut Goal> {
        self.list.iter_mut().find(|goal| goal.id == *id)
    }

    /// Takes a goal in at `stamp` (ns of the node's clock).
    pub fn accept(&mut self, id: GoalId, stamp: Nanoseconds) {
        let goal = Goal { id, stamp, state: State::Accepted, motion: None, waiting: Vec::new(), ended: None };
        self.list.push(goal);
    }

    /// Notes by what name the simulation knows a goal.
    pub fn offered(&mut self, id: &GoalId, motion: MotionId) {
        if let Some(goal) = self.find(id) {
            goal.motion = Some(motion);
        }
    }

    /// The axes have it.
    pub fn started(&mut self, id: &GoalId) {
        if let Some(goal) = self.find(id)
            && goal.state == State::Accepted
        {
            goal.state = State::Executing;
        }
    }

    /// A goal has ended: who waits for its result, and the response. The first end counts.
    pub fn end(
        &mut self,
        id: &GoalId,
        state: State,
        result: FollowJointTrajectoryResult,
        now: Instant,
    ) -> (Vec<RmwRequestId>, GetResultResponse) {
        let response = GetResultResponse { status: state as i8, result: result.clone() };
        let waiting = match self.find(id) {
            Some(goal) if goal.ended.is_none() => {
                goal.state = state;
                goal.ended = Some((result, now));
                std::mem::take(&mut goal.waiting)
            }
            _ => Vec::new(),
        };
        self.forget(now);
        (waiting, response)
    }

    /// Somebody asks for a result.
    pub fn result(&mut self, id: &GoalId, request: RmwRequestId) -> Answer {
        let waiting = self.list.iter().map(|goal| goal.waiting.len()).sum::<usize>();
        match self.find(id) {
            Some(Goal { state, ended: Some((result, _)), .. }) => {
                Answer::Now(GetResultResponse { status: *state as i8, result: result.clone() })
            }
            Some(goal) if waiting < MOST_WAITING => {
                goal.waiting.push(request);
                Answer::Later
            }
            // Status unknown.
            _ => Answer::Now(GetResultResponse::default()),
        }
    }

    /// Somebody wants goals canceled: the response, and the motions to call off.
    pub fn cancel(&mut self, request: &CancelGoalRequest) -> (CancelGoalResponse, Vec<MotionId>) {
        let asked = &request.goal_info;
        let time = i64::from(asked.stamp.sec) * SECOND_NS + i64::from(asked.stamp.nanosec);
        let candidates = self.list.iter().map(|goal| CancelCandidate {
            id: goal.id,
            stamp: goal.stamp,
            is_cancelable: matches!(goal.state, State::Accepted | State::Executing),
        });
        let mut response = CancelGoalResponse::default();
        let mut motions = Vec::new();
        match select_goals_to_cancel(&asked.goal_id.uuid, time, candidates) {
            Ok(ids) => {
                for goal in self.list.iter_mut().filter(|goal| ids.contains(&goal.id)) {
                    goal.state = State::Canceling;
                    response.goals_canceling.push(goal.info());
                    motions.extend(goal.motion);
                }
            }
            Err(code) => response.return_code = code,
        }
        (response, motions)
    }

    /// What the status topic says.
    pub fn statuses(&self) -> GoalStatusArray {
        let status = |goal: &Goal| GoalStatus { goal_info: goal.info(), status: goal.state as i8 };
        GoalStatusArray { status_list: self.list.iter().map(status).collect() }
    }

    /// Forgets results that are old or too many, the oldest first.
    fn forget(&mut self, now: Instant) {
        let ended = self.list.iter().filter(|goal| goal.ended.is_some()).count();
        let mut too_many = ended.saturating_sub(MOST_ENDED);
        self.list.retain(|goal| match &goal.ended {
            Some((_, since)) if too_many > 0 || now.duration_since(*since) > RESULTS_KEPT => {
                too_many = too_many.saturating_sub(1);
                false
            }
            _ => true,
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn id(number: u16) -> GoalId {
        let mut id = [7; 16];
        id[..2].copy_from_slice(&number.to_le_bytes());
        id
    }

    fn response(goals: &mut Goals, number: u16) -> Answer {
        goals.result(&id(number), RmwRequestId::default())
    }

    #[test]
    fn a_result_is_there_for_those_who_ask_before_and_after_the_end() {
        let mut goals = Goals::default();
        goals.accept(id(1), 5);
        assert_eq!(response(&mut goals, 1), Answer::Later);
        assert_eq!(response(&mut goals, 1), Answer::Later);
        let result = FollowJointTrajectoryResult { error_code: -5, error_string: "far".into() };
        let (waiting, answer) = goals.end(&id(1), State::Aborted, result, Instant::now());
        assert_eq!((waiting.len(), answer.status, answer.result.error_code), (2, 6, -5));
        assert_eq!(response(&mut goals, 1), Answer::Now(answer));
        assert_eq!(response(&mut goals, 2), Answer::Now(GetResultResponse::default()));
    }

    /// A thousand goals had room for 256 requests each, which are all answered when a reset ends them.
    #[test]
    fn requests_for_results_are_bounded_over_all_goals() {
        let mut goals = Goals::default();
        for number in 1..=2 {
            goals.accept(id(number), 5);
        }
        for _ in 0..MOST_WAITING / 2 {
            assert_eq!(response(&mut goals, 1), Answer::Later);
            assert_eq!(response(&mut goals, 2), Answer::Later);
        }
        for number in 1..=2 {
            assert_eq!(response(&mut goals, number), Answer::Now(GetResultResponse::default()));
        }
        goals.end(&id(1), State::Succeeded, FollowJointTrajectoryResult::default(), Instant::now());
        assert_eq!(response(&mut goals, 2), Answer::Later);
    }

    #[test]
    fn the_first_end_of_a_goal_counts() {
        let mut goals = Goals::default();
        goals.accept(id(1), 5);
        let now = Instant::now();
        goals.end(&id(1), State::Succeeded, FollowJointTrajectoryResult::default(), now);
        goals.end(&id(1), State::Aborted, FollowJointTrajectoryResult::default(), now);
        assert_eq!(goals.statuses().status_list[0].status, State::Succeeded as i8);
    }

    #[test]
    fn old_results_and_those_beyond_the_most_are_forgotten_but_no_goal_under_way() {
        let mut goals = Goals::default();
        goals.accept(id(0), 0);
        let begin = Instant::now();
        let most = MOST_ENDED as u16;
        for number in 1..=most + 2 {
            goals.accept(id(number), 0);
            goals.end(&id(number), State::Succeeded, FollowJointTrajectoryResult::default(), begin);
        }
        assert_eq!(goals.list.len(), MOST_ENDED + 1);
        assert!(goals.knows(&id(0)) && !goals.knows(&id(2)) && goals.knows(&id(3)));
        let later = begin + RESULTS_KEPT + Duration::from_secs(1);
        goals.accept(id(9999), 0);
        goals.end(&id(9999), State::Succeeded, FollowJointTrajectoryResult::default(), later);
        assert_eq!(goals.live_ids(), [id(0)]);
        assert_eq!(goals.list.len(), 2);
    }

    #[test]
    fn canceling_tells_the_motions_once() {
        let mut goals = Goals::default();
        for number in [1, 2] {
            goals.accept(id(number), SECOND_NS);
            goals.offered(&id(number), MotionId(number.into()));
            goals.started(&id(number));
        }
        let (response, motions) = goals.cancel(&CancelGoalRequest::default());
        assert_eq!((response.return_code, motions), (0, vec![MotionId(1), MotionId(2)]));
        assert_eq!(response.goals_canceling[0].stamp.sec, 1);
        let (response, motions) = goals.cancel(&CancelGoalRequest::default());
        assert!(motions.is_empty() && response.goals_canceling.is_empty());
    }
}
