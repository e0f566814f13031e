//! Accepted motions: start, completion, preemption, cancellation, tolerances and figures.

use crate::assess::{MotionAssessor, MotionReport};
use crate::config::{AxisKind, Periods};
use crate::machine::Machine;
use crate::trajectory::{MotionId, Timeline};
use crate::units::Nanoseconds;

use super::tolerance::{ErrorHistory, ToleranceViolation, Tolerances, first_violation};

/// Outcome of a finished motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum MotionOutcome {
    /// The last setpoint has passed the pure delay, and the axes are within their goal tolerances.
    Completed,
    /// Preempted: another motion took over at least one of the axes.
    Preempted {
        /// Preempting motion.
        by: MotionId,
    },
    /// Ended by a controlled stop.
    Stopped,
    /// Canceled by its client and stopped.
    Canceled,
    /// A path tolerance was violated; the motion is being stopped.
    PathTolerance(ToleranceViolation),
    /// A goal tolerance was still violated after the goal time tolerance.
    GoalTolerance(ToleranceViolation),
    /// Aborted together with all other motions.
    Aborted(AbortReason),
}

/// Reason for which all motions were aborted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AbortReason {
    /// Reset of the machine.
    Reset,
    /// Jump of the followed clock.
    ClockJump {
        /// Time of the position cycle before the jump, ns.
        from: Nanoseconds,
        /// Time of the position cycle after the jump, ns.
        to: Nanoseconds,
    },
    /// Change to a clock whose time is not known yet.
    ClockChange,
}

/// Finished motion with its outcome and figures.
#[derive(Debug, Clone, PartialEq)]
pub struct MotionEnd {
    /// Identifier of the motion.
    pub id: MotionId,
    /// Time of the position cycle of the end, ns.
    pub time: Nanoseconds,
    /// Outcome.
    pub outcome: MotionOutcome,
    /// Machine indices of its axes, in the order of the report.
    pub axis_indices: Vec<usize>,
    /// Figures.
    pub report: MotionReport,
}

/// Times of the position cycles.
#[derive(Debug, Clone, Copy)]
pub(super) struct PositionGrid {
    /// Time of instant 0, ns.
    pub origin: Nanoseconds,
    /// Tsp, ns.
    pub period: Nanoseconds,
}

impl PositionGrid {
    /// Returns the time of instant `k`, ns.
    pub fn time_of(self, k: i64) -> Nanoseconds {
        self.origin.saturating_add(k.saturating_mul(self.period))
    }
}

/// Result of marking a motion as canceled.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum CancelState {
    /// Unknown id.
    Unknown,
    /// Newly canceled.
    NewlyCanceled,
    /// Already canceled.
    AlreadyCanceled,
}

#[derive(Debug, Clone)]
struct ActiveMotion {
    id: MotionId,
    axis_indices: Vec<usize>,
    /// Assessor of its figures; `None` if assessment is disabled.
    assessor: Option<MotionAssessor>,
    is_running: bool,
    /// Instant at which its last setpoint has passed the delays.
    finish_k: Option<i64>,
    tolerances: Option<Tolerances>,
    /// Canceled and being stopped.
    is_canceled: bool,
}

impl ActiveMotion {
    fn into_end(self, outcome: MotionOutcome, time: Nanoseconds) -> MotionEnd {
        let outcome = match outcome {
            // A cancellation takes precedence over a later successor, stop or abort.
            MotionOutcome::Completed
            | MotionOutcome::Preempted { .. }
            | MotionOutcome::Stopped
            | MotionOutcome::Aborted(_)
                if self.is_canceled =>
            {
                MotionOutcome::Canceled
            }
            outcome => outcome,
        };
        let report = self.assessor.map(|assessor| assessor.report()).unwrap_or_default();
        MotionEnd { id: self.id, time, outcome, report, axis_indices: self.axis_indices }
    }
}

/// Accepted motions that wait, run, or whose last setpoints are passing the delays.
#[derive(Debug, Clone)]
pub(super) struct ActiveMotions {
    kinds: Vec<AxisKind>,
    periods: Periods,
    /// Preview of the contour error, position cycles.
    preview_cycles: u32,
    is_assessing: bool,
    list: Vec<ActiveMotion>,
}

impl ActiveMotions {
    /// Creates an empty list for axes of `kinds`.
    pub(super) fn new(kinds: Vec<AxisKind>, periods: Periods, preview_cycles: u32) -> Self {
        ActiveMotions { kinds, periods, preview_cycles, is_assessing: true, list: Vec::new() }
    }

    /// Adds an accepted motion.
    pub(super) fn add(&mut self, id: MotionId, axis_indices: &[usize], tolerances: Option<Tolerances>) {
        self.list.push(ActiveMotion {
            id,
            axis_indices: axis_indices.to_vec(),
            assessor: self
                .is_assessing
                .then(|| MotionAssessor::new(axis_indices, &self.kinds, &self.periods, self.preview_cycles)),
            is_running: false,
            finish_k: None,
            tolerances,
            is_canceled: false,
        });
    }

    /// Returns true if there is no motion.
    pub(super) fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// Returns true if a motion has started.
    pub(super) fn is_any_running(&self) -> bool {
        self.list.iter().any(|m| m.is_running)
    }

    fn find(&mut self, id: MotionId) -> Option<&mut ActiveMotion> {
        self.list.iter_mut().find(|m| m.id == id)
    }

    /// Marks a motion as started.
    pub(super) fn start(&mut self, id: MotionId) {
        if let Some(motion) = self.find(id) {
            motion.is_running = true;
        }
    }

    /// Schedules the completion of a motion at instant `k`, when its last setpoint has passed the delays.
    pub(super) fn finish_at(&mut self, id: MotionId, k: i64) {
        if let Some(motion) = self.find(id) {
            motion.finish_k = Some(k);
        }
    }

    /// Marks a motion as canceled.
    pub(super) fn cancel(&mut self, id: MotionId) -> CancelState {
        let Some(motion) = self.find(id) else { return CancelState::Unknown };
        if std::mem::replace(&mut motion.is_canceled, true) {
            CancelState::AlreadyCanceled
        } else {
            CancelState::NewlyCanceled
        }
    }

    /// Returns true if the motion is canceled.
    pub(super) fn is_canceled(&self, id: MotionId) -> bool {
        self.list.iter().any(|m| m.id == id && m.is_canceled)
    }

    /// Ends a motion with `outcome`.
    pub(super) fn end(
        &mut self,
        id: MotionId,
        outcome: MotionOutcome,
        time: Nanoseconds,
        finished: &mut Vec<MotionEnd>,
    ) {
        if let Some(index) = self.list.iter().position(|m| m.id == id) {
            finished.push(self.list.remove(index).into_end(outcome, time));
        }
    }

    /// Returns the first running motion that violates a path tolerance.
    pub(super) fn path_violation(
        &self,
        errors: &[ErrorHistory],
        period: Nanoseconds,
    ) -> Option<(MotionId, ToleranceViolation)> {
        let running = self.list.iter().filter(|m| m.is_running && !m.is_canceled);
        running.filter_map(|m| Some((m, m.tolerances.as_ref()?))).find_map(|(motion, tolerances)| {
            let violation = first_violation(&motion.axis_indices, &tolerances.path, errors, period)?;
            Some((motion.id, violation))
        })
    }

    /// Ends the motions whose last setpoints have passed the delays at instant `k` and that are within
    /// their goal tolerances, have exceeded the goal time tolerance, or lost an axis to a successor.
    pub(super) fn finish(
        &mut self,
        k: i64,
        errors: &[ErrorHistory],
        grid: PositionGrid,
        finished: &mut Vec<MotionEnd>,
    ) {
        let mut index = 0;
        while let Some(motion) = self.list.get(index) {
            match motion
                .finish_k
                .and_then(|finish_k| self.outcome_at_goal(motion, k - finish_k, errors, grid))
            {
                Some(outcome) => finished.push(self.list.remove(index).into_end(outcome, grid.time_of(k))),
                None => index += 1,
            }
        }
    }

    /// Returns the outcome of a motion `elapsed` instants after its setpoints have passed the delays;
    /// `None` if it is not finished.
    fn outcome_at_goal(
        &self,
        motion: &ActiveMotion,
        elapsed: i64,
        errors: &[ErrorHistory],
        grid: PositionGrid,
    ) -> Option<MotionOutcome> {
        if elapsed < 0 {
            return None;
        }
        let Some(tolerances) = motion.tolerances.as_ref().filter(|_| !motion.is_canceled) else {
            return Some(MotionOutcome::Completed);
        };
        let goal_violation = first_violation(&motion.axis_indices, &tolerances.goal, errors, grid.period);
        let Some(violation) = goal_violation else {
            return Some(MotionOutcome::Completed);
        };
        let is_successor = |other: &&ActiveMotion| {
            other.is_running
                && other.finish_k.is_none()
                && other.axis_indices.iter().any(|axis| motion.axis_indices.contains(axis))
        };
        if let Some(successor) = self.list.iter().find(is_successor) {
            return Some(MotionOutcome::Preempted { by: successor.id });
        }
        let is_in_time =
            tolerances.goal_time.is_none_or(|allowed| elapsed.saturating_mul(grid.period) < allowed);
        (!is_in_time).then_some(MotionOutcome::GoalTolerance(violation))
    }

    /// Aborts all motions.
    pub(super) fn abort_all(
        &mut self,
        reason: AbortReason,
        time: Nanoseconds,
        finished: &mut Vec<MotionEnd>,
    ) {
        finished.extend(self.list.drain(..).map(|m| m.into_end(MotionOutcome::Aborted(reason), time)));
    }

    /// Returns the assessors of the running motions.
    fn assessors(&mut self) -> impl Iterator<Item = &mut MotionAssessor> {
        self.list.iter_mut().filter(|m| m.is_running).filter_map(|m| m.assessor.as_mut())
    }

    /// Enables or disables the assessment of motions accepted from now on.
    pub(super) fn set_assessing(&mut self, is_assessing: bool) {
        self.is_assessing = is_assessing;
    }

    /// Passes the preview of setpoints from `timeline` to the assessors of the running motions.
    pub(super) fn push_preview(&mut self, timeline: &Timeline) {
        for assessor in self.assessors() {
            assessor.push_preview(|axis, cycles| timeline.psec_ahead(axis, cycles).unwrap_or(0.0));
        }
    }

    /// Adds the last position cycle of `machine` to the figures.
    pub(super) fn observe(&mut self, machine: &Machine) {
        for assessor in self.assessors() {
            assessor.observe(machine);
        }
    }

    /// Returns the contour error of the running motion `id` at the end of the last position cycle, m.
    pub(super) fn contour_error(&self, id: MotionId) -> Option<f64> {
        let motion = self.list.iter().find(|motion| motion.id == id)?;
        motion.assessor.as_ref().and_then(MotionAssessor::contour_error)
    }
}
