//! Deviations of tool poses from a path.

use nalgebra::Vector3;

/// Point of a path nearest to a tool pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NearestPoint {
    /// Progress along the path ([`Path::length`](crate::path::Path::length)).
    pub progress: f64,
    /// Position in the workpiece frame, m.
    pub point: Vector3<f64>,
    /// Tool axis of the path at that point.
    pub axis: Vector3<f64>,
    /// Contour error: distance of the tool tip from the point, m.
    pub distance: f64,
    /// Contour error without overshoot beyond the path's ends, m: distance from the path extended straight
    /// beyond its first and last point.
    pub within_ends: f64,
    /// Orientation error: angle between the tool axes, rad.
    pub orientation: f64,
}

/// Deviations of consecutive poses from a path.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PathDeviations {
    /// [`NearestPoint::distance`] of each pose, m.
    pub distance: Vec<f64>,
    /// [`NearestPoint::within_ends`] of each pose, m.
    pub within_ends: Vec<f64>,
    /// [`NearestPoint::orientation`] of each pose, rad.
    pub orientation: Vec<f64>,
}

impl PathDeviations {
    /// Sets the number of poses; the values of further ones are 0.
    pub(super) fn resize(&mut self, count: usize) {
        self.distance.resize(count, 0.0);
        self.within_ends.resize(count, 0.0);
        self.orientation.resize(count, 0.0);
    }

    /// Sets the deviations of the poses from `index` on to those of one pose.
    pub(super) fn fill_from(&mut self, index: usize, nearest: &NearestPoint) {
        self.distance[index..].fill(nearest.distance);
        self.within_ends[index..].fill(nearest.within_ends);
        self.orientation[index..].fill(nearest.orientation);
    }
}
