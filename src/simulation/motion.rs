//! The motions that have been accepted, with their figures.

use crate::assess::{MotionAssessor, MotionReport};
use crate::config::AxisKind;
use crate::machine::Machine;
use crate::trajectory::{MotionId, Timeline};
use crate::units::Nanoseconds;

use super::tolerance::Violation;

/// How a motion ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Outcome {
    /// Its last set-point has passed the pure delay, and the axes are within its goal tolerances.
    Completed,
    /// Another one took one or more of its axes over.
    Displaced {
        /// The one that did.
        by: MotionId,
    },
    /// By a controlled stop.
    Stopped,
    /// Called off by whoever asked for it, and stopped.
    Cancelled,
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
    /// The clock that the node follows jumped.
    ClockJump,
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

#[derive(Debug, Clone)]
struct Motion {
    id: MotionId,
    places: Vec<usize>,
    assessor: MotionAssessor,
    running: bool,
    /// The instant at which its last set-point has passed the delays.
    finishes: Option<i64>,
}

impl Motion {
    fn into_end(self, outcome: Outcome, time: Nanoseconds) -> MotionEnd {
        MotionEnd { id: self.id, time, outcome, report: self.assessor.report(), places: self.places }
    }
}

/// Accepted motions: waiting, running, or waiting for their last set-points to pass the delays.
#[derive(Debug, Clone)]
pub(super) struct Motions {
    kinds: Vec<AxisKind>,
    tick: f64,
    horizon: u32,
    list: Vec<Motion>,
}

impl Motions {
    pub(super) fn new(kinds: Vec<AxisKind>, tick: f64, horizon: u32) -> Self {
        Motions { kinds, tick, horizon, list: Vec::new() }
    }

    pub(super) fn accept(&mut self, id: MotionId, places: &[usize]) {
        self.list.push(Motion {
            id,
            places: places.to_vec(),
            assessor: MotionAssessor::new(places, &self.kinds, self.tick, self.horizon),
            running: false,
            finishes: None,
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

    pub(super) fn finish_at(&mut self, id: MotionId, k: i64) {
        if let Some(motion) = self.find(id) {
            motion.finishes = Some(k);
        }
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

    /// Completes the motions whose last set-points have passed the delays at instant `k`.
    pub(super) fn finish(&mut self, k: i64, time: Nanoseconds, ends: &mut Vec<MotionEnd>) {
        while let Some(place) = self.list.iter().position(|m| m.finishes.is_some_and(|f| k >= f)) {
            ends.push(self.list.remove(place).into_end(Outcome::Completed, time));
        }
    }

    pub(super) fn abort_all(&mut self, why: Abort, time: Nanoseconds, ends: &mut Vec<MotionEnd>) {
        ends.extend(self.list.drain(..).map(|m| m.into_end(Outcome::Aborted(why), time)));
    }

    /// Shows the motions under way what `timeline` commands next.
    pub(super) fn look_ahead(&mut self, timeline: &Timeline) {
        for motion in self.list.iter_mut().filter(|m| m.running) {
            motion.assessor.look_ahead(|place, periods| timeline.psec_ahead(place, periods).unwrap_or(0.0));
        }
    }

    pub(super) fn observe(&mut self, machine: &Machine, position_instant: bool) {
        for motion in self.list.iter_mut().filter(|m| m.running) {
            motion.assessor.observe(machine, position_instant);
        }
    }
}
