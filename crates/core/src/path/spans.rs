//! Blocks divided into spans, each with its own constant limits.

use super::block::Derivatives;
use super::bounds::{Samples, fastest};
use super::curve::JointCurve;
use super::profile::{Limits, Ramp};
use crate::config::LimitsConfig;
use crate::units::REVOLUTION;

/// Angle between two samples of an arc, rad: a 128th of a turn, so that the quadrants are among them.
const ARC_STEP: f64 = REVOLUTION / 128.0;
/// Cells into which a polynomial piece of a spline is divided: candidates for spans.
const CELLS_OF_PIECE: usize = 4;
/// Samples of a cell, without its end.
const SAMPLES_OF_CELL: usize = 6;
/// Largest turn of the tables, or of an arc, in one cell of a path of the tip, rad.
const TURN_OF_CELL: f64 = 0.25;
/// Most cells of a block, whatever its turns: what is missed then is found when setpoints are checked.
const MAX_CELLS: usize = 2000;
/// Merging two spans must not cost more than that part of their time.
const MERGE_COST: f64 = 1.01;

/// A part of a block that is passed with constant limits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Draft {
    pub block: usize,
    pub s_from: f64,
    pub s_to: f64,
    pub limits: Limits,
    /// Whether the joints run along a straight line in it.
    pub straight: bool,
}

impl Draft {
    pub fn length(&self) -> f64 {
        self.s_to - self.s_from
    }
}

/// Samples of a whole block.
pub(super) fn sample_block(curve: &mut JointCurve<'_>) -> Samples {
    let mut samples = Samples::default();
    let cells = if let Some(places) = one_span(curve) { vec![places] } else { cells(curve) };
    let mut derivatives = Derivatives::new(curve.block().joints());
    for cell in cells {
        sample(curve, &cell, &mut derivatives, &mut samples);
    }
    samples
}

/// A cell: the smooth piece that it lies in, and the places of its samples, both its ends among them.
struct Cell {
    piece: (f64, f64),
    places: Vec<f64>,
}

impl Cell {
    fn ends(&self) -> (f64, f64) {
        (self.places.first().copied().unwrap_or(0.0), self.places.last().copied().unwrap_or(0.0))
    }
}

fn sample(curve: &mut JointCurve<'_>, cell: &Cell, derivatives: &mut Derivatives, samples: &mut Samples) {
    for &s in &cell.places {
        curve.derivatives(s, cell.piece, derivatives);
        samples.push(derivatives);
    }
}

/// The one cell of a straight line, or of an arc of the joints, which is as curved everywhere.
fn one_span(curve: &JointCurve<'_>) -> Option<Cell> {
    let length = curve.block().length();
    let piece = (0.0, length);
    if curve.is_straight() {
        return Some(Cell { piece, places: vec![0.0] });
    }
    let circle = curve.block().circle().filter(|_| !curve.is_bent())?;
    let start = curve.block().start();
    let [x, y] = [0, 1].map(|i| start[circle.plane[i]] - circle.center[i]);
    // Where the spoke points in multiples of the step, and from there on over one turn at most.
    let turns = (y.atan2(x) / ARC_STEP * circle.sweep.signum()).fract();
    let swept = circle.sweep.abs().min(REVOLUTION + ARC_STEP) / ARC_STEP;
    let per_step = length / (circle.sweep.abs() / ARC_STEP);
    let inner = (0..=swept.ceil() as usize).map(|i| (i as f64 - turns) * per_step);
    let mut places: Vec<f64> = inner.filter(|s| *s > 0.0 && *s < length).collect();
    places.insert(0, 0.0);
    places.push(length);
    Some(Cell { piece, places })
}

/// The cells of any other block.
fn cells(curve: &JointCurve<'_>) -> Vec<Cell> {
    let block = curve.block();
    let knots = block.knots();
    let turns = if curve.is_bent() {
        let sweep = block.circle().map_or(0.0, |circle| circle.sweep.abs());
        let steps = block.start().iter().zip(block.end()).map(|(start, end)| (end - start).abs());
        // Tables and others alike: a path of the tip that turns by more than its tables do is a spline.
        ((sweep + steps.fold(0.0, f64::max)) / TURN_OF_CELL).ceil().min(MAX_CELLS as f64) as usize
    } else {
        0
    };
    let pieces = knots.len().saturating_sub(1).max(1);
    let per_piece = if block.is_line() || block.circle().is_some() {
        turns.max(1)
    } else {
        turns.div_ceil(pieces).max(CELLS_OF_PIECE)
    };
    let mut cells = Vec::with_capacity(pieces * per_piece);
    for pair in knots.windows(2) {
        let (from, to) = (pair[0], pair[1]);
        let at = |i: usize, parts: usize| {
            if i == parts { to } else { from + (to - from) * (i as f64 / parts as f64) }
        };
        for cell in 0..per_piece {
            let parts = per_piece * SAMPLES_OF_CELL;
            let first = cell * SAMPLES_OF_CELL;
            let places = (first..=first + SAMPLES_OF_CELL).map(|i| at(i, parts)).collect();
            // Difference quotients need a piece not much longer than their cell.
            let piece = (at(cell, per_piece), at(cell + 1, per_piece));
            cells.push(Cell { piece, places });
        }
    }
    cells
}

/// The first and the last smooth piece of a block, short enough for difference quotients.
pub(super) fn end_pieces(curve: &JointCurve<'_>) -> [(f64, f64); 2] {
    let whole = (0.0, curve.block().length());
    if !curve.is_bent() {
        let knots = curve.block().knots();
        return match knots.as_slice() {
            [first, second, .., before, last] => [(*first, *second), (*before, *last)],
            _ => [whole; 2],
        };
    }
    let cells = cells(curve);
    [cells.first(), cells.last()].map(|cell| cell.map_or(whole, |cell| cell.piece))
}

/// Divides a block into spans.
pub(super) struct Divider<'a> {
    pub joints: &'a [LimitsConfig],
    pub cap: Limits,
    /// Length of the whole block.
    pub length: f64,
}

impl Divider<'_> {
    /// The spans of block `block`, in order; also its samples.
    pub fn divide(&self, curve: &mut JointCurve<'_>, block: usize) -> Vec<Draft> {
        let mut samples = Samples::default();
        let mut derivatives = Derivatives::new(self.joints.len());
        let straight = curve.is_straight();
        if let Some(cell) = one_span(curve) {
            sample(curve, &cell, &mut derivatives, &mut samples);
            let limits = fastest(samples.all(), self.joints, &self.cap, self.length);
            return vec![Draft { block, s_from: 0.0, s_to: self.length, limits, straight }];
        }
        let cells = cells(curve);
        for cell in &cells {
            sample(curve, cell, &mut derivatives, &mut samples);
        }
        let per_cell = SAMPLES_OF_CELL + 1;
        let make = |from: usize, to: usize| {
            let rows = samples.range(from * per_cell, to * per_cell, self.joints.len());
            let limits = fastest(rows, self.joints, &self.cap, self.length);
            let (s_from, s_to) = (cells[from].ends().0, cells[to - 1].ends().1);
            Draft { block, s_from, s_to, limits, straight }
        };
        divide(0, cells.len(), &make)
    }
}

/// Time of passing `spans`, each at its speed, with what changes of speed cost.
fn time(spans: &[Draft]) -> f64 {
    let passing: f64 = spans.iter().map(|span| span.length() / span.limits.velocity).sum();
    let changing = spans.windows(2).map(|pair| {
        let (a, b) = (pair[0].limits, pair[1].limits);
        let (slow, fast) = if a.velocity < b.velocity { (a, b) } else { (b, a) };
        let ramp = Ramp::new(slow.velocity, fast.velocity, &fast);
        0.5 * ramp.duration() * (1.0 - slow.velocity / fast.velocity)
    });
    passing + changing.sum::<f64>()
}

/// Spans of cells `from` to `to`: those of its halves, or one if that is as good.
fn divide(from: usize, to: usize, make: &impl Fn(usize, usize) -> Draft) -> Vec<Draft> {
    let whole = vec![make(from, to)];
    if to - from <= 1 {
        return whole;
    }
    let middle = from + (to - from) / 2;
    let mut halves = divide(from, middle, make);
    halves.extend(divide(middle, to, make));
    if time(&whole) <= MERGE_COST * time(&halves) { whole } else { halves }
}
