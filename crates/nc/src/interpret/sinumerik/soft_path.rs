//! Path of a smooth approach or retraction beside the contour.

use std::f64::consts::{FRAC_PI_2, PI};

use crate::motion::Coordinates;

/// Shape of the path at the contour.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum SoftShape {
    Line,
    Quarter,
    Semicircle,
}

/// Values of a block, m.
#[derive(Debug, Clone)]
pub(super) struct SoftPath {
    pub shape: SoftShape,
    /// DISR: distance of the cutter from the contour, or radius of the tool center's circle.
    pub distance: f64,
    /// Level DISCL along the normal of the plane, where rapid traverse ends; `None` at the level of the contour.
    pub level: Option<f64>,
    /// FAD: feed of the infeed, m/min.
    pub infeed: Option<f64>,
    /// True if rapid traverse leads to the path.
    pub is_rapid: bool,
    /// Start of the contour.
    pub point: Coordinates,
    /// True if the coordinates of the plane are known; otherwise they are those of the next motion.
    pub has_point: bool,
}

/// Path beside the contour, whose parallel is that of the tool center.
pub(super) struct Beside {
    /// Other end of the path along the axes of the plane, m.
    pub end: [f64; 2],
    /// Center and angle of the circle.
    pub arc: Option<([f64; 2], f64)>,
}

impl SoftPath {
    /// Returns the path beside the contour at a point with the tangent of the contour; `forward` is 1 behind the contour and
    /// −1 in front of it.
    pub fn beside(
        &self,
        point: [f64; 2],
        tangent: [f64; 2],
        forward: f64,
        (side, radius): (f64, f64),
    ) -> Beside {
        let along = |length: f64, across: f64| {
            [
                point[0] + length * tangent[0] - across * tangent[1],
                point[1] + length * tangent[1] + across * tangent[0],
            ]
        };
        // The parallel of the circle has the radius DISR.
        let size = self.distance + radius;
        let center = along(0.0, side * size);
        match self.shape {
            SoftShape::Line => Beside { end: along(forward * size, 0.0), arc: None },
            SoftShape::Quarter => {
                Beside { end: along(forward * size, side * size), arc: Some((center, side * FRAC_PI_2)) }
            }
            SoftShape::Semicircle => {
                Beside { end: along(0.0, 2.0 * side * size), arc: Some((center, side * PI)) }
            }
        }
    }
}
