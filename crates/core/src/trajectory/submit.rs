//! Acceptance of trajectories: start instant, junction with the commanded setpoints, preemption.

use super::event::MotionId;
use super::joint_trajectory::Trajectory;
use super::motion_table::Release;
use super::plan::{JointPlan, PlanKind, TrajectoryColumn, elapsed};
use super::rejection::{Rejection, RejectionCode};
use super::request::Start;
use super::spline::{KinematicState, Segment, SplineDegree};
use super::stream::StreamEnd;
use super::timeline::{MAX_WAITING, Timeline};
use super::validation::check_samples;
use crate::units::{Nanoseconds, Rounded, SECOND_NS, seconds};
use std::f64::consts::TAU;
use std::sync::Arc;

/// Number of instants checked between the start and a later first point. For a single polynomial this
/// bounds the error to 10⁻³ of its largest speed: see [`Trajectory::new`].
const APPROACH_SAMPLES: i64 = 256;

/// Difference from the present time at which a stamp is of another clock, ns: 100 h, the longest trajectory of a file.
const OTHER_CLOCK: i128 = 360_000 * SECOND_NS as i128;
const OTHER_CLOCK_HINT: &str =
    "; the stamp may be of another clock: set use_sim_time of both nodes, or of neither";
/// Largest number of whole turns between a trajectory and a continuous joint; the angles of more would be inexact.
const MAX_TURNS: f64 = 1e6;

/// Position cycles of an accepted trajectory, with the feed override 1 from its acceptance on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Admission {
    /// Position cycle of the start: the first one at or after its stamp.
    pub start_k: i64,
    /// First commanded instant: `start_k`, or the next instant for a start in the past.
    pub join_k: i64,
    /// Instant of the last setpoint; for a stop, the first instant at rest.
    pub end_k: i64,
    /// The start is in the past, so the first part is not executed.
    pub is_late: bool,
}

/// [`Admission`] with the requested start and end, ns.
struct Schedule {
    admission: Admission,
    nominal_start: i128,
    nominal_end: i128,
}

impl Timeline {
    /// Submits a trajectory. `origin` is the absolute time of instant 0, ns: instant k is at
    /// `origin + k·Tsp`.
    ///
    /// - `Start::Now` starts at the next instant. A start in the future waits, and the active plan
    ///   continues until then. A trajectory with its start in the past and its end in the future is
    ///   joined at its present time.
    /// - For each joint, the trajectory replaces the commanded setpoints from its start on (preemption).
    ///   Waiting plans of the joint that start at or after its start are discarded. Plans that end at or
    ///   before its start are completed. Joints that the trajectory does not name are not affected.
    /// - A first point later than the start is approached from the commanded state by a segment of the
    ///   degree of the point.
    /// - A trajectory that begins at its first point moves by the whole turns that bring this point nearest to the commanded
    ///   position of a continuous joint; a later first point is an absolute angle.
    /// - A last point in motion without a successor is followed by a controlled stop.
    /// - A trajectory without points is a controlled stop of the named joints, or of all joints, from the
    ///   last commanded state, independent of its stamp. It ends all active and waiting motions of the
    ///   joints.
    ///
    /// Only the junction is checked here: a few evaluations per joint, at most 257 on the approach to a
    /// later first point. A rejected trajectory changes nothing.
    ///
    /// # Errors
    /// - [`RejectionCode::EndedInThePast`], [`RejectionCode::QueueFull`], [`RejectionCode::InvalidTime`].
    /// - [`RejectionCode::Jump`] if the first setpoint is not reachable within one position cycle.
    /// - [`RejectionCode::Speed`], [`RejectionCode::OutsideTravelLimits`] on the approach to a later first
    ///   point.
    /// - [`RejectionCode::UnknownJoint`] if the trajectory was validated for another number of joints.
    pub fn submit(
        &mut self,
        id: MotionId,
        trajectory: Arc<Trajectory>,
        origin: Nanoseconds,
    ) -> Result<Admission, Rejection> {
        if trajectory.machine_joints() != self.joints.len() {
            return Err(Rejection::new(
                RejectionCode::UnknownJoint,
                format!(
                    "the trajectory was validated for {} joints, the machine has {}",
                    trajectory.machine_joints(),
                    self.joints.len()
                ),
            ));
        }
        let admission = if trajectory.is_stop() {
            self.submit_stop(id, &trajectory)
        } else {
            self.submit_path(id, &trajectory, origin)?
        };
        let end = if trajectory.is_stop() { StreamEnd::Stopped } else { StreamEnd::Preempted };
        self.end_stream(trajectory.joints().iter().copied(), end(id));
        self.reserve_events();
        // From the path time to position cycles; 0 while the feed override has been 1.
        let shift = self.next_k - self.clock.next_instant(self.period);
        Ok(Admission {
            start_k: admission.start_k.saturating_add(shift),
            join_k: admission.join_k.saturating_add(shift),
            end_k: admission.end_k.saturating_add(shift),
            ..admission
        })
    }

    fn submit_stop(&mut self, id: MotionId, trajectory: &Trajectory) -> Admission {
        let join_k = self.clock.next_instant(self.period);
        let slot = self.motions.open(id, trajectory.joints().len());
        let mut last_k = self.next_k;
        for &joint in trajectory.joints() {
            self.release_all(joint, Release::Stopped(Some(id)));
            last_k = last_k.max(self.brake(joint, Some(slot)));
        }
        self.stop_incomplete_motion();
        self.motions.settle(&mut self.pending);
        let end_k = join_k.saturating_add(last_k - self.next_k);
        Admission { start_k: join_k, join_k, end_k, is_late: false }
    }

    fn submit_path(
        &mut self,
        id: MotionId,
        trajectory: &Arc<Trajectory>,
        origin: Nanoseconds,
    ) -> Result<Admission, Rejection> {
        let schedule = self.schedule(trajectory, origin)?;
        let mut columns = Vec::with_capacity(trajectory.joints().len());
        for column in 0..trajectory.joints().len() {
            columns.push(self.join(trajectory, column, &schedule.admission)?);
        }
        let Admission { join_k, end_k, .. } = schedule.admission;
        let slot = self.motions.open(id, columns.len());
        for (column, &joint) in columns.into_iter().zip(trajectory.joints()) {
            let plans = &mut self.queues[joint].plans;
            let keep = plans.partition_point(|plan| plan.join_k < join_k);
            let kept = keep.checked_sub(1).and_then(|last| plans[last].slot);
            let discarded = plans.drain(keep..).filter_map(|discarded| discarded.slot);
            self.motions.release_each(discarded, kept, joint, Release::Preempted(id));
            plans.push_back(JointPlan {
                slot: Some(slot),
                join_k,
                end_k,
                nominal_start: schedule.nominal_start,
                nominal_end: schedule.nominal_end,
                kind: PlanKind::Trajectory(column),
            });
        }
        self.motions.settle(&mut self.pending);
        Ok(schedule.admission)
    }

    fn schedule(&self, trajectory: &Trajectory, origin: Nanoseconds) -> Result<Schedule, Rejection> {
        let period = i128::from(self.period);
        let next_k = self.clock.next_instant(self.period);
        let nominal_start = match trajectory.start() {
            Start::Now => i128::from(next_k) * period,
            Start::At(stamp) => i128::from(stamp) - i128::from(origin),
        };
        let duration = i128::from(trajectory.duration());
        let nominal_end = nominal_start + duration;
        let start = ceil_div(nominal_start, period);
        let end = start + ceil_div(duration, period);
        let (Ok(start_k), Ok(end_k)) = (i64::try_from(start), i64::try_from(end)) else {
            return Err(Rejection::new(
                RejectionCode::InvalidTime,
                "the start is too far from the present time to be counted in position cycles",
            ));
        };
        let now = i128::from(next_k) * period;
        if end_k < next_k {
            let ago = (now - nominal_end) as f64 / SECOND_NS as f64;
            let hint = if now - nominal_end > OTHER_CLOCK { OTHER_CLOCK_HINT } else { "" };
            return Err(Rejection::new(
                RejectionCode::EndedInThePast,
                format!("its last point is {} s before the next position cycle{hint}", Rounded(ago)),
            )
            .numbers(ago, 0.0));
        }
        if nominal_start - now > OTHER_CLOCK {
            let (ahead, limit) =
                ((nominal_start - now) as f64 / SECOND_NS as f64, OTHER_CLOCK as f64 / SECOND_NS as f64);
            return Err(Rejection::new(
                RejectionCode::InvalidTime,
                format!(
                    "its start is {} s after the next position cycle, at most {limit} s are allowed{OTHER_CLOCK_HINT}",
                    Rounded(ahead)
                ),
            )
            .numbers(ahead, limit));
        }
        let join_k = start_k.max(next_k);
        let is_late = join_k > start_k;
        Ok(Schedule {
            admission: Admission { start_k, join_k, end_k, is_late },
            // A late start does not preempt motions that ended before it.
            nominal_start: if is_late { i128::from(join_k) * period } else { nominal_start },
            nominal_end,
        })
    }

    /// Creates the plan of `column`, checked at its junction with the setpoints commanded before it.
    fn join(
        &self,
        trajectory: &Arc<Trajectory>,
        column: usize,
        admission: &Admission,
    ) -> Result<TrajectoryColumn, Rejection> {
        let joint = trajectory.joints()[column];
        let Admission { start_k, join_k, .. } = *admission;
        self.check_planned_until(joint, join_k)?;
        let limits = &self.joints[joint];
        let plans = &self.queues[joint].plans;
        let before = plans.partition_point(|plan| plan.join_k < join_k);
        if before > MAX_WAITING {
            return Err(Rejection::new(
                RejectionCode::QueueFull,
                format!("{}: queue is full, {MAX_WAITING} trajectories are waiting", limits.name),
            )
            .joint(&limits.name)
            .numbers(before as f64, MAX_WAITING as f64));
        }
        let mut path = TrajectoryColumn {
            trajectory: Arc::clone(trajectory),
            column,
            start_k,
            cursor: 0,
            approach: None,
            turns: 0.0,
        };
        let begin = elapsed(start_k, join_k, self.period);
        if begin < trajectory.first_time() {
            let (from, degree) = (self.predicted(joint, join_k), trajectory.degree(0));
            let to = match degree {
                // The commanded state is held until the first point.
                SplineDegree::Step => KinematicState::at_rest(from.position),
                _ => trajectory.point(column, 0),
            };
            let segment = Segment::new(from, to, trajectory.first_time() - begin, degree);
            path.approach = Some((begin, segment));
            self.check_approach(joint, &path, begin, &segment)?;
        } else {
            let before = self.predicted(joint, join_k - 1).position;
            let mut first = path.state(begin.into()).position;
            let turns = ((before - first) / TAU).round();
            if limits.is_continuous() && turns.abs() <= MAX_TURNS {
                path.turns = turns * TAU;
                first += path.turns;
            }
            let index = trajectory.locate(begin, 0);
            limits.check_jump(index, before, first, seconds(self.period))?;
        }
        Ok(path)
    }

    /// Checks speed and travel limits on the approach to the first point, up to the first instant at or
    /// after it.
    fn check_approach(
        &self,
        joint: usize,
        path: &TrajectoryColumn,
        begin: Nanoseconds,
        segment: &Segment,
    ) -> Result<(), Rejection> {
        let (limits, period) = (&self.joints[joint], self.period);
        let at = |k: i64| path.state(k.saturating_mul(period).into()).position;
        let step = |k: i64| {
            let (before, position) = (at(k - 1), at(k));
            limits.check_travel_limits(Some(0), position)?;
            limits.check_speed(0, (position - before) / seconds(period), "speed on the approach to it")
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

/// Returns ⌈n / d⌉ for d > 0.
fn ceil_div(n: i128, d: i128) -> i128 {
    n.div_euclid(d) + i128::from(n.rem_euclid(d) != 0)
}
