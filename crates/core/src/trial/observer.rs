//! Evaluation of every tick of a trial: figures and signal recording.

use std::sync::Arc;

use crate::assess::{AxisAssessor, NearestPoint, PathDeviations, PathTracker, SetpointTracker, StandingTurn};
use crate::config::{AxisKind, MachineConfig};
use crate::kinematics::{AxisRole, Kinematics, Poses, RotaryAngles, ToolPose};
use crate::machine::Machine;
use crate::path::Frame;
use crate::simd::LANES;
use crate::simulation::{Simulation, contour_preview_cycles};
use crate::statistics::rms_of_sum;
use crate::units::seconds;

use super::circle::Circles;
use super::corner::Corners;
use super::cycle::PositionCycle;
use super::definition::{Measures, Trial, TrialOutcome};
use super::energy::EnergyMeter;
use super::figures::{AxisFigures, ContourFigures, Figures, OrientationFigures, RapidFigures, Reference};
use super::recorder::{SignalRecorder, ToolSample};

/// Largest value and RMS of an error, in one part per lane.
#[derive(Debug, Clone, Copy, Default)]
struct ErrorStatistics {
    max: [f64; LANES],
    sum_of_squares: [f64; LANES],
    count: u64,
}

impl ErrorStatistics {
    fn add(&mut self, errors: &[f64]) {
        for group in errors.chunks(LANES) {
            for (k, &error) in group.iter().enumerate() {
                // NaN is not larger.
                self.max[k] = if error > self.max[k] { error } else { self.max[k] };
                self.sum_of_squares[k] += error * error;
            }
        }
        self.count += errors.len() as u64;
    }

    fn max(&self) -> f64 {
        self.max.into_iter().fold(0.0, f64::max)
    }

    fn rms(&self) -> f64 {
        rms_of_sum(self.sum_of_squares.into_iter().sum(), self.count).unwrap_or(0.0)
    }
}

/// Reference of the tool's contour error.
#[derive(Clone)]
enum Tracker {
    Path(Box<PathTracker>),
    Setpoints(Box<SetpointTracker>),
}

/// Accumulator of figures and recording.
#[derive(Clone)]
pub(super) struct Observer<'a> {
    trial: &'a Trial<'a>,
    kinematics: Kinematics,
    rotated: RotaryAngles,
    tracker: Option<Tracker>,
    tick: f64,
    end: f64,
    axes: Vec<AxisAssessor>,
    /// Figures of the position cycles at feed.
    cuts: Vec<AxisAssessor>,
    moves: Vec<bool>,
    extrapolated: Vec<bool>,
    /// Number of position cycles outside the travel limits, per axis.
    outside_travel: Vec<u64>,
    start: Vec<f64>,
    /// Buffer for future setpoints.
    preview: Vec<f64>,
    has_preview: bool,
    /// Programmed setpoints that the polyline runs through, instead of the setpoints of the simulation; m or rad, a row of
    /// all axes per position cycle.
    programmed: Option<&'a [f64]>,
    /// Tool poses of the position cycle and their deviations.
    poses: Poses,
    deviations: PathDeviations,
    contour: ErrorStatistics,
    within_ends: ErrorStatistics,
    /// Contour errors at rapid traverse.
    rapids: ErrorStatistics,
    /// True if the tool moves at feed.
    has_cuts: bool,
    rapids_within_ends: ErrorStatistics,
    turn: StandingTurn,
    orientation: ErrorStatistics,
    circles: Circles,
    corners: Corners,
    energy: Option<EnergyMeter>,
    recorder: Option<SignalRecorder>,
}

impl<'a> Observer<'a> {
    pub(super) fn new(trial: &'a Trial<'a>, start: &[f64]) -> Self {
        let machine: &MachineConfig = trial.machine;
        let count = machine.axes().len();
        let kinematics = Kinematics::new(machine);
        let measures = trial.measures;
        let has_tool = measures.contour && kinematics.has_linear_axis();
        let tracker = has_tool.then(|| match &trial.program {
            Some(program) => Tracker::Path(Box::new(PathTracker::new(Arc::clone(program.path())))),
            None => Tracker::Setpoints(Box::new(SetpointTracker::new(kinematics.forward(start)))),
        });
        let program = trial.program.as_deref();
        let circles = program.filter(|_| measures.circles);
        Observer {
            trial,
            tracker,
            rotated: RotaryAngles::default(),
            tick: seconds(machine.periods().current),
            end: 0.0,
            axes: vec![AxisAssessor::default(); count],
            cuts: vec![AxisAssessor::default(); count],
            moves: vec![false; count],
            extrapolated: vec![false; count],
            outside_travel: vec![0; count],
            start: start.to_vec(),
            preview: start.to_vec(),
            has_preview: false,
            programmed: None,
            poses: Poses::default(),
            deviations: PathDeviations::default(),
            contour: ErrorStatistics::default(),
            within_ends: ErrorStatistics::default(),
            rapids: ErrorStatistics::default(),
            has_cuts: program.is_some(),
            rapids_within_ends: ErrorStatistics::default(),
            turn: StandingTurn::default(),
            orientation: ErrorStatistics::default(),
            circles: circles.map(|p| Circles::of(p, machine)).unwrap_or_default(),
            // Without a tool there is no contour error at corners.
            corners: program.filter(|_| has_tool).map(|p| Corners::of(p, machine)).unwrap_or_default(),
            energy: measures.energy.then(|| EnergyMeter::new(machine)),
            recorder: trial.record.then(|| SignalRecorder::new(count)),
            kinematics,
        }
    }

    /// Sets the programmed setpoints that contour errors are measured against without a known path.
    pub(super) fn set_programmed(&mut self, rows: &'a [f64]) {
        self.programmed = Some(rows);
    }

    /// Returns true if the figures need the positions at every tick.
    pub(super) fn needs_positions(&self) -> bool {
        let Measures { contour, circles, .. } = self.trial.measures;
        contour || circles
    }

    /// Returns the deviations of the tool at the ticks of the last position cycle; `None` without contour errors.
    pub(super) fn deviations(&self) -> Option<&PathDeviations> {
        self.tracker.as_ref().map(|_| &self.deviations)
    }

    /// Adds a position cycle; `axis` returns the machine of an axis and its index there.
    pub(super) fn observe<'m>(
        &mut self,
        axis: impl Fn(usize) -> (&'m Machine, usize),
        cycle: &mut PositionCycle,
    ) {
        for index in 0..self.axes.len() {
            let (machine, at) = axis(index);
            let (sample, activity) = (machine.axis(at).sample(), machine.activity(at));
            self.moves[index] |= sample.psec != self.start[index];
            self.extrapolated[index] |= activity.friction_extrapolated;
            let limits = &self.trial.machine.axes()[index].limits;
            self.outside_travel[index] += u64::from(limits.is_outside_travel(sample.position));
            if cycle.is_moving {
                self.axes[index].observe(sample, &activity);
            }
        }
        if let Some(energy) = &mut self.energy {
            energy.observe(&axis);
        }
        if self.needs_positions() {
            self.kinematics.forward_batch(
                &mut self.rotated,
                &cycle.positions,
                cycle.ticks(),
                &mut self.poses,
            );
        }
        let turned = self.turn.is_turning(cycle.times.at(0)).then(|| {
            let delayed = |index| {
                let (machine, at) = axis(index);
                machine.axis(at).sample().delayed_psec
            };
            self.kinematics.forward(&(0..self.axes.len()).map(delayed).collect::<Vec<_>>())
        });
        let first = self.follow(cycle, turned.as_ref());
        if cycle.is_moving && !self.is_rapid() {
            for (index, cuts) in self.cuts.iter_mut().enumerate() {
                let (machine, at) = axis(index);
                cuts.observe(machine.axis(at).sample(), &machine.activity(at));
            }
        }
        if let Some(recorder) = &mut self.recorder {
            let axes = (0..self.axes.len()).map(|index| {
                let (machine, at) = axis(index);
                let share = machine.activity(at).saturated_ticks as f64 / cycle.ticks() as f64;
                (machine.axis(at).sample(), machine.signed_peak_current(at), share)
            });
            let largest = |errors: &[f64]| errors.iter().copied().fold(0.0, f64::max);
            let tool = first.map(|nearest| ToolSample {
                reference: nearest.point.into(),
                position: self.poses.tip(0).into(),
                contour_error: largest(&self.deviations.distance),
                orientation_error: largest(&self.deviations.orientation),
            });
            recorder.push(cycle.times.at(0), axes, tool);
        }
        if self.trial.measures.circles {
            self.observe_circles(cycle);
        }
        self.end = cycle.times.at(cycle.ticks());
    }

    /// Adds the tool poses; returns the nearest point at the first tick.
    ///
    /// `turned` is the pose of the same time for the orientation of a standing tip.
    fn follow(&mut self, cycle: &mut PositionCycle, turned: Option<&ToolPose>) -> Option<NearestPoint> {
        let (poses, deviations) = (&self.poses, &mut self.deviations);
        let mut first = match (self.tracker.as_mut()?, &self.trial.program) {
            (Tracker::Path(tracker), Some(program)) => {
                tracker.follow(poses, |tick| cycle.until(program, tick), deviations)?
            }
            (Tracker::Setpoints(tracker), _) => tracker.follow(poses, deviations)?,
            (Tracker::Path(_), None) => return None,
        };
        if let Some(turned) = turned {
            first.axis = turned.axis;
            first.orientation = Kinematics::orientation_error(&turned.axis, &poses.get(0).axis);
            deviations.orientation.fill(first.orientation);
        }
        self.orientation.add(&deviations.orientation);
        let mut rapid = match &self.tracker {
            Some(Tracker::Setpoints(tracker)) => Some(tracker.rapid().peekable()),
            _ => None,
        };
        let mut begin = 0;
        while begin < deviations.distance.len() {
            // Ticks in a row of the same kind.
            let (mut end, mut is_rapid) = (deviations.distance.len(), false);
            if let Some(rapid) = &mut rapid {
                is_rapid = rapid.next().unwrap_or(false);
                end = begin + 1;
                while rapid.next_if_eq(&is_rapid).is_some() {
                    end += 1;
                }
            }
            let [contour, within_ends] = match is_rapid {
                true => [&mut self.rapids, &mut self.rapids_within_ends],
                false => [&mut self.contour, &mut self.within_ends],
            };
            contour.add(&deviations.distance[begin..end]);
            within_ends.add(&deviations.within_ends[begin..end]);
            begin = end;
        }
        self.corners.observe(cycle.times, &deviations.within_ends);
        Some(first)
    }

    /// Returns true if the first tick of the last position cycle is at rapid traverse.
    fn is_rapid(&self) -> bool {
        matches!(&self.tracker, Some(Tracker::Setpoints(tracker)) if tracker.rapid().next().unwrap_or(false))
    }

    fn observe_circles(&mut self, cycle: &PositionCycle) {
        let workpiece = self.trial.program.as_ref().is_some_and(|p| p.path().frame() == Frame::Workpiece);
        let (kinematics, poses, ticks) = (&self.kinematics, &self.poses, cycle.ticks());
        let tips = AxisRole::LINEAR.map(|role| kinematics.role(role)).into_iter().zip(poses.tips());
        let coordinates = |index: usize| {
            let tip = tips.clone().find(|(joint, _)| workpiece && *joint == Some(index));
            tip.map_or(&cycle.positions[index * ticks..][..ticks], |(_, values)| values)
        };
        self.circles.observe(cycle.times, coordinates, self.recorder.is_some());
    }

    /// Returns the figures so far, without a recording.
    pub(super) fn figures(&self) -> Figures {
        let machine = self.trial.machine;
        let has_both = self.has_cuts && self.rapids.count > 0;
        let axes = machine.axes().iter().enumerate().map(|(index, axis)| AxisFigures {
            name: axis.name().to_owned(),
            kind: axis.kind(),
            moves: self.moves[index],
            max_current: axis.motor.max_current,
            report: self.axes[index].report(self.tick),
            cuts: has_both.then(|| self.cuts[index].report(self.tick)),
            outside_travel_limits_time: self.outside_travel[index] as f64
                * seconds(machine.periods().position),
            friction_extrapolated: self.extrapolated[index],
            energy: self.energy.as_ref().map(|energy| energy.axis(index)),
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
            dc_link: self.energy.as_ref().map(EnergyMeter::link),
            contour: reference.map(|reference| self.contour_figures(reference)),
            orientation: has_orientation
                .then(|| OrientationFigures { max: self.orientation.max(), rms: self.orientation.rms() }),
            circles: self.circles.figures(),
            more_circles: self.circles.more(),
            bidirectional: self.circles.bidirectional(),
            corners: self.corners.figures(),
            more_corners: self.corners.more(),
        }
    }

    fn contour_figures(&self, reference: Reference) -> ContourFigures {
        // A program of rapid traverse alone has no other errors.
        let is_cutting = self.has_cuts || self.rapids.count == 0;
        let (contour, within_ends) = match is_cutting {
            true => (&self.contour, &self.within_ends),
            false => (&self.rapids, &self.rapids_within_ends),
        };
        let rapids = &self.rapids;
        ContourFigures {
            reference,
            max: contour.max(),
            rms: contour.rms(),
            max_within_ends: within_ends.max(),
            rms_within_ends: within_ends.rms(),
            rapids: (is_cutting && rapids.count > 0)
                .then(|| RapidFigures { max: rapids.max(), rms: rapids.rms() }),
        }
    }

    /// Returns true if a rotary axis moves.
    fn has_rotary_motion(&self) -> bool {
        let axes = self.trial.machine.axes().iter();
        axes.zip(&self.moves).any(|(axis, &moves)| moves && axis.kind() == AxisKind::Rotary)
    }

    /// Adds future setpoints to the polyline before a position cycle, if it is the reference.
    ///
    /// `is_rapid` returns true for instants whose setpoints are reached at rapid traverse.
    pub(super) fn push_preview(&mut self, simulation: &Simulation, is_rapid: impl Fn(i64) -> bool) {
        let Some(Tracker::Setpoints(tracker)) = &mut self.tracker else { return };
        let horizon = contour_preview_cycles(simulation.period());
        let first = if self.has_preview { horizon } else { 0 };
        self.has_preview = true;
        for periods in first..=horizon {
            let instant = simulation.next_instant() + i64::from(periods);
            if let Some(rows) = self.programmed {
                let index = usize::try_from(instant).unwrap_or(0);
                if let Some(row) = rows.chunks_exact(self.preview.len().max(1)).nth(index) {
                    self.preview.copy_from_slice(row);
                }
            } else {
                simulation.all_psec_ahead(periods, &mut self.preview);
            }
            let (pose, is_rapid) = (self.kinematics.forward(&self.preview), is_rapid(instant));
            self.has_cuts |= !is_rapid && tracker.moves_to(&pose);
            self.turn.push(pose, seconds(simulation.time_of(instant)));
            tracker.push(pose, is_rapid);
        }
    }

    pub(super) fn finish(self) -> TrialOutcome {
        let figures = self.figures();
        let machine = self.trial.machine;
        let turns = figures.orientation.is_some() && self.has_rotary_motion();
        let recording = self.recorder.map(|recorder| {
            let mut recording = recorder.finish(machine, &self.moves, turns);
            recording.circles = self.circles.into_traces();
            recording
        });
        TrialOutcome { figures, recording }
    }
}
