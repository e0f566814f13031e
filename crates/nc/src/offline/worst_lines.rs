//! Lines of a part program with the largest contour errors.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::io::{self, BufRead};

use nalgebra::Vector3;
use virtual_axes_core::assess::StandingTurn;
use virtual_axes_core::config::{AxisKind, MachineConfig};
use virtual_axes_core::encoding::{TextEncoding, decode};
use virtual_axes_core::kinematics::{Kinematics, ToolPose};
use virtual_axes_core::statistics::rms_of_sum;
use virtual_axes_core::text::{BuiltinFiles, cut};
use virtual_axes_core::trajectory::PathPlace;
use virtual_axes_core::trial::Tick;
use virtual_axes_core::units::{Nanoseconds, seconds};

use super::operations::{OperationMeter, OperationSummary};
use super::setpoints::ProgramTrack;
use crate::builtin::open_program;
use crate::interpret::read_line;
use crate::plan::{ProgrammedCorner, ProgrammedPath};

/// Number of lines reported.
const COUNT: usize = 10;
/// Position cycles that the position may lag behind its setpoint.
const WINDOW: usize = 112;
/// Position cycles before and after the nearest setpoint that explain an error.
const BEFORE: usize = 16;
const AFTER: usize = 16;
/// Length of the programmed path that is kept before the window of setpoints, m.
const KEPT_PATH: f64 = 0.05;
/// Distance behind a corner, as a multiple of the distance from it and in addition, m, at which it is passed.
const CORNER_REACH: f64 = 4.0;
const CORNER_MARGIN: f64 = 1e-4;
/// Distance before a corner from which on it is followed, m.
const CORNER_AHEAD: f64 = 0.01;
/// Smallest step of a setpoint that counts as motion, m or rad.
const RESOLUTION: f64 = 1e-8;
/// Change of direction in one step that is a reversal of the path, rad.
const REVERSAL_TURN: f64 = 2.6;
/// Smallest turn, rad, and largest radius, m, of a corner.
const CORNER_TURN: f64 = 0.2;
const CORNER_RADIUS: f64 = 2e-3;
/// Smallest turn that is a curved path, rad.
const SMALLEST_TURN: f64 = 5e-3;
/// Longest text of a line that is shown, characters.
const TEXT: usize = 100;
/// Largest change of the distance between the path positions of a program and its reference, relative to the path.
const REFERENCE_DRIFT: f64 = 0.05;
/// Number of bytes of a line that are read; the interpreter rejects longer lines.
const LINE_BYTES: usize = 1 << 13;

/// Cause of an error, by the setpoints around it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Cause {
    /// Change of direction.
    Corner,
    /// Change of sign of the speed of the named axis.
    Reversal(String),
    /// Curved path.
    Curvature,
    /// Standstill at the end of the motion.
    Stop,
    /// Straight path: feed and its changes.
    Feed,
}

impl Cause {
    /// Returns the cause as a text.
    pub fn text(&self) -> String {
        match self {
            Cause::Corner => "corner".to_owned(),
            Cause::Reversal(axis) => format!("reversal of {axis}"),
            Cause::Curvature => "curvature".to_owned(),
            Cause::Stop => "stop".to_owned(),
            Cause::Feed => "feed".to_owned(),
        }
    }
}

/// Largest contour error of a line.
#[derive(Debug, Clone)]
pub struct WorstLine {
    /// Position cycle of the contour error. At a corner that is cut, error and blending are the distances from the corner.
    pub cycle: CycleError,
    /// Text of the line.
    pub text: String,
    /// Largest orientation error on the line, rad: angle between the tool axis and that of the nearest setpoint.
    pub orientation: f64,
    /// Cause of the error.
    pub cause: Cause,
}

/// Contour errors against the programmed path, at position cycles.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ProgrammedErrors {
    /// Largest contour error, m.
    pub max: f64,
    /// RMS contour error, m.
    pub rms: f64,
    /// Largest share of blending, m: distance of the planned path from the programmed path.
    pub blending: f64,
    /// Largest share of the drives, m: distance of the tool tip from the planned path.
    pub drives: f64,
}

/// Sums of contour errors.
#[derive(Debug, Clone, Copy, Default)]
struct ErrorSums {
    largest: ProgrammedErrors,
    sum_of_squares: f64,
    count: u64,
}

impl ErrorSums {
    fn add(&mut self, cycle: &CycleError) {
        let CycleError { contour_error, blending, drives, .. } = *cycle;
        let largest = &mut self.largest;
        largest.max = largest.max.max(contour_error);
        largest.blending = largest.blending.max(blending);
        largest.drives = largest.drives.max(drives);
        self.sum_of_squares += contour_error * contour_error;
        self.count += 1;
    }

    fn figures(&self) -> Option<ProgrammedErrors> {
        let rms = rms_of_sum(self.sum_of_squares, self.count)?;
        Some(ProgrammedErrors { rms, ..self.largest })
    }
}

/// Times and worst lines of a part program.
#[derive(Debug, Clone)]
pub struct ProgramFigures {
    /// Time from the first to the last setpoint, s.
    pub cycle_time: f64,
    /// Duration of all motions at their programmed feed, s.
    pub programmed_time: f64,
    /// Times and energy by operation, tool and line.
    pub operations: OperationSummary,
    /// Contour errors of motions at feed; `None` without any.
    pub cuts: Option<ProgrammedErrors>,
    /// Contour errors at rapid traverse; `None` without any.
    pub rapids: Option<ProgrammedErrors>,
    /// Lines with the largest contour errors of motions at feed, the largest first.
    pub worst_lines: Vec<WorstLine>,
    /// Lines with the largest contour errors at rapid traverse, the largest first.
    pub worst_rapids: Vec<WorstLine>,
    /// Notes on dialect, assumptions and words without effect: line and text.
    pub notes: Vec<(usize, String)>,
}

/// Place, feed and contour error of the tool tip in a position cycle.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct CycleError {
    /// Time, s.
    pub time: f64,
    /// Source line of the nearest setpoint, from 1; 0 before the first motion.
    pub line: usize,
    /// Simulated tool tip in the workpiece frame, m.
    pub tip: [f64; 3],
    /// Nearest point of the programmed path, m.
    pub reference: [f64; 3],
    /// Path position of the nearest setpoint from the start of the program, m.
    pub path_position: f64,
    /// Programmed feed of the tool tip, m/s; infinite at rapid traverse, NaN where rotary axes move alone.
    pub programmed_feed: f64,
    /// Speed of the simulated tool tip, m/s.
    pub reached_feed: f64,
    /// Contour error against the programmed path, m.
    pub contour_error: f64,
    /// Distance of the planned path from the programmed path, m.
    pub blending: f64,
    /// Distance of the tool tip from the planned path, m.
    pub drives: f64,
    /// True at rapid traverse.
    pub is_rapid: bool,
}

/// Corner of the programmed path that is being passed.
#[derive(Debug, Clone)]
struct PassedCorner {
    corner: ProgrammedCorner,
    /// Smallest distance of the planned path, m.
    planned: f64,
    /// Smallest distance of the tool tip, m, with that position cycle and the number of its setpoint.
    nearest: Option<(f64, CycleError, usize)>,
}

impl PassedCorner {
    /// Returns true if the path has moved away from the corner.
    fn is_passed(&self, path_position: f64) -> bool {
        let reach = self.planned.max(self.nearest.map_or(0.0, |(distance, ..)| distance));
        path_position > self.corner.path_position + CORNER_REACH * reach + CORNER_MARGIN
    }
}

/// Setpoint with its line.
struct TrackedSetpoint {
    pose: ToolPose,
    joints: Vec<f64>,
    place: PathPlace,
    /// Programmed feed of the tool tip, m/s; NaN where rotary axes move alone.
    tip_feed: f64,
}

/// Contour and orientation errors by source line: distance of the simulated tool tip from the programmed path, and angle
/// between the tool axes at the nearest point of the polyline of setpoints, at each position cycle. The planned path is that
/// polyline.
pub struct LineErrors {
    kinematics: Kinematics,
    names: Vec<String>,
    is_linear: Vec<bool>,
    /// Position period, s.
    period: f64,
    window: VecDeque<TrackedSetpoint>,
    /// Simulated tool poses with their times, ns, that wait for later setpoints, and the setpoints of the same time,
    /// delayed by α.
    poses: VecDeque<(ToolPose, Nanoseconds, ToolPose)>,
    turn: StandingTurn,
    programmed: ProgrammedPath,
    /// Path position on the reference beyond that of the run, m; `None` without a reference.
    reference_offset: Option<f64>,
    /// Path position of the cycle before, m.
    last_position: f64,
    /// Largest contour error of each line at feed, m; `None` if they are not kept.
    line_maxima: Option<BTreeMap<usize, f64>>,
    operations: OperationMeter,
    /// Corners that are being passed.
    corners: VecDeque<PassedCorner>,
    /// Contour errors of motions at feed and at rapid traverse.
    sums: [ErrorSums; 2],
    /// Number of setpoints before the window.
    passed: usize,
    /// Worst lines of motions at feed and at rapid traverse, with the number of their nearest setpoint until the cause is
    /// known.
    worst: [Vec<(WorstLine, Option<usize>)>; 2],
    /// Simulated tool tip of the position cycle before.
    last_tip: Option<Vector3<f64>>,
    /// Line of the cycle before, and the largest orientation error in the cycles in a row on it, rad.
    last_line: (usize, f64),
}

impl LineErrors {
    /// Creates the errors of a run on `machine`.
    pub fn new(machine: &MachineConfig) -> Self {
        let names = machine.axes().iter().map(|axis| axis.name().to_owned()).collect();
        Self {
            kinematics: Kinematics::new(machine),
            names,
            is_linear: machine.axes().iter().map(|axis| axis.kind() == AxisKind::Linear).collect(),
            period: seconds(machine.periods().position),
            window: VecDeque::new(),
            poses: VecDeque::new(),
            passed: 0,
            turn: StandingTurn::default(),
            programmed: ProgrammedPath::default(),
            reference_offset: None,
            last_position: 0.0,
            line_maxima: None,
            operations: OperationMeter::new(machine),
            corners: VecDeque::new(),
            sums: Default::default(),
            worst: Default::default(),
            last_tip: None,
            last_line: (0, 0.0),
        }
    }

    /// Measures contour errors against the whole programmed path of another program, of which that of the run is a variant
    /// with moved points: lines in the same order, and lengths that differ by less than 5 %.
    #[must_use]
    pub fn with_reference(mut self, path: ProgrammedPath) -> Self {
        (self.programmed, self.reference_offset) = (path, Some(0.0));
        self
    }

    /// Keeps the largest contour error of each line for [`into_cuts`](Self::into_cuts).
    #[must_use]
    pub(crate) fn with_line_maxima(mut self) -> Self {
        self.line_maxima = Some(BTreeMap::new());
        self
    }

    /// Returns the path position on the programmed path, m, of one of the run.
    fn on_programmed(&self, path_position: f64) -> f64 {
        path_position + self.reference_offset.unwrap_or(0.0)
    }

    /// Follows the path position on the reference.
    fn follow_reference(&mut self, path_position: f64, found: f64) {
        let step = (path_position - self.last_position).max(0.0) * REFERENCE_DRIFT;
        self.last_position = path_position;
        if let Some(offset) = &mut self.reference_offset {
            *offset += (found - path_position - *offset).clamp(-step, step);
        }
    }

    /// Adds a position cycle and takes its setpoint from `track`; other ticks are ignored.
    ///
    /// Returns feed and error of an earlier cycle, for which later setpoints were awaited.
    pub fn add(&mut self, tick: &Tick<'_>, track: &mut ProgramTrack) -> Option<CycleError> {
        if !tick.position_instant {
            return None;
        }
        match self.reference_offset {
            None => self.programmed.append(&mut track.programmed),
            Some(_) => track.programmed = ProgrammedPath::default(),
        }
        let samples = || tick.machine.axes().iter().map(|axis| axis.sample());
        let joints: Vec<f64> = samples().map(|sample| sample.psec).collect();
        let start = PathPlace { programmed_feed: f64::INFINITY, ..PathPlace::default() };
        let last = self.window.back();
        let (place, activity) = track.setpoints.pop_front().unzip();
        self.operations.add(&track.comments, activity, tick.machine);
        let place = place.or(last.map(|last| last.place)).unwrap_or(start);
        let moves = |linear: bool| {
            let steps =
                last.into_iter().flat_map(|last| last.joints.iter().zip(&joints)).zip(&self.is_linear);
            steps.into_iter().any(|((from, to), is_linear)| *is_linear == linear && from != to)
        };
        let tip_feed = if moves(false) && !moves(true) { f64::NAN } else { place.programmed_feed };
        let pose = self.kinematics.forward(&joints);
        self.window.push_back(TrackedSetpoint { pose, joints, place, tip_feed });
        if self.window.len() > WINDOW {
            self.window.pop_front();
            self.passed += 1;
            let first = self.on_programmed(self.window[0].place.path_position);
            self.programmed.drop_before(first - KEPT_PATH);
        }
        self.plan_corners();
        self.explain(AFTER);
        let positions: Vec<f64> = samples().map(|sample| sample.position).collect();
        self.turn.push(pose, seconds(tick.time));
        let delayed: Vec<f64> = samples().map(|sample| sample.delayed_psec).collect();
        let delayed = self.kinematics.forward(&delayed);
        self.poses.push_back((self.kinematics.forward(&positions), tick.time, delayed));
        if self.poses.len() > AFTER { self.evaluate() } else { None }
    }

    /// Evaluates the first waiting tool pose.
    fn evaluate(&mut self) -> Option<CycleError> {
        let (actual, time, delayed) = self.poses.pop_front()?;
        let (mut drives, mut nearest, mut axis, mut reference) = (f64::INFINITY, 0, actual.axis, actual.tip);
        let mut path_position = 0.0;
        for (i, pair) in self.window.iter().zip(self.window.iter().skip(1)).enumerate() {
            let [from, to] = [&pair.0.pose, &pair.1.pose];
            let (distance, along) = distance(&actual.tip, &from.tip, &to.tip);
            if distance < drives {
                let [start, end] = [pair.0.place.path_position, pair.1.place.path_position];
                path_position = start + (end - start) * along;
                (drives, nearest, axis) = (distance, i + 1, from.axis + (to.axis - from.axis) * along);
                reference = from.tip + (to.tip - from.tip) * along;
            }
        }
        if self.turn.is_turning(seconds(time)) {
            axis = delayed.axis;
        }
        let last_tip = self.last_tip.replace(actual.tip);
        drives.is_finite().then(|| {
            let on_programmed = self.on_programmed(path_position);
            let nearest_to = |tip| self.programmed.nearest(tip, on_programmed);
            let blending = nearest_to(&reference).map_or(0.0, |(point, _)| (reference - point).norm());
            let found;
            (reference, found) = nearest_to(&actual.tip).unwrap_or((reference, on_programmed));
            self.follow_reference(path_position, found);
            let contour_error = (actual.tip - reference).norm();
            let TrackedSetpoint { place, tip_feed, .. } = &self.window[nearest];
            let found = CycleError {
                time: seconds(time),
                line: place.line,
                tip: actual.tip.into(),
                reference: reference.into(),
                path_position: place.path_position,
                programmed_feed: *tip_feed,
                reached_feed: last_tip.map_or(0.0, |last| (actual.tip - last).norm() / self.period),
                contour_error,
                blending,
                drives,
                is_rapid: place.programmed_feed.is_infinite(),
            };
            let orientation = Kinematics::orientation_error(&axis, &actual.axis);
            let before = if self.last_line.0 == place.line { self.last_line.1 } else { 0.0 };
            self.last_line = (place.line, orientation.max(before));
            self.record(&found, self.passed + nearest, None);
            self.pass_corners([last_tip.unwrap_or(actual.tip), actual.tip], path_position, &found, nearest);
            found
        })
    }

    /// Adds the newest setpoint to the corners near it.
    fn plan_corners(&mut self) {
        let Some(newest) = self.window.back() else { return };
        let before = self.window.iter().rev().nth(1).unwrap_or(newest);
        let ahead = newest.place.path_position + self.reference_offset.unwrap_or(0.0) + CORNER_AHEAD;
        while let Some(corner) = self.programmed.next_corner(ahead) {
            self.corners.push_back(PassedCorner { corner, planned: f64::INFINITY, nearest: None });
        }
        for passed in &mut self.corners {
            let planned = distance(&passed.corner.tip, &before.pose.tip, &newest.pose.tip).0;
            passed.planned = passed.planned.min(planned);
        }
    }

    /// Follows the corners of the programmed path near `path_position`: of a corner that is cut, the distance from the
    /// planned path and from the tool path is the error.
    fn pass_corners(
        &mut self,
        [before, tip]: [Vector3<f64>; 2],
        path_position: f64,
        cycle: &CycleError,
        nearest: usize,
    ) {
        for passed in &mut self.corners {
            let actual = distance(&passed.corner.tip, &before, &tip).0;
            if passed.nearest.is_none_or(|(least, ..)| actual < least) {
                passed.nearest = Some((actual, *cycle, self.passed + nearest));
            }
        }
        let path_position = self.on_programmed(path_position);
        while self.corners.front().is_some_and(|corner| corner.is_passed(path_position)) {
            self.corners.pop_front().into_iter().for_each(|corner| self.record_corner(corner));
        }
    }

    fn record_corner(&mut self, passed: PassedCorner) {
        if let Some((actual, mut cycle, number)) = passed.nearest
            && actual > cycle.contour_error
        {
            (cycle.contour_error, cycle.blending) = (actual, passed.planned);
            // Where the planned path cuts the corner by more than the drives, an axis that reverses in the blend is no cause.
            let cause = (2.0 * passed.planned > actual).then_some(Cause::Corner);
            self.record(&cycle, number, cause);
        }
    }

    /// Adds an error to the figures and worst lines; without a `cause`, that follows from the setpoints about `number`.
    fn record(&mut self, cycle: &CycleError, number: usize, cause: Option<Cause>) {
        let line = cycle.line;
        let kind = usize::from(cycle.is_rapid);
        self.sums[kind].add(cycle);
        if let (Some(maxima), false) = (&mut self.line_maxima, cycle.is_rapid) {
            let largest = maxima.entry(line).or_insert(0.0);
            *largest = largest.max(cycle.contour_error);
        }
        let (lines, error) = (&mut self.worst[kind], cycle.contour_error);
        let known = lines.iter().position(|(worst, _)| worst.cycle.line == line);
        let mut orientation = self.last_line.1;
        if let Some((worst, _)) = known.and_then(|known| lines.get_mut(known)) {
            worst.orientation = worst.orientation.max(orientation);
            orientation = worst.orientation;
        }
        let least = lines.last().map_or(0.0, |(worst, _)| worst.cycle.contour_error);
        let is_new =
            known.map_or(lines.len() < COUNT || error > least, |i| error > lines[i].0.cycle.contour_error);
        if !is_new {
            return;
        }
        if let Some(index) = known {
            lines.remove(index);
        }
        let number = cause.is_none().then_some(number);
        let (text, cause) = (String::new(), cause.unwrap_or(Cause::Feed));
        let entry = WorstLine { cycle: *cycle, text, orientation, cause };
        let place = lines.partition_point(|(worst, _)| worst.cycle.contour_error >= error);
        lines.insert(place, (entry, number));
        lines.truncate(COUNT);
    }

    /// Determines the causes of errors with `after` later setpoints.
    fn explain(&mut self, after: usize) {
        let end = self.passed + self.window.len();
        let mut lines = std::mem::take(&mut self.worst);
        for (worst, number) in lines.iter_mut().flatten() {
            if let Some(number) = number.take_if(|number| *number + after <= end) {
                worst.cause = self.cause(number.saturating_sub(self.passed));
            }
        }
        self.worst = lines;
    }

    fn cause(&self, index: usize) -> Cause {
        let range = index.saturating_sub(BEFORE)..(index + AFTER).min(self.window.len());
        let (mut turn, mut sharpest, mut curvature, mut is_stop) = (0.0, 0.0_f64, 0.0_f64, false);
        let mut direction: Option<Vector3<f64>> = None;
        let mut reversed = None;
        let mut speeds = vec![0.0; self.names.len()];
        for i in range.start + 1..range.end {
            let (from, to) = (&self.window[i - 1], &self.window[i]);
            let step = to.pose.tip - from.pose.tip;
            if step.norm() > RESOLUTION {
                let angle = direction.map_or(0.0, |before| Kinematics::orientation_error(&before, &step));
                (turn, sharpest) = (turn + angle, sharpest.max(angle));
                curvature = curvature.max(angle / step.norm());
                direction = Some(step);
            }
            is_stop = direction.is_some() && step.norm() <= RESOLUTION;
            for (j, before) in speeds.iter_mut().enumerate() {
                let speed = to.joints[j] - from.joints[j];
                if speed.abs() > RESOLUTION {
                    reversed = reversed.or((speed * *before < 0.0).then_some(j));
                    *before = speed;
                }
            }
        }
        match reversed.and_then(|joint| self.names.get(joint)) {
            Some(axis) if sharpest > REVERSAL_TURN => Cause::Reversal(axis.clone()),
            _ if turn > CORNER_TURN && curvature * CORNER_RADIUS > 1.0 => Cause::Corner,
            _ if is_stop => Cause::Stop,
            Some(axis) => Cause::Reversal(axis.clone()),
            _ if turn > SMALLEST_TURN => Cause::Curvature,
            _ => Cause::Feed,
        }
    }

    /// Evaluates the last position cycles and calls `visit` with each.
    fn evaluate_rest(&mut self, mut visit: impl FnMut(&CycleError)) {
        while !self.poses.is_empty() {
            self.evaluate().iter().for_each(&mut visit);
        }
        for passed in std::mem::take(&mut self.corners) {
            self.record_corner(passed);
        }
    }

    /// Evaluates the last position cycles, calls `visit` with each, and returns the contour errors at feed: of the program,
    /// `None` without any, and the largest of each line, m, if they are kept.
    pub(crate) fn into_cuts(
        mut self,
        visit: impl FnMut(&CycleError),
    ) -> (Option<ProgrammedErrors>, BTreeMap<usize, f64>) {
        self.evaluate_rest(visit);
        (self.sums[0].figures(), self.line_maxima.unwrap_or_default())
    }

    /// Evaluates the last position cycles, calls `visit` with each, and returns the figures of the program with the texts of
    /// the lines from the program `name` of `builtin` or the file `name`; `track` has its times.
    ///
    /// # Errors
    ///
    /// Returns an error if the file cannot be read.
    pub fn finish(
        mut self,
        name: &str,
        builtin: &BuiltinFiles,
        track: &ProgramTrack,
        visit: impl FnMut(&CycleError),
    ) -> io::Result<ProgramFigures> {
        self.evaluate_rest(visit);
        self.explain(0);
        let mut operations = self.operations.finish(&track.comments);
        let numbers = self.worst.iter().flatten().map(|(worst, _)| worst.cycle.line);
        let numbers = numbers.chain(operations.energy_lines.iter().map(|one| one.line)).collect();
        let texts = line_texts(name, builtin, &numbers)?;
        let text = |line: usize| texts.get(&line).cloned().unwrap_or_default();
        let [worst_lines, worst_rapids] = self.worst.map(|lines| {
            lines.into_iter().map(|(worst, _)| WorstLine { text: text(worst.cycle.line), ..worst }).collect()
        });
        operations.energy_lines.iter_mut().for_each(|one| one.text = text(one.line));
        let ProgramTrack { cycle_time, programmed_time, .. } = *track;
        let [cuts, rapids] = self.sums.map(|sums| sums.figures());
        Ok(ProgramFigures {
            cycle_time,
            programmed_time,
            operations,
            cuts,
            rapids,
            worst_lines,
            worst_rapids,
            notes: track.notes(),
        })
    }
}

/// Returns the texts of source lines, shortened, from the program `name` of `builtin` or the file `name`.
///
/// # Errors
///
/// Returns an error if the file cannot be read.
pub fn line_texts(
    name: &str,
    builtin: &BuiltinFiles,
    lines: &BTreeSet<usize>,
) -> io::Result<BTreeMap<usize, String>> {
    let mut reader = open_program(name, builtin)?;
    let encoding = TextEncoding::of(reader.fill_buf()?);
    let mut texts = BTreeMap::new();
    let mut line = Vec::new();
    for number in 1..=lines.last().copied().unwrap_or(0) {
        if read_line(encoding, &mut reader, LINE_BYTES, &mut line)? == 0 {
            break;
        }
        if lines.contains(&number) {
            texts.insert(number, cut(decode(&line).trim(), TEXT));
        }
    }
    Ok(texts)
}

/// Returns the distance of a point from the line between two points, and the place of its nearest point from 0 to 1.
fn distance(point: &Vector3<f64>, from: &Vector3<f64>, to: &Vector3<f64>) -> (f64, f64) {
    let step = to - from;
    let squared = step.norm_squared();
    let along = if squared > 0.0 { ((point - from).dot(&step) / squared).clamp(0.0, 1.0) } else { 0.0 };
    ((point - from - step * along).norm(), along)
}
