//! Looks at every tick of a trial.

use std::sync::Arc;

use crate::assess::{AxisAssessor, Deviations, Nearest, PathTracker, SetpointTracker};
use crate::config::{AxisKind, MachineConfig};
use crate::kinematics::{Kinematics, Poses, Role, Turned};
use crate::machine::Machine;
use crate::path::Frame;
use crate::simulation::{Simulation, horizon};
use crate::units::seconds;

use super::circle::Circles;
use super::corner::Corners;
use super::figures::{AxisFigures, ContourFigures, Figures, OrientationFigures, Reference};
use super::period::Period;
use super::recorder::{Recorder, Tool};
use super::{Outcome, Trial};

/// Largest and mean square of an error.
#[derive(Debug, Clone, Copy, Default)]
struct Extent {
    max: f64,
    squares: f64,
    count: u64,
}

impl Extent {
    fn push(&mut self, value: f64) {
        self.max = self.max.max(value);
        self.squares += value * value;
        self.count += 1;
    }

    fn rms(&self) -> f64 {
        if self.count == 0 { 0.0 } else { (self.squares / self.count as f64).sqrt() }
    }
}

/// What is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Measures {
    All,
    /// Not the circles, each of which takes longer and more memory than all of the rest.
    WithoutCircles,
}

/// What the tool is followed along.
#[derive(Clone)]
enum Tracker {
    Path(Box<PathTracker>),
    Setpoints(Box<SetpointTracker>),
}

/// Gathers figures and recording.
#[derive(Clone)]
pub(super) struct Observer<'a> {
    trial: &'a Trial<'a>,
    kinematics: Kinematics,
    turned: Turned,
    tracker: Option<Tracker>,
    tick: f64,
    end: f64,
    axes: Vec<AxisAssessor>,
    moves: Vec<bool>,
    extrapolated: Vec<bool>,
    /// Position instants at which an axis had left its stroke.
    outside: Vec<u64>,
    start: Vec<f64>,
    /// Room for setpoints to come.
    ahead: Vec<f64>,
    looked_ahead: bool,
    /// Where the tool was in the position period, and by how much it was off.
    poses: Poses,
    found: Deviations,
    contour: Extent,
    within_ends: Extent,
    orientation: Extent,
    circles: Circles,
    corners: Corners,
    recorder: Option<Recorder>,
}

impl<'a> Observer<'a> {
    pub(super) fn new(trial: &'a Trial<'a>, start: &[f64], measures: Measures) -> Self {
        let machine: &MachineConfig = trial.machine;
        let count = machine.axes().len();
        let kinematics = Kinematics::new(machine);
        let has_tool = kinematics.has_linear_axis();
        let tracker = has_tool.then(|| match &trial.program {
            Some(program) => Tracker::Path(Box::new(PathTracker::new(Arc::clone(program.path())))),
            None => Tracker::Setpoints(Box::new(SetpointTracker::new(kinematics.forward(start)))),
        });
        let program = trial.program.as_deref();
        let circles = program.filter(|_| measures == Measures::All);
        Observer {
            trial,
            tracker,
            turned: Turned::default(),
            tick: seconds(machine.periods().current),
            end: 0.0,
            axes: vec![AxisAssessor::default(); count],
            moves: vec![false; count],
            extrapolated: vec![false; count],
            outside: vec![0; count],
            start: start.to_vec(),
            ahead: start.to_vec(),
            looked_ahead: false,
            poses: Poses::default(),
            found: Deviations::default(),
            contour: Extent::default(),
            within_ends: Extent::default(),
            orientation: Extent::default(),
            circles: circles.map(|p| Circles::of(p, machine)).unwrap_or_default(),
            // Without a tool there is no contour error to tell at a corner.
            corners: program.filter(|_| has_tool).map(|p| Corners::of(p, machine)).unwrap_or_default(),
            recorder: trial.record.then(|| Recorder::new(count)),
            kinematics,
        }
    }

    /// Takes a position period in; `axis` tells where each axis is: a machine, and the place in it.
    pub(super) fn observe<'m>(&mut self, axis: impl Fn(usize) -> (&'m Machine, usize), period: &mut Period) {
        for place in 0..self.axes.len() {
            let (machine, at) = axis(place);
            let (sample, activity) = (machine.axis(at).sample(), machine.activity(at));
            self.moves[place] |= sample.psec != self.start[place];
            self.extrapolated[place] |= activity.friction_extrapolated;
            let limits = &self.trial.machine.axes()[place].limits;
            self.outside[place] += u64::from(limits.is_left_by(sample.position));
            if period.moving {
                self.axes[place].observe(sample, &activity);
            }
        }
        self.kinematics.forward_all(&mut self.turned, &period.positions, period.ticks(), &mut self.poses);
        let first = self.follow(period);
        if let Some(recorder) = &mut self.recorder {
            let axes = (0..self.axes.len()).map(|place| {
                let (machine, at) = axis(place);
                (machine.axis(at).sample(), machine.largest_current(at))
            });
            let largest = |errors: &[f64]| errors.iter().copied().fold(0.0, f64::max);
            let tool = first.map(|nearest| Tool {
                reference: nearest.point.into(),
                position: self.poses.tip(0).into(),
                contour_error: largest(&self.found.distance),
                orientation_error: largest(&self.found.orientation),
            });
            recorder.push(period.times[0], axes, tool);
        }
        self.observe_circles(period);
        self.end = period.end;
    }

    /// Takes the tool into account: what is nearest to it at the first tick.
    fn follow(&mut self, period: &mut Period) -> Option<Nearest> {
        let (poses, found) = (&self.poses, &mut self.found);
        let first = match (self.tracker.as_mut()?, &self.trial.program) {
            (Tracker::Path(tracker), Some(program)) => {
                tracker.follow(poses, |tick| period.until(program, tick), found)?.first
            }
            (Tracker::Setpoints(tracker), _) => {
                found.clear();
                let mut at = |tick| {
                    let nearest = tracker.nearest(&poses.get(tick));
                    found.push(&nearest);
                    nearest
                };
                let first = at(0);
                (1..poses.len()).for_each(|tick| _ = at(tick));
                first
            }
            (Tracker::Path(_), None) => return None,
        };
        let each = found.distance.iter().zip(&found.within_ends).zip(&found.orientation);
        for ((&distance, &within_ends), &orientation) in each {
            self.contour.push(distance);
            self.within_ends.push(within_ends);
            self.orientation.push(orientation);
        }
        self.corners.observe(&period.times, &found.within_ends);
        Some(first)
    }

    fn observe_circles(&mut self, period: &Period) {
        let workpiece = self.trial.program.as_ref().is_some_and(|p| p.path().frame() == Frame::Workpiece);
        let (kinematics, poses, ticks) = (&self.kinematics, &self.poses, period.ticks());
        let tips = Role::LINEAR.map(|role| kinematics.role(role)).into_iter().zip(poses.tips());
        let coordinates = |place: usize| {
            let tip = tips.clone().find(|(joint, _)| workpiece && *joint == Some(place));
            tip.map_or(&period.positions[place * ticks..][..ticks], |(_, values)| values)
        };
        self.circles.observe(&period.times, coordinates, self.recorder.is_some());
    }

    /// What was measured so far, without a recording.
    pub(super) fn figures(&self) -> Figures {
        let machine = self.trial.machine;
        let axes = machine.axes().iter().enumerate().map(|(place, axis)| AxisFigures {
            name: axis.name().to_owned(),
            kind: axis.kind(),
            moves: self.moves[place],
            report: self.axes[place].report(self.tick),
            outside_stroke_time: self.outside[place] as f64 * seconds(machine.periods().position),
            friction_extrapolated: self.extrapolated[place],
        });
        let reference = match self.tracker {
            Some(Tracker::Path(_)) => Some(Reference::Path),
            Some(Tracker::Setpoints(_)) => Some(Reference::Setpoints),
            None => None,
        };
        let has_orientation = reference.is_some() && self.kinematics.has_rotary_axis();
        Figures {
            duration: self.end,
            axes: axes.collect(),
            contour: reference.map(|reference| ContourFigures {
                reference,
                max: self.contour.max,
                rms: self.contour.rms(),
                max_within_ends: self.within_ends.max,
                rms_within_ends: self.within_ends.rms(),
            }),
            orientation: has_orientation
                .then(|| OrientationFigures { max: self.orientation.max, rms: self.orientation.rms() }),
            circles: self.circles.figures(),
            more_circles: self.circles.more(),
            bidirectional: self.circles.bidirectional(),
            corners: self.corners.figures(),
            more_corners: self.corners.more(),
        }
    }

    /// Whether a rotary axis moves.
    fn turns(&self) -> bool {
        let axes = self.trial.machine.axes().iter();
        axes.zip(&self.moves).any(|(axis, &moves)| moves && axis.kind() == AxisKind::Rotary)
    }

    /// Learns, before a position instant, where the setpoints go, if they are what the tool is
    /// followed along.
    pub(super) fn look_ahead(&mut self, simulation: &Simulation) {
        let Some(Tracker::Setpoints(tracker)) = &mut self.tracker else { return };
        let horizon = horizon(simulation.period());
        let first = if self.looked_ahead { horizon } else { 0 };
        self.looked_ahead = true;
        for periods in first..=horizon {
            for (joint, value) in self.ahead.iter_mut().enumerate() {
                *value = simulation.psec_ahead(joint, periods).unwrap_or(*value);
            }
            tracker.push(self.kinematics.forward(&self.ahead));
        }
    }

    pub(super) fn finish(self) -> Outcome {
        let figures = self.figures();
        let machine = self.trial.machine;
        let turns = figures.orientation.is_some() && self.turns();
        let recording = self.recorder.map(|recorder| {
            let mut recording = recorder.finish(machine, &self.moves, turns);
            recording.circles = self.circles.into_traces();
            recording
        });
        Outcome { figures, recording }
    }
}
