//! Directions of motions where they meet.

use super::super::machine_model::MachineModel;
use super::super::motion_curve::{MotionCurve, Shape};
use super::super::vector::{JointVector, MAX_JOINTS, norm};

/// Change of direction below which a path is straight, and distance from a reversal at which it is one, rad.
pub(super) const STRAIGHT: f64 = 1e-7;
pub(super) const REVERSAL: f64 = 1e-3;
/// Returns the radius of the arc that passes a corner at a distance, m.
pub(super) fn corner_radius(angle: f64, distance: f64) -> f64 {
    let cosine = (0.5 * angle).cos();
    distance * cosine / (1.0 - cosine)
}

/// Returns true if two motions that meet lie in the plane of the arcs among them.
pub(super) fn are_coplanar(
    curves: [&MotionCurve; 2],
    tangents: &[JointVector; 2],
    model: &MachineModel,
) -> bool {
    curves.iter().all(|curve| match &curve.shape {
        Shape::Arc(arc) => (0..model.joints.len())
            .filter(|joint| !arc.plane.contains(joint))
            .all(|joint| tangents.iter().all(|tangent| tangent[joint].abs() < STRAIGHT)),
        _ => true,
    })
}

/// Returns true for X, Y and Z.
pub(super) fn is_spatial(model: &MachineModel, joint: usize) -> bool {
    model.kinds.linear.iter().position(|&linear| linear == joint).is_some_and(|position| position < 3)
}

/// Returns a rotary tolerance in the metric of the path, m.
pub(super) fn rotary_length(tolerance: f64, model: &MachineModel) -> f64 {
    let Some(&joint) = model.kinds.rotary.first() else { return tolerance };
    let mut step = [0.0; MAX_JOINTS];
    step[joint] = tolerance;
    model.kinds.length(&step)
}

/// Returns the change of direction of X, Y and Z; a motion without them counts as one along X.
pub(super) fn angle_between(tangents: &[JointVector; 2], model: &MachineModel) -> f64 {
    let linear = &model.kinds.linear;
    let unit = tangents.each_ref().map(|tangent| -> JointVector {
        let length = norm(tangent, linear);
        std::array::from_fn(|i| match length > 0.0 {
            true => tangent[i] / length,
            false => f64::from(linear.first() == Some(&i)),
        })
    });
    let half = |sign: f64| {
        let sum: f64 = linear.iter().map(|&i| (unit[0][i] + sign * unit[1][i]).powi(2)).sum();
        sum.sqrt()
    };
    2.0 * half(-1.0).atan2(half(1.0))
}
