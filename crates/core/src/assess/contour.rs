//! Contour error of the linear axes against the polyline through the setpoints. Offline runs along a continuous path
//! use `path_tracker` instead.
//!
//! The positions of a position cycle are searched together. All of them lie within a ball: a segment whose distance from
//! the center exceeds that of the nearest segment by more than twice the radius is nearest to none of them, so few
//! segments remain, which are compared with all positions.

use crate::simd::{SliceOperation, vectorize};
use crate::trajectory::JointSet;

/// Numbers of columns for which the search is compiled: a usual machine, one with gantry axes, the largest machine.
const FEW: usize = 3;
const MORE: usize = 8;
const MOST: usize = JointSet::CAPACITY;
/// Number of stored setpoints: the largest lag of the axes before the oldest setpoint is overwritten.
pub(super) const CAPACITY: usize = 512;
/// Number of setpoints by which the stored ones are moved at once.
const SPARE: usize = 128;
/// Segments searched before the last nearest one, in which a point may move backwards.
const LOOK_BACK: u64 = 8;
/// Slack of the comparison with the ball, relative to the size of the coordinates: far more than rounding.
const SLACK: f64 = 1e-12;

/// Contour error along a path that is extended setpoint by setpoint.
///
/// The path is the polyline through the setpoints of the linear axes. The nearest point is searched from a few segments
/// before the last nearest one up to the newest setpoint, which may be a future one, so that a self-intersecting path is
/// followed in order.
#[derive(Debug, Clone)]
pub(super) struct ContourTracker {
    dimension: usize,
    /// Coordinates of the last points, a column per axis, zero in further columns.
    columns: Box<[Box<[f64]>]>,
    /// Reciprocals of the squared length of the segment after each point, 1/m²; 0 for a segment of length 0.
    reciprocals: Box<[f64]>,
    /// Index of the first point in the columns.
    first: u64,
    count: u64,
    nearest: u64,
    /// Index of the first setpoint equal to the newest one.
    last_change: u64,
}

/// Foot points of consecutive positions on the polyline.
#[derive(Debug, Clone, Default)]
pub(super) struct FootPoints {
    /// Nearest segments, by the index of their first setpoint.
    pub segment: Vec<u64>,
    /// Positions on the segments, from 0 at the start to 1 at the end.
    pub along: Vec<f64>,
    /// Squares of the distances, m².
    pub square_distance: Vec<f64>,
}

impl FootPoints {
    /// Sets the number of positions; their values are undetermined.
    pub fn resize(&mut self, count: usize) {
        self.segment.resize(count, 0);
        self.along.resize(count, 0.0);
        self.square_distance.resize(count, 0.0);
    }
}

impl ContourTracker {
    /// Creates a tracker for `dimension` linear axes.
    pub fn new(dimension: usize) -> Self {
        let column = vec![0.0; CAPACITY + SPARE].into_boxed_slice();
        let columns = [FEW, MORE].into_iter().find(|count| *count >= dimension).unwrap_or(MOST);
        ContourTracker {
            dimension,
            columns: vec![column.clone(); columns].into_boxed_slice(),
            reciprocals: column,
            first: 0,
            count: 0,
            nearest: 0,
            last_change: 0,
        }
    }

    /// Returns the number of coordinates of a position; those without an axis are 0.
    pub fn column_count(&self) -> usize {
        self.columns.len()
    }

    /// Adds a setpoint, m per axis.
    pub fn push(&mut self, point: impl Iterator<Item = f64>) {
        if self.column_index(self.count) == CAPACITY + SPARE {
            self.columns.iter_mut().for_each(|column| column.copy_within(SPARE.., 0));
            self.reciprocals.copy_within(SPARE.., 0);
            self.first += SPARE as u64;
        }
        let index = self.column_index(self.count);
        let before = index.saturating_sub(1);
        let mut square = 0.0;
        for (column, value) in self.columns[..self.dimension].iter_mut().zip(point) {
            let step = if self.count > 0 { value - column[before] } else { 0.0 };
            square += step * step;
            column[index] = value;
        }
        self.reciprocals[before] = if square > 0.0 { 1.0 / square } else { 0.0 };
        let changes = self.columns[..self.dimension].iter().any(|column| column[index] != column[before]);
        if self.count > 0 && changes {
            self.last_change = self.count;
        }
        self.count += 1;
    }

    /// Returns the segment from which the next search starts.
    pub fn last_nearest(&self) -> u64 {
        self.nearest
    }

    /// Starts the next search at a segment.
    pub fn search_from(&mut self, segment: u64) {
        self.nearest = segment.min(self.count);
    }

    /// Returns the number of setpoints added.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Returns true if the segment `k` ends at the position of the newest setpoint.
    pub fn is_last(&self, k: u64) -> bool {
        k + 1 >= self.last_change
    }

    /// Returns true if the point at position `along` of the segment `k` is the position of the newest setpoint.
    pub fn is_newest(&self, k: u64, along: f64) -> bool {
        k >= self.last_change || self.is_last(k) && along == 1.0
    }

    /// Searches the nearest points of consecutive positions; all distances are 0 without a setpoint.
    ///
    /// `positions` contains the coordinates of each column, m, slices of equal lengths.
    pub fn nearest(&mut self, positions: &[impl AsRef<[f64]>], feet: &mut FootPoints) {
        match self.columns.len() {
            FEW => self.nearest_of::<FEW>(positions, feet),
            MORE => self.nearest_of::<MORE>(positions, feet),
            _ => self.nearest_of::<MOST>(positions, feet),
        }
    }

    fn nearest_of<const D: usize>(&mut self, positions: &[impl AsRef<[f64]>], feet: &mut FootPoints) {
        let none: &[f64] = &[];
        let positions = std::array::from_fn(|axis| positions.get(axis).map_or(none, AsRef::as_ref));
        let count = positions[0].len();
        feet.resize(count);
        if self.count == 0 {
            feet.square_distance.fill(0.0);
            return;
        }
        let mut begin = 0;
        while begin < count {
            let nearest = self.nearest;
            let searched = positions.map(|values| &values[begin..]);
            vectorize(WindowSearch::<D> { tracker: self, positions: searched, feet, begin });
            // The window of a position begins at the nearest segment of the position before it. The search of all at once
            // is that of each one as long as the first window contains the others and has found nothing before them.
            let is_outside = |pair: &[u64]| pair[0] < nearest || pair[1] + LOOK_BACK < pair[0];
            match feet.segment[begin..].windows(2).position(is_outside) {
                Some(index) => begin += index + 1,
                None => begin = count,
            }
            self.nearest = feet.segment[begin - 1];
        }
    }

    /// Returns the index of point `k` in the columns.
    fn column_index(&self, k: u64) -> usize {
        (k - self.first) as usize
    }
}

/// Search of the nearest points of consecutive positions.
struct WindowSearch<'a, const D: usize> {
    tracker: &'a ContourTracker,
    positions: [&'a [f64]; D],
    feet: &'a mut FootPoints,
    /// Index of the first position in `feet`.
    begin: usize,
}

impl<const D: usize> SliceOperation for WindowSearch<'_, D> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let WindowSearch { tracker, positions, feet, begin } = self;
        let oldest = tracker.count.saturating_sub(CAPACITY as u64);
        let low = tracker.nearest.saturating_sub(LOOK_BACK).max(oldest);
        // After the first segment of length 0, further ones are no closer. A single setpoint is a segment, too.
        let end = (tracker.count - 1).min(tracker.last_change + 1).max(low + 1);
        let (start, last) = (tracker.column_index(low), tracker.column_index(tracker.count - 1));
        let segments = (end - low) as usize;
        let reciprocals = &tracker.reciprocals[start..start + segments];
        let columns: [&[f64]; D] = std::array::from_fn(|axis| &*tracker.columns[axis]);
        let (mut squares, mut bound) = ([0.0; CAPACITY], f64::INFINITY);
        if segments > 1 {
            let (center, radius) = ball(positions);
            let window = columns.map(|column| &column[start..=start + segments]);
            let least = square_distances(center, window, reciprocals, &mut squares[..segments]);
            let slack = SLACK * (1.0 + radius + center.iter().map(|value| value.abs()).sum::<f64>());
            bound = (least.sqrt() + 2.0 * radius + slack).powi(2);
        }
        let mut is_first = true;
        for (at, square) in squares[..segments].iter().enumerate() {
            // No segment is beyond a bound that is not a number.
            if *square > bound {
                continue;
            }
            let ends = [start + at, (start + at + 1).min(last)].map(|at| columns.map(|column| column[at]));
            let line = SegmentLine::new(ends, reciprocals[at]);
            consider_segment(positions, line, low + at as u64, is_first, feet, begin);
            is_first = false;
        }
    }
}

/// Returns the middle one of positions, and the largest distance of a position from it, NaN with a coordinate that is
/// not a number.
#[inline(always)]
fn ball<const D: usize>(positions: [&[f64]; D]) -> ([f64; D], f64) {
    let count = positions[0].len();
    let center = positions.map(|values| values[count / 2]);
    let columns = positions.map(|values| &values[..count]);
    // Squares are in the order of their bits; NaN is the largest.
    let mut largest = 0;
    for index in 0..count {
        let mut square = 0.0;
        for (column, center) in columns.iter().zip(&center) {
            let difference = column[index] - center;
            square += difference * difference;
        }
        largest = largest.max(square.to_bits());
    }
    (center, f64::from_bits(largest).sqrt())
}

/// Computes the squares of the distances of a position from the segments between consecutive points; returns the
/// least.
#[inline(always)]
fn square_distances<const D: usize>(
    position: [f64; D],
    points: [&[f64]; D],
    reciprocals: &[f64],
    squares: &mut [f64],
) -> f64 {
    let count = squares.len();
    let reciprocals = &reciprocals[..count];
    let [starts, ends] = [0, 1].map(|first| points.map(|column| &column[first..count + first]));
    let mut least = u64::MAX;
    for index in 0..count {
        let ends = [starts, ends].map(|columns| columns.map(|column| column[index]));
        let square = SegmentLine::new(ends, reciprocals[index]).foot(position).1;
        squares[index] = square;
        least = least.min(square.to_bits());
    }
    f64::from_bits(least)
}

/// Compares the segment `k` with the nearest ones so far, the first one at index `begin` of `feet`.
#[inline(always)]
fn consider_segment<const D: usize>(
    positions: [&[f64]; D],
    line: SegmentLine<D>,
    k: u64,
    is_first: bool,
    feet: &mut FootPoints,
    begin: usize,
) {
    let count = positions[0].len();
    let columns = positions.map(|values| &values[..count]);
    let segments = &mut feet.segment[begin..][..count];
    let alongs = &mut feet.along[begin..][..count];
    let squares = &mut feet.square_distance[begin..][..count];
    for index in 0..count {
        let (along, square) = line.foot(columns.map(|column| column[index]));
        let closer = is_first | (square < squares[index]);
        segments[index] = if closer { k } else { segments[index] };
        alongs[index] = if closer { along } else { alongs[index] };
        squares[index] = if closer { square } else { squares[index] };
    }
}

/// Segment as its start and its difference vector.
#[derive(Debug, Clone, Copy)]
struct SegmentLine<const D: usize> {
    from: [f64; D],
    step: [f64; D],
    /// Reciprocal of the squared length, 0 for a segment of length 0.
    reciprocal: f64,
}

impl<const D: usize> SegmentLine<D> {
    #[inline(always)]
    fn new([from, to]: [[f64; D]; 2], reciprocal: f64) -> Self {
        let mut step = to;
        for axis in 0..D {
            step[axis] = to[axis] - from[axis];
        }
        SegmentLine { from, step, reciprocal }
    }

    /// Returns the position along the segment and the square of the distance of its point closest to `position`.
    #[inline(always)]
    fn foot(&self, position: [f64; D]) -> (f64, f64) {
        let (mut product, mut square) = (0.0, 0.0);
        let axes = || position.iter().zip(&self.from).zip(&self.step);
        for ((value, from), step) in axes() {
            product += (value - from) * step;
        }
        let along = (product * self.reciprocal).clamp(0.0, 1.0);
        for ((value, from), step) in axes() {
            let off = value - from - along * step;
            square += off * off;
        }
        (along, square)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn distance(contour: &mut ContourTracker, position: &[f64]) -> f64 {
        let mut columns = vec![[0.0]; contour.column_count()];
        columns.iter_mut().zip(position).for_each(|(column, value)| *column = [*value]);
        let mut feet = FootPoints::default();
        contour.nearest(&columns, &mut feet);
        feet.square_distance[0].sqrt()
    }

    #[test]
    fn a_cut_corner_is_measured_from_the_nearer_leg() {
        let mut contour = ContourTracker::new(2);
        for k in 0..=10 {
            contour.push([f64::from(k) * 0.1, 0.0].into_iter());
        }
        for k in 1..=10 {
            contour.push([1.0, f64::from(k) * 0.1].into_iter());
        }
        assert!((distance(&mut contour, &[0.5, 0.02]) - 0.02).abs() < 1e-15);
        // 0.3 from the first leg, 0.1 from the second.
        assert!((distance(&mut contour, &[0.9, 0.3]) - 0.1).abs() < 1e-15);
        assert!((distance(&mut contour, &[1.0, 1.25]) - 0.25).abs() < 1e-15);
    }

    #[test]
    fn setpoints_at_rest_count_as_one_point() {
        let mut contour = ContourTracker::new(1);
        for k in 0..=20 {
            contour.push(std::iter::once(f64::from(k)));
        }
        for behind in 0..2 * CAPACITY {
            contour.push(std::iter::once(20.0));
            // Before the end, past the end, and back along the path as long as that part is stored.
            assert_eq!(distance(&mut contour, &[20.0]), 0.0);
            assert_eq!(distance(&mut contour, &[23.0]), 3.0);
            let on_the_way = behind + 20 < CAPACITY - 1;
            if on_the_way {
                assert_eq!(distance(&mut contour, &[12.5]), 0.0, "{behind} behind");
            }
        }
        assert_eq!(distance(&mut contour, &[12.5]), 7.5);
    }

    #[test]
    fn a_lag_longer_than_the_ring_buffer_is_measured_from_the_oldest_point() {
        let mut contour = ContourTracker::new(1);
        for k in 0..=CAPACITY {
            contour.push([k as f64].into_iter());
        }
        assert_eq!(distance(&mut contour, &[0.0]), 1.0);
    }
}
