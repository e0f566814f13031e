//! Rotation of the workpiece or of the tool about a rotary axis.

use nalgebra::Vector3;

use super::role::AxisRole;
use crate::config::{KinematicsConfig, RotaryName};

/// Rotation about a principal direction of the machine: a rotary axis of the kinematic chain.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rotation {
    name: RotaryName,
    /// Index of the joint; `None` if the machine has none: the angle is 0.
    joint: Option<usize>,
    is_head: bool,
    pivot: Vector3<f64>,
    /// Travel limits of the joint, rad.
    travel: [f64; 2],
}

impl Rotation {
    /// Creates the rotations of a machine, from the workpiece to the tool. `joint` returns index and travel limits of the
    /// joint with a role.
    pub(super) fn of_chain(
        geometry: &KinematicsConfig,
        joint: impl Fn(AxisRole) -> Option<(usize, [f64; 2])>,
    ) -> [Self; 2] {
        [0, 1].map(|place| {
            let name = geometry.chain.axes[place];
            let joint = name.and_then(|name| joint(name.into()));
            let pivot = match name {
                Some(RotaryName::A) => Vector3::new(0.0, geometry.pivot_a[0], geometry.pivot_a[1]),
                Some(RotaryName::B) => Vector3::new(geometry.pivot_b[0], 0.0, geometry.pivot_b[1]),
                Some(RotaryName::C) => Vector3::new(geometry.pivot_c[0], geometry.pivot_c[1], 0.0),
                None => Vector3::zeros(),
            };
            Rotation {
                name: name.unwrap_or(RotaryName::C),
                joint: joint.map(|(index, _)| index),
                is_head: place >= geometry.chain.tables,
                pivot,
                travel: joint.map_or([f64::NEG_INFINITY, f64::INFINITY], |(_, travel)| travel),
            }
        })
    }

    /// Returns the index of its joint; `None` if the machine has none.
    pub fn joint(&self) -> Option<usize> {
        self.joint
    }

    /// Returns true for a head, which rotates the tool, and false for a table, which rotates the workpiece against the sign
    /// of its joint (ISO 841).
    pub fn is_head(&self) -> bool {
        self.is_head
    }

    /// Returns the point on the axis that is fixed in the configuration, in the machine frame with every axis at home, m.
    pub fn pivot(&self) -> Vector3<f64> {
        self.pivot
    }

    /// Returns the indices of the two coordinates that change: a positive rotation turns the first towards the second.
    pub fn plane(&self) -> [usize; 2] {
        match self.name {
            RotaryName::A => [1, 2],
            RotaryName::B => [2, 0],
            RotaryName::C => [0, 1],
        }
    }

    /// Returns the unit vector of the axis of a positive rotation.
    pub fn direction(&self) -> Vector3<f64> {
        let [i, j] = self.plane();
        let mut direction = Vector3::zeros();
        direction[3 - i - j] = 1.0;
        direction
    }

    /// Returns the role of its joint.
    pub fn role(&self) -> AxisRole {
        self.name.into()
    }

    /// Returns true if `angle`, rad, is outside the travel limits by more than `tolerance`.
    pub(super) fn is_outside_travel(&self, angle: f64, tolerance: f64) -> bool {
        let [min, max] = self.travel;
        angle < min - tolerance || angle > max + tolerance
    }

    /// Returns the vector rotated by the angle with this sine and cosine.
    #[inline(always)]
    pub(super) fn turned(&self, v: Vector3<f64>, (sin, cos): (f64, f64)) -> Vector3<f64> {
        match self.name {
            RotaryName::A => Vector3::new(v.x, cos * v.y - sin * v.z, sin * v.y + cos * v.z),
            RotaryName::B => Vector3::new(sin * v.z + cos * v.x, v.y, cos * v.z - sin * v.x),
            RotaryName::C => Vector3::new(cos * v.x - sin * v.y, sin * v.x + cos * v.y, v.z),
        }
    }

    /// Returns the point rotated about the pivot.
    #[inline(always)]
    pub(super) fn turned_point(&self, point: Vector3<f64>, sin_cos: (f64, f64)) -> Vector3<f64> {
        self.turned(point - self.pivot, sin_cos) + self.pivot
    }

    /// Returns the point rotated about the pivot in the opposite direction.
    #[inline(always)]
    pub(super) fn turned_back(&self, point: Vector3<f64>, (sin, cos): (f64, f64)) -> Vector3<f64> {
        self.turned(point - self.pivot, (-sin, cos)) + self.pivot
    }
}
