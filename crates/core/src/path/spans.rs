//! Division of blocks into spans with constant feed limits.

use super::bounds::{fastest_limits, push_sample};
use super::curve::JointCurve;
use super::derivatives::Derivatives;
use super::profile::{FeedLimits, Ramp};
use crate::config::LimitsConfig;
use crate::units::REVOLUTION;

/// Angle between two samples of an arc, rad: a 128th of a turn, so that the quadrants are sampled.
const ARC_STEP: f64 = REVOLUTION / 128.0;
/// Cells per polynomial piece of a spline: candidates for spans.
const CELLS_OF_PIECE: usize = 4;
/// Samples per cell, without its end.
const SAMPLES_OF_CELL: usize = 6;
/// Largest rotation of the tables, or of an arc, in one cell of a workpiece path, rad.
const TURN_OF_CELL: f64 = 0.25;
/// Largest number of cells of a block. Limits missed by the coarser sampling are found by the verification
/// of the setpoints.
const MAX_CELLS: usize = 2000;
/// Largest relative increase in time accepted for merging two spans.
const MERGE_COST: f64 = 1.01;

/// Part of a block with constant feed limits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct SpanDraft {
    pub block: usize,
    pub s_from: f64,
    pub s_to: f64,
    pub limits: FeedLimits,
    /// True if the joints move along a straight line.
    pub is_straight: bool,
}

impl SpanDraft {
    pub fn length(&self) -> f64 {
        self.s_to - self.s_from
    }
}

/// Returns the magnitudes of the three derivatives of each joint along a whole block, sample by sample.
pub(super) fn sample_block(curve: &mut JointCurve<'_>) -> Vec<[f64; 3]> {
    let cells = single_cell(curve).map_or_else(|| cells(curve), |cell| vec![cell]);
    sample(curve, &cells)
}

/// A cell: its smooth piece and the arc lengths of its samples, including both ends.
struct Cell {
    piece: (f64, f64),
    samples_at: Vec<f64>,
}

impl Cell {
    fn ends(&self) -> (f64, f64) {
        (self.samples_at.first().copied().unwrap_or(0.0), self.samples_at.last().copied().unwrap_or(0.0))
    }
}

fn sample(curve: &mut JointCurve<'_>, cells: &[Cell]) -> Vec<[f64; 3]> {
    let (mut rows, mut derivatives) = (Vec::new(), Derivatives::new(curve.block().joints()));
    for cell in cells {
        for &s in &cell.samples_at {
            curve.derivatives(s, cell.piece, &mut derivatives);
            push_sample(&derivatives, &mut rows);
        }
    }
    rows
}

/// Returns the single cell of a straight line, or of an arc in joint space, which has constant curvature.
fn single_cell(curve: &JointCurve<'_>) -> Option<Cell> {
    let length = curve.block().length();
    let piece = (0.0, length);
    if curve.is_straight() {
        return Some(Cell { piece, samples_at: vec![0.0] });
    }
    let circle = curve.block().circle().filter(|_| !curve.has_moving_tables())?;
    let start = curve.block().start();
    let [x, y] = [0, 1].map(|i| start[circle.plane[i]] - circle.center[i]);
    // Phase of the start radius in multiples of the step; one turn at most is sampled.
    let turns = (y.atan2(x) / ARC_STEP * circle.sweep.signum()).fract();
    let swept = circle.sweep.abs().min(REVOLUTION + ARC_STEP) / ARC_STEP;
    let per_step = length / (circle.sweep.abs() / ARC_STEP);
    let inner = (0..=swept.ceil() as usize).map(|i| (i as f64 - turns) * per_step);
    let mut samples_at: Vec<f64> = inner.filter(|s| *s > 0.0 && *s < length).collect();
    samples_at.insert(0, 0.0);
    samples_at.push(length);
    Some(Cell { piece, samples_at })
}

/// Returns the cells of any other block.
fn cells(curve: &JointCurve<'_>) -> Vec<Cell> {
    let block = curve.block();
    let knots = block.knots();
    let turns = if curve.has_moving_tables() {
        let sweep = block.circle().map_or(0.0, |circle| circle.sweep.abs());
        let steps = block.start().iter().zip(block.end()).map(|(start, end)| (end - start).abs());
        // All coordinates count: a workpiece path that turns by more than its tables is a spline.
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
            let samples_at = (first..=first + SAMPLES_OF_CELL).map(|i| at(i, parts)).collect();
            // Difference quotients need a piece not much longer than their cell.
            let piece = (at(cell, per_piece), at(cell + 1, per_piece));
            cells.push(Cell { piece, samples_at });
        }
    }
    cells
}

/// Returns the first and the last smooth piece of a block, short enough for difference quotients.
pub(super) fn end_pieces(curve: &JointCurve<'_>) -> [(f64, f64); 2] {
    let whole = (0.0, curve.block().length());
    if !curve.has_moving_tables() {
        let knots = curve.block().knots();
        return match knots.as_slice() {
            [first, second, .., before, last] => [(*first, *second), (*before, *last)],
            _ => [whole; 2],
        };
    }
    let cells = cells(curve);
    [cells.first(), cells.last()].map(|cell| cell.map_or(whole, |cell| cell.piece))
}

/// Divider of a block into spans.
pub(super) struct SpanDivider<'a> {
    pub joints: &'a [LimitsConfig],
    pub cap: FeedLimits,
    /// Arc length of the whole block, m or rad.
    pub length: f64,
}

impl SpanDivider<'_> {
    /// Returns the spans of block `block` in order.
    pub fn divide(&self, curve: &mut JointCurve<'_>, block: usize) -> Vec<SpanDraft> {
        let is_straight = curve.is_straight();
        if let Some(cell) = single_cell(curve) {
            let limits = fastest_limits(&sample(curve, &[cell]), self.joints, &self.cap, self.length);
            return vec![SpanDraft { block, s_from: 0.0, s_to: self.length, limits, is_straight }];
        }
        let cells = cells(curve);
        let rows = sample(curve, &cells);
        let per_cell = (SAMPLES_OF_CELL + 1) * self.joints.len();
        let make = |from: usize, to: usize| {
            let limits =
                fastest_limits(&rows[from * per_cell..to * per_cell], self.joints, &self.cap, self.length);
            let (s_from, s_to) = (cells[from].ends().0, cells[to - 1].ends().1);
            SpanDraft { block, s_from, s_to, limits, is_straight }
        };
        divide(0, cells.len(), &make)
    }
}

/// Returns the time for passing `spans`, each at its speed limit, with an estimate for the speed changes.
fn time(spans: &[SpanDraft]) -> f64 {
    let passing: f64 = spans.iter().map(|span| span.length() / span.limits.velocity).sum();
    let changing = spans.windows(2).map(|pair| {
        let (a, b) = (pair[0].limits, pair[1].limits);
        let (slow, fast) = if a.velocity < b.velocity { (a, b) } else { (b, a) };
        let ramp = Ramp::new(slow.velocity, fast.velocity, &fast);
        0.5 * ramp.duration() * (1.0 - slow.velocity / fast.velocity)
    });
    passing + changing.sum::<f64>()
}

/// Returns the spans of the cells `from..to`: those of both halves, or a single one if its time is about
/// the same.
fn divide(from: usize, to: usize, make: &impl Fn(usize, usize) -> SpanDraft) -> Vec<SpanDraft> {
    let whole = vec![make(from, to)];
    if to - from <= 1 {
        return whole;
    }
    let middle = from + (to - from) / 2;
    let mut halves = divide(from, middle, make);
    halves.extend(divide(middle, to, make));
    if time(&whole) <= MERGE_COST * time(&halves) { whole } else { halves }
}
