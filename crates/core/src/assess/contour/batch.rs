//! Nearest points of consecutive positions on the polyline, with one window of segments for all of them.
//!
//! All positions lie within a ball. A segment whose distance from the center exceeds that of the nearest segment by
//! more than twice the radius is nearest to none of them, so few segments remain, which are compared with all
//! positions. Distances and foot points are bit-identical to those of the search for single positions.

use super::{ContourTracker, FootPoint, LOOK_BACK};
use crate::simd::{AlignedBuffer, SliceOperation, vectorize};

/// Number of coordinates of the search for several positions; positions have at most as many.
pub(in crate::assess) const COLUMNS: usize = 3;
/// Largest number of segments compared with the ball; in longer windows, positions are searched one by one.
const MAX_SEGMENTS: usize = 256;
/// Segments searched before those that the first position may have: the positions may move back so far.
const MARGIN: u64 = 8;
/// Slack of the comparison with the ball, relative to the size of the coordinates: far more than rounding.
const SLACK: f64 = 1e-12;

/// Foot points of consecutive positions on the polyline.
#[derive(Debug, Clone, Default)]
pub struct FootPoints {
    /// Nearest segments, by the index of their first setpoint.
    pub segment: Vec<u64>,
    /// Positions on the segments, from 0 at the start to 1 at the end.
    pub along: AlignedBuffer,
    /// Squares of the distances, m².
    pub square_distance: AlignedBuffer,
}

impl FootPoints {
    /// Creates `count` foot points with undetermined values.
    pub fn new(count: usize) -> Self {
        let mut feet = FootPoints::default();
        feet.resize(count);
        feet
    }

    /// Returns the foot point of the position of an index.
    pub fn get(&self, index: usize) -> FootPoint {
        FootPoint { square_distance: self.square_distance[index], along: self.along[index] }
    }

    /// Sets the number of positions; their values are undetermined.
    pub fn resize(&mut self, count: usize) {
        self.segment.resize(count, 0);
        self.along.resize(count);
        self.square_distance.resize(count);
    }
}

impl ContourTracker {
    /// Searches the nearest points of consecutive positions in order, as [`nearest`](Self::nearest) does for each.
    ///
    /// `positions` contains the coordinates of up to three axes, m, slices of equal lengths; those without an axis are
    /// 0. Without a setpoint all distances are 0.
    pub(in crate::assess) fn nearest_all(&mut self, positions: [&[f64]; COLUMNS], feet: &mut FootPoints) {
        debug_assert!(self.dimension <= COLUMNS, "a coordinate for each axis");
        feet.resize(positions[0].len());
        if !vectorize(WindowSearch { tracker: self, positions, feet }) {
            self.nearest_one_by_one(&positions, feet);
        }
    }

    /// Searches the nearest points of consecutive positions one by one; `positions` contains the coordinates of each
    /// axis.
    pub(in crate::assess) fn nearest_one_by_one(
        &mut self,
        positions: &[impl AsRef<[f64]>],
        feet: &mut FootPoints,
    ) {
        let none = (0, FootPoint { square_distance: 0.0, along: 0.0 });
        for index in 0..feet.segment.len() {
            let found = self.nearest_from(|axis| positions[axis].as_ref()[index]);
            let (segment, foot) = found.unwrap_or(none);
            feet.segment[index] = segment;
            (feet.along[index], feet.square_distance[index]) = (foot.along, foot.square_distance);
        }
    }

    /// Searches one window for all positions. Returns false, without a change of the tracker, if the windows of the
    /// single positions could have another result.
    #[inline(always)]
    fn search(&mut self, positions: [&[f64]; COLUMNS], feet: &mut FootPoints) -> bool {
        let oldest = self.oldest();
        let low = self.nearest.saturating_sub(LOOK_BACK + MARGIN).max(oldest);
        let end = self.end_of_search();
        if low >= end || end - low > MAX_SEGMENTS as u64 || positions[0].is_empty() {
            return false;
        }
        let (center, radius) = ball(positions);
        let (start, segments) = (self.column_index(low), (end - low) as usize);
        let window = [0, 1, 2].map(|axis| &self.columns[axis][start..=start + segments]);
        let mut squares = [0.0; MAX_SEGMENTS];
        let squares = &mut squares[..segments];
        let reciprocals = &self.reciprocals[start..start + segments];
        let least = square_distances(center, window, reciprocals, squares);
        let slack = SLACK * (1.0 + radius + center.iter().map(|value| value.abs()).sum::<f64>());
        let bound = least.sqrt() + 2.0 * radius + slack;
        if !bound.is_finite() {
            return false;
        }
        feet.square_distance.fill(f64::INFINITY);
        for (at, _) in squares.iter().enumerate().filter(|(_, square)| **square <= bound * bound) {
            let ends = [at, at + 1].map(|at| window.map(|column| column[at]));
            let line = SegmentLine::new(ends, reciprocals[at]);
            consider_segment(positions, line, low + at as u64, feet);
        }
        let (first, last) = feet
            .segment
            .iter()
            .fold((self.nearest, self.nearest), |(first, last), &k| (first.min(k), last.max(k)));
        // Each window of a single position begins after `low` and contains the segment found in the common one.
        let same = first + LOOK_BACK >= last && (first.saturating_sub(LOOK_BACK) >= low || low == oldest);
        if same {
            self.nearest = feet.segment.last().copied().unwrap_or(self.nearest);
        }
        same
    }
}

/// Search of one window for all positions.
struct WindowSearch<'a> {
    tracker: &'a mut ContourTracker,
    positions: [&'a [f64]; COLUMNS],
    feet: &'a mut FootPoints,
}

impl SliceOperation for WindowSearch<'_> {
    type Output = bool;

    #[inline(always)]
    fn run(self) -> bool {
        self.tracker.search(self.positions, self.feet)
    }
}

/// Returns the middle one of positions, and the largest distance of a position from it, NaN with a coordinate that is
/// not a number.
#[inline(always)]
fn ball(positions: [&[f64]; COLUMNS]) -> ([f64; COLUMNS], f64) {
    let count = positions[0].len();
    let center = positions.map(|values| values[count / 2]);
    let [xs, ys, zs] = positions.map(|values| &values[..count]);
    // Squares are in the order of their bits; NaN is the largest.
    let mut largest = 0;
    for index in 0..count {
        let (x, y, z) = (xs[index] - center[0], ys[index] - center[1], zs[index] - center[2]);
        largest = largest.max((x * x + y * y + z * z).to_bits());
    }
    (center, f64::from_bits(largest).sqrt())
}

/// Computes the squares of the distances of a position from the segments between consecutive points; returns the
/// least.
#[inline(always)]
fn square_distances(
    position: [f64; COLUMNS],
    points: [&[f64]; COLUMNS],
    reciprocals: &[f64],
    squares: &mut [f64],
) -> f64 {
    let count = squares.len();
    let reciprocals = &reciprocals[..count];
    let [xs, ys, zs] = points.map(|column| &column[..count]);
    let [x_ends, y_ends, z_ends] = points.map(|column| &column[1..count + 1]);
    let mut least = u64::MAX;
    for index in 0..count {
        let from = [xs[index], ys[index], zs[index]];
        let to = [x_ends[index], y_ends[index], z_ends[index]];
        let square = SegmentLine::new([from, to], reciprocals[index]).foot(position).1;
        squares[index] = square;
        least = least.min(square.to_bits());
    }
    f64::from_bits(least)
}

/// Compares the segment `k` with the nearest ones so far.
#[inline(always)]
fn consider_segment(positions: [&[f64]; COLUMNS], line: SegmentLine, k: u64, feet: &mut FootPoints) {
    let count = positions[0].len();
    let [xs, ys, zs] = positions.map(|values| &values[..count]);
    let segments = &mut feet.segment[..count];
    let alongs = &mut feet.along[..count];
    let squares = &mut feet.square_distance[..count];
    for index in 0..count {
        let (along, square) = line.foot([xs[index], ys[index], zs[index]]);
        let closer = square < squares[index];
        segments[index] = if closer { k } else { segments[index] };
        alongs[index] = if closer { along } else { alongs[index] };
        squares[index] = if closer { square } else { squares[index] };
    }
}

/// Segment as its start and its difference vector.
#[derive(Debug, Clone, Copy)]
struct SegmentLine {
    from: [f64; COLUMNS],
    step: [f64; COLUMNS],
    /// Reciprocal of the squared length, 0 for a segment of length 0.
    reciprocal: f64,
}

impl SegmentLine {
    #[inline(always)]
    fn new([from, to]: [[f64; COLUMNS]; 2], reciprocal: f64) -> Self {
        SegmentLine { from, step: [to[0] - from[0], to[1] - from[1], to[2] - from[2]], reciprocal }
    }

    /// Returns the position along the segment and the square of the distance of its point closest to `position`.
    #[inline(always)]
    fn foot(&self, position: [f64; COLUMNS]) -> (f64, f64) {
        let [a, b, c] = [position[0] - self.from[0], position[1] - self.from[1], position[2] - self.from[2]];
        let [u, v, w] = self.step;
        let along = ((a * u + b * v + c * w) * self.reciprocal).clamp(0.0, 1.0);
        let (x, y, z) = (a - along * u, b - along * v, c - along * w);
        (along, x * x + y * y + z * z)
    }
}
