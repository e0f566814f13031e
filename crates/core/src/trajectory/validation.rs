//! Validation of trajectory requests: joints, times, travel limits, speed, velocity at the end. NaN and infinity are
//! rejected when points are added to a request ([`TrajectoryRequest::push`]).

use super::joint_trajectory::Trajectory;
use super::limits::JointLimits;
use super::rejection::{Rejection, RejectionCode};
use super::request::TrajectoryRequest;
use super::spline::{Segment, SplineDegree};
use crate::units::{Nanoseconds, Rounded, seconds};

/// Number of instants checked per joint and trajectory, shared by its segments; each segment gets at least
/// [`MIN_SHARE`].
const BUDGET: usize = 1 << 22;
/// Smallest number of instants checked of a longer segment; see [`Trajectory::new`] for the error.
const MIN_SHARE: usize = 64;
/// Largest velocity at the end of a trajectory that counts as zero, m/s or rad/s: what planners leave by rounding.
const MAX_RESIDUAL_VELOCITY: f64 = 1e-6;

/// Machine and options for the validation of a trajectory.
#[derive(Debug, Clone, Copy)]
pub struct ValidationContext<'a> {
    /// Limits of the joints, in the order of the machine.
    pub joints: &'a [JointLimits],
    /// Position cycle Tsp, ns; greater than 0.
    pub period: Nanoseconds,
    /// Largest number of points of one trajectory.
    pub max_points: usize,
    /// Allows a velocity at the last point (for chunks of a longer path).
    pub allow_nonzero_end_velocity: bool,
}

impl Trajectory {
    /// Validates `request` against the machine.
    ///
    /// A trajectory has known joints, finite values (no NaN), increasing times, positions within the
    /// travel limits and speeds within Vmax on the position grid. The junction with the commanded
    /// setpoints is checked by [`Timeline::submit`](super::Timeline::submit).
    ///
    /// The grid is local: setpoints are evaluated at multiples of Tsp from the start, because a start
    /// between two position cycles is moved to the later one. Every instant is checked,
    /// `|PSEC_k − PSEC_{k−1}| / Tsp ≤ Vmax`, unless a segment has more instants than its share of a fixed
    /// budget (4 million instants per joint and trajectory, i.e. hours of motion). A longer segment is
    /// checked at as many equidistant instants as its share, at least 64, by velocity and position of its
    /// polynomial. By Markov's inequality a polynomial of degree n exceeds the largest of N equidistant
    /// samples by at most n²(n²−1)/(6N²) of it: in the worst case 1 % in speed and 3 % of the span in
    /// position, less than 10⁻⁸ with the whole budget. The cost is therefore bounded by the number of
    /// points, independent of their times.
    ///
    /// # Errors
    /// The first violation found, with code, joint, point, value and limit.
    pub fn new(mut request: TrajectoryRequest, context: &ValidationContext<'_>) -> Result<Self, Rejection> {
        if request.points() > context.max_points {
            let (found, limit) = (request.points(), context.max_points);
            return Err(Rejection::new(
                RejectionCode::TooManyPoints,
                format!("{found} points; max_points allows {limit}"),
            )
            .numbers(found as f64, limit as f64));
        }
        let joints = find_joints(&request.joints, context.joints)?;
        request.check_times()?;
        if !context.allow_nonzero_end_velocity {
            let last = request.velocities.iter_mut().rev().take(joints.len());
            last.filter(|velocity| velocity.abs() <= MAX_RESIDUAL_VELOCITY)
                .for_each(|velocity| *velocity = 0.0);
        }
        let trajectory = Self::new_unchecked(request, joints, context.joints);
        check_limits(&trajectory, context)?;
        Ok(trajectory)
    }
}

fn check_limits(trajectory: &Trajectory, context: &ValidationContext<'_>) -> Result<(), Rejection> {
    if trajectory.is_stop() {
        return Ok(());
    }
    let share = (BUDGET / trajectory.segments().max(1)).max(MIN_SHARE) as i64;
    for (column, &joint) in trajectory.joints().iter().enumerate() {
        let check = ColumnCheck { trajectory, column, joint: &context.joints[joint], period: context.period };
        check.points()?;
        check.end(context.allow_nonzero_end_velocity)?;
        check.grid(share)?;
    }
    Ok(())
}

/// Returns the machine indices of `names`; all indices if `names` is empty.
fn find_joints(names: &[String], machine: &[JointLimits]) -> Result<Vec<usize>, Rejection> {
    if names.is_empty() {
        return Ok((0..machine.len()).collect());
    }
    let mut found = Vec::with_capacity(machine.len());
    for name in names {
        let Some(index) = machine.iter().position(|joint| joint.name == *name) else {
            let known: Vec<_> = machine.iter().map(|joint| joint.name.as_str()).collect();
            return Err(Rejection::new(
                RejectionCode::UnknownJoint,
                format!("unknown joint {name:?}; the machine has {}", known.join(", ")),
            )
            .joint(name));
        };
        if found.contains(&index) {
            return Err(Rejection::new(
                RejectionCode::DuplicateJoint,
                format!("joint {name} is given twice"),
            )
            .joint(name));
        }
        found.push(index);
    }
    Ok(found)
}

struct ColumnCheck<'a> {
    trajectory: &'a Trajectory,
    column: usize,
    joint: &'a JointLimits,
    period: Nanoseconds,
}

impl ColumnCheck<'_> {
    fn points(&self) -> Result<(), Rejection> {
        for index in 0..self.trajectory.points() {
            let point = self.trajectory.point(self.column, index);
            self.joint.check_travel_limits(Some(index), point.position)?;
            self.joint.check_speed(index, point.velocity, "velocity")?;
        }
        Ok(())
    }

    fn end(&self, allow_nonzero_velocity: bool) -> Result<(), Rejection> {
        let last = self.trajectory.points() - 1;
        let velocity = self.trajectory.point(self.column, last).velocity;
        if velocity == 0.0 || allow_nonzero_velocity {
            return Ok(());
        }
        let (name, unit) = (&self.joint.name, self.joint.unit());
        Err(Rejection::new(
            RejectionCode::VelocityAtEnd,
            format!(
                "{name}, point {last}: the velocity at the end is {} {unit}/s; it must be zero (within \
                 {MAX_RESIDUAL_VELOCITY:e}) unless allow_nonzero_velocity_at_trajectory_end is set",
                Rounded(velocity)
            ),
        )
        .joint(name)
        .index(last)
        .numbers(velocity, 0.0))
    }

    /// Checks the instants of the position grid, at most `share` per segment. The approach to a first
    /// point later than 0 begins at the commanded state and is checked by the timeline.
    fn grid(&self, share: i64) -> Result<(), Rejection> {
        let times = self.trajectory.times();
        let on_grid = times[0] % self.period == 0;
        let mut previous = on_grid.then(|| self.trajectory.point(self.column, 0).position);
        for index in 0..self.trajectory.segments() {
            let (begin, end) = (times[index], times[index + 1]);
            let (first, last) = (begin / self.period + 1, end / self.period);
            if first > last {
                continue;
            }
            if first == last && last * self.period == end {
                self.step(index + 1, &mut previous, self.trajectory.point(self.column, index + 1).position)?;
                continue;
            }
            let segment = self.trajectory.segment(self.column, index);
            let at = |k: i64| segment.position(k * self.period - begin);
            let point = index + 1;
            self.step(point, &mut previous, at(first))?;
            if last - first < share {
                for k in first + 1..=last {
                    self.step(point, &mut previous, at(k))?;
                }
            } else {
                check_samples(self.joint, point, &segment, (0, end - begin), share)?;
                previous = Some(at(last));
            }
        }
        let beyond = self.trajectory.duration() % self.period;
        if beyond != 0 {
            let last = self.trajectory.points() - 1;
            let end = match self.trajectory.final_stop(self.column) {
                Some(stop) => stop.state(seconds(self.period - beyond)).position,
                None => self.trajectory.point(self.column, last).position,
            };
            self.step(last, &mut previous, end)?;
        }
        Ok(())
    }

    fn step(&self, point: usize, previous: &mut Option<f64>, position: f64) -> Result<(), Rejection> {
        self.joint.check_travel_limits(Some(point), position)?;
        if let Some(before) = previous.replace(position) {
            let speed = (position - before) / seconds(self.period);
            self.joint.check_speed(point, speed, "speed")?;
        }
        Ok(())
    }
}

/// Checks position and velocity of `segment` at `samples` + 1 equidistant instants of `interval`, ns from
/// its start. A linear segment and a step are checked at their ends only.
pub(super) fn check_samples(
    joint: &JointLimits,
    point: usize,
    segment: &Segment,
    interval: (Nanoseconds, Nanoseconds),
    samples: i64,
) -> Result<(), Rejection> {
    let samples = if segment.degree() <= SplineDegree::Linear { 1 } else { samples };
    let step = (interval.1 - interval.0) / samples;
    for i in 0..=samples {
        let time = if i == samples { interval.1 } else { interval.0 + i * step };
        let state = segment.state(time);
        joint.check_travel_limits(Some(point), state.position)?;
        joint.check_speed(point, state.velocity, "speed")?;
    }
    Ok(())
}
