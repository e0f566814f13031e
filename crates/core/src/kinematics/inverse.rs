//! Inverse kinematics: tool pose to joints.

use std::f64::consts::{PI, TAU};

use nalgebra::Vector3;

use super::chain::{AxisRole, Kinematics, ToolPose};
use super::error::KinematicsError;

/// Sine of the angle between the tool axis and the axis of C below which the pose is singular: a few hundred times the
/// rounding of a unit vector. It also bounds the orientation error at the singularity, rad.
const SINGULAR_SINE: f64 = 1e-13;
/// Tolerance on the orientation for machines without A or C, rad: one nanometer per meter.
const ANGLE_TOLERANCE: f64 = 1e-9;
/// Tolerance on the position of a missing linear axis, m.
const POSITION_TOLERANCE: f64 = 1e-9;
/// Tolerance on the travel limits of A, rad.
const TRAVEL_TOLERANCE: f64 = 1e-9;

impl Kinematics {
    /// Computes the joints for a tool pose (inverse kinematics) into `out`, one value per joint, m or rad.
    ///
    /// The solution nearest to the reference joints `near` (sum of squares) is selected from (a, c) and (−a, c + 180°) with
    /// any number of turns. Solutions inside the travel limits of A take precedence; other travel limits are not checked. At
    /// the singularity (A = 0), C keeps its value of `near`, and so do joints without role. The length of the tool axis is
    /// irrelevant.
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
        let near_angles = [self.value(near, AxisRole::A), self.value(near, AxisRole::C)];
        if !pose.tip.iter().chain(&pose.axis).chain(&near_angles).all(|value| value.is_finite()) {
            return Err(KinematicsError::NotFinite { tip: pose.tip.into(), axis: pose.axis.into() });
        }
        let [a, c] = self.angles(&pose.axis, near_angles)?;
        let linear = self.tables(a, c).linear_joints(pose.tip);
        for (position, role) in linear.iter().zip(AxisRole::LINEAR) {
            if self.role(role).is_none() && position.abs() > POSITION_TOLERANCE {
                let (tip, position) = (pose.tip.into(), *position);
                return Err(KinematicsError::TipUnreachable { tip, missing: role, position });
            }
        }
        out.copy_from_slice(near);
        let values = [
            (AxisRole::X, linear.x),
            (AxisRole::Y, linear.y),
            (AxisRole::Z, linear.z),
            (AxisRole::A, a),
            (AxisRole::C, c),
        ];
        for (role, value) in values {
            self.set(role, value, out);
        }
        Ok(())
    }

    /// Returns A and C for a tool axis, rad.
    fn angles(&self, axis: &Vector3<f64>, [near_a, near_c]: [f64; 2]) -> Result<[f64; 2], KinematicsError> {
        let across = axis.x.hypot(axis.y);
        let length = across.hypot(axis.z);
        if length == 0.0 {
            return Err(KinematicsError::NoDirection { axis: (*axis).into() });
        }
        let require_within_tolerance = |missing: AxisRole, angle: f64| {
            if angle <= ANGLE_TOLERANCE {
                return Ok(());
            }
            Err(KinematicsError::AxisUnreachable { axis: (*axis).into(), missing, angle })
        };
        if self.role(AxisRole::A).is_none() {
            require_within_tolerance(AxisRole::A, across.atan2(axis.z))?;
            return Ok([0.0, near_c]);
        }
        if self.role(AxisRole::C).is_none() {
            require_within_tolerance(AxisRole::C, axis.x.abs().atan2(axis.y.hypot(axis.z)))?;
            return Ok([nearest_turn((-axis.y).atan2(axis.z), near_a), 0.0]);
        }
        if across <= SINGULAR_SINE * length {
            // Residual transverse component, at the present angle of C.
            let (sin_c, cos_c) = near_c.sin_cos();
            let along = axis.x * sin_c - axis.y * cos_c;
            return Ok([nearest_turn(along.atan2(axis.z), near_a), near_c]);
        }
        let (a, c) = (across.atan2(axis.z), axis.x.atan2(-axis.y));
        let solutions =
            [[a, c], [-a, c + PI]].map(|[a, c]| [nearest_turn(a, near_a), nearest_turn(c, near_c)]);
        let rank =
            |[a, c]: [f64; 2]| (self.is_outside_travel(a), (a - near_a).powi(2) + (c - near_c).powi(2));
        let second_is_better = rank(solutions[1]) < rank(solutions[0]);
        Ok(solutions[usize::from(second_is_better)])
    }

    fn is_outside_travel(&self, a: f64) -> bool {
        let [min, max] = self.travel_a;
        a < min - TRAVEL_TOLERANCE || a > max + TRAVEL_TOLERANCE
    }

    /// Returns the angle between two directions, 0 to π rad, accurate at small angles too. Lengths are irrelevant; the angle
    /// to a zero vector is 0.
    pub fn orientation_error(a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
        a.cross(b).norm().atan2(a.dot(b))
    }
}

/// Returns `angle` plus the number of full turns that brings it nearest to `near`, rad.
fn nearest_turn(angle: f64, near: f64) -> f64 {
    angle + TAU * ((near - angle) / TAU).round()
}
