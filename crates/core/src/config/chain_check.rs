//! Validation of the kinematic chain.

use super::cross_check::CrossChecks;
use super::error::ConfigError;
use super::rotary_chain::{LINEAR, RotaryName, is_rotary};
use super::value::Value;

const CHAIN: &str = "kinematics.chain";

/// Checks that the chain contains the linear axes once and at most two rotary joints, the second of which tilts the tool.
pub(super) fn check_chain(set: &CrossChecks<'_>) -> Result<(), ConfigError> {
    let Some(Value::TextList(list)) = set.value(CHAIN) else { return Ok(()) };
    let reject = |allowed: String| Err(set.rejection(&[CHAIN], allowed));
    let (linear, rotary): (Vec<&String>, Vec<&String>) =
        list.iter().partition(|name| name.eq_ignore_ascii_case(LINEAR));
    if linear.len() != 1 {
        return reject(format!(
            "contain {LINEAR} once: tables before it, heads behind it, for example [c, a, {LINEAR}]"
        ));
    }
    let joints: Vec<&str> = set.layout.joints.iter().map(|joint| joint.name.as_str()).collect();
    for (index, name) in rotary.iter().enumerate() {
        let is_joint = set.layout.joints.iter().any(|joint| is_rotary(joint, name));
        if RotaryName::of(name).is_none() || !is_joint {
            let wanted = RotaryName::NAMES.join(", ");
            return reject(format!(
                "contain rotary joints of the machine named {wanted} only, found {name}; joints: {}",
                joints.join(", ")
            ));
        }
        if rotary[..index].iter().any(|other| other.eq_ignore_ascii_case(name)) {
            return reject(format!("contain each joint once, found {name} twice"));
        }
    }
    match rotary[..] {
        [] | [_] => Ok(()),
        [_, second] if RotaryName::of(second) != Some(RotaryName::C) => Ok(()),
        [_, _] => {
            reject("not have c as the second rotary joint: it turns the tool about its axis".to_owned())
        }
        _ => reject("contain at most two rotary joints".to_owned()),
    }
}

/// Returns true if the chain has the tables c and a, which carry a workpiece with a mass.
pub(super) fn has_tables_c_and_a(set: &CrossChecks<'_>) -> bool {
    match set.value(CHAIN) {
        Some(Value::TextList(list)) => {
            list.len() == 3
                && list.iter().zip(["c", "a", LINEAR]).all(|(name, wanted)| name.eq_ignore_ascii_case(wanted))
        }
        _ => ["a", "c"].iter().all(|name| set.layout.joints.iter().any(|joint| is_rotary(joint, name))),
    }
}
