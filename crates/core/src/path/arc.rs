//! Circular arc, or helix: a circle in two coordinates, the others linear.

use super::block::Derivatives;
use crate::units::REVOLUTION;

/// The circle of an arc.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Circle {
    /// Places of the two coordinates.
    pub plane: [usize; 2],
    /// Center in these, m.
    pub center: [f64; 2],
    /// m.
    pub radius: f64,
    /// rad, positive from the first coordinate towards the second.
    pub sweep: f64,
}

/// An arc by its length.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Arc {
    pub circle: Circle,
    /// From the center to the start, m.
    pub spoke: [f64; 2],
    /// Angle per unit of length, rad/m.
    pub turn: f64,
    /// Change of the other coordinates per unit of length; 0 in the plane.
    pub slopes: Vec<f64>,
}

impl Arc {
    /// The spoke turned by what `s` meters turn it.
    fn spoke_at(&self, s: f64) -> [f64; 2] {
        turned(self.spoke, self.turn * s)
    }

    pub fn point(&self, from: &[f64], s: f64, out: &mut [f64]) {
        for ((value, from), slope) in out.iter_mut().zip(from).zip(&self.slopes) {
            *value = from + slope * s;
        }
        let spoke = self.spoke_at(s);
        for i in 0..2 {
            out[self.circle.plane[i]] = self.circle.center[i] + spoke[i];
        }
    }

    pub fn derivatives(&self, s: f64, out: &mut Derivatives) {
        out.first.copy_from_slice(&self.slopes);
        out.second.fill(0.0);
        out.third.fill(0.0);
        let [x, y] = self.spoke_at(s);
        let k = self.turn;
        let [p, q] = self.circle.plane;
        (out.first[p], out.first[q]) = (-k * y, k * x);
        (out.second[p], out.second[q]) = (-k * k * x, -k * k * y);
        (out.third[p], out.third[q]) = (k * k * k * y, -k * k * k * x);
    }
}

/// `spoke` turned by `angle`, rad; whole revolutions turn it back into itself, bit for bit.
pub(super) fn turned(spoke: [f64; 2], angle: f64) -> [f64; 2] {
    if (angle / REVOLUTION).fract() == 0.0 {
        return spoke;
    }
    let (sine, cosine) = angle.sin_cos();
    let [x, y] = spoke;
    [x * cosine - y * sine, x * sine + y * cosine]
}
