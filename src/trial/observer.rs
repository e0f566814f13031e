//! Looks at every tick of a trial.

use std::sync::Arc;

use crate::assess::{AxisAssessor, Nearest, PathTracker, SetpointTracker};
use crate::config::{AxisKind, MachineConfig};
use crate::kinematics::{Kinematics, ToolPose, Turned};
use crate::machine::{AxisSample, Machine};
use crate::path::Frame;
use crate::simulation::{Simulation, horizon};
use crate::units::{Nanoseconds, seconds};

use super::circle::Circles;
use super::corner::Corners;
use super::figures::{AxisFigures, ContourFigures, Figures, OrientationFigures, Reference};
use super::recorder::Recorder;
use super::{Outcome, Trial};

/// How far ahead of the set-point the nearest point of a path is sought, m or rad: an axis that
/// overshoots a corner is nearest to what comes behind it.
const AHEAD: f64 = 5e-3;

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

/// What the tool is followed along.
enum Tracker {
    Path(Box<PathTracker>),
    Setpoints(Box<SetpointTracker>),
}

/// Gathers figures and recording.
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
    start: Vec<f64>,
    /// Room for set-points to come.
    ahead: Vec<f64>,
    looked_ahead: bool,
    position: Vec<f64>,
    contour: Extent,
    within_ends: Extent,
    orientation: Extent,
    circles: Circles,
    corners: Corners,
    recorder: Option<Recorder>,
}

impl<'a> Observer<'a> {
    pub(super) fn new(trial: &'a Trial<'a>, start: &[f64]) -> Self {
        let machine: &MachineConfig = trial.machine;
        let count = machine.axes().len();
        let kinematics = Kinematics::new(machine);
        let has_tool = kinematics.has_linear_axis();
        let tracker = has_tool.then(|| match &trial.program {
            Some(program) => Tracker::Path(Box::new(PathTracker::new(Arc::clone(program.path())))),
            None => Tracker::Setpoints(Box::new(SetpointTracker::new(kinematics.forward(start)))),
        });
        let program = trial.program.as_deref();
        Observer {
            trial,
            tracker,
            turned: Turned::default(),
            tick: seconds(machine.periods().current),
            end: 0.0,
            axes: vec![AxisAssessor::default(); count],
            moves: vec![false; count],
            extrapolated: vec![false; count],
            start: start.to_vec(),
            ahead: start.to_vec(),
            looked_ahead: false,
            position: start.to_vec(),
            contour: Extent::default(),
            within_ends: Extent::default(),
            orientation: Extent::default(),
            circles: program.map(|p| Circles::of(p, machine)).unwrap_or_default(),
            // Without a tool there is no contour error to tell at a corner.
            corners: program.filter(|_| has_tool).map(|p| Corners::of(p, machine)).unwrap_or_default(),
            recorder: trial.record.then(|| Recorder::new(count)),
            kinematics,
        }
    }

    /// Takes the position period in that was computed last, which began at `time` ns; `moving` tells
    /// whether set-points are under way, and `axis` where each axis is: a machine, and the place in it.
    pub(super) fn observe<'m>(
        &mut self,
        axis: impl Fn(usize) -> (&'m Machine, usize),
        time: Nanoseconds,
        moving: bool,
    ) {
        let periods = self.trial.machine.periods();
        for place in 0..self.axes.len() {
            let (machine, at) = axis(place);
            let (sample, activity) = (machine.axis(at).sample(), machine.activity(at));
            self.moves[place] |= sample.psec != self.start[place];
            self.extrapolated[place] |= activity.friction_extrapolated;
            if moving {
                self.axes[place].observe(sample, &activity);
            }
        }
        let mut time = time;
        for tick in 0..periods.ticks_per_position() as usize {
            for (place, position) in self.position.iter_mut().enumerate() {
                let (machine, at) = axis(place);
                *position = machine.position(at, tick);
            }
            let samples = (0..self.axes.len()).map(|place| {
                let (machine, at) = axis(place);
                machine.axis(at).sample()
            });
            self.observe_tool(seconds(time), (tick == 0).then_some(samples));
            time += periods.current;
        }
        self.end = seconds(time);
    }

    /// Takes a tick at `time` s into account, at which the axes are at `position`; `samples` are those of a
    /// position instant.
    fn observe_tool<'m>(&mut self, time: f64, samples: Option<impl Iterator<Item = &'m AxisSample>>) {
        let pose = self.kinematics.forward_from(&mut self.turned, &self.position);
        let nearest = self.nearest(&pose, time);
        if let Some(nearest) = &nearest {
            self.contour.push(nearest.distance);
            self.within_ends.push(nearest.within_ends);
            self.orientation.push(nearest.orientation);
            self.corners.observe(time, nearest);
        }
        if let (Some(samples), Some(recorder)) = (samples, &mut self.recorder) {
            let tool = nearest.as_ref().map(|nearest| (nearest, pose.tip.into()));
            recorder.push(time, samples, tool);
        }
        if self.trial.program.as_ref().is_some_and(|p| p.path().frame() == Frame::Workpiece) {
            self.kinematics.put_tip(pose.tip, &mut self.position);
        }
        self.circles.observe(time, &self.position, self.recorder.is_some());
    }

    /// What was measured so far, without a recording.
    pub(super) fn figures(&self) -> Figures {
        let machine = self.trial.machine;
        let axes = machine.axes().iter().enumerate().map(|(place, axis)| AxisFigures {
            name: axis.name().to_owned(),
            kind: axis.kind(),
            moves: self.moves[place],
            report: self.axes[place].report(self.tick),
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
            bidirectional: self.circles.bidirectional(),
            corners: self.corners.figures(),
        }
    }

    /// Whether a rotary axis moves.
    fn turns(&self) -> bool {
        let axes = self.trial.machine.axes().iter();
        axes.zip(&self.moves).any(|(axis, &moves)| moves && axis.kind() == AxisKind::Rotary)
    }

    /// Learns, before a position instant, where the set-points go, if they are what the tool is
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

    fn nearest(&mut self, pose: &ToolPose, time: f64) -> Option<Nearest> {
        match (self.tracker.as_mut()?, &self.trial.program) {
            (Tracker::Path(tracker), Some(program)) => {
                Some(tracker.nearest(pose, program.progress(time) + AHEAD))
            }
            (Tracker::Setpoints(tracker), _) => Some(tracker.nearest(pose)),
            (Tracker::Path(_), None) => None,
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
