//! Circular arc or helix: a circle in two coordinates, linear in the others.

use super::derivatives::Derivatives;
use crate::units::REVOLUTION;

/// Circle of an arc.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Circle {
    /// Indices of the two coordinates.
    pub plane: [usize; 2],
    /// Center in these coordinates, m.
    pub center: [f64; 2],
    /// Radius, m.
    pub radius: f64,
    /// Swept angle, rad, positive from the first coordinate towards the second.
    pub sweep: f64,
}

/// An arc, parametrized by arc length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct CircularArc {
    pub circle: Circle,
    /// Vector from the center to the start, m.
    pub start_radius: [f64; 2],
    /// Angle per unit of arc length, rad/m.
    pub angle_per_length: f64,
}

impl CircularArc {
    /// Returns the vector from the center to the point at arc length `s`.
    fn radius_at(&self, s: f64) -> [f64; 2] {
        rotated(self.start_radius, self.angle_per_length * s)
    }

    /// Writes the coordinates in the plane.
    pub fn point(&self, s: f64, out: &mut [f64]) {
        let radius_vector = self.radius_at(s);
        for i in 0..2 {
            out[self.circle.plane[i]] = self.circle.center[i] + radius_vector[i];
        }
    }

    /// Writes the derivatives of the coordinates in the plane.
    pub fn derivatives(&self, s: f64, out: &mut Derivatives) {
        let [x, y] = self.radius_at(s);
        let k = self.angle_per_length;
        let [p, q] = self.circle.plane;
        (out.first[p], out.first[q]) = (-k * y, k * x);
        (out.second[p], out.second[q]) = (-k * k * x, -k * k * y);
        (out.third[p], out.third[q]) = (k * k * k * y, -k * k * k * x);
    }
}

/// Rotates a vector by `angle`, rad; bit-identical after whole revolutions.
pub(super) fn rotated(radius_vector: [f64; 2], angle: f64) -> [f64; 2] {
    if (angle / REVOLUTION).fract() == 0.0 {
        return radius_vector;
    }
    let (sine, cosine) = angle.sin_cos();
    let [x, y] = radius_vector;
    [x * cosine - y * sine, x * sine + y * cosine]
}
