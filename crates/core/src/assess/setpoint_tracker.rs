//! Nearest point on the polyline through the setpoints, for motions without a known path.

use nalgebra::Vector3;

use crate::kinematics::{Poses, ToolPose};
use crate::simd::{SliceOperation, vectorize};

use super::contour::{CAPACITY, ContourTracker, FootPoints};
use super::deviations::{NearestPoint, PathDeviations};
use super::tool_angle::{ToolAngles, tool_angle};

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
    /// True for each setpoint that is reached at rapid traverse.
    rapid: Box<[bool]>,
    /// First and last difference of setpoints of nonzero length, m.
    end_steps: Option<[Vector3<f64>; 2]>,
    /// Buffers of [`follow`](Self::follow).
    feet: FootPoints,
    angles: ToolAngles,
}

impl SetpointTracker {
    /// Creates a tracker whose first setpoint is `start`.
    pub fn new(start: ToolPose) -> Self {
        let mut tracker = SetpointTracker {
            contour: ContourTracker::new(3),
            poses: vec![start; CAPACITY].into_boxed_slice(),
            rapid: vec![false; CAPACITY].into_boxed_slice(),
            end_steps: None,
            feet: FootPoints::default(),
            angles: ToolAngles::default(),
        };
        tracker.push(start, false);
        tracker
    }

    fn newest(&self) -> u64 {
        self.contour.count().saturating_sub(1)
    }

    /// Adds the tool pose of a setpoint, which is reached at rapid traverse or at a feed.
    pub fn push(&mut self, pose: ToolPose, is_rapid: bool) {
        let step = pose.tip - self.poses[ring_index(self.newest())].tip;
        if step.norm_squared() > MIN_STEP * MIN_STEP {
            let first = self.end_steps.map_or(step, |[first, _]| first);
            self.end_steps = Some([first, step]);
        }
        self.contour.push(pose.tip.iter().copied());
        self.poses[ring_index(self.newest())] = pose;
        self.rapid[ring_index(self.newest())] = is_rapid;
    }

    /// Returns true if the tip of `pose` is not that of the newest setpoint.
    pub fn moves_to(&self, pose: &ToolPose) -> bool {
        self.poses[ring_index(self.newest())].tip != pose.tip
    }

    /// Returns true for each pose followed last whose nearest point is reached at rapid traverse.
    pub fn rapid(&self) -> impl Iterator<Item = bool> + '_ {
        let newest = self.newest();
        self.feet.segment.iter().map(move |&k| self.rapid[ring_index((k + 1).min(newest))])
    }

    /// Returns the segment from which the next search starts, counted from 0.
    pub fn last_nearest(&self) -> u64 {
        self.contour.last_nearest()
    }

    /// Starts the next search at a segment, as after the searches of an equal tracker.
    pub fn search_from(&mut self, segment: u64) {
        self.contour.search_from(segment);
    }

    /// Returns the point of the polyline closest to `pose`.
    pub fn nearest(&mut self, pose: &ToolPose) -> NearestPoint {
        self.contour.nearest(&<[f64; 3]>::from(pose.tip).map(|value| [value]), &mut self.feet);
        self.nearest_at(pose, 0)
    }

    /// Returns the poses at both ends of segment `k`.
    fn ends_of(&self, k: u64) -> [&ToolPose; 2] {
        [k, (k + 1).min(self.newest())].map(|k| &self.poses[ring_index(k)])
    }

    /// Returns the foot point of an index as the nearest point to `pose`.
    fn nearest_at(&self, pose: &ToolPose, index: usize) -> NearestPoint {
        let (k, along) = (self.feet.segment[index], self.feet.along[index]);
        let [from, to] = self.ends_of(k);
        let point = from.tip + along * (to.tip - from.tip);
        let axis = (from.axis + along * (to.axis - from.axis)).normalize();
        let overshoot = self.overshoot(k, along, pose.tip - point);
        let distance = self.feet.square_distance[index].sqrt();
        NearestPoint {
            progress: k as f64 + along,
            point,
            axis,
            distance,
            within_ends: within_ends(distance, overshoot),
            orientation: tool_angle(&axis, &pose.axis),
        }
    }

    /// Returns the overshoot beyond the ends of the path, m, for a position with the vector `offset` from its nearest
    /// point, m.
    fn overshoot(&self, k: u64, along: f64, offset: Vector3<f64>) -> f64 {
        self.end_steps.map_or(0.0, |steps| {
            let [first, last] = steps.map(|step| step.normalize());
            let is_at_start = k == 0 && along == 0.0;
            let before = if is_at_start { (-offset.dot(&first)).max(0.0) } else { 0.0 };
            let behind = if self.contour.is_newest(k, along) { offset.dot(&last).max(0.0) } else { 0.0 };
            before.max(behind)
        })
    }

    /// Computes the deviations of consecutive `poses` and replaces the contents of `found` by them.
    ///
    /// Returns the nearest point to the first pose, `None` without a pose.
    pub fn follow(&mut self, poses: &Poses, found: &mut PathDeviations) -> Option<NearestPoint> {
        found.resize(poses.len());
        self.angles.resize(poses.len());
        if poses.is_empty() {
            return None;
        }
        self.contour.nearest(&poses.tips(), &mut self.feet);
        let segments = self.feet.segment.iter();
        let (low, high) =
            segments.fold((u64::MAX, 0), |(low, high), &segment| (low.min(segment), high.max(segment)));
        for segment in low..=high {
            if high == low || self.feet.segment.contains(&segment) {
                let axes = self.ends_of(segment).map(|pose| pose.axis.into());
                let (feet, angles) = (&self.feet, &mut self.angles);
                vectorize(SegmentAngles { segment, axes, poses, feet, angles });
            }
        }
        self.angles.write_angles(&mut found.orientation);
        vectorize(Distances { squares: &self.feet.square_distance, found });
        if low == 0 || self.contour.is_last(high) {
            self.exclude_overshoot(poses, found);
        }
        Some(self.nearest_at(&poses.get(0), 0))
    }

    /// Excludes the overshoot beyond the ends of the path.
    fn exclude_overshoot(&self, poses: &Poses, found: &mut PathDeviations) {
        for (index, within) in found.within_ends.iter_mut().enumerate() {
            let (k, along) = (self.feet.segment[index], self.feet.along[index]);
            if k == 0 || self.contour.is_last(k) {
                let [from, to] = self.ends_of(k);
                let point = from.tip + along * (to.tip - from.tip);
                *within =
                    within_ends(found.distance[index], self.overshoot(k, along, poses.tip(index) - point));
            }
        }
    }
}

/// Returns the index of setpoint `k` in the ring buffer.
fn ring_index(k: u64) -> usize {
    (k % CAPACITY as u64) as usize
}

/// Returns the distance from the path extended straight beyond its ends, m.
fn within_ends(distance: f64, overshoot: f64) -> f64 {
    (distance * distance - overshoot * overshoot).max(0.0).sqrt()
}

/// Computation of the distances from their squares, m.
struct Distances<'a> {
    squares: &'a [f64],
    found: &'a mut PathDeviations,
}

impl SliceOperation for Distances<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let count = self.squares.len();
        let distances = &mut self.found.distance[..count];
        let within_ends = &mut self.found.within_ends[..count];
        for index in 0..count {
            let distance = self.squares[index].sqrt();
            distances[index] = distance;
            within_ends[index] = distance;
        }
    }
}

/// Comparison of the tool axes of the poses whose nearest point lies on a segment.
struct SegmentAngles<'a> {
    segment: u64,
    /// Tool axes at both ends.
    axes: [[f64; 3]; 2],
    poses: &'a Poses,
    feet: &'a FootPoints,
    angles: &'a mut ToolAngles,
}

impl SliceOperation for SegmentAngles<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let count = self.feet.segment.len();
        let (segments, alongs) = (&self.feet.segment[..count], &self.feet.along[..count]);
        let [us, vs, ws] = self.poses.axes().map(|values| &values[..count]);
        let [square_sines, cosines] = self.angles.columns(count);
        let [from, to] = self.axes;
        let turn = [to[0] - from[0], to[1] - from[1], to[2] - from[2]];
        for index in 0..count {
            let t = alongs[index];
            let nominal = [from[0] + t * turn[0], from[1] + t * turn[1], from[2] + t * turn[2]];
            let axis = [us[index], vs[index], ws[index]];
            let [square, cosine] = ToolAngles::square_sine_and_cosine(axis, nominal);
            let is_here = segments[index] == self.segment;
            square_sines[index] = if is_here { square } else { square_sines[index] };
            cosines[index] = if is_here { cosine } else { cosines[index] };
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
            tracker.push(at(0.01 * f64::from(k), 0.0), false);
        }
        // At rest the end point is repeated.
        tracker.push(at(0.1, 0.0), false);
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
        tracker.push(tilted(0.01, 0.02), false);
        let error = tracker.nearest(&tilted(0.005, 0.01 + 1e-6)).orientation;
        assert!((error - 1e-6).abs() < 1e-11, "{error}");
    }
}
