//! Validation of the plant parameters of an axis against each other: transmission, load and friction.

use super::cross_check::CrossChecks;
use super::declaration::{CheckedValues, JointVariant, ParameterGroup};
use super::error::ConfigError;
use super::plant::GearConfig;
use super::value::{Value, number_text};
use crate::units::Rounded;

const STIFFNESS: &[&str] = &["transmission.stiffness_n_um", "transmission.stiffness_nm_rad"];
const DAMPING: &[&str] = &["transmission.damping_n_s_m", "transmission.damping_nm_s_rad"];
const LOAD: &[&str] = &["transmission.load_mass_kg", "transmission.load_inertia_kg_m2"];
const BACKLASH: &[&str] = &["transmission.backlash_um", "transmission.backlash_deg"];
const LOAD_FRICTION: &[&str] = &["transmission.load_friction"];
const STRUCTURE: &[&str] = &["structure.mass_kg", "structure.inertia_kg_m2"];
const STRUCTURE_FREQUENCY: &[&str] = &["structure.frequency_hz"];
const PRESLIDING: &[&str] = &["friction.presliding_stiffness_n_um", "friction.presliding_stiffness_nm_rad"];
const PRESLIDING_DAMPING: &[&str] =
    &["friction.presliding_damping_n_s_m", "friction.presliding_damping_nm_s_rad"];
const ATTRACTION: &[&str] = &["friction.presliding_attraction_n_s", "friction.presliding_attraction_nm_s"];

/// Transmissions that are stepped from event to event.
pub(super) const EVENT_DRIVEN: [&[&str]; 3] = [BACKLASH, LOAD_FRICTION, STRUCTURE_FREQUENCY];

/// Checks the plant of an axis.
pub(super) fn check_plant(set: &CrossChecks<'_>, joint: &JointVariant) -> Result<(), ConfigError> {
    check_gear(set, joint)?;
    check_elasticity(set, joint)?;
    check_backlash(set, joint)?;
    check_friction(set, joint)
}

fn check_gear(set: &CrossChecks<'_>, joint: &JointVariant) -> Result<(), ConfigError> {
    let name = &joint.name;
    let drive = joint.key(&["transmission.screw_lead_mm", "transmission.gear_ratio"]);
    let direct = joint.key(&["transmission.direct"]);
    match (set.value(&direct) == Some(Value::Bool(true)), set.is_given(&drive)) {
        (true, true) => Err(set.rejection(
            &[&drive, &direct],
            format!("be the only transmission of {name}, found {drive} and {direct} = true"),
        )),
        (false, false) => {
            let wanted = format!("expected {drive} or {direct} = true");
            Err(ConfigError::missing(set.origin, &format!("{name}.transmission"), &wanted))
        }
        _ => Ok(()),
    }
}

/// Checks that stiffness and load are given together, and that the motor has an inertia of its own.
fn check_elasticity(set: &CrossChecks<'_>, joint: &JointVariant) -> Result<(), ConfigError> {
    let [stiffness, damping, load] = [STIFFNESS, DAMPING, LOAD].map(|suffixes| joint.key(suffixes));
    set.require(&load, "it", &stiffness)?;
    set.require(&stiffness, "it", &load)?;
    set.require(&stiffness, "it", &damping)?;
    let motor = joint.key(&["motor.inertia_kg_m2", "motor.mass_kg"]);
    let values = CheckedValues { entries: set.entries, joints: &set.layout.joints, joint: Some(joint) };
    let ratio = GearConfig::read(&values).and_then(|gear| gear.ratio());
    let (Some(entry), Some(load_inertia), Some(inertia), Some(ratio)) =
        (set.entries.get(&load), set.number(&load), set.number(&motor), ratio)
    else {
        return Ok(());
    };
    let most = inertia / (ratio * ratio);
    if load_inertia < most {
        return Ok(());
    }
    let allowed = format!("be below {}, which is {motor} at the axis", Rounded(most));
    Err(ConfigError::not_allowed(&entry.source, &load, &number_text(load_inertia), &allowed))
}

/// Checks that backlash, friction at the load and structure have a stiffness and no presliding beside them, and that the
/// position controller of a compensated backlash reads the motor.
fn check_backlash(set: &CrossChecks<'_>, joint: &JointVariant) -> Result<(), ConfigError> {
    let [stiffness, presliding, frequency, inertia] =
        [STIFFNESS, PRESLIDING, STRUCTURE_FREQUENCY, STRUCTURE].map(|suffixes| joint.key(suffixes));
    for suffixes in [BACKLASH, LOAD_FRICTION, STRUCTURE_FREQUENCY, STRUCTURE] {
        let key = joint.key(suffixes);
        set.require(&stiffness, "it", &key)?;
        set.exclude([&key, &presliding], "")?;
    }
    set.require(&inertia, "it", &frequency)?;
    set.require(&frequency, "it", &inertia)?;
    let width = joint.key(&["backlash_compensation.width_um", "backlash_compensation.width_deg"]);
    let feedback = joint.key(&["position_loop.feedback"]);
    match set.is_given(&width) && set.is_chosen(&feedback, "load") {
        true => Err(set.rejection(
            &[&width, &feedback],
            format!(
                "not be given together: a scale at the load ({feedback}) sees the backlash, {width} must be 0"
            ),
        )),
        false => Ok(()),
    }
}

fn check_friction(set: &CrossChecks<'_>, joint: &JointVariant) -> Result<(), ConfigError> {
    let [stiffness, damping, attraction] =
        [PRESLIDING, PRESLIDING_DAMPING, ATTRACTION].map(|suffixes| joint.key(suffixes));
    let elements = joint.key(&["friction.presliding_elements"]);
    set.require(&stiffness, "it above 0", &damping)?;
    set.require(&stiffness, "it above 0", &elements)?;
    set.exclude([&elements, &damping], "; the generalized Maxwell-slip model has no damping")?;
    set.require(&elements, "it above 0", &attraction)?;
    let [a_key, c_key] = ["friction.a", "friction.c"].map(|suffix| joint.key(&[suffix]));
    match (set.number(&a_key), set.number(&c_key)) {
        (Some(a), Some(c)) if a + c < 0.0 => Err(set.rejection(
            &[&a_key, &c_key],
            format!(
                "keep a + c ≥ 0, the friction at standstill, found a = {} and c = {}",
                number_text(a),
                number_text(c)
            ),
        )),
        _ => Ok(()),
    }
}
