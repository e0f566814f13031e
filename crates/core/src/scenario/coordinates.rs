//! Coordinates keyed by joint name and unit, as in `x_mm` and `c_deg`.

use crate::config::AxisKind;
use crate::text::{nearest_hint, nearest_name};
use crate::trajectory::JointLimits;
use crate::units::{DEGREE, MILLIMETER};

use super::error::ScenarioError;
use super::file::KeyedNumbers;
use crate::yaml::YamlNumber;

/// Returns the key suffix of a coordinate and its unit in m or rad.
fn unit(kind: AxisKind) -> (&'static str, f64) {
    match kind {
        AxisKind::Linear => ("mm", MILLIMETER),
        AxisKind::Rotary => ("deg", DEGREE),
    }
}

/// Returns the key of a joint coordinate.
fn key_of(joint: &JointLimits) -> String {
    format!("{}_{}", joint.name, unit(joint.kind).0)
}

/// Returns the joint index of `key` and the coordinate, m or rad.
pub(super) fn coordinate(
    key: &str,
    value: f64,
    joints: &[JointLimits],
    at: &str,
) -> Result<(usize, f64), ScenarioError> {
    let Some(index) = joints.iter().position(|joint| key_of(joint) == key) else {
        let known: Vec<String> = joints.iter().map(key_of).collect();
        let hint = nearest_hint(&nearest_name(key, &known));
        let reason = format!("unknown coordinate; this machine has {}{hint}", known.join(", "));
        return Err(ScenarioError::key(at, key, &reason));
    };
    let scaled = value * unit(joints[index].kind).1;
    if !scaled.is_finite() {
        return Err(ScenarioError::value(at, key, value, "be a finite number"));
    }
    Ok((index, scaled))
}

/// Overwrites the coordinates of `point` that `values` contains.
pub(super) fn overlay(
    point: &mut [f64],
    values: &KeyedNumbers,
    joints: &[JointLimits],
    at: &str,
) -> Result<(), ScenarioError> {
    for (key, &YamlNumber(value)) in values {
        let (index, value) = coordinate(key, value, joints, at)?;
        point[index] = value;
    }
    Ok(())
}
