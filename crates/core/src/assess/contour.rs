//! Contour error of the linear axes against the polyline through the setpoints. Offline runs along a continuous path
//! use `path_tracker` instead.

mod batch;

pub(super) use batch::{COLUMNS, FootPoints};

/// Number of stored setpoints: the largest lag of the axes before the oldest setpoint is overwritten.
pub(super) const CAPACITY: usize = 512;
/// Number of setpoints by which the stored ones are moved at once.
const SPARE: usize = 128;
/// Segments searched before the last nearest one, in which a point may move backwards.
const LOOK_BACK: u64 = 8;

/// Contour error along a path that is extended setpoint by setpoint.
///
/// The path is the polyline through the setpoints of the linear axes. The nearest point is searched from a
/// few segments before the last nearest one up to the newest setpoint, which may be a future one, so that a
/// self-intersecting path is followed in order.
#[derive(Debug, Clone)]
pub struct ContourTracker {
    dimension: usize,
    /// Coordinates of the last points, a column per axis and at least [`COLUMNS`] columns, zero in further ones.
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

impl ContourTracker {
    /// Creates a tracker for `dimension` linear axes.
    pub fn new(dimension: usize) -> Self {
        let column = vec![0.0; CAPACITY + SPARE].into_boxed_slice();
        ContourTracker {
            dimension,
            columns: vec![column.clone(); dimension.max(COLUMNS)].into_boxed_slice(),
            reciprocals: column,
            first: 0,
            count: 0,
            nearest: 0,
            last_change: 0,
        }
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

    /// Returns the number of setpoints added.
    pub(super) fn count(&self) -> u64 {
        self.count
    }

    /// Returns true if the segment `k` ends at the position of the newest setpoint.
    pub(super) fn is_last(&self, k: u64) -> bool {
        k + 1 >= self.last_change
    }

    /// Returns true if the point at position `along` of the segment `k` is the position of the newest setpoint.
    pub(super) fn is_newest(&self, k: u64, along: f64) -> bool {
        k >= self.last_change || self.is_last(k) && along == 1.0
    }

    /// Returns the distance of `position` from the path, m; 0 without a setpoint.
    pub fn distance(&mut self, position: &[f64]) -> f64 {
        self.nearest(position).map_or(0.0, |(_, foot)| foot.square_distance.sqrt())
    }

    /// Returns the nearest segment, by the index of its first setpoint, and the foot point on it; `None`
    /// without a setpoint.
    pub(super) fn nearest(&mut self, position: &[f64]) -> Option<(u64, FootPoint)> {
        self.nearest_from(|axis| position[axis])
    }

    /// Returns the nearest segment and its foot point as [`nearest`](Self::nearest); `position` returns the
    /// coordinate of an axis.
    fn nearest_from(&mut self, position: impl Fn(usize) -> f64) -> Option<(u64, FootPoint)> {
        if self.count == 0 {
            return None;
        }
        let from = self.nearest.saturating_sub(LOOK_BACK).max(self.oldest());
        let mut best = self.foot_point(&position, from, from);
        self.nearest = from;
        for k in from..self.end_of_search() {
            let foot = self.foot_point(&position, k, k + 1);
            if foot.square_distance < best.square_distance {
                best = foot;
                self.nearest = k;
            }
        }
        Some((self.nearest, best))
    }

    /// Returns the index of point `k` in the columns.
    fn column_index(&self, k: u64) -> usize {
        (k - self.first) as usize
    }

    /// Returns the index of the oldest stored setpoint.
    fn oldest(&self) -> u64 {
        self.count.saturating_sub(CAPACITY as u64)
    }

    /// Returns the end of the segments that are searched. After the first segment of length 0, further ones are no
    /// closer.
    fn end_of_search(&self) -> u64 {
        self.count.saturating_sub(1).min(self.last_change + 1)
    }

    /// Returns the point of the segment from setpoint `from` to setpoint `to` closest to a position.
    fn foot_point(&self, position: impl Fn(usize) -> f64, from: u64, to: u64) -> FootPoint {
        let (from, to) = (self.column_index(from), self.column_index(to));
        let axes = || self.columns[..self.dimension].iter().enumerate();
        let mut along = 0.0;
        for (axis, column) in axes() {
            let (p, a, b) = (position(axis), column[from], column[to]);
            along += (p - a) * (b - a);
        }
        let t = if from < to { (along * self.reciprocals[from]).clamp(0.0, 1.0) } else { 0.0 };
        let square = |axis: usize| {
            let column = &self.columns[axis];
            let (p, a, b) = (position(axis), column[from], column[to]);
            (p - a - t * (b - a)).powi(2)
        };
        FootPoint { square_distance: (0..self.dimension).map(square).sum(), along: t }
    }
}

/// Foot point: the nearest point of a segment.
#[derive(Debug, Clone, Copy)]
pub(super) struct FootPoint {
    pub square_distance: f64,
    /// Position on the segment, from 0 at its start to 1 at its end.
    pub along: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cut_corner_is_measured_from_the_nearer_leg() {
        let mut contour = ContourTracker::new(2);
        for k in 0..=10 {
            contour.push([f64::from(k) * 0.1, 0.0].into_iter());
        }
        for k in 1..=10 {
            contour.push([1.0, f64::from(k) * 0.1].into_iter());
        }
        assert!((contour.distance(&[0.5, 0.02]) - 0.02).abs() < 1e-15);
        // 0.3 from the first leg, 0.1 from the second.
        assert!((contour.distance(&[0.9, 0.3]) - 0.1).abs() < 1e-15);
        assert!((contour.distance(&[1.0, 1.25]) - 0.25).abs() < 1e-15);
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
            assert_eq!(contour.distance(&[20.0]), 0.0);
            assert_eq!(contour.distance(&[23.0]), 3.0);
            let on_the_way = behind + 20 < CAPACITY - 1;
            if on_the_way {
                assert_eq!(contour.distance(&[12.5]), 0.0, "{behind} behind");
            }
        }
        assert_eq!(contour.distance(&[12.5]), 7.5);
    }

    #[test]
    fn a_lag_longer_than_the_ring_buffer_is_measured_from_the_oldest_point() {
        let mut contour = ContourTracker::new(1);
        for k in 0..=CAPACITY {
            contour.push([k as f64].into_iter());
        }
        assert_eq!(contour.distance(&[0.0]), 1.0);
    }
}
