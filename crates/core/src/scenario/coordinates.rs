//! Coordinates by joint name and unit, as in `x_mm` and `c_deg`.

use crate::config::{AxisKind, shortened};
use crate::trajectory::JointLimits;
use crate::units::{DEGREE, MILLIMETER};

use super::error::ScenarioError;
use super::file::{Number, Values};

/// Similarity (Jaro-Winkler) below which a known key is no help.
const NEAR_ENOUGH: f64 = 0.7;

/// Suffix of a coordinate's key, and its unit in SI.
fn unit(kind: AxisKind) -> (&'static str, f64) {
    match kind {
        AxisKind::Linear => ("mm", MILLIMETER),
        AxisKind::Rotary => ("deg", DEGREE),
    }
}

/// Key of a joint's coordinate.
fn key_of(joint: &JointLimits) -> String {
    format!("{}_{}", joint.name, unit(joint.kind).0)
}

/// Place of the joint that `key` names, and the coordinate in m or rad.
pub(super) fn coordinate(
    key: &str,
    value: f64,
    joints: &[JointLimits],
    at: &str,
) -> Result<(usize, f64), ScenarioError> {
    let Some(place) = joints.iter().position(|joint| key_of(joint) == key) else {
        let known: Vec<String> = joints.iter().map(key_of).collect();
        // A key of any length is compared in memory of as many cells.
        let key = shortened(key);
        let nearest = known
            .iter()
            .min_by_key(|known| strsim::damerau_levenshtein(&key, known))
            .filter(|known| strsim::jaro_winkler(&key, known) >= NEAR_ENOUGH);
        let hint = nearest.map(|nearest| format!("; the nearest is {nearest}")).unwrap_or_default();
        return Err(ScenarioError::Key {
            at: at.to_owned(),
            key,
            reason: format!("no coordinate of this machine, which has {}{hint}", known.join(", ")),
        });
    };
    let scaled = value * unit(joints[place].kind).1;
    if !scaled.is_finite() {
        return Err(ScenarioError::Value {
            at: at.to_owned(),
            key: key.to_owned(),
            value,
            allowed: "be a finite number".to_owned(),
        });
    }
    Ok((place, scaled))
}

/// Puts `values` over the coordinates of `point`.
pub(super) fn overlay(
    point: &mut [f64],
    values: &Values,
    joints: &[JointLimits],
    at: &str,
) -> Result<(), ScenarioError> {
    for (key, &Number(value)) in values {
        let (place, value) = coordinate(key, value, joints, at)?;
        point[place] = value;
    }
    Ok(())
}
