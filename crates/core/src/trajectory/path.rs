//! A checked trajectory.

use super::check;
use super::limits::JointLimits;
use super::rejection::{Code, Rejection};
use super::request::{Request, Start};
use super::spline::{Order, Segment, State};
use super::stop::{Stop, StopPlanner};
use crate::units::Nanoseconds;

/// What a trajectory is checked against.
#[derive(Debug, Clone, Copy)]
pub struct Context<'a> {
    /// The machine's joints, in its order.
    pub joints: &'a [JointLimits],
    /// Tsp, ns; more than zero.
    pub period: Nanoseconds,
    /// Most points of one trajectory.
    pub max_points: usize,
    /// Whether the last point may ask for a velocity (chunks of a longer path).
    pub allow_nonzero_end_velocity: bool,
}

/// A trajectory that the machine can execute, if it is where the trajectory starts.
///
/// Times are local, in ns from its start; a column is one of its joints.
#[derive(Debug, Clone, PartialEq)]
pub struct Trajectory {
    start: Start,
    /// Index in the machine of each column.
    joints: Vec<usize>,
    machine_joints: usize,
    times: Vec<Nanoseconds>,
    positions: Vec<f64>,
    velocities: Vec<f64>,
    accelerations: Vec<f64>,
    orders: Vec<Order>,
    /// What follows an end in motion, per column; empty while that is not planned.
    tails: Vec<Option<Stop>>,
}

impl Trajectory {
    /// Checks `request` against the machine. All the work on points is done here: a trajectory
    /// that exists is known, finite, ordered, inside the stroke and within Vmax on the position
    /// grid. Whether the axes are where it starts is seen by
    /// [`Timeline::offer`](super::Timeline::offer).
    ///
    /// The grid is local: a start between two position periods is the later one, so setpoints are
    /// evaluated at multiples of Tsp from the start. Every grid instant is checked,
    /// `|PSEC_k − PSEC_{k−1}| / Tsp ≤ Vmax`, as long as a segment has no more of them than its
    /// share of a fixed budget (4 million instants per joint and trajectory, hours of motion). A
    /// longer segment is checked at as many equidistant instants, at least 64, through the
    /// velocity and position of its polynomial. By Markov's inequality a polynomial of degree n
    /// exceeds the largest of N equidistant samples by no more than n²(n²−1)/(6N²) of it: at worst
    /// 1 % in speed and 3 % of the span in position, and less than 10⁻⁸ with the whole budget. So
    /// the cost is bounded by the number of points, whatever their times say.
    ///
    /// # Errors
    /// The first fault found, with its code, joint, point, value and limit.
    pub fn new(request: Request, context: &Context<'_>) -> Result<Self, Rejection> {
        if request.points() > context.max_points {
            let (found, limit) = (request.points(), context.max_points);
            return Err(Rejection::new(
                Code::TooManyPoints,
                format!("{found} points; max_points allows {limit}"),
            )
            .numbers(found as f64, limit as f64));
        }
        let joints = find_joints(&request.joints, context.joints)?;
        request.check_times()?;
        let mut trajectory = Self {
            start: request.start,
            joints,
            machine_joints: context.joints.len(),
            times: request.times,
            positions: request.positions,
            velocities: request.velocities,
            accelerations: request.accelerations,
            orders: request.orders,
            tails: Vec::new(),
        };
        trajectory.plan_tails(context.joints);
        check::check(&trajectory, context)?;
        Ok(trajectory)
    }

    /// When it starts.
    pub fn start(&self) -> Start {
        self.start
    }

    /// Its joints, as indices into the machine's, one per column.
    pub fn joints(&self) -> &[usize] {
        &self.joints
    }

    /// Number of joints of the machine that it was checked against.
    pub fn machine_joints(&self) -> usize {
        self.machine_joints
    }

    /// Number of points.
    pub fn points(&self) -> usize {
        self.times.len()
    }

    /// Whether it has no points: a request to stop its joints.
    pub fn is_stop(&self) -> bool {
        self.times.is_empty()
    }

    /// Times of the points from the start, ns, strictly increasing.
    pub fn times(&self) -> &[Nanoseconds] {
        &self.times
    }

    /// Time of the last point, ns; 0 for a stop.
    pub fn duration(&self) -> Nanoseconds {
        self.times.last().copied().unwrap_or(0)
    }

    /// Time of the first point, ns; 0 for a stop.
    pub fn first_time(&self) -> Nanoseconds {
        self.times.first().copied().unwrap_or(0)
    }

    /// What point `index` says about `column`; fields that it lacks are zero.
    pub(super) fn point(&self, column: usize, index: usize) -> State {
        let at = index * self.joints.len() + column;
        State {
            position: self.positions[at],
            velocity: self.velocities.get(at).copied().unwrap_or(0.0),
            acceleration: self.accelerations.get(at).copied().unwrap_or(0.0),
        }
    }

    /// Positions of point `index`, m or rad, one per column; nothing beyond the last point.
    pub fn positions(&self, index: usize) -> Option<&[f64]> {
        let columns = self.joints.len();
        self.positions.get(index.checked_mul(columns)?..)?.get(..columns)
    }

    /// Highest derivative that point `index` has.
    pub(super) fn order(&self, index: usize) -> Order {
        self.orders[index]
    }

    /// Number of segments.
    pub(super) fn segments(&self) -> usize {
        self.times.len().saturating_sub(1)
    }

    /// Segment `index`, between that point and the next, by the fields that both have.
    pub(super) fn segment(&self, column: usize, index: usize) -> Segment {
        Segment::new(
            self.point(column, index),
            self.point(column, index + 1),
            self.times[index + 1] - self.times[index],
            self.orders[index].min(self.orders[index + 1]),
        )
    }

    /// Index of the last point that is not later than `time`. `hint` is where it was last found:
    /// there and one further are tried first, so that walking along costs no search.
    pub(super) fn locate(&self, time: Nanoseconds, hint: usize) -> usize {
        let holds = |i: usize| {
            self.times.get(i).is_some_and(|&t| t <= time) && self.times.get(i + 1).is_none_or(|&t| time < t)
        };
        if holds(hint) {
            hint
        } else if holds(hint + 1) {
            hint + 1
        } else {
            self.times.partition_point(|&t| t <= time).saturating_sub(1)
        }
    }

    /// State of `column` at local `time`, ns, clamped to the first and last point; exactly the
    /// point's position at the time of a point, and from there on the following segment's
    /// derivatives. At rest from the last point on.
    pub(super) fn state_near(&self, column: usize, time: Nanoseconds, hint: usize) -> State {
        let index = self.locate(time, hint);
        if index >= self.segments() {
            return State::rest(self.point(column, index).position);
        }
        self.segment(column, index).state(time - self.times[index])
    }

    /// Position of `column` at local `time`, ns, likewise; `None` for a stop or an unknown column.
    pub fn position(&self, column: usize, time: Nanoseconds) -> Option<f64> {
        (!self.is_stop() && column < self.joints.len()).then(|| self.state_near(column, time, 0).position)
    }

    fn plan_tails(&mut self, machine: &[JointLimits]) {
        let mut planner = StopPlanner::default();
        let tail = |column: usize| {
            let end = self.moving_end(column)?;
            Some(planner.plan(end, &machine[self.joints[column]].limits))
        };
        self.tails = (0..self.joints.len()).map(tail).collect();
    }

    /// The controlled stop from the end of `column`, if that is in motion.
    pub(super) fn tail(&self, column: usize) -> Option<&Stop> {
        self.tails.get(column)?.as_ref()
    }

    /// State at the end, if the last point asks for a velocity there.
    fn moving_end(&self, column: usize) -> Option<State> {
        let last = self.points().checked_sub(1)?;
        let mut end = self.point(column, last);
        if end.velocity == 0.0 {
            return None;
        }
        if self.orders[last] < Order::Quintic && last > 0 {
            let segment = self.segment(column, last - 1);
            end.acceleration = segment.state(Nanoseconds::MAX).acceleration;
        }
        Some(end)
    }
}

/// Indices of `names` in the machine; all of them if there is no name.
fn find_joints(names: &[String], machine: &[JointLimits]) -> Result<Vec<usize>, Rejection> {
    if names.is_empty() {
        return Ok((0..machine.len()).collect());
    }
    let mut found = Vec::with_capacity(machine.len());
    for name in names {
        let Some(index) = machine.iter().position(|joint| joint.name == *name) else {
            let known: Vec<_> = machine.iter().map(|joint| joint.name.as_str()).collect();
            return Err(Rejection::new(
                Code::UnknownJoint,
                format!("{name:?} is not a joint of this machine; it has {}", known.join(", ")),
            )
            .joint(name));
        };
        if found.contains(&index) {
            return Err(Rejection::new(Code::DuplicateJoint, format!("{name} is named twice")).joint(name));
        }
        found.push(index);
    }
    Ok(found)
}
