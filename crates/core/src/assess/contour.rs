//! Contour error of the linear axes against the polyline through the setpoints. Offline runs along a continuous path
//! use `path_tracker` instead.

/// Number of stored setpoints: the largest lag of the axes before the oldest setpoint is overwritten.
pub(super) const CAPACITY: usize = 512;
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
    /// Ring buffer of points, `dimension` numbers each.
    ring: Box<[f64]>,
    count: u64,
    nearest: u64,
    /// Index of the first setpoint equal to the newest one.
    last_change: u64,
}

impl ContourTracker {
    /// Creates a tracker for `dimension` linear axes.
    pub fn new(dimension: usize) -> Self {
        ContourTracker {
            dimension,
            ring: vec![0.0; dimension * CAPACITY].into_boxed_slice(),
            count: 0,
            nearest: 0,
            last_change: 0,
        }
    }

    /// Adds a setpoint, m per axis.
    pub fn push(&mut self, point: impl Iterator<Item = f64>) {
        let start = (self.count % CAPACITY as u64) as usize * self.dimension;
        for (coordinate, value) in self.ring[start..start + self.dimension].iter_mut().zip(point) {
            *coordinate = value;
        }
        if self.count > 0 && self.point(self.count) != self.point(self.count - 1) {
            self.last_change = self.count;
        }
        self.count += 1;
    }

    fn point(&self, k: u64) -> &[f64] {
        let start = (k % CAPACITY as u64) as usize * self.dimension;
        &self.ring[start..start + self.dimension]
    }

    /// Returns the number of setpoints added.
    pub(super) fn count(&self) -> u64 {
        self.count
    }

    /// Returns the distance of `position` from the path, m; 0 without a setpoint.
    pub fn distance(&mut self, position: &[f64]) -> f64 {
        self.nearest(position).map_or(0.0, |(_, foot)| foot.square_distance.sqrt())
    }

    /// Returns the nearest segment, by the index of its first setpoint, and the foot point on it; `None`
    /// without a setpoint.
    pub(super) fn nearest(&mut self, position: &[f64]) -> Option<(u64, FootPoint)> {
        if self.count == 0 {
            return None;
        }
        let oldest = self.count.saturating_sub(CAPACITY as u64);
        let from = self.nearest.saturating_sub(LOOK_BACK).max(oldest);
        let mut best = foot_point_on_segment(position, self.point(from), self.point(from));
        self.nearest = from;
        // After the first segment of length 0, further ones are no closer.
        for k in from..(self.count - 1).min(self.last_change + 1) {
            let foot = foot_point_on_segment(position, self.point(k), self.point(k + 1));
            if foot.square_distance < best.square_distance {
                best = foot;
                self.nearest = k;
            }
        }
        Some((self.nearest, best))
    }
}

/// Foot point: the nearest point of a segment.
#[derive(Debug, Clone, Copy)]
pub(super) struct FootPoint {
    pub square_distance: f64,
    /// Position on the segment, from 0 at its start to 1 at its end.
    pub along: f64,
}

/// Returns the point of the segment from `a` to `b` closest to `p`.
fn foot_point_on_segment(p: &[f64], a: &[f64], b: &[f64]) -> FootPoint {
    let (mut along, mut length) = (0.0, 0.0);
    for ((p, a), b) in p.iter().zip(a).zip(b) {
        along += (p - a) * (b - a);
        length += (b - a) * (b - a);
    }
    let t = if length > 0.0 { (along / length).clamp(0.0, 1.0) } else { 0.0 };
    let square_distance = p.iter().zip(a).zip(b).map(|((p, a), b)| (p - a - t * (b - a)).powi(2)).sum();
    FootPoint { square_distance, along: t }
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
