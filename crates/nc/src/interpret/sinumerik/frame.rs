//! Frames: rotation, scaling, mirroring and translation of the programmed coordinates.

use nalgebra::{Matrix3, Rotation3, Vector3};

use super::super::frame::CoordinateFrame as LinearMap;
use crate::motion::{AXIS_COUNT, Coordinates};

/// Programmable frame: `linear * (x, y, z) + offset`, and an offset of each other axis, m and rad.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct AxisFrame {
    /// Rotation, scaling and mirroring of X, Y and Z.
    pub linear: Matrix3<f64>,
    /// Coarse translation (TRANS, G58).
    pub offset: Coordinates,
    /// Fine translation (ATRANS, G59).
    pub fine: Coordinates,
}

impl Default for AxisFrame {
    /// Returns the frame without effect.
    fn default() -> Self {
        Self { linear: Matrix3::identity(), offset: [0.0; AXIS_COUNT], fine: [0.0; AXIS_COUNT] }
    }
}

impl AxisFrame {
    /// Returns a translation, m and rad.
    pub(super) fn translation(offset: Coordinates) -> Self {
        Self { offset, ..Self::default() }
    }

    /// Returns a rotation by the angles about X, Y and Z, rad, in the order of the control: about Z, then about the new Y,
    /// then about the new X.
    pub(super) fn rotation([x, y, z]: [f64; 3]) -> Self {
        Self::about(2, z).then(&Self::about(1, y)).then(&Self::about(0, x))
    }

    /// Returns a rotation about one axis by an angle, rad.
    pub(super) fn about(axis: usize, angle: f64) -> Self {
        let mut direction = Vector3::zeros();
        direction[axis.min(2)] = 1.0;
        let rotation = Rotation3::from_axis_angle(&nalgebra::Unit::new_unchecked(direction), angle);
        Self { linear: rotation.into_inner(), ..Self::default() }
    }

    /// Returns a scaling of X, Y and Z; −1 mirrors.
    pub(super) fn scaling(factors: [f64; 3]) -> Self {
        Self { linear: Matrix3::from_diagonal(&Vector3::from(factors)), ..Self::default() }
    }

    /// Returns the chain of this frame and one in its coordinates.
    #[must_use]
    pub(super) fn then(&self, inner: &Self) -> Self {
        let chained = |outer: &Coordinates, inner: &Coordinates| {
            let moved = self.linear * linear_part(inner);
            std::array::from_fn(|axis| outer[axis] + if axis < 3 { moved[axis] } else { inner[axis] })
        };
        let [offset, fine] = [(&self.offset, &inner.offset), (&self.fine, &inner.fine)]
            .map(|(outer, inner)| chained(outer, inner));
        Self { linear: self.linear * inner.linear, offset, fine }
    }

    /// Returns the translation with its fine part, m and rad.
    pub(super) fn total(&self) -> Coordinates {
        std::array::from_fn(|axis| self.offset[axis] + self.fine[axis])
    }

    /// Returns the map of X, Y and Z.
    pub(super) fn linear_map(&self) -> LinearMap {
        LinearMap { linear: self.linear, origin: linear_part(&self.total()) }
    }

    /// Returns true without rotation, scaling and mirroring.
    pub(super) fn is_translation(&self) -> bool {
        self.linear == Matrix3::identity()
    }
}

/// Returns X, Y and Z.
fn linear_part(point: &Coordinates) -> Vector3<f64> {
    Vector3::new(point[0], point[1], point[2])
}
