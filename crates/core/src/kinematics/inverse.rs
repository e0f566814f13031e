//! Tool pose to joints.

use std::f64::consts::{PI, TAU};

use nalgebra::Vector3;

use super::chain::{Kinematics, Role, ToolPose};
use super::error::KinematicsError;

/// Sine of the angle between tool axis and C below which C is free: a few hundred times the rounding of
/// a unit vector, whose transverse part has no direction there. It also bounds by how much the tool
/// axis is not the one asked for, rad.
const SINGULAR_SINE: f64 = 1e-13;
/// How far a tool axis may be from what a machine with fewer axes reaches, rad: a nanometer in a meter.
const ANGLE_TOLERANCE: f64 = 1e-9;
/// How far a linear axis that does not exist may have to be from 0, m.
const POSITION_TOLERANCE: f64 = 1e-9;
/// Rounding that does not put A outside its travel limits, rad.
const TRAVEL_TOLERANCE: f64 = 1e-9;

impl Kinematics {
    /// Joints that bring the tool to the pose, into `out`: m or rad, one value for each joint.
    ///
    /// Of the solutions (a, c) and (−a, c + 180°) and their turns it is the one nearest to `near`, by
    /// the sum of the squares; one inside the travel limits of A goes before one outside it. No other stroke
    /// is looked at. Where C is free (A = 0), it keeps its value of `near`. Joints without a role keep
    /// theirs. The length of the pose's axis does not matter.
    ///
    /// # Errors
    ///
    /// Any [`KinematicsError`]; `out` is unchanged then.
    pub fn inverse(&self, pose: &ToolPose, near: &[f64], out: &mut [f64]) -> Result<(), KinematicsError> {
        for found in [near.len(), out.len()] {
            if found != self.joints {
                return Err(KinematicsError::WrongSize { found, wanted: self.joints });
            }
        }
        let near_angles = [self.value(near, Role::A), self.value(near, Role::C)];
        if !pose.tip.iter().chain(&pose.axis).chain(&near_angles).all(|value| value.is_finite()) {
            return Err(KinematicsError::NotFinite { tip: pose.tip.into(), axis: pose.axis.into() });
        }
        let [a, c] = self.angles(&pose.axis, near_angles)?;
        let linear = self.tables(a, c).linear_joints(pose.tip);
        for (position, role) in linear.iter().zip(Role::LINEAR) {
            if self.role(role).is_none() && position.abs() > POSITION_TOLERANCE {
                let (tip, position) = (pose.tip.into(), *position);
                return Err(KinematicsError::TipUnreachable { tip, missing: role, position });
            }
        }
        out.copy_from_slice(near);
        let values =
            [(Role::X, linear.x), (Role::Y, linear.y), (Role::Z, linear.z), (Role::A, a), (Role::C, c)];
        for (role, value) in values {
            self.put(role, value, out);
        }
        Ok(())
    }

    /// A and C for a tool axis, rad.
    fn angles(&self, axis: &Vector3<f64>, [near_a, near_c]: [f64; 2]) -> Result<[f64; 2], KinematicsError> {
        let across = axis.x.hypot(axis.y);
        let length = across.hypot(axis.z);
        if length == 0.0 {
            return Err(KinematicsError::NoDirection { axis: (*axis).into() });
        }
        let reached_within = |missing: Role, angle: f64| {
            if angle <= ANGLE_TOLERANCE {
                return Ok(());
            }
            Err(KinematicsError::AxisUnreachable { axis: (*axis).into(), missing, angle })
        };
        if self.role(Role::A).is_none() {
            reached_within(Role::A, across.atan2(axis.z))?;
            return Ok([0.0, near_c]);
        }
        if self.role(Role::C).is_none() {
            reached_within(Role::C, axis.x.abs().atan2(axis.y.hypot(axis.z)))?;
            return Ok([nearest_turn((-axis.y).atan2(axis.z), near_a), 0.0]);
        }
        if across <= SINGULAR_SINE * length {
            // What is left of the transverse part, seen with C where it is.
            let (sin_c, cos_c) = near_c.sin_cos();
            let along = axis.x * sin_c - axis.y * cos_c;
            return Ok([nearest_turn(along.atan2(axis.z), near_a), near_c]);
        }
        let (a, c) = (across.atan2(axis.z), axis.x.atan2(-axis.y));
        let solutions =
            [[a, c], [-a, c + PI]].map(|[a, c]| [nearest_turn(a, near_a), nearest_turn(c, near_c)]);
        let rank = |[a, c]: [f64; 2]| (self.outside_travel_limits(a), (a - near_a).powi(2) + (c - near_c).powi(2));
        let second_is_better = rank(solutions[1]) < rank(solutions[0]);
        Ok(solutions[usize::from(second_is_better)])
    }

    fn outside_travel_limits(&self, a: f64) -> bool {
        let [min, max] = self.stroke_a;
        a < min - TRAVEL_TOLERANCE || a > max + TRAVEL_TOLERANCE
    }

    /// Angle between two directions, rad, 0 to π; exact to rounding at every angle, also where the
    /// cosine does not tell small angles apart. Lengths do not matter; 0 where one is zero.
    pub fn orientation_error(a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
        a.cross(b).norm().atan2(a.dot(b))
    }
}

/// `angle` with as many turns as bring it nearest to `near`, rad.
fn nearest_turn(angle: f64, near: f64) -> f64 {
    angle + TAU * ((near - angle) / TAU).round()
}
