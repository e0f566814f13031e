//! Distance from the simulated point to the path of its setpoints.

/// Setpoints that are remembered: how far the axes may lag behind before the oldest is forgotten.
pub(super) const CAPACITY: usize = 512;
/// Segments looked at behind the nearest one so far, for a point that swings back.
const LOOK_BACK: u64 = 8;

/// Contour error along a path that becomes known setpoint by setpoint.
///
/// The path is the polyline through the setpoints of the linear axes. The nearest point is sought
/// from a few segments behind the last nearest one up to the newest setpoint, which may be one that
/// is commanded later, so that a path that crosses itself is followed in order.
#[derive(Debug, Clone)]
pub struct ContourTracker {
    dimension: usize,
    /// Ring of points, `dimension` numbers each.
    ring: Box<[f64]>,
    count: u64,
    nearest: u64,
    /// The first of the setpoints that are where the newest is.
    still: u64,
}

impl ContourTracker {
    /// A tracker for `dimension` linear axes.
    pub fn new(dimension: usize) -> Self {
        ContourTracker {
            dimension,
            ring: vec![0.0; dimension * CAPACITY].into_boxed_slice(),
            count: 0,
            nearest: 0,
            still: 0,
        }
    }

    /// Adds a setpoint, m per axis.
    pub fn push(&mut self, point: impl Iterator<Item = f64>) {
        let start = (self.count % CAPACITY as u64) as usize * self.dimension;
        for (place, value) in self.ring[start..start + self.dimension].iter_mut().zip(point) {
            *place = value;
        }
        if self.count > 0 && self.point(self.count) != self.point(self.count - 1) {
            self.still = self.count;
        }
        self.count += 1;
    }

    fn point(&self, k: u64) -> &[f64] {
        let start = (k % CAPACITY as u64) as usize * self.dimension;
        &self.ring[start..start + self.dimension]
    }

    /// Setpoints that have been added.
    pub(super) fn count(&self) -> u64 {
        self.count
    }

    /// Distance of `position` from the path, m; zero before the first setpoint.
    pub fn distance(&mut self, position: &[f64]) -> f64 {
        self.nearest(position).map_or(0.0, |(_, foot)| foot.square_distance.sqrt())
    }

    /// The segment nearest to `position`, by the setpoint that it starts at, and the foot on it;
    /// none before the first setpoint.
    pub(super) fn nearest(&mut self, position: &[f64]) -> Option<(u64, Foot)> {
        if self.count == 0 {
            return None;
        }
        let oldest = self.count.saturating_sub(CAPACITY as u64);
        let from = self.nearest.saturating_sub(LOOK_BACK).max(oldest);
        let mut best = foot_on_segment(position, self.point(from), self.point(from));
        self.nearest = from;
        // Segments of no length behind the first one of them come no nearer.
        for k in from..(self.count - 1).min(self.still + 1) {
            let foot = foot_on_segment(position, self.point(k), self.point(k + 1));
            if foot.square_distance < best.square_distance {
                best = foot;
                self.nearest = k;
            }
        }
        Some((self.nearest, best))
    }
}

/// Nearest point of a segment.
#[derive(Debug, Clone, Copy)]
pub(super) struct Foot {
    pub square_distance: f64,
    /// Where it is, from 0 at the segment's start to 1 at its end.
    pub along: f64,
}

/// The point of the segment from `a` to `b` that is nearest to `p`.
fn foot_on_segment(p: &[f64], a: &[f64], b: &[f64]) -> Foot {
    let (mut along, mut length) = (0.0, 0.0);
    for ((p, a), b) in p.iter().zip(a).zip(b) {
        along += (p - a) * (b - a);
        length += (b - a) * (b - a);
    }
    let t = if length > 0.0 { (along / length).clamp(0.0, 1.0) } else { 0.0 };
    let square_distance = p.iter().zip(a).zip(b).map(|((p, a), b)| (p - a - t * (b - a)).powi(2)).sum();
    Foot { square_distance, along: t }
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
    fn set_points_that_stand_still_are_one_place() {
        let mut contour = ContourTracker::new(1);
        for k in 0..=20 {
            contour.push(std::iter::once(f64::from(k)));
        }
        for behind in 0..2 * CAPACITY {
            contour.push(std::iter::once(20.0));
            // Swung back, past the end, and away from it as long as the way there is remembered.
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
    fn a_lag_longer_than_the_memory_is_measured_from_the_oldest_point() {
        let mut contour = ContourTracker::new(1);
        for k in 0..=CAPACITY {
            contour.push([k as f64].into_iter());
        }
        assert_eq!(contour.distance(&[0.0]), 1.0);
    }
}
