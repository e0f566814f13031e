//! Points and feeds of a program that can be changed.

use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::TAU;
use std::io::Cursor;

use nalgebra::{Matrix3, Vector3};
use virtual_axes_core::kinematics::Kinematics;

use super::super::error::CompileError;
use super::super::simulation::Runs;
use super::super::words::WordLine;
use super::line_start::{LineStart, line_starts};
use crate::interpret::{Interpreter, InterpreterOptions, LineModes, TipTransform};
use crate::motion::{
    AXIS_COUNT, AXIS_LETTERS, Coordinates, Feed, MotionKind, PathControl, PlanarArc, ProgramEvent,
    ProgramMotion, ProgramStep, is_rotary,
};

/// Change of direction from which a junction is a corner, rad.
const CORNER_TURN: f64 = 0.05;
/// Distance from a corner within which errors are those of the corner, m.
const CORNER_REACH: f64 = 3e-3;
/// Weight of the size of the shift of a corner beside its errors.
const CORNER_WEIGHT: f64 = 0.1;
/// Part of a line within which extra points are placed from each of its ends, and from which one in its middle is.
const SPLIT_PART: f64 = 0.4;
const MIDDLE: f64 = 0.2;
/// Difference of the tool tip from the coordinates that counts as the same on all lines, m.
const SAME: f64 = 1e-8;
/// Sweep of a whole turn, and the least one of an arc whose radius is corrected, rad.
const WHOLE_TURN: f64 = TAU - 1e-6;
pub(super) const LEAST_SWEEP: f64 = 0.2;
/// Distance of the sweep from half a turn within which an arc by R is not changed, rad.
const HALF_TURN_MARGIN: f64 = 0.2;

/// End of a part of a cut.
#[derive(Debug, Clone)]
pub(in super::super) struct CutPoint {
    pub(super) programmed: Coordinates,
    pub(super) at: Coordinates,
    /// Tool tip in the workpiece frame, m.
    pub tip: Vector3<f64>,
    /// True if the point is not moved.
    pub is_fixed: bool,
    /// 1 for the coordinates that can be moved, 0 for those that the program may not know.
    pub free: Vector3<f64>,
}

/// Curve of a piece.
#[derive(Debug, Clone, Copy)]
pub(in super::super) enum CutShape {
    Line,
    Arc(PlanarArc),
}

/// Cut, or part of a cut with extra points.
#[derive(Debug, Clone)]
pub(in super::super) struct CutPiece {
    /// Motion, and source line from 1.
    pub(super) motion: usize,
    pub line: usize,
    pub from: usize,
    pub to: usize,
    pub shape: CutShape,
}

/// Program with the cuts that can be changed.
pub(in super::super) struct ProgramModel {
    pub(super) lines: Vec<String>,
    pub(super) line_end: &'static str,
    pub(super) motions: Vec<(ProgramMotion, LineModes)>,
    pub(super) events: Vec<ProgramEvent>,
    pub(super) words: BTreeMap<usize, WordLine>,
    pub nodes: Vec<CutPoint>,
    pub pieces: Vec<CutPiece>,
    /// Pieces of each line that is changed, in order.
    pub(super) by_line: BTreeMap<usize, std::ops::Range<usize>>,
    /// First and last line of each sequence of changed lines.
    pub(super) chains: Vec<[usize; 2]>,
    starts: Vec<LineStart>,
    /// Number of lines at feed that are not changed, by reason.
    pub left: BTreeMap<&'static str, usize>,
}

/// Changes of the points and feeds of a program.
#[derive(Debug, Clone)]
pub(in super::super) struct Changes {
    /// Shift of each node, m.
    pub shifts: Vec<Vector3<f64>>,
    /// Change of the radius of each piece, m.
    pub radii: Vec<f64>,
    /// Factor of the feed of each piece.
    pub feeds: Vec<f64>,
}

/// Points that are added to the lines of a program.
#[derive(Clone, Copy)]
pub(in super::super) struct ExtraPoints<'a> {
    /// Distances from corners, m.
    pub distances: &'a [f64],
    /// Place of a point on a line on which rotary axes turn, as a part of its length.
    pub middles: &'a BTreeMap<usize, f64>,
}

/// Steps of a program.
pub(super) type Steps = (Vec<(ProgramMotion, LineModes)>, Vec<ProgramEvent>);

/// Interprets a program.
pub(super) fn steps(text: &str, name: &str, options: &InterpreterOptions) -> Result<Steps, CompileError> {
    let mut interpreter = Interpreter::new(Cursor::new(text), name, options.clone());
    let (mut motions, mut events) = (Vec::new(), Vec::new());
    while let Some(step) = interpreter.next() {
        match step.map_err(|error| CompileError::Program(error.to_string()))? {
            ProgramStep::Motion(motion) => motions.push((motion, interpreter.line_modes())),
            ProgramStep::Event { event, .. } => events.push(event),
        }
    }
    Ok((motions, events))
}

impl ProgramModel {
    /// Reads a program; lines of `left_out` are not changed.
    ///
    /// # Errors
    ///
    /// An invalid program.
    pub fn read(
        (text, name): (&str, &str),
        (options, kinematics): (&InterpreterOptions, &Kinematics),
        extra: ExtraPoints<'_>,
        left_out: &BTreeSet<usize>,
    ) -> Result<Self, CompileError> {
        let line_end = if text.contains("\r\n") { "\r\n" } else { "\n" };
        let lines: Vec<String> = text.replace("\r\n", "\n").split('\n').map(str::to_owned).collect();
        let (motions, events) = steps(text, name, options)?;
        let mut model = Self {
            lines,
            line_end,
            motions,
            events,
            words: BTreeMap::new(),
            nodes: Vec::new(),
            pieces: Vec::new(),
            by_line: BTreeMap::new(),
            chains: Vec::new(),
            starts: Vec::new(),
            left: BTreeMap::new(),
        };
        let editable = model.editable(left_out);
        let mut from = 0;
        while from < editable.len() {
            let mut to = from + 1;
            if editable[from] {
                while to < editable.len() && editable[to] && model.follows(to) {
                    to += 1;
                }
                model.add_chain(from..to, options.kinematics.as_ref(), kinematics, extra);
            }
            from = to;
        }
        Ok(model)
    }

    /// Returns for each motion whether its line can be changed.
    fn editable(&mut self, left_out: &BTreeSet<usize>) -> Vec<bool> {
        let mut count: BTreeMap<usize, usize> = BTreeMap::new();
        self.motions.iter().for_each(|(motion, _)| *count.entry(motion.line).or_default() += 1);
        // A return alone in the middle of a text ends a line for the interpreter.
        let has_lines = !self.lines.iter().any(|line| line.contains('\r'));
        let mut reasons: BTreeMap<usize, &'static str> = BTreeMap::new();
        self.starts = line_starts(&self.lines);
        for (motion, modes) in &self.motions {
            if motion.feed == Feed::Rapid {
                continue;
            }
            let words = self.lines.get(motion.line - 1).filter(|_| has_lines);
            let words = words.and_then(|line| WordLine::read(line));
            let half = |arc: &PlanarArc| (arc.sweep.abs() - TAU / 2.0).abs() < HALF_TURN_MARGIN;
            let reason = match (&motion.kind, words) {
                _ if count.get(&motion.line) != Some(&1) => "executed more than once, or several motions",
                (MotionKind::Nurbs(_) | MotionKind::Rapid, _) => "spline",
                _ if !modes.is_plain
                    || start_of(&self.starts, motion.line).is_compensated
                    || !matches!(motion.feed, Feed::Linear(_)) =>
                {
                    "cycle, probing, compensation, rotation, scaling or feed that is not per minute"
                }
                (_, None) => "words that are no literal numbers, or other codes",
                (MotionKind::Arc(arc), Some(words)) if words.has('R') && half(arc) => "half turn by R",
                (MotionKind::Arc(_), Some(words)) if !self.is_start_known(motion, modes, &words) => {
                    "arc whose start depends on an offset, a reference, a probe, an optional line or a jump"
                }
                _ if left_out.contains(&motion.line) => "position used elsewhere in the program",
                (_, Some(words)) => {
                    self.words.insert(motion.line, words);
                    continue;
                }
            };
            reasons.insert(motion.line, reason);
        }
        reasons.values().for_each(|reason| *self.left.entry(reason).or_default() += 1);
        self.motions
            .iter()
            .map(|(motion, _)| self.words.contains_key(&motion.line) && !reasons.contains_key(&motion.line))
            .collect()
    }

    /// Returns true if a line begins at a position that the program has given for all axes that it moves.
    fn is_start_known(&self, motion: &ProgramMotion, modes: &LineModes, words: &WordLine) -> bool {
        let known = start_of(&self.starts, motion.line).known;
        let is_in_plane = |axis: usize| match &motion.kind {
            MotionKind::Arc(arc) => arc.plane.axes()[..2].contains(&axis),
            _ => false,
        };
        let is_moved = |axis: usize| words.has(AXIS_LETTERS[axis]) || is_in_plane(axis);
        modes.is_incremental || (0..AXIS_COUNT).all(|axis| known[axis] || !is_moved(axis))
    }

    /// Returns true if a motion follows that before it with nothing but comments and feeds between their lines.
    fn follows(&self, index: usize) -> bool {
        let [before, line] = [index - 1, index].map(|index| self.motions[index].0.line);
        before < line
            && self.lines[before..line - 1]
                .iter()
                .all(|text| WordLine::is_comment(text) || WordLine::feed_alone(text).is_some())
    }

    fn add_chain(
        &mut self,
        chain: std::ops::Range<usize>,
        transform: Option<&TipTransform>,
        kinematics: &Kinematics,
        extra: ExtraPoints<'_>,
    ) {
        let tip = |at: &Coordinates, tcp: Option<f64>| match transform {
            Some(transform) => kinematics.forward(&transform.joints(at, tcp)).tip,
            None => Vector3::from_column_slice(&at[..3]),
        };
        let offset = |at: &Coordinates, tcp| tip(at, tcp) - Vector3::from_column_slice(&at[..3]);
        let first = &self.motions[chain.start].0;
        let place = offset(&first.start, first.tcp_length);
        let is_shifted = self.motions[chain.clone()]
            .iter()
            .all(|(motion, _)| (offset(&motion.end, motion.tcp_length) - place).norm() < SAME);
        let node = |at: Coordinates, motion: &ProgramMotion, modes: &LineModes, is_fixed: bool| CutPoint {
            programmed: std::array::from_fn(|axis| modes.programmed[axis] + at[axis] - motion.end[axis]),
            tip: tip(&at, motion.tcp_length),
            at,
            is_fixed: is_fixed || !is_shifted,
            free: Vector3::from_fn(|axis, _| {
                let is_known = modes.is_incremental || start_of(&self.starts, motion.line).known[axis];
                f64::from(u8::from(is_known || self.words[&motion.line].has(AXIS_LETTERS[axis])))
            }),
        };
        let (motion, modes) = &self.motions[chain.start];
        self.nodes.push(node(motion.start, motion, modes, true));
        self.chains.push([motion.line, self.motions[chain.end - 1].0.line]);
        for index in chain.clone() {
            let (motion, modes) = &self.motions[index];
            let begins = self.pieces.len();
            let is_last = index + 1 == chain.end;
            let shape = match motion.kind {
                MotionKind::Arc(arc) => CutShape::Arc(arc),
                _ => CutShape::Line,
            };
            let mut places = vec![1.0];
            let is_split = is_shifted
                && matches!((shape, motion.path_control), (CutShape::Line, PathControl::Blend(_)))
                && self.is_start_known(motion, modes, &self.words[&motion.line]);
            if is_split && turns(motion) {
                // A control that overlaps motions of rotary axes is slower with more of them.
                places.extend(extra.middles.get(&motion.line));
                places.sort_by(f64::total_cmp);
            } else if is_split {
                let length = (direction(motion, true).1).norm();
                let near: Vec<f64> = extra
                    .distances
                    .iter()
                    .map(|distance| distance / length)
                    .filter(|part| *part < SPLIT_PART)
                    .collect();
                if index == chain.start || self.is_corner(index) {
                    places.extend(&near);
                }
                if is_last || self.is_corner(index + 1) {
                    places.extend(near.iter().map(|part| 1.0 - part));
                }
                places.sort_by(f64::total_cmp);
            }
            for place in places {
                let at = std::array::from_fn(|axis| match place < 1.0 {
                    true => motion.start[axis] + place * (motion.end[axis] - motion.start[axis]),
                    false => motion.end[axis],
                });
                let to = self.nodes.len();
                self.nodes.push(node(at, motion, modes, is_last && place == 1.0));
                self.pieces.push(CutPiece { motion: index, line: motion.line, from: to - 1, to, shape });
            }
            self.by_line.insert(motion.line, begins..self.pieces.len());
        }
    }

    /// Returns true if the path has a corner before a motion, or begins or ends an arc there.
    fn is_corner(&self, index: usize) -> bool {
        let [before, after] = [index - 1, index].map(|index| &self.motions[index].0);
        let is_arc = |motion: &ProgramMotion| matches!(motion.kind, MotionKind::Arc(_));
        is_arc(before)
            || is_arc(after)
            || direction(before, true).0.angle(&direction(after, false).0) > CORNER_TURN
    }

    /// Returns no changes.
    pub fn unchanged(&self) -> Changes {
        Changes {
            shifts: vec![Vector3::zeros(); self.nodes.len()],
            radii: vec![0.0; self.pieces.len()],
            feeds: vec![1.0; self.pieces.len()],
        }
    }

    /// Returns the programmed feed of a piece, m/s; infinite where it is no speed.
    pub fn feed(&self, piece: usize) -> f64 {
        match self.motions[self.pieces[piece].motion].0.feed {
            Feed::Linear(feed) => feed,
            _ => f64::INFINITY,
        }
    }

    /// Returns true for an arc of at least a whole turn.
    pub fn is_whole_turn(&self, piece: usize) -> bool {
        matches!(self.pieces[piece].shape, CutShape::Arc(arc) if arc.sweep.abs() >= WHOLE_TURN)
    }

    /// Returns the unit vector from the center of an arc to one of its ends, in three coordinates; zero for a line.
    pub fn normal(&self, piece: usize, at_end: bool) -> Vector3<f64> {
        let CutPiece { from, to, shape, .. } = self.pieces[piece];
        let CutShape::Arc(arc) = shape else { return Vector3::zeros() };
        let [first, second, _] = arc.plane.axes();
        let at = &self.nodes[if at_end { to } else { from }].at;
        let mut normal = Vector3::zeros();
        (normal[first], normal[second]) = (at[first] - arc.center[0], at[second] - arc.center[1]);
        normal.try_normalize(0.0).unwrap_or_default()
    }

    /// Returns true if a line ends at a corner with another line.
    pub fn is_line_corner(&self, piece: usize) -> bool {
        let (one, two) = (&self.pieces[piece], &self.pieces[piece + 1]);
        matches!((one.shape, two.shape), (CutShape::Line, CutShape::Line))
            && self.along(piece).angle(&self.along(piece + 1)) > CORNER_TURN
    }

    /// Returns the vector from start to end of a line, m.
    fn along(&self, piece: usize) -> Vector3<f64> {
        let CutPiece { from, to, .. } = self.pieces[piece];
        self.nodes[to].tip - self.nodes[from].tip
    }

    /// Returns the shift of the corner at the end of a line that has the largest errors normal to both lines near it, by
    /// least squares.
    pub fn corner_error(&self, piece: usize, tips: [&[(usize, Vector3<f64>)]; 2]) -> Vector3<f64> {
        let mut matrix = Matrix3::identity() * CORNER_WEIGHT;
        let mut error = Vector3::zeros();
        for (piece, is_end, tips) in [(piece, true, tips[0]), (piece + 1, false, tips[1])] {
            let along = self.along(piece).try_normalize(0.0).unwrap_or_default();
            matrix += Matrix3::identity() - along * along.transpose();
            error += self.largest_error(piece, is_end, tips);
        }
        matrix.try_inverse().unwrap_or_default() * error
    }

    /// Returns the places of the largest errors of lines on which rotary axes turn, which can be where an axis reverses,
    /// as parts of their lengths; none near their ends, and none of errors below `least`, m.
    pub fn middles(&self, runs: &Runs, least: f64) -> BTreeMap<usize, f64> {
        let mut largest: BTreeMap<usize, (f64, f64)> = BTreeMap::new();
        let lines: BTreeMap<usize, usize> = (0..self.pieces.len())
            .filter(|&piece| {
                let CutPiece { motion, shape, .. } = self.pieces[piece];
                matches!(shape, CutShape::Line) && turns(&self.motions[motion].0)
            })
            .map(|piece| (self.pieces[piece].line, piece))
            .collect();
        for (line, tip) in runs.plants.iter().flat_map(|run| &run.tips) {
            let Some(&piece) = lines.get(line) else { continue };
            let along = self.along(piece);
            let from_start = tip - self.nodes[self.pieces[piece].from].tip;
            let place = from_start.dot(&along) / along.norm_squared();
            let error = (from_start - place * along).norm();
            if (MIDDLE..1.0 - MIDDLE).contains(&place) && error >= largest.get(line).map_or(least, |l| l.0) {
                largest.insert(*line, (error, place));
            }
        }
        largest.into_iter().map(|(line, (_, place))| (line, place)).collect()
    }

    /// Returns the largest error vector normal to a line near one of its ends.
    fn largest_error(&self, piece: usize, at_end: bool, tips: &[(usize, Vector3<f64>)]) -> Vector3<f64> {
        let along = self.along(piece);
        let length = along.norm();
        let along = along.try_normalize(0.0).unwrap_or_default();
        let start = self.nodes[self.pieces[piece].from].tip;
        let error = |(_, tip): &(usize, Vector3<f64>)| {
            let place = (tip - start).dot(&along);
            let distance = if at_end { length - place } else { place };
            (0.0..=CORNER_REACH.min(length)).contains(&distance).then(|| tip - start - along * place)
        };
        let larger = |a: &Vector3<f64>, b: &Vector3<f64>| a.norm_squared().total_cmp(&b.norm_squared());
        tips.iter().filter_map(error).max_by(larger).unwrap_or_default()
    }

    /// Returns the center of an arc in the workpiece frame, its radius, m, and the axes of its plane.
    pub fn circle(&self, piece: usize) -> Option<(Vector3<f64>, f64, [usize; 2])> {
        let CutPiece { from, shape, .. } = self.pieces[piece];
        let CutShape::Arc(arc) = shape else { return None };
        let [first, second, _] = arc.plane.axes();
        let node = &self.nodes[from];
        let mut center = node.tip;
        center[first] += arc.center[0] - node.at[first];
        center[second] += arc.center[1] - node.at[second];
        let radius = (node.at[first] - arc.center[0]).hypot(node.at[second] - arc.center[1]);
        (arc.sweep.abs() > LEAST_SWEEP).then_some((center, radius, [first, second]))
    }

    /// Returns a text with the number of its line.
    pub fn line(&self, line: usize) -> &str {
        self.lines.get(line.saturating_sub(1)).map_or("", |text| text.trim())
    }
}

/// Returns what is known at the start of a line, from 1; nothing for a line of another file.
fn start_of(starts: &[LineStart], line: usize) -> LineStart {
    starts.get(line.wrapping_sub(1)).copied().unwrap_or_default()
}

/// Returns true if a rotary axis turns.
fn turns(motion: &ProgramMotion) -> bool {
    (0..AXIS_COUNT).any(|axis| is_rotary(axis) && motion.start[axis] != motion.end[axis])
}

/// Returns the unit vector along the path at an end of a motion, and the chord of the motion, m.
fn direction(motion: &ProgramMotion, at_end: bool) -> (Vector3<f64>, Vector3<f64>) {
    let [start, end] = [&motion.start, &motion.end].map(|at| Vector3::from_column_slice(&at[..3]));
    let chord = end - start;
    let tangent = match &motion.kind {
        MotionKind::Arc(arc) => {
            let [first, second, normal] = arc.plane.axes();
            let at = if at_end { end } else { start };
            let turn = arc.sweep.signum();
            let mut tangent = Vector3::zeros();
            tangent[first] = -turn * (at[second] - arc.center[1]);
            tangent[second] = turn * (at[first] - arc.center[0]);
            tangent[normal] = chord[normal] / arc.sweep.abs();
            tangent
        }
        _ => chord,
    };
    (tangent.try_normalize(0.0).unwrap_or_default(), chord)
}
