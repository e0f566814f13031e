//! Plan of one joint from an instant on: a pure function of the position cycle, or of the path time for a trajectory.

use std::collections::VecDeque;
use std::sync::Arc;

use super::chunk::ChunkColumn;
use super::joint_trajectory::Trajectory;
use super::path_time::{PathTime, PlanInstant};
use super::spline::{KinematicState, Segment};
use super::stop::Stop;
use crate::units::{Nanoseconds, SECOND_NS, seconds};

/// Entry of the plan queue of a joint.
#[derive(Debug, Clone)]
pub(super) struct JointPlan {
    /// Slot of its motion in the motion table; `None` after the end of the motion.
    pub slot: Option<usize>,
    /// First commanded instant, of the path time.
    pub join_k: i64,
    /// Instant of the last setpoint: of the path time for a trajectory, a position cycle for a stop.
    pub end_k: i64,
    /// Requested start as a path time, ns, not rounded to an instant.
    pub nominal_start: i128,
    /// Requested end as a path time, ns, not rounded to an instant.
    pub nominal_end: i128,
    pub kind: PlanKind,
}

#[derive(Debug, Clone)]
pub(super) enum PlanKind {
    /// Hold at, or approach to, the newest setpoint, m or rad.
    Hold(f64),
    /// Controlled stop; `from_k` is the position cycle of its initial state.
    Stop { from_k: i64, stop: Stop },
    /// Column of a trajectory.
    Trajectory(TrajectoryColumn),
    /// Column of a chunk of a motion that is planned while it runs.
    Chunk(ChunkColumn),
}

/// Column of a trajectory, executed by one joint.
#[derive(Debug, Clone)]
pub(super) struct TrajectoryColumn {
    pub trajectory: Arc<Trajectory>,
    pub column: usize,
    /// Instant of the path time at local time 0.
    pub start_k: i64,
    /// Index of the last evaluated segment.
    pub cursor: usize,
    /// Approach from the commanded state to a later first point, and its local start time, ns.
    pub approach: Option<(Nanoseconds, Segment)>,
    /// Angle of whole turns that is added to the positions of a continuous joint, rad.
    pub turns: f64,
}

impl TrajectoryColumn {
    /// Returns the local time at `path`.
    pub fn local_time(&self, path: PathTime, period: Nanoseconds) -> PathTime {
        path.relative_to(self.start_k.saturating_mul(period))
    }

    /// Returns the state at local `time`.
    pub fn state(&self, time: PathTime) -> KinematicState {
        let state = self.state_of_points(time);
        KinematicState { position: state.position + self.turns, ..state }
    }

    /// Returns the state at local `time` without the whole turns.
    fn state_of_points(&self, time: PathTime) -> KinematicState {
        if let Some((begin, segment)) = &self.approach
            && time.ns < self.trajectory.first_time()
        {
            return segment.state_at(time.since(*begin));
        }
        match self.trajectory.final_stop(self.column) {
            Some(stop) if time.ns >= self.trajectory.duration() => {
                stop.state(time.since(self.trajectory.duration()) / SECOND_NS as f64)
            }
            _ => self.trajectory.state_near(self.column, time, self.cursor),
        }
    }

    /// Returns the position at local `time`, m or rad. `near` is the last index found at this time for another joint, or
    /// `None`, and is replaced.
    #[inline]
    pub fn position(&self, time: PathTime, near: &mut Option<usize>) -> f64 {
        let trajectory = &self.trajectory;
        let is_on_points = self.approach.is_none() || time.ns >= trajectory.first_time();
        if is_on_points && (time.ns < trajectory.duration() || trajectory.final_stop(self.column).is_none()) {
            let index = trajectory.locate(time.ns, near.unwrap_or(self.cursor));
            *near = Some(index);
            return trajectory.position_after(self.column, time, index) + self.turns;
        }
        self.state(time).position
    }
}

impl JointPlan {
    /// Creates a plan at rest at `position` without a start.
    pub fn hold(position: f64) -> Self {
        Self {
            slot: None,
            join_k: i64::MIN,
            end_k: i64::MIN,
            nominal_start: i128::MIN,
            nominal_end: i128::MIN,
            kind: PlanKind::Hold(position),
        }
    }

    /// Returns the state at `instant`, at the earliest `join_k`. The derivatives of a trajectory are those with respect
    /// to the path time.
    pub fn state(&self, instant: PlanInstant, period: Nanoseconds) -> KinematicState {
        match &self.kind {
            PlanKind::Hold(position) => KinematicState::at_rest(*position),
            PlanKind::Stop { from_k, stop } => stop.state(seconds(elapsed(*from_k, instant.k, period))),
            PlanKind::Trajectory(path) => path.state(path.local_time(instant.path, period)),
            PlanKind::Chunk(column) => column.state(instant.path, period),
        }
    }

    /// Returns the position at `instant`, at the earliest `join_k`, m or rad. `near` is that of
    /// [`TrajectoryColumn::position`]: the joints of a trajectory have the same points.
    #[inline]
    pub fn position(&self, instant: PlanInstant, period: Nanoseconds, near: &mut Option<usize>) -> f64 {
        match &self.kind {
            PlanKind::Trajectory(path) => path.position(path.local_time(instant.path, period), near),
            _ => self.state(instant, period).position,
        }
    }

    /// Moves the cursor to `instant`, for the next evaluations.
    pub fn advance(&mut self, instant: PlanInstant, period: Nanoseconds) {
        if let PlanKind::Trajectory(path) = &mut self.kind {
            let time = path.local_time(instant.path, period);
            path.cursor = path.trajectory.locate(time.ns, path.cursor);
        }
    }

    /// Returns true if the plan commands the joint from an instant of the path time at or before `path_k`. A stop
    /// commands it from the next position cycle on.
    pub fn has_joined(&self, path_k: i64) -> bool {
        self.join_k <= path_k || matches!(self.kind, PlanKind::Stop { .. })
    }

    /// Returns true if the last setpoint is commanded at or before `instant`.
    pub fn has_ended(&self, instant: PlanInstant, period: Nanoseconds) -> bool {
        match &self.kind {
            PlanKind::Trajectory(_) | PlanKind::Chunk(_) => {
                instant.path.ns >= self.end_k.saturating_mul(period)
            }
            _ => instant.k >= self.end_k,
        }
    }

    /// Returns true if the plan follows the path time.
    pub fn is_trajectory(&self) -> bool {
        matches!(self.kind, PlanKind::Trajectory(_) | PlanKind::Chunk(_))
    }

    /// Returns true for the last chunk so far of a motion that is planned while it runs.
    pub fn is_open(&self) -> bool {
        matches!(self.kind, PlanKind::Chunk(_)) && self.end_k == i64::MAX
    }

    /// Returns true if the joint moves at or after `instant`.
    pub fn is_moving(&self, instant: PlanInstant, period: Nanoseconds) -> bool {
        match &self.kind {
            PlanKind::Hold(_) => false,
            PlanKind::Stop { .. } | PlanKind::Chunk(_) => !self.has_ended(instant, period),
            PlanKind::Trajectory(path) => {
                !self.has_ended(instant, period)
                    || path.trajectory.final_stop(path.column).is_some_and(|stop| {
                        let time = path.local_time(instant.path, period);
                        time.since(path.trajectory.duration()) / (SECOND_NS as f64) < stop.duration()
                    })
            }
        }
    }
}

/// Returns the time between two instants, ns, saturating.
pub(super) fn elapsed(from_k: i64, to_k: i64, period: Nanoseconds) -> Nanoseconds {
    to_k.saturating_sub(from_k).saturating_mul(period)
}

/// Plan queue and last commanded state of one joint.
#[derive(Debug, Clone)]
pub(super) struct JointQueue {
    /// Plans of the joint; the first one commands it.
    pub plans: VecDeque<JointPlan>,
    /// State commanded at the last instant.
    pub state: KinematicState,
}

impl JointQueue {
    /// Returns the position at the end of a controlled stop, otherwise that of the last instant, m or rad.
    pub fn end_position(&self) -> f64 {
        match self.plans.back() {
            Some(JointPlan { kind: PlanKind::Stop { stop, .. }, .. }) => stop.state(f64::INFINITY).position,
            _ => self.state.position,
        }
    }

    /// Returns the plan that commands the joint at instant `path_k` of the path time.
    #[inline]
    pub fn plan_at(&self, path_k: i64) -> Option<&JointPlan> {
        if self.plans.len() == 1 {
            return self.plans.front();
        }
        let after = self.plans.partition_point(|plan| plan.has_joined(path_k));
        self.plans.get(after.saturating_sub(1))
    }
}
