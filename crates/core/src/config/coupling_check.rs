//! Validation of what concerns several axes: kinematic chain, workpiece on two tables, gantry, cross-coupled control.

use super::chain_check::{check_chain, has_tables_c_and_a};
use super::cross_check::CrossChecks;
use super::definition::AxisKind;
use super::error::ConfigError;
use super::plant_check::EVENT_DRIVEN;
use super::value::Value;

const WORKPIECE_MASS: &str = "workpiece.mass_kg";
const CENTER_OF_MASS: [&str; 3] =
    ["workpiece.center_of_mass_x_mm", "workpiece.center_of_mass_y_mm", "workpiece.center_of_mass_z_mm"];
const MOMENTS: [&str; 3] =
    ["workpiece.inertia_x_kg_m2", "workpiece.inertia_y_kg_m2", "workpiece.inertia_z_kg_m2"];
const GANTRY_AXES: &str = "gantry.axes";
const CONTOUR_GAIN: &str = "contour_control.gain";

/// Checks the couplings between axes.
pub(super) fn check_couplings(set: &CrossChecks<'_>) -> Result<(), ConfigError> {
    check_chain(set)?;
    check_workpiece(set)?;
    check_gantry(set)?;
    check_contour_control(set)
}

/// Checks that a workpiece has a mass, possible moments of inertia and two tables to lie on.
fn check_workpiece(set: &CrossChecks<'_>) -> Result<(), ConfigError> {
    for key in CENTER_OF_MASS.into_iter().chain(MOMENTS) {
        set.require(WORKPIECE_MASS, "it above 0", key)?;
    }
    if !set.is_given(WORKPIECE_MASS) {
        return Ok(());
    }
    if !has_tables_c_and_a(set) {
        let allowed =
            "be 0 on a machine without tables c and a, which carry the workpiece (kinematics.chain)";
        return Err(set.rejection(&[WORKPIECE_MASS], allowed.to_owned()));
    }
    let is_table = |name: &str| ["a", "c"].iter().any(|table| name.eq_ignore_ascii_case(table));
    check_coupled_transmissions(set, WORKPIECE_MASS, is_table)?;
    let moments = MOMENTS.map(|key| set.number(key).unwrap_or_default());
    let sum: f64 = moments.iter().sum();
    if moments.iter().any(|moment| *moment > (sum - moment) * (1.0 + 1e-9)) {
        let allowed = format!("keep each of {} at most the sum of the other two", MOMENTS.join(", "));
        return Err(set.rejection(&MOMENTS, allowed));
    }
    Ok(())
}

/// Checks that a gantry has two linear joints and a stiffness.
fn check_gantry(set: &CrossChecks<'_>) -> Result<(), ConfigError> {
    const STIFFNESS: &str = "gantry.stiffness_n_um";
    set.require(GANTRY_AXES, "two linear joints", STIFFNESS)?;
    set.require(GANTRY_AXES, "two linear joints", "gantry.damping_n_s_m")?;
    let Some(Value::TextList(names)) = set.value(GANTRY_AXES) else { return Ok(()) };
    let linear = set.layout.joints.iter().filter(|joint| joint.axis == AxisKind::Linear);
    let linear: Vec<&str> = linear.map(|joint| joint.name.as_str()).collect();
    let is_pair = matches!(&names[..], [first, second] if first != second);
    if !is_pair || !names.iter().all(|name| linear.contains(&name.as_str())) {
        let allowed = format!("contain two different linear joints, found linear: {}", linear.join(", "));
        return Err(set.rejection(&[GANTRY_AXES], allowed));
    }
    set.require(STIFFNESS, "it above 0", GANTRY_AXES)?;
    check_coupled_transmissions(set, GANTRY_AXES, |name| names.iter().any(|own| own == name))
}

/// Checks that cross-coupled control has two of the linear axes x, y and z, and acts on both sides of a gantry or none.
fn check_contour_control(set: &CrossChecks<'_>) -> Result<(), ConfigError> {
    if !set.is_given(CONTOUR_GAIN) {
        return Ok(());
    }
    let is_coordinate = |name: &str| ["x", "y", "z"].iter().any(|axis| name.eq_ignore_ascii_case(axis));
    let linear = set.layout.joints.iter().filter(|joint| joint.axis == AxisKind::Linear);
    if linear.filter(|joint| is_coordinate(&joint.name)).count() < 2 {
        let allowed = "be 0 on a machine without two of the linear joints x, y and z";
        return Err(set.rejection(&[CONTOUR_GAIN], allowed.to_owned()));
    }
    match set.value(GANTRY_AXES) {
        Some(Value::TextList(names)) if names.iter().any(|name| is_coordinate(name)) => {
            set.exclude([CONTOUR_GAIN, GANTRY_AXES], "")
        }
        _ => Ok(()),
    }
}

/// Checks that coupled joints have no transmission that is stepped from event to event: its motion within a tick is not a
/// smooth function of the force of the coupling, so that the force would not be found.
fn check_coupled_transmissions(
    set: &CrossChecks<'_>,
    coupling: &str,
    is_coupled: impl Fn(&str) -> bool,
) -> Result<(), ConfigError> {
    for joint in set.layout.joints.iter().filter(|joint| is_coupled(&joint.name)) {
        for suffixes in EVENT_DRIVEN {
            set.exclude([&joint.key(suffixes), coupling], "")?;
        }
    }
    Ok(())
}
