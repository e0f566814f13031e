//! What one joint does from an instant on: a pure function of the position instant.

use super::path::Trajectory;
use super::spline::{Segment, State};
use super::stop::Stop;
use crate::units::{Nanoseconds, seconds};
use std::sync::Arc;

/// One entry of a joint's queue.
#[derive(Debug, Clone)]
pub(super) struct Plan {
    /// The motion that it belongs to, while that is not over.
    pub slot: Option<usize>,
    /// First instant that it commands.
    pub join_k: i64,
    /// Instant of its last setpoint.
    pub end_k: i64,
    /// Start and end as asked for, in ns of the position grid (k·Tsp), not rounded to an instant.
    pub nominal_start: i128,
    /// Likewise.
    pub nominal_end: i128,
    pub kind: Kind,
}

#[derive(Debug, Clone)]
pub(super) enum Kind {
    /// Stands, m or rad.
    Hold(f64),
    /// Comes to rest; `from_k` is the instant of the state that it starts from.
    Stop { from_k: i64, stop: Stop },
    /// Follows a trajectory.
    Path(Path),
}

#[derive(Debug, Clone)]
pub(super) struct Path {
    pub trajectory: Arc<Trajectory>,
    pub column: usize,
    /// Instant of local time 0.
    pub start_k: i64,
    /// Where the trajectory was last evaluated.
    pub cursor: usize,
    /// The way from the commanded state to a first point that is later, and its local begin, ns.
    pub approach: Option<(Nanoseconds, Segment)>,
}

impl Path {
    /// State at local `time`, ns.
    pub fn state(&self, time: Nanoseconds) -> State {
        if let Some((begin, segment)) = &self.approach
            && time < self.trajectory.first_time()
        {
            return segment.state(time - begin);
        }
        match self.trajectory.tail(self.column) {
            Some(stop) if time >= self.trajectory.duration() => {
                stop.state(seconds(time - self.trajectory.duration()))
            }
            _ => self.trajectory.state_near(self.column, time, self.cursor),
        }
    }
}

impl Plan {
    /// At rest at `position` from ever on.
    pub fn hold(position: f64) -> Self {
        Self {
            slot: None,
            join_k: i64::MIN,
            end_k: i64::MIN,
            nominal_start: i128::MIN,
            nominal_end: i128::MIN,
            kind: Kind::Hold(position),
        }
    }

    /// State at instant `k`, not before `join_k`.
    pub fn state(&self, k: i64, period: Nanoseconds) -> State {
        match &self.kind {
            Kind::Hold(position) => State::rest(*position),
            Kind::Stop { from_k, stop } => stop.state(seconds(elapsed(*from_k, k, period))),
            Kind::Path(path) => path.state(elapsed(path.start_k, k, period)),
        }
    }

    /// Remembers where instant `k` is, for the evaluations that follow.
    pub fn advance(&mut self, k: i64, period: Nanoseconds) {
        if let Kind::Path(path) = &mut self.kind {
            let time = elapsed(path.start_k, k, period);
            path.cursor = path.trajectory.locate(time, path.cursor);
        }
    }

    /// Whether the joint moves at instant `k` or after it.
    pub fn is_moving(&self, k: i64, period: Nanoseconds) -> bool {
        match &self.kind {
            Kind::Hold(_) => false,
            Kind::Stop { .. } => k < self.end_k,
            Kind::Path(path) => {
                k < self.end_k
                    || path.trajectory.tail(path.column).is_some_and(|stop| {
                        let time = elapsed(path.start_k, k, period) - path.trajectory.duration();
                        seconds(time) < stop.duration()
                    })
            }
        }
    }
}

/// Time between two instants, ns; saturates, in centuries.
pub(super) fn elapsed(from_k: i64, to_k: i64, period: Nanoseconds) -> Nanoseconds {
    to_k.saturating_sub(from_k).saturating_mul(period)
}
