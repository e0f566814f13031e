//! A trajectory meets what is being commanded.

use super::check::check_samples;
use super::event::MotionId;
use super::motions::Release;
use super::path::Trajectory;
use super::plan::{Kind, Path, Plan, elapsed};
use super::rejection::{Code, Rejection};
use super::request::Start;
use super::spline::Segment;
use super::stream::StreamEnd;
use super::timeline::{MAX_WAITING, Timeline};
use crate::units::{Nanoseconds, SECOND_NS, seconds};
use std::sync::Arc;

/// Instants checked on the way to a first point that is later than the start. Of a single
/// polynomial that is enough for 10⁻³ of its largest speed: see [`Trajectory::new`].
const APPROACH_SAMPLES: i64 = 256;

/// An accepted trajectory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Admission {
    /// Position instant of its start: the first one that is not before its stamp.
    pub start_k: i64,
    /// First instant that it commands: `start_k`, or the next one if that is over.
    pub join_k: i64,
    /// Instant of its last setpoint; of a stop, the first one at rest.
    pub end_k: i64,
    /// It started in the past and is joined on the way: worth a warning.
    pub joined_late: bool,
}

/// An [`Admission`] with the times that were asked for.
struct Schedule {
    admission: Admission,
    nominal_start: i128,
    nominal_end: i128,
}

impl Timeline {
    /// Takes a trajectory, from its start on. `origin` is the absolute time of instant 0, ns, so
    /// that instant k is at `origin + k·Tsp`.
    ///
    /// - `Start::Now` starts at the next instant; a start in the future waits, and what moves now
    ///   goes on until then; a start in the past with the end ahead joins in.
    /// - Joint by joint, it replaces what is commanded from its start on. What waited for that
    ///   joint and would have started at or after it is discarded; what ends before it, or at it,
    ///   is complete. Joints that it does not name go on with what they were doing.
    /// - A first point later than the start is reached from the commanded state by the fields that
    ///   the point has.
    /// - An end in motion that nothing follows becomes a controlled stop from that state.
    /// - No points: a controlled stop from the state commanded last, whatever the stamp says, for
    ///   the named joints or all; what moves them or waits for them is over.
    ///
    /// Only the junction is looked at here: a few evaluations per joint, at most 257 on the way to
    /// a later first point. A refused trajectory changes nothing.
    ///
    /// # Errors
    /// [`Code::EndedInThePast`], [`Code::Jump`], [`Code::QueueFull`], [`Code::InvalidTime`];
    /// [`Code::Speed`] and [`Code::OutsideStroke`] on the way to a later first point;
    /// [`Code::UnknownJoint`] if it was checked against another machine.
    pub fn offer(
        &mut self,
        id: MotionId,
        trajectory: Arc<Trajectory>,
        origin: Nanoseconds,
    ) -> Result<Admission, Rejection> {
        if trajectory.machine_joints() != self.joints.len() {
            return Err(Rejection::new(
                Code::UnknownJoint,
                format!(
                    "the trajectory was checked against {} joints, this machine has {}",
                    trajectory.machine_joints(),
                    self.joints.len()
                ),
            ));
        }
        let admission = if trajectory.is_stop() {
            self.stop(id, &trajectory)
        } else {
            self.follow(id, &trajectory, origin)?
        };
        let end = if trajectory.is_stop() { StreamEnd::Stopped } else { StreamEnd::Displaced };
        self.end_stream(trajectory.joints().iter().copied(), end(id));
        self.reserve_events();
        Ok(admission)
    }

    fn stop(&mut self, id: MotionId, trajectory: &Trajectory) -> Admission {
        let join_k = self.next_k;
        let slot = self.motions.open(id, trajectory.joints().len());
        let mut last_k = join_k;
        for &joint in trajectory.joints() {
            self.stop_all(joint, Some(id));
            last_k = last_k.max(self.brake(joint, Some(slot)));
        }
        self.motions.settle(&mut self.pending);
        Admission { start_k: join_k, join_k, end_k: last_k, joined_late: false }
    }

    fn follow(
        &mut self,
        id: MotionId,
        trajectory: &Arc<Trajectory>,
        origin: Nanoseconds,
    ) -> Result<Admission, Rejection> {
        let schedule = self.schedule(trajectory, origin)?;
        let mut paths = Vec::with_capacity(trajectory.joints().len());
        for column in 0..trajectory.joints().len() {
            paths.push(self.path(trajectory, column, &schedule.admission)?);
        }
        let Admission { join_k, end_k, .. } = schedule.admission;
        let slot = self.motions.open(id, paths.len());
        for (path, &joint) in paths.into_iter().zip(trajectory.joints()) {
            let queue = &mut self.tracks[joint].queue;
            let keep = queue.partition_point(|plan| plan.join_k < join_k);
            for discarded in queue.drain(keep..) {
                if let Some(slot) = discarded.slot {
                    self.motions.release(slot, joint, Release::Displaced(id));
                }
            }
            queue.push_back(Plan {
                slot: Some(slot),
                join_k,
                end_k,
                nominal_start: schedule.nominal_start,
                nominal_end: schedule.nominal_end,
                kind: Kind::Path(path),
            });
        }
        self.motions.settle(&mut self.pending);
        Ok(schedule.admission)
    }

    fn schedule(&self, trajectory: &Trajectory, origin: Nanoseconds) -> Result<Schedule, Rejection> {
        let period = i128::from(self.period);
        let nominal_start = match trajectory.start() {
            Start::Now => i128::from(self.next_k) * period,
            Start::At(stamp) => i128::from(stamp) - i128::from(origin),
        };
        let duration = i128::from(trajectory.duration());
        let nominal_end = nominal_start + duration;
        let start = ceil_div(nominal_start, period);
        let end = start + ceil_div(duration, period);
        let (Ok(start_k), Ok(end_k)) = (i64::try_from(start), i64::try_from(end)) else {
            return Err(Rejection::new(
                Code::InvalidTime,
                "the start is too far from the present to count position periods to it",
            ));
        };
        if end_k < self.next_k {
            let ago = i128::from(self.next_k) * period - nominal_end;
            let ago = ago as f64 / SECOND_NS as f64;
            return Err(Rejection::new(
                Code::EndedInThePast,
                format!("its last point is {ago} s before the next position period"),
            )
            .numbers(ago, 0.0));
        }
        let join_k = start_k.max(self.next_k);
        let joined_late = join_k > start_k;
        Ok(Schedule {
            admission: Admission { start_k, join_k, end_k, joined_late },
            // Whoever joins in late takes nothing from those that ended before.
            nominal_start: if joined_late { i128::from(join_k) * period } else { nominal_start },
            nominal_end,
        })
    }

    /// What `column` does, checked where it meets what is commanded before it.
    fn path(
        &self,
        trajectory: &Arc<Trajectory>,
        column: usize,
        admission: &Admission,
    ) -> Result<Path, Rejection> {
        let joint = trajectory.joints()[column];
        let Admission { start_k, join_k, .. } = *admission;
        let limits = &self.joints[joint];
        let queue = &self.tracks[joint].queue;
        let before = queue.partition_point(|plan| plan.join_k < join_k);
        if before > MAX_WAITING {
            return Err(Rejection::new(
                Code::QueueFull,
                format!("{}: {MAX_WAITING} trajectories wait for it already", limits.name),
            )
            .joint(&limits.name)
            .numbers(before as f64, MAX_WAITING as f64));
        }
        let mut path =
            Path { trajectory: Arc::clone(trajectory), column, start_k, cursor: 0, approach: None };
        let begin = elapsed(start_k, join_k, self.period);
        if begin < trajectory.first_time() {
            let segment = Segment::new(
                self.predicted(joint, join_k),
                trajectory.point(column, 0),
                trajectory.first_time() - begin,
                trajectory.order(0),
            );
            path.approach = Some((begin, segment));
            self.check_approach(joint, &path, begin, &segment)?;
        } else {
            let before = self.predicted(joint, join_k - 1).position;
            let first = path.state(begin).position;
            let index = trajectory.locate(begin, 0);
            limits.check_jump(index, before, first, seconds(self.period))?;
        }
        Ok(path)
    }

    /// Speed and stroke on the way to the first point, up to the first instant that is not before
    /// it.
    fn check_approach(
        &self,
        joint: usize,
        path: &Path,
        begin: Nanoseconds,
        segment: &Segment,
    ) -> Result<(), Rejection> {
        let (limits, period) = (&self.joints[joint], self.period);
        let at = |k: i64| path.state(k.saturating_mul(period)).position;
        let step = |k: i64| {
            let (before, position) = (at(k - 1), at(k));
            limits.check_stroke(0, position)?;
            limits.check_speed(0, (position - before) / seconds(period), "speed on the way to it")
        };
        let join = begin / period;
        let first_time = path.trajectory.first_time();
        let last = ceil_div(first_time.into(), period.into()) as i64;
        if last - join <= APPROACH_SAMPLES {
            return (join + 1..=last).try_for_each(step);
        }
        check_samples(limits, 0, segment, (0, first_time - begin), APPROACH_SAMPLES)?;
        step(last)
    }
}

/// ⌈n / d⌉ for d > 0.
fn ceil_div(n: i128, d: i128) -> i128 {
    n.div_euclid(d) + i128::from(n.rem_euclid(d) != 0)
}
