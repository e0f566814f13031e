//! Validated trajectory: points, segments between them and the stop after a last point in motion.

use super::limits::JointLimits;
use super::path_time::PathTime;
use super::request::{Start, TrajectoryRequest};
use super::spline::{KinematicState, Segment, SplineDegree};
use super::stop::{Stop, StopPlanner};
use crate::units::Nanoseconds;

/// Validated trajectory, created by [`Trajectory::new`].
///
/// Times are local, in ns from the start. A column contains the values of one joint.
#[derive(Debug, Clone, PartialEq)]
pub struct Trajectory {
    start: Start,
    /// Machine index of the joint of each column.
    joints: Vec<usize>,
    machine_joints: usize,
    times: Vec<Nanoseconds>,
    positions: Vec<f64>,
    velocities: Vec<f64>,
    accelerations: Vec<f64>,
    degrees: Vec<SplineDegree>,
    /// Controlled stop after a last point in motion, per column.
    final_stops: Vec<Option<Stop>>,
}

impl Trajectory {
    /// Creates a trajectory of the joints with the indices `joints` of a machine with the limits
    /// `machine`, without any check.
    pub(super) fn new_unchecked(
        request: TrajectoryRequest,
        joints: Vec<usize>,
        machine: &[JointLimits],
    ) -> Self {
        let mut trajectory = Self {
            start: request.start,
            joints,
            machine_joints: machine.len(),
            times: request.times,
            positions: request.positions,
            velocities: request.velocities,
            accelerations: request.accelerations,
            degrees: request.degrees,
            final_stops: Vec::new(),
        };
        trajectory.plan_final_stops(machine);
        trajectory
    }

    /// Returns the start of the trajectory.
    pub fn start(&self) -> Start {
        self.start
    }

    /// Returns the machine indices of the joints, one per column.
    pub fn joints(&self) -> &[usize] {
        &self.joints
    }

    /// Returns the number of joints of the machine for which the trajectory was validated.
    pub fn machine_joints(&self) -> usize {
        self.machine_joints
    }

    /// Returns the number of points.
    pub fn points(&self) -> usize {
        self.times.len()
    }

    /// Returns true for a trajectory without points, i.e. a request to stop its joints.
    pub fn is_stop(&self) -> bool {
        self.times.is_empty()
    }

    /// Returns the times of the points from the start, ns, strictly increasing.
    pub fn times(&self) -> &[Nanoseconds] {
        &self.times
    }

    /// Returns the time of the last point, ns; 0 for a stop.
    pub fn duration(&self) -> Nanoseconds {
        self.times.last().copied().unwrap_or(0)
    }

    /// Returns the time of the first point, ns; 0 for a stop.
    pub fn first_time(&self) -> Nanoseconds {
        self.times.first().copied().unwrap_or(0)
    }

    /// Returns the state of `column` at point `index`; missing fields are zero.
    pub(super) fn point(&self, column: usize, index: usize) -> KinematicState {
        let at = index * self.joints.len() + column;
        KinematicState {
            position: self.positions[at],
            velocity: self.velocities.get(at).copied().unwrap_or(0.0),
            acceleration: self.accelerations.get(at).copied().unwrap_or(0.0),
        }
    }

    /// Returns the positions of point `index`, m or rad, one per column; `None` beyond the last point.
    pub fn positions(&self, index: usize) -> Option<&[f64]> {
        let columns = self.joints.len();
        self.positions.get(index.checked_mul(columns)?..)?.get(..columns)
    }

    /// Returns the spline degree allowed by the fields of point `index`.
    pub(super) fn degree(&self, index: usize) -> SplineDegree {
        self.degrees[index]
    }

    /// Returns the number of segments.
    pub(super) fn segments(&self) -> usize {
        self.times.len().saturating_sub(1)
    }

    /// Returns segment `index`, from point `index` to the next; its degree is the lower of both points.
    pub(super) fn segment(&self, column: usize, index: usize) -> Segment {
        Segment::new(
            self.point(column, index),
            self.point(column, index + 1),
            self.times[index + 1] - self.times[index],
            self.degrees[index].min(self.degrees[index + 1]),
        )
    }

    /// Returns the index of the last point at or before `time`. `hint` is the last result: it and the
    /// next index are tried first, so that sequential evaluation needs no search.
    #[inline]
    pub(super) fn locate(&self, time: Nanoseconds, hint: usize) -> usize {
        let holds = |i: usize| {
            self.times.get(i).is_some_and(|&t| t <= time) && self.times.get(i + 1).is_none_or(|&t| time < t)
        };
        if holds(hint) {
            return hint;
        }
        if holds(hint + 1) {
            return hint + 1;
        }
        let guess = self.equidistant_index(time, hint).filter(|&index| holds(index));
        guess.unwrap_or_else(|| self.times.partition_point(|&t| t <= time).saturating_sub(1))
    }

    /// Returns the index of the last point at or before `time` if the points after `hint` are equidistant.
    fn equidistant_index(&self, time: Nanoseconds, hint: usize) -> Option<usize> {
        let (from, to) = (*self.times.get(hint)?, *self.times.get(hint + 1)?);
        // A division of floats takes less time than one of integers, and is exact below 104 days.
        let steps = time.checked_sub(from)? as f64 / (to - from) as f64;
        Some(hint.saturating_add(steps as usize))
    }

    /// Returns the state of `column` at local `time`, clamped to the first and last point.
    ///
    /// At the time of a point the position is exactly that of the point, and the derivatives are those
    /// of the following segment. From the last point on the state is at rest.
    pub(super) fn state_near(&self, column: usize, time: PathTime, hint: usize) -> KinematicState {
        let index = self.locate(time.ns, hint);
        if index >= self.segments() {
            return KinematicState::at_rest(self.point(column, index).position);
        }
        self.segment(column, index).state_at(time.since(self.times[index]))
    }

    /// Returns the position of [`state_near`](Self::state_near); `index` is the last point at or before `time`.
    #[inline]
    pub(super) fn position_after(&self, column: usize, time: PathTime, index: usize) -> f64 {
        if index >= self.segments() || time.since(self.times[index]) <= 0.0 {
            return self.positions[index * self.joints.len() + column];
        }
        self.segment(column, index).position_at(time.since(self.times[index]))
    }

    /// Returns the position of `column` at local `time`, ns, clamped to the first and last point; `None`
    /// for a stop or an unknown column.
    pub fn position(&self, column: usize, time: Nanoseconds) -> Option<f64> {
        (!self.is_stop() && column < self.joints.len())
            .then(|| self.position_after(column, time.into(), self.locate(time, 0)))
    }

    fn plan_final_stops(&mut self, machine: &[JointLimits]) {
        let mut planner = StopPlanner::default();
        let final_stop = |column: usize| {
            let end = self.end_in_motion(column)?;
            Some(planner.plan(end, &machine[self.joints[column]].limits))
        };
        self.final_stops = (0..self.joints.len()).map(final_stop).collect();
    }

    /// Returns the controlled stop after the last point of `column`, if that point is in motion.
    pub(super) fn final_stop(&self, column: usize) -> Option<&Stop> {
        self.final_stops.get(column)?.as_ref()
    }

    /// Returns the state at the last point of `column` if its velocity is not zero and it is interpolated.
    fn end_in_motion(&self, column: usize) -> Option<KinematicState> {
        let last = self.points().checked_sub(1)?;
        let mut end = self.point(column, last);
        if end.velocity == 0.0 || self.degrees[last] == SplineDegree::Step {
            return None;
        }
        if self.degrees[last] < SplineDegree::Quintic && last > 0 {
            let segment = self.segment(column, last - 1);
            end.acceleration = segment.state(Nanoseconds::MAX).acceleration;
        }
        Some(end)
    }
}
