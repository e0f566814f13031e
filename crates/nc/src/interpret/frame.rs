//! Programmable frame: affine map of X, Y and Z from programmed coordinates to those of the work coordinate system.
//!
//! Scaling and mirroring (G51), rotation in a plane (G68), tilted planes (G68.2), and the frames of Sinumerik are
//! products of such maps.

use nalgebra::{Matrix3, Rotation3, Unit, Vector3};

use crate::motion::Plane;

/// Largest product of two columns of a frame that counts as 0, relative to their lengths.
const RIGHT: f64 = 1e-12;

/// Affine map of X, Y and Z, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct CoordinateFrame {
    pub linear: Matrix3<f64>,
    pub origin: Vector3<f64>,
}

impl CoordinateFrame {
    /// Returns the frame without effect.
    pub(super) fn identity() -> Self {
        Self { linear: Matrix3::identity(), origin: Vector3::zeros() }
    }

    /// Returns the frame that shifts its origin.
    pub(super) fn shift(origin: Vector3<f64>) -> Self {
        Self { linear: Matrix3::identity(), origin }
    }

    /// Returns the right-handed rotation about a coordinate axis (0 is X) through the origin, rad.
    pub(super) fn rotation(axis: usize, angle: f64) -> Self {
        let direction = Unit::new_unchecked(Vector3::ith(axis, 1.0));
        Self { linear: *Rotation3::from_axis_angle(&direction, angle).matrix(), origin: Vector3::zeros() }
    }

    /// Returns the scaling along X, Y and Z; a negative factor mirrors.
    pub(super) fn scaling(factors: Vector3<f64>) -> Self {
        Self { linear: Matrix3::from_diagonal(&factors), origin: Vector3::zeros() }
    }

    /// Returns this frame with `center` as its fixed point in place of the origin.
    pub(super) fn about(self, center: Vector3<f64>) -> Self {
        Self { linear: self.linear, origin: self.origin + center - self.linear * center }
    }

    /// Returns the map that applies `inner` first, which is the frame programmed later.
    pub(super) fn then(&self, inner: &Self) -> Self {
        Self { linear: self.linear * inner.linear, origin: self.apply(&inner.origin) }
    }

    /// Returns true without effect.
    pub(super) fn is_identity(&self) -> bool {
        *self == Self::identity()
    }

    /// Returns true if the frame shifts only.
    pub(super) fn is_shift(&self) -> bool {
        self.linear == Matrix3::identity()
    }

    /// Returns the plane onto which a plane is mapped, if that is one of coordinate axes and circles remain circles, and
    /// the sign of the turn: −1 if the image of a counterclockwise arc is clockwise.
    pub(super) fn image_of(&self, plane: Plane) -> Option<(Plane, f64)> {
        if self.is_shift() {
            return Some((plane, 1.0));
        }
        let [first, second, normal] = plane.axes();
        let image = self.linear.column(normal);
        let size = image.norm();
        let to = [Plane::Xy, Plane::Zx, Plane::Yz]
            .into_iter()
            .find(|to| (image[to.axes()[2]].abs() - size).abs() < RIGHT * size)?;
        let [x, y] = [first, second].map(|axis| self.linear.column(axis).into_owned());
        let is_circle = x.dot(&y).abs() < RIGHT * x.norm_squared()
            && (x.norm_squared() - y.norm_squared()).abs() < RIGHT * x.norm_squared();
        let [a, b, _] = to.axes();
        is_circle.then(|| (to, (x[a] * y[b] - x[b] * y[a]).signum()))
    }

    /// Returns the image of a point.
    pub(super) fn apply(&self, point: &Vector3<f64>) -> Vector3<f64> {
        self.linear * point + self.origin
    }

    /// Returns the point with an image; the frame must be invertible.
    pub(super) fn invert(&self, image: &Vector3<f64>) -> Vector3<f64> {
        if self.is_shift() {
            return image - self.origin;
        }
        let inverse = self.linear.try_inverse().unwrap_or_else(Matrix3::identity);
        inverse * (image - self.origin)
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use super::*;

    #[test]
    fn a_rotation_about_a_center_keeps_it_and_turns_the_rest() {
        let center = Vector3::new(1.0, 2.0, 3.0);
        let frame = CoordinateFrame::rotation(2, FRAC_PI_2).about(center);
        assert!((frame.apply(&center) - center).norm() < 1e-15);
        assert!((frame.apply(&Vector3::new(2.0, 2.0, 0.0)) - Vector3::new(1.0, 3.0, 0.0)).norm() < 1e-15);
    }

    #[test]
    fn the_later_frame_acts_first_and_the_inverse_returns() {
        let outer = CoordinateFrame::shift(Vector3::new(10.0, 0.0, 0.0));
        let frame = outer.then(&CoordinateFrame::rotation(2, FRAC_PI_2));
        let image = frame.apply(&Vector3::new(1.0, 0.0, 5.0));
        assert!((image - Vector3::new(10.0, 1.0, 5.0)).norm() < 1e-15);
        assert!((frame.invert(&image) - Vector3::new(1.0, 0.0, 5.0)).norm() < 1e-15);
        assert_eq!(frame.image_of(Plane::Xy), Some((Plane::Xy, 1.0)));
        assert_eq!(frame.image_of(Plane::Zx), Some((Plane::Yz, -1.0)), "Z to X, X to Y");
        assert_eq!(CoordinateFrame::scaling(Vector3::new(2.0, 1.0, 1.0)).image_of(Plane::Xy), None);
        assert_eq!(
            CoordinateFrame::scaling(Vector3::new(-2.0, 2.0, 2.0)).image_of(Plane::Xy),
            Some((Plane::Xy, -1.0))
        );
        assert_eq!(CoordinateFrame::rotation(0, 0.3).image_of(Plane::Xy), None);
    }
}
