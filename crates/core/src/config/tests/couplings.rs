//! Couplings between axes: values in SI units, and rejections with the complete messages.

use super::mikron;
use crate::config::{GantryConfig, Parameters, Value, ValueSource, WorkpieceConfig, parse_assignment};

/// Sets the parameters of a machine one after the other; returns the message of the first rejection.
fn set(parameters: &mut Parameters, texts: &[&str]) -> Result<(), String> {
    let source = ValueSource::named("test");
    let assignments = texts.iter().map(|text| parse_assignment(text, &source).expect("an assignment"));
    parameters.set_all(assignments.collect()).map(|_| ()).map_err(|error| error.to_string())
}

fn rejection(texts: &[&str]) -> String {
    set(&mut mikron(), texts).expect_err("a rejection")
}

#[test]
fn a_machine_has_no_coupling_by_default() {
    let config = mikron().machine_config().expect("valid");
    assert_eq!((config.workpiece(), config.gantry(), config.has_coupled_axes()), (None, None, false));
}

#[test]
fn couplings_in_si_units() {
    let mut parameters = mikron();
    let texts = [
        "workpiece.mass_kg=40",
        "workpiece.center_of_mass_x_mm=150",
        "workpiece.center_of_mass_z_mm=-20",
        "workpiece.inertia_x_kg_m2=2",
        "workpiece.inertia_y_kg_m2=3",
        "workpiece.inertia_z_kg_m2=4",
        "gantry.axes=[z, x]",
        "gantry.stiffness_n_um=200",
        "gantry.damping_n_s_m=5000",
    ];
    set(&mut parameters, &texts).expect("valid");
    let config = parameters.machine_config().expect("valid");
    let workpiece =
        WorkpieceConfig { mass: 40.0, center_of_mass: [0.15, 0.0, -0.02], moments: [2.0, 3.0, 4.0] };
    assert_eq!(config.workpiece(), Some(&workpiece));
    assert_eq!(config.gantry(), Some(&GantryConfig { axes: [2, 0], stiffness: 2e8, damping: 5000.0 }));
}

#[test]
fn a_workpiece_needs_a_mass_two_tables_and_possible_moments() {
    assert_eq!(
        rejection(&["workpiece.center_of_mass_y_mm=10"]),
        "test: workpiece.mass_kg is missing: expected it above 0 beside workpiece.center_of_mass_y_mm"
    );
    assert_eq!(
        rejection(&["workpiece.mass_kg=40", "workpiece.inertia_x_kg_m2=2", "workpiece.inertia_y_kg_m2=1.5"]),
        "test: workpiece.inertia_y_kg_m2 = 1.5: must keep each of workpiece.inertia_x_kg_m2, \
         workpiece.inertia_y_kg_m2, workpiece.inertia_z_kg_m2 at most the sum of the other two"
    );
    let mut linear = mikron();
    let names = ["x", "y", "z"].map(str::to_owned).to_vec();
    linear.set("joints", Value::TextList(names), &ValueSource::named("test")).expect("valid");
    assert_eq!(
        set(&mut linear, &["workpiece.mass_kg=40"]).expect_err("a rejection"),
        "test: workpiece.mass_kg = 40: must be 0 on a machine without tables c and a, which carry the workpiece (kinematics.chain)"
    );
}

#[test]
fn a_gantry_needs_two_linear_axes_and_a_stiffness() {
    assert_eq!(
        rejection(&["gantry.damping_n_s_m=5"]),
        "test: gantry.axes is missing: expected two linear joints beside gantry.damping_n_s_m"
    );
    assert_eq!(
        rejection(&["gantry.axes=[x, y]"]),
        "test: gantry.stiffness_n_um is missing: expected it above 0 beside gantry.axes"
    );
    for (names, shown) in [("[x, a]", "[x, a]"), ("[x, x]", "[x, x]"), ("[x]", "[x]"), ("[x, w]", "[x, w]")] {
        assert_eq!(
            rejection(&[&format!("gantry.axes={names}"), "gantry.stiffness_n_um=1"]),
            format!(
                "test: gantry.axes = {shown}: must contain two different linear joints, found linear: x, y, z"
            )
        );
    }
}
