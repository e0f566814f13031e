//! Text of a program with changed points and feeds.

use nalgebra::{Vector2, Vector3};
use virtual_axes_core::units::MILLIMETER;

use super::super::words::{WordLine, number, rounded};
use super::program_model::{Changes, CutPiece, CutShape, LEAST_SWEEP, ProgramModel, steps};
use crate::interpret::{InterpreterOptions, LineModes};
use crate::motion::{AXIS_COUNT, AXIS_LETTERS, Coordinates, Feed, PlanarArc, is_rotary};

/// Words of the center of an arc by its axis.
const CENTERS: [char; 3] = ['I', 'J', 'K'];
/// Largest difference of an end of a motion from the planned one beside the rounding of its words, m, and in all, rad.
const ROUNDING: f64 = 3.5e-7;
const ROTARY_ROUNDING: f64 = 1e-6;

/// Text of a changed program.
pub(in super::super) struct ChangedProgram {
    pub text: String,
    /// Piece of each line, and its source line, from 1.
    pub pieces: Vec<Option<usize>>,
    pub sources: Vec<usize>,
}

impl ProgramModel {
    /// Writes the program with changes.
    pub fn write(&self, changes: &Changes) -> ChangedProgram {
        let mut out = Vec::new();
        let (mut pieces, mut sources) = (Vec::new(), Vec::new());
        let mut carried = [0.0; AXIS_COUNT];
        let mut feed = 0.0;
        for (line, text) in (1..).zip(&self.lines) {
            let (Some(range), Some(words)) = (self.by_line.get(&line), self.words.get(&line)) else {
                feed = WordLine::feed_alone(text).unwrap_or(feed);
                out.push(text.clone());
                pieces.push(None);
                sources.push(line);
                continue;
            };
            let modes = &self.motions[self.pieces[range.start].motion].1;
            if self.chains.iter().any(|[first, _]| *first == line) {
                carried = self.nodes[self.pieces[range.start].from].programmed;
                feed = modes.feed_word;
            }
            for piece in range.clone() {
                let is_first = piece == range.start;
                let mut numbers = self.points(piece, changes, words, &mut carried, is_first);
                let decimals = words.decimals('F').max(if modes.unit == MILLIMETER { 1 } else { 3 });
                let wanted = match changes.feeds[piece] {
                    1.0 => modes.feed_word,
                    factor => rounded(modes.feed_word * factor, decimals),
                };
                let is_given = is_first && words.has('F');
                if wanted != if is_given { modes.feed_word } else { feed } {
                    numbers.push(('F', number(wanted, decimals)));
                }
                feed = wanted;
                out.push(match is_first {
                    true => words.with(&numbers),
                    false => {
                        numbers.iter().map(|(letter, n)| format!("{letter}{n}")).collect::<Vec<_>>().join(" ")
                    }
                });
                pieces.push(Some(piece));
                sources.push(line);
            }
            if self.chains.iter().any(|[_, last]| *last == line) && feed != modes.feed_word {
                out.push(format!("F{}", number(modes.feed_word, 6)));
                pieces.push(None);
                sources.push(line);
            }
        }
        ChangedProgram { text: out.join(self.line_end), pieces, sources }
    }

    /// Returns the words of the end and the center of a piece; `carried` are the programmed coordinates before and after it.
    fn points(
        &self,
        piece: usize,
        changes: &Changes,
        words: &WordLine,
        carried: &mut Coordinates,
        is_first: bool,
    ) -> Vec<(char, String)> {
        let CutPiece { motion, from, to, shape, .. } = self.pieces[piece];
        let modes = &self.motions[motion].1;
        let least = least_decimals(modes);
        let start = *carried;
        let mut numbers = Vec::new();
        for (axis, letter) in AXIS_LETTERS.into_iter().enumerate() {
            let unit = if is_rotary(axis) { virtual_axes_core::units::DEGREE } else { modes.unit };
            let decimals = words.decimals(letter).max(least);
            let shift = if axis < 3 { changes.shifts[to][axis] } else { 0.0 };
            let target = self.nodes[to].programmed[axis] + shift;
            let base = if modes.is_incremental { carried[axis] } else { 0.0 };
            let moves = (target - carried[axis]).abs() > 0.5 * 0.1_f64.powi(decimals as i32) * unit;
            let given = words.value(letter).filter(|_| is_first);
            let value = (target - base) / unit;
            match given {
                Some(given) if (value - given).abs() < 1e-9 => carried[axis] = target,
                Some(_) => {
                    numbers.push((letter, number(value, decimals)));
                    carried[axis] = base + rounded(value, decimals) * unit;
                }
                None if moves => {
                    numbers.push((letter, number(value, decimals)));
                    carried[axis] = base + rounded(value, decimals) * unit;
                }
                None => {}
            }
        }
        let CutShape::Arc(arc) = shape else { return numbers };
        let center = self.center(piece, &arc, changes);
        let [first, second, _] = arc.plane.axes();
        if let Some(radius) = words.value('R') {
            let end = &self.nodes[to];
            let at = [first, second].map(|axis| end.at[axis] + changes.shifts[to][axis]);
            let new = (at[0] - center[0]).hypot(at[1] - center[1]) / modes.unit * radius.signum();
            if changes.radii[piece] != 0.0 || changes.shifts[from] != changes.shifts[to] {
                numbers.push(('R', number(new, words.decimals('R').max(least))));
            }
            return numbers;
        }
        let node = &self.nodes[from];
        for (axis, center) in [first, second].into_iter().zip(center) {
            let letter = CENTERS[axis];
            let decimals = words.decimals(letter).max(least);
            let programmed = node.programmed[axis] - node.at[axis] + center;
            let base = if modes.has_absolute_centers { 0.0 } else { start[axis] };
            let value = (programmed - base) / modes.unit;
            let tolerance = 0.5 * 0.1_f64.powi(decimals as i32);
            if (value - words.value(letter).unwrap_or(0.0)).abs() > tolerance {
                numbers.push((letter, number(value, decimals)));
            }
        }
        numbers
    }

    /// Returns the center of a changed arc, in its plane: through both ends, and for a part of a turn through its middle.
    fn center(&self, piece: usize, arc: &PlanarArc, changes: &Changes) -> [f64; 2] {
        let CutPiece { from, to, .. } = self.pieces[piece];
        let [first, second, _] = arc.plane.axes();
        let center = Vector2::from(arc.center);
        let plane = |vector: &Vector3<f64>| Vector2::new(vector[first], vector[second]);
        let (start, end) = (plane(&changes.shifts[from]), plane(&changes.shifts[to]));
        if self.is_whole_turn(piece) {
            let moved = center + start - plane(&self.normal(piece, false)) * changes.radii[piece];
            return moved.into();
        }
        let at = |node: usize| Vector2::new(self.nodes[node].at[first], self.nodes[node].at[second]);
        let middle = nalgebra::Rotation2::new(0.5 * arc.sweep) * (at(from) - center);
        let raised = match arc.sweep.abs() > LEAST_SWEEP {
            true => middle.normalize() * changes.radii[piece],
            false => 0.5 * (start + end),
        };
        let (a, b, c) = (at(from) + start, center + middle + raised, at(to) + end);
        through(a, b, c).unwrap_or(arc.center)
    }

    /// Interprets a changed program and compares it with the planned changes. Returns the source line of the first motion
    /// that differs.
    pub fn verify(
        &self,
        changed: &ChangedProgram,
        changes: &Changes,
        name: &str,
        options: &InterpreterOptions,
    ) -> Result<(), usize> {
        let (motions, events) = steps(&changed.text, name, options).map_err(|_| 0_usize)?;
        let mut found = motions.iter();
        let mut last = 0;
        for (index, (motion, _)) in self.motions.iter().enumerate() {
            let ends: Vec<(Coordinates, Option<usize>)> = match self.by_line.get(&motion.line) {
                Some(range) => range.clone().map(|piece| (self.end(piece, changes), Some(piece))).collect(),
                None => vec![(motion.end, None)],
            };
            for (end, piece) in ends {
                let Some((new, _)) = found.next() else { return Err(last) };
                let modes = &self.motions[index].1;
                let rounding = ROUNDING + 0.5 * 0.1_f64.powi(least_decimals(modes) as i32) * modes.unit;
                let is_near = end.iter().zip(&new.end).enumerate().all(|(axis, (wanted, end))| {
                    let rounding = if is_rotary(axis) { ROTARY_ROUNDING } else { rounding };
                    (wanted - end).abs() < rounding
                });
                let is_same = std::mem::discriminant(&motion.kind) == std::mem::discriminant(&new.kind)
                    && motion.path_control == new.path_control
                    && motion.tcp_length == new.tcp_length;
                let has_feed = match (motion.feed, new.feed, piece) {
                    (Feed::Linear(old), Feed::Linear(new), Some(piece)) => {
                        (new / old / changes.feeds[piece] - 1.0).abs() < 0.02
                    }
                    (old, new, _) => old == new,
                };
                if !is_near || !is_same || !has_feed {
                    return Err(motion.line);
                }
                last = motion.line;
            }
        }
        if found.next().is_some() || events != self.events { Err(last) } else { Ok(()) }
    }

    fn end(&self, piece: usize, changes: &Changes) -> Coordinates {
        let to = self.pieces[piece].to;
        let shift = changes.shifts[to];
        std::array::from_fn(|axis| self.nodes[to].at[axis] + if axis < 3 { shift[axis] } else { 0.0 })
    }
}

/// Returns the least number of decimals of words: increments have no more than a control resolves, since it would add up their
/// rounding.
fn least_decimals(modes: &LineModes) -> usize {
    let of_millimeters = if modes.is_incremental { 3 } else { 4 };
    if modes.unit == MILLIMETER { of_millimeters } else { of_millimeters + 1 }
}

/// Returns the center of the circle through three points; `None` on a line.
fn through(a: Vector2<f64>, b: Vector2<f64>, c: Vector2<f64>) -> Option<[f64; 2]> {
    let (b, c) = (b - a, c - a);
    let cross = 2.0 * b.perp(&c);
    if cross.abs() < f64::MIN_POSITIVE {
        return None;
    }
    let (bb, cc) = (b.norm_squared(), c.norm_squared());
    Some([a.x + (c.y * bb - b.y * cc) / cross, a.y + (b.x * cc - c.x * bb) / cross])
}
