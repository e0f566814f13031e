//! Inverse kinematics: tool pose to joints.

use std::f64::consts::{PI, TAU};

use nalgebra::Vector3;

use super::chain::{Kinematics, ToolPose};
use super::error::KinematicsError;
use super::role::AxisRole;
use super::rotation::Rotation;

/// Sine of the angle between the tool axis and the first rotary axis below which the pose is singular: a few hundred times
/// the rounding of a unit vector. It also bounds the orientation error at the singularity, rad.
const SINGULAR_SINE: f64 = 1e-13;
/// Tolerance on the orientation for machines with fewer than two rotary axes, rad: one nanometer per meter.
const ANGLE_TOLERANCE: f64 = 1e-9;
/// Tolerance on the position of a missing linear axis, m.
const POSITION_TOLERANCE: f64 = 1e-9;
/// Tolerance on the travel limits of rotary axes, rad.
const TRAVEL_TOLERANCE: f64 = 1e-9;

impl Kinematics {
    /// Computes the joints for a tool pose (inverse kinematics) into `out`, one value per joint, m or rad.
    ///
    /// The solution nearest to the reference joints `near` (sum of squares) is selected from the two pairs of angles with any
    /// number of turns. Solutions inside the travel limits of the rotary axes take precedence; other travel limits are not
    /// checked. At the singularity, the first rotary axis of the chain keeps its value of `near`, and so do joints without
    /// role. The length of the tool axis is irrelevant.
    ///
    /// # Errors
    ///
    /// Any [`KinematicsError`]; `out` remains unchanged.
    pub fn inverse(&self, pose: &ToolPose, near: &[f64], out: &mut [f64]) -> Result<(), KinematicsError> {
        for found in [near.len(), out.len()] {
            if found != self.joints {
                return Err(KinematicsError::WrongSize { found, wanted: self.joints });
            }
        }
        let near_angles = self.angles_of(near);
        if !pose.tip.iter().chain(&pose.axis).chain(&near_angles).all(|value| value.is_finite()) {
            return Err(KinematicsError::NotFinite { tip: pose.tip.into(), axis: pose.axis.into() });
        }
        let angles = self.angles(&pose.axis, near_angles)?;
        let linear = self.linear_joints(pose.tip, &angles.map(f64::sin_cos));
        for (position, role) in linear.iter().zip(AxisRole::LINEAR) {
            if self.role(role).is_none() && position.abs() > POSITION_TOLERANCE {
                let (tip, position) = (pose.tip.into(), *position);
                return Err(KinematicsError::TipUnreachable { tip, missing: role, position });
            }
        }
        out.copy_from_slice(near);
        self.set_linear(linear, out);
        self.set_angles(angles, out);
        Ok(())
    }

    /// Returns the angles of the rotary axes for a tool axis, rad, 0 for a missing one.
    fn angles(&self, axis: &Vector3<f64>, near: [f64; 2]) -> Result<[f64; 2], KinematicsError> {
        if axis.iter().all(|component| *component == 0.0) {
            return Err(KinematicsError::NoDirection { axis: (*axis).into() });
        }
        let [first, second] = self.rotations();
        match (first.joint(), second.joint()) {
            (Some(_), Some(_)) => Ok(self.both_angles(axis, near)),
            (Some(_), None) => Ok([single_angle(first, axis, near[0])?, 0.0]),
            (None, _) => Ok([0.0, single_angle(second, axis, near[1])?]),
        }
    }

    /// Returns the angles of both rotary axes for a tool axis, rad.
    fn both_angles(&self, axis: &Vector3<f64>, near: [f64; 2]) -> [f64; 2] {
        let [x, y, z] = [axis.x, axis.y, axis.z];
        // Components of the tool axis along the first rotary axis and in its plane. The first one in the plane is where the
        // second rotary axis tilts the tool from the first axis.
        let [first, second] = self.rotations().each_ref().map(Rotation::role);
        let (along, plane) = match (first, second) {
            (AxisRole::A, _) => (x, [z, -y]),
            (AxisRole::B, _) => (-y, [z, x]),
            (_, AxisRole::A) => (z, [-y, x]),
            _ => (z, [x, y]),
        };
        let is_from_z = first == AxisRole::C;
        let tilt = |across: f64| if is_from_z { across.atan2(along) } else { along.atan2(across) };
        let across = plane[0].hypot(plane[1]);
        if across <= SINGULAR_SINE * across.hypot(along) {
            // Residual component in the plane, at the present angle of the first axis.
            let (sin, cos) = near[0].sin_cos();
            return [near[0], nearest_turn(tilt(plane[0] * cos + plane[1] * sin), near[1])];
        }
        let (turn, tilt) = (plane[1].atan2(plane[0]), tilt(across));
        let other = if is_from_z { -tilt } else { PI - tilt };
        let solutions = [[turn, tilt], [turn + PI, other]]
            .map(|angles| [0, 1].map(|place| nearest_turn(angles[place], near[place])));
        let rank = |angles: [f64; 2]| {
            let outside = self.rotations().iter().zip(angles);
            let outside =
                outside.filter(|(rotation, angle)| rotation.is_outside_travel(*angle, TRAVEL_TOLERANCE));
            (outside.count(), (angles[0] - near[0]).powi(2) + (angles[1] - near[1]).powi(2))
        };
        let second_is_better = rank(solutions[1]) < rank(solutions[0]);
        solutions[usize::from(second_is_better)]
    }

    /// Returns the angle between two directions, 0 to π rad, accurate at small angles too. Lengths are irrelevant; the angle
    /// to a zero vector is 0.
    pub fn orientation_error(a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
        a.cross(b).norm().atan2(a.dot(b))
    }
}

/// Returns the angle of the only rotary axis for a tool axis that it reaches, rad; without a joint it is `near`.
fn single_angle(rotation: &Rotation, axis: &Vector3<f64>, near: f64) -> Result<f64, KinematicsError> {
    let (angle, off_plane, missing) = match rotation.joint().map(|_| rotation.role()) {
        Some(AxisRole::A) => ((-axis.y).atan2(axis.z), axis.x.abs().atan2(axis.y.hypot(axis.z)), AxisRole::C),
        Some(AxisRole::B) => (axis.x.atan2(axis.z), axis.y.abs().atan2(axis.x.hypot(axis.z)), AxisRole::C),
        _ => (near, axis.x.hypot(axis.y).atan2(axis.z), AxisRole::A),
    };
    match off_plane <= ANGLE_TOLERANCE {
        true => Ok(nearest_turn(angle, near)),
        false => Err(KinematicsError::AxisUnreachable { axis: (*axis).into(), missing, angle: off_plane }),
    }
}

/// Returns `angle` plus the number of full turns that brings it nearest to `near`, rad.
fn nearest_turn(angle: f64, near: f64) -> f64 {
    angle + TAU * ((near - angle) / TAU).round()
}
