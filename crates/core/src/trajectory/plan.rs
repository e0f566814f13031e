//! Plan of one joint from an instant on: a pure function of the position cycle.

use super::joint_trajectory::Trajectory;
use super::spline::{KinematicState, Segment};
use super::stop::Stop;
use crate::units::{Nanoseconds, seconds};
use std::sync::Arc;

/// Entry of the plan queue of a joint.
#[derive(Debug, Clone)]
pub(super) struct JointPlan {
    /// Slot of its motion in the motion table; `None` after the end of the motion.
    pub slot: Option<usize>,
    /// First commanded instant.
    pub join_k: i64,
    /// Instant of the last setpoint.
    pub end_k: i64,
    /// Requested start in ns of the position grid (k·Tsp), not rounded to an instant.
    pub nominal_start: i128,
    /// Requested end in ns of the position grid (k·Tsp), not rounded to an instant.
    pub nominal_end: i128,
    pub kind: PlanKind,
}

#[derive(Debug, Clone)]
pub(super) enum PlanKind {
    /// Hold at, or approach to, the newest setpoint, m or rad.
    Hold(f64),
    /// Controlled stop; `from_k` is the instant of its initial state.
    Stop { from_k: i64, stop: Stop },
    /// Column of a trajectory.
    Trajectory(TrajectoryColumn),
}

/// Column of a trajectory, executed by one joint.
#[derive(Debug, Clone)]
pub(super) struct TrajectoryColumn {
    pub trajectory: Arc<Trajectory>,
    pub column: usize,
    /// Instant of local time 0.
    pub start_k: i64,
    /// Index of the last evaluated segment.
    pub cursor: usize,
    /// Approach from the commanded state to a later first point, and its local start time, ns.
    pub approach: Option<(Nanoseconds, Segment)>,
}

impl TrajectoryColumn {
    /// Returns the state at local `time`, ns.
    pub fn state(&self, time: Nanoseconds) -> KinematicState {
        if let Some((begin, segment)) = &self.approach
            && time < self.trajectory.first_time()
        {
            return segment.state(time - begin);
        }
        match self.trajectory.final_stop(self.column) {
            Some(stop) if time >= self.trajectory.duration() => {
                stop.state(seconds(time - self.trajectory.duration()))
            }
            _ => self.trajectory.state_near(self.column, time, self.cursor),
        }
    }

    /// Returns the position at local `time`, ns, m or rad.
    pub fn position(&self, time: Nanoseconds) -> f64 {
        let trajectory = &self.trajectory;
        let is_on_points = self.approach.is_none() || time >= trajectory.first_time();
        if is_on_points && (time < trajectory.duration() || trajectory.final_stop(self.column).is_none()) {
            return trajectory.position_near(self.column, time, self.cursor);
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

    /// Returns the state at instant `k`, at the earliest `join_k`.
    pub fn state(&self, k: i64, period: Nanoseconds) -> KinematicState {
        match &self.kind {
            PlanKind::Hold(position) => KinematicState::at_rest(*position),
            PlanKind::Stop { from_k, stop } => stop.state(seconds(elapsed(*from_k, k, period))),
            PlanKind::Trajectory(path) => path.state(elapsed(path.start_k, k, period)),
        }
    }

    /// Returns the position at instant `k`, at the earliest `join_k`, m or rad.
    pub fn position(&self, k: i64, period: Nanoseconds) -> f64 {
        match &self.kind {
            PlanKind::Trajectory(path) => path.position(elapsed(path.start_k, k, period)),
            _ => self.state(k, period).position,
        }
    }

    /// Moves the cursor to instant `k`, for the next evaluations.
    pub fn advance(&mut self, k: i64, period: Nanoseconds) {
        if let PlanKind::Trajectory(path) = &mut self.kind {
            let time = elapsed(path.start_k, k, period);
            path.cursor = path.trajectory.locate(time, path.cursor);
        }
    }

    /// Returns true if the joint moves at or after instant `k`.
    pub fn is_moving(&self, k: i64, period: Nanoseconds) -> bool {
        match &self.kind {
            PlanKind::Hold(_) => false,
            PlanKind::Stop { .. } => k < self.end_k,
            PlanKind::Trajectory(path) => {
                k < self.end_k
                    || path.trajectory.final_stop(path.column).is_some_and(|stop| {
                        let time = elapsed(path.start_k, k, period) - path.trajectory.duration();
                        seconds(time) < stop.duration()
                    })
            }
        }
    }
}

/// Returns the time between two instants, ns, saturating.
pub(super) fn elapsed(from_k: i64, to_k: i64, period: Nanoseconds) -> Nanoseconds {
    to_k.saturating_sub(from_k).saturating_mul(period)
}
