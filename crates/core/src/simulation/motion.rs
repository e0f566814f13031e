//! The motions that have been accepted, with their figures.

use crate::assess::{MotionAssessor, MotionReport};
use crate::config::AxisKind;
use crate::machine::Machine;
use crate::trajectory::{MotionId, Timeline};
use crate::units::Nanoseconds;

use super::tolerance::{Errors, Tolerances, Violation, first_violation};

/// How a motion ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Outcome {
    /// Its last setpoint has passed the pure delay, and the axes are within its goal tolerances.
    Completed,
    /// Another one took one or more of its axes over.
    Displaced {
        /// The one that did.
        by: MotionId,
    },
    /// By a controlled stop.
    Stopped,
    /// Called off by whoever asked for it, and stopped.
    Canceled,
    /// It strayed further than its path tolerances allow, and is being stopped.
    PathTolerance(Violation),
    /// It was not within its goal tolerances in time.
    GoalTolerance(Violation),
    /// With everything else.
    Aborted(Abort),
}

/// What ended every motion at once.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Abort {
    /// The machine was put at rest.
    Reset,
    /// The clock that is followed jumped.
    ClockJump {
        /// Time of the position instant before it, ns.
        from: Nanoseconds,
        /// Time of the one after it, ns.
        to: Nanoseconds,
    },
}

/// The end of a motion.
#[derive(Debug, Clone, PartialEq)]
pub struct MotionEnd {
    /// Which one.
    pub id: MotionId,
    /// Time of the position instant, ns.
    pub time: Nanoseconds,
    /// How.
    pub outcome: Outcome,
    /// Places of its axes in the machine, in the order of the report.
    pub places: Vec<usize>,
    /// Its figures.
    pub report: MotionReport,
}

/// Position instants as times.
#[derive(Debug, Clone, Copy)]
pub(super) struct Grid {
    /// Time of instant 0, ns.
    pub origin: Nanoseconds,
    /// Tsp, ns.
    pub period: Nanoseconds,
}

impl Grid {
    /// Time of instant `k`, ns.
    pub fn time_of(self, k: i64) -> Nanoseconds {
        self.origin.saturating_add(k.saturating_mul(self.period))
    }
}

/// What there is to be called off.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Cancel {
    /// No such motion.
    Unknown,
    /// A motion that is called off for the first time,
    New,
    /// or once more.
    Known,
}

#[derive(Debug, Clone)]
struct Motion {
    id: MotionId,
    places: Vec<usize>,
    /// Its figures; none where nobody reads them.
    assessor: Option<MotionAssessor>,
    running: bool,
    /// The instant at which its last setpoint has passed the delays.
    finishes: Option<i64>,
    tolerances: Option<Tolerances>,
    /// It has been called off, and is being stopped.
    canceled: bool,
}

impl Motion {
    fn into_end(self, outcome: Outcome, time: Nanoseconds) -> MotionEnd {
        let outcome = match outcome {
            // It was over for whoever asked for it before a successor or a stop came.
            Outcome::Completed | Outcome::Displaced { .. } | Outcome::Stopped | Outcome::Aborted(_)
                if self.canceled =>
            {
                Outcome::Canceled
            }
            outcome => outcome,
        };
        let report = self.assessor.map(|assessor| assessor.report()).unwrap_or_default();
        MotionEnd { id: self.id, time, outcome, report, places: self.places }
    }
}

/// Accepted motions: waiting, running, or waiting for their last setpoints to pass the delays.
#[derive(Debug, Clone)]
pub(super) struct Motions {
    kinds: Vec<AxisKind>,
    tick: f64,
    horizon: u32,
    assessing: bool,
    list: Vec<Motion>,
}

impl Motions {
    pub(super) fn new(kinds: Vec<AxisKind>, tick: f64, horizon: u32) -> Self {
        Motions { kinds, tick, horizon, assessing: true, list: Vec::new() }
    }

    pub(super) fn accept(&mut self, id: MotionId, places: &[usize], tolerances: Option<Tolerances>) {
        self.list.push(Motion {
            id,
            places: places.to_vec(),
            assessor: self
                .assessing
                .then(|| MotionAssessor::new(places, &self.kinds, self.tick, self.horizon)),
            running: false,
            finishes: None,
            tolerances,
            canceled: false,
        });
    }

    pub(super) fn any(&self) -> bool {
        !self.list.is_empty()
    }

    pub(super) fn any_running(&self) -> bool {
        self.list.iter().any(|m| m.running)
    }

    fn find(&mut self, id: MotionId) -> Option<&mut Motion> {
        self.list.iter_mut().find(|m| m.id == id)
    }

    pub(super) fn start(&mut self, id: MotionId) {
        if let Some(motion) = self.find(id) {
            motion.running = true;
        }
    }

    /// The last setpoint of a motion has been commanded; it has passed the delays at instant `k`.
    pub(super) fn finish_at(&mut self, id: MotionId, k: i64) {
        if let Some(motion) = self.find(id) {
            motion.finishes = Some(k);
        }
    }

    /// Notes that a motion is called off.
    pub(super) fn cancel(&mut self, id: MotionId) -> Cancel {
        let Some(motion) = self.find(id) else { return Cancel::Unknown };
        if std::mem::replace(&mut motion.canceled, true) { Cancel::Known } else { Cancel::New }
    }

    pub(super) fn is_canceled(&self, id: MotionId) -> bool {
        self.list.iter().any(|m| m.id == id && m.canceled)
    }

    pub(super) fn end(
        &mut self,
        id: MotionId,
        outcome: Outcome,
        time: Nanoseconds,
        ends: &mut Vec<MotionEnd>,
    ) {
        if let Some(place) = self.list.iter().position(|m| m.id == id) {
            ends.push(self.list.remove(place).into_end(outcome, time));
        }
    }

    /// The first motion that strays from its path further than its tolerances allow.
    pub(super) fn strayed(&self, errors: &[Errors], period: Nanoseconds) -> Option<(MotionId, Violation)> {
        let under_way = self.list.iter().filter(|m| m.running && !m.canceled);
        under_way.filter_map(|m| Some((m, m.tolerances.as_ref()?))).find_map(|(motion, tolerances)| {
            let violation = first_violation(&motion.places, &tolerances.path, errors, period)?;
            Some((motion.id, violation))
        })
    }

    /// Ends the motions whose last setpoints have passed the delays at instant `k`, as soon as they are
    /// within their goal tolerances, have no time left to get there, or lost an axis to a successor.
    pub(super) fn finish(&mut self, k: i64, errors: &[Errors], grid: Grid, ends: &mut Vec<MotionEnd>) {
        let mut place = 0;
        while let Some(motion) = self.list.get(place) {
            match motion
                .finishes
                .and_then(|finishes| self.outcome_at_goal(motion, k - finishes, errors, grid))
            {
                Some(outcome) => ends.push(self.list.remove(place).into_end(outcome, grid.time_of(k))),
                None => place += 1,
            }
        }
    }

    /// How a motion ends `late` instants after its setpoints have passed the delays; none: not yet.
    fn outcome_at_goal(&self, motion: &Motion, late: i64, errors: &[Errors], grid: Grid) -> Option<Outcome> {
        if late < 0 {
            return None;
        }
        let Some(tolerances) = motion.tolerances.as_ref().filter(|_| !motion.canceled) else {
            return Some(Outcome::Completed);
        };
        let Some(violation) = first_violation(&motion.places, &tolerances.goal, errors, grid.period) else {
            return Some(Outcome::Completed);
        };
        let takes_over = |other: &&Motion| {
            other.running
                && other.finishes.is_none()
                && other.places.iter().any(|p| motion.places.contains(p))
        };
        if let Some(successor) = self.list.iter().find(takes_over) {
            return Some(Outcome::Displaced { by: successor.id });
        }
        let in_time = tolerances.goal_time.is_none_or(|allowed| late.saturating_mul(grid.period) < allowed);
        (!in_time).then_some(Outcome::GoalTolerance(violation))
    }

    pub(super) fn abort_all(&mut self, why: Abort, time: Nanoseconds, ends: &mut Vec<MotionEnd>) {
        ends.extend(self.list.drain(..).map(|m| m.into_end(Outcome::Aborted(why), time)));
    }

    /// Assessors of the motions under way.
    fn assessors(&mut self) -> impl Iterator<Item = &mut MotionAssessor> {
        self.list.iter_mut().filter(|m| m.running).filter_map(|m| m.assessor.as_mut())
    }

    /// Whether motions that are accepted from now on have figures.
    pub(super) fn set_assessing(&mut self, assessing: bool) {
        self.assessing = assessing;
    }

    /// Shows the motions under way what `timeline` commands next.
    pub(super) fn look_ahead(&mut self, timeline: &Timeline) {
        for assessor in self.assessors() {
            assessor.look_ahead(|place, periods| timeline.psec_ahead(place, periods).unwrap_or(0.0));
        }
    }

    /// Takes the position period in that `machine` has computed last.
    pub(super) fn observe(&mut self, machine: &Machine) {
        for assessor in self.assessors() {
            assessor.observe(machine);
        }
    }
}
