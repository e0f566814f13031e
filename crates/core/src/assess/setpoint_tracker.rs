//! Nearest point on the polyline through the setpoints, for motions without a known path.

use nalgebra::Vector3;

use crate::kinematics::ToolPose;

use super::contour::{CAPACITY, ContourTracker};
use super::path_tracker::NearestPoint;

/// Length below which two setpoints do not define a direction, m.
const MIN_STEP: f64 = 1e-12;

/// Nearest-point search along the polyline through the setpoints in the workpiece frame.
///
/// The chord of a circle lies inside it by `(v·Tsp)²/(8R)`: 1.9 µm in the ballbar test of Prévost et al. If
/// the path is known, [`PathTracker`](super::PathTracker) measures against it.
#[derive(Debug, Clone)]
pub struct SetpointTracker {
    contour: ContourTracker,
    poses: Box<[ToolPose]>,
    /// Directions of the first and the last segment of nonzero length.
    end_directions: Option<[Vector3<f64>; 2]>,
}

impl SetpointTracker {
    /// Creates a tracker whose first setpoint is `start`.
    pub fn new(start: ToolPose) -> Self {
        let mut tracker = SetpointTracker {
            contour: ContourTracker::new(3),
            poses: vec![start; CAPACITY].into_boxed_slice(),
            end_directions: None,
        };
        tracker.push(start);
        tracker
    }

    fn ring_index(k: u64) -> usize {
        (k % CAPACITY as u64) as usize
    }

    fn newest(&self) -> u64 {
        self.contour.count().saturating_sub(1)
    }

    /// Adds the tool pose of a setpoint.
    pub fn push(&mut self, pose: ToolPose) {
        let step = pose.tip - self.poses[Self::ring_index(self.newest())].tip;
        if step.norm() > MIN_STEP {
            let direction = step.normalize();
            let first = self.end_directions.map_or(direction, |[first, _]| first);
            self.end_directions = Some([first, direction]);
        }
        self.contour.push(pose.tip.iter().copied());
        self.poses[Self::ring_index(self.newest())] = pose;
    }

    /// Returns the point of the polyline closest to `pose`.
    pub fn nearest(&mut self, pose: &ToolPose) -> NearestPoint {
        let (k, along) = match self.contour.nearest(pose.tip.as_slice()) {
            Some((k, foot)) => (k, foot.along),
            None => (0, 0.0),
        };
        let from = &self.poses[Self::ring_index(k)];
        let to = &self.poses[Self::ring_index((k + 1).min(self.newest()))];
        let point = from.tip + along * (to.tip - from.tip);
        let axis = (from.axis + along * (to.axis - from.axis)).normalize();
        let offset = pose.tip - point;
        let overshoot = self.end_directions.map_or(0.0, |[first, last]| {
            let at_start = k == 0 && along == 0.0;
            let at_end = point == self.poses[Self::ring_index(self.newest())].tip;
            let before = if at_start { (-offset.dot(&first)).max(0.0) } else { 0.0 };
            let behind = if at_end { offset.dot(&last).max(0.0) } else { 0.0 };
            before.max(behind)
        });
        let distance = offset.norm();
        NearestPoint {
            progress: k as f64 + along,
            point,
            axis,
            distance,
            within_ends: (distance * distance - overshoot * overshoot).max(0.0).sqrt(),
            orientation: pose.axis.cross(&axis).norm().atan2(pose.axis.dot(&axis)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(x: f64, y: f64) -> ToolPose {
        ToolPose { tip: Vector3::new(x, y, 0.0), axis: Vector3::z() }
    }

    #[test]
    fn overshoot_beyond_the_last_setpoint_is_reported_separately() {
        let mut tracker = SetpointTracker::new(at(0.0, 0.0));
        for k in 1..=10 {
            tracker.push(at(0.01 * f64::from(k), 0.0));
        }
        // At rest the end point is repeated.
        tracker.push(at(0.1, 0.0));
        let inside = tracker.nearest(&at(0.055, 3e-6));
        assert!((inside.distance - 3e-6).abs() < 1e-15 && (inside.within_ends - 3e-6).abs() < 1e-15);
        let beyond = tracker.nearest(&at(0.1 + 4e-6, 3e-6));
        assert!((beyond.distance - 5e-6).abs() < 1e-15, "{beyond:?}");
        assert!((beyond.within_ends - 3e-6).abs() < 1e-15, "{beyond:?}");
    }

    #[test]
    fn orientation_is_compared_at_the_nearest_point() {
        let tilted = |x: f64, angle: f64| ToolPose {
            tip: Vector3::new(x, 0.0, 0.0),
            axis: Vector3::new(angle.sin(), 0.0, angle.cos()),
        };
        let mut tracker = SetpointTracker::new(tilted(0.0, 0.0));
        tracker.push(tilted(0.01, 0.02));
        let error = tracker.nearest(&tilted(0.005, 0.01 + 1e-6)).orientation;
        assert!((error - 1e-6).abs() < 1e-11, "{error}");
    }
}
