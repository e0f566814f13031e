//! The checks of a trajectory on its own: stroke, speed, velocity at the end.

use super::limits::JointLimits;
use super::path::{Context, Trajectory};
use super::rejection::{Code, Rejection};
use super::spline::{Order, Segment};
use crate::units::{Nanoseconds, Told, seconds};

/// Instants checked per joint and trajectory, as long as each segment gets [`MIN_SHARE`].
const BUDGET: usize = 1 << 22;
/// Fewest instants checked of a segment that has more: see [`Trajectory::new`] for the error.
const MIN_SHARE: usize = 64;

/// Refuses what the machine cannot do.
pub(super) fn check(trajectory: &Trajectory, context: &Context<'_>) -> Result<(), Rejection> {
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
            self.joint.check_stroke(index, point.position)?;
            self.joint.check_speed(index, point.velocity, "velocity")?;
        }
        Ok(())
    }

    fn end(&self, may_move: bool) -> Result<(), Rejection> {
        let last = self.trajectory.points() - 1;
        let velocity = self.trajectory.point(self.column, last).velocity;
        if velocity == 0.0 || may_move {
            return Ok(());
        }
        let (name, unit) = (&self.joint.name, self.joint.unit());
        Err(Rejection::new(
            Code::VelocityAtEnd,
            format!(
                "{name}, point {last}: the last velocity is {} {unit}/s, not zero; see \
                 allow_nonzero_velocity_at_trajectory_end",
                Told(velocity)
            ),
        )
        .joint(name)
        .index(last)
        .numbers(velocity, 0.0))
    }

    /// Walks along the grid, `share` instants per segment at most. The way to a first point that is
    /// later than 0 begins at the commanded state and is checked where that is known.
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
            let end = match self.trajectory.tail(self.column) {
                Some(stop) => stop.state(seconds(self.period - beyond)).position,
                None => self.trajectory.point(self.column, last).position,
            };
            self.step(last, &mut previous, end)?;
        }
        Ok(())
    }

    fn step(&self, point: usize, previous: &mut Option<f64>, position: f64) -> Result<(), Rejection> {
        self.joint.check_stroke(point, position)?;
        if let Some(before) = previous.replace(position) {
            let speed = (position - before) / seconds(self.period);
            self.joint.check_speed(point, speed, "speed")?;
        }
        Ok(())
    }
}

/// Checks position and velocity of `segment` at `samples` + 1 equidistant instants of `interval`,
/// ns from its start and not before it. A line needs one.
pub(super) fn check_samples(
    joint: &JointLimits,
    point: usize,
    segment: &Segment,
    interval: (Nanoseconds, Nanoseconds),
    samples: i64,
) -> Result<(), Rejection> {
    let samples = if segment.order() == Order::Linear { 1 } else { samples };
    let step = (interval.1 - interval.0) / samples;
    for i in 0..=samples {
        let time = if i == samples { interval.1 } else { interval.0 + i * step };
        let state = segment.state(time);
        joint.check_stroke(point, state.position)?;
        joint.check_speed(point, state.velocity, "speed")?;
    }
    Ok(())
}
