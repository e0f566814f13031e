//! Nearest point on the path that the setpoints describe, where no geometry is known.

use nalgebra::Vector3;

use crate::kinematics::ToolPose;

use super::contour::{CAPACITY, ContourTracker};
use super::path_tracker::Nearest;

/// Length below which two setpoints do not tell a direction, m.
const SHORTEST: f64 = 1e-12;

/// Follows the tool along the polyline through its setpoints in the workpiece frame.
///
/// The chord of a circle runs inside of it, by `(v·Tsp)²/(8R)`: 1.9 µm on the paper's ballbar.
/// Where the path itself is known, [`PathTracker`](super::PathTracker) measures against that.
#[derive(Debug, Clone)]
pub struct SetpointTracker {
    contour: ContourTracker,
    poses: Box<[ToolPose]>,
    /// Unit vectors of the first and the last segment that has a length.
    ends: Option<[Vector3<f64>; 2]>,
}

impl SetpointTracker {
    /// Before the first setpoint, which is at `start`.
    pub fn new(start: ToolPose) -> Self {
        let mut tracker = SetpointTracker {
            contour: ContourTracker::new(3),
            poses: vec![start; CAPACITY].into_boxed_slice(),
            ends: None,
        };
        tracker.push(start);
        tracker
    }

    fn place(k: u64) -> usize {
        (k % CAPACITY as u64) as usize
    }

    fn newest(&self) -> u64 {
        self.contour.count().saturating_sub(1)
    }

    /// Adds the tool's pose of a setpoint.
    pub fn push(&mut self, pose: ToolPose) {
        let step = pose.tip - self.poses[Self::place(self.newest())].tip;
        if step.norm() > SHORTEST {
            let direction = step.normalize();
            let first = self.ends.map_or(direction, |[first, _]| first);
            self.ends = Some([first, direction]);
        }
        self.contour.push(pose.tip.iter().copied());
        self.poses[Self::place(self.newest())] = pose;
    }

    /// The nearest point to where the tool is.
    pub fn nearest(&mut self, pose: &ToolPose) -> Nearest {
        let (k, along) = match self.contour.nearest(pose.tip.as_slice()) {
            Some((k, foot)) => (k, foot.along),
            None => (0, 0.0),
        };
        let from = &self.poses[Self::place(k)];
        let to = &self.poses[Self::place((k + 1).min(self.newest()))];
        let point = from.tip + along * (to.tip - from.tip);
        let axis = (from.axis + along * (to.axis - from.axis)).normalize();
        let offset = pose.tip - point;
        let overshoot = self.ends.map_or(0.0, |[first, last]| {
            let at_start = k == 0 && along == 0.0;
            let at_end = point == self.poses[Self::place(self.newest())].tip;
            let before = if at_start { (-offset.dot(&first)).max(0.0) } else { 0.0 };
            let behind = if at_end { offset.dot(&last).max(0.0) } else { 0.0 };
            before.max(behind)
        });
        let distance = offset.norm();
        Nearest {
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
    fn overshoot_beyond_the_last_set_point_is_told_apart() {
        let mut tracker = SetpointTracker::new(at(0.0, 0.0));
        for k in 1..=10 {
            tracker.push(at(0.01 * f64::from(k), 0.0));
        }
        // At rest: the end stays the end.
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
