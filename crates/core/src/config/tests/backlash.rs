//! Rejected parameters of backlash, friction at the load and structure, with the complete messages.

use crate::config::{Parameters, ValueSource, parse_assignment};

const ELASTIC: [&str; 2] = ["x.transmission.stiffness_n_um=200", "x.transmission.load_mass_kg=1200"];

/// Returns the rejection of changes of the default machine.
fn rejection(changes: &[&str]) -> String {
    let mut parameters = Parameters::embedded_default().expect("the embedded machine is valid");
    let source = ValueSource::named("test");
    let assignment = |change: &&str| parse_assignment(change, &source).expect("an assignment");
    let assignments = changes.iter().map(assignment).collect();
    parameters.set_all(assignments).expect_err("rejected").to_string()
}

fn with_elasticity(changes: &[&str]) -> String {
    rejection(&[&ELASTIC[..], changes].concat())
}

#[test]
fn a_gap_needs_a_stiffness() {
    for key in ["transmission.backlash_um", "transmission.load_friction"] {
        assert_eq!(
            rejection(&[&format!("x.{key}=0.5")]),
            format!("test: x.transmission.stiffness_n_um is missing: expected it beside x.{key}")
        );
    }
}

#[test]
fn a_structure_needs_frequency_and_mass() {
    assert_eq!(
        with_elasticity(&["x.structure.frequency_hz=40"]),
        "test: x.structure.mass_kg is missing: expected it beside x.structure.frequency_hz"
    );
    assert_eq!(
        with_elasticity(&["x.structure.mass_kg=4000"]),
        "test: x.structure.frequency_hz is missing: expected it beside x.structure.mass_kg"
    );
}

#[test]
fn presliding_has_no_gap() {
    assert_eq!(
        with_elasticity(&["x.transmission.backlash_um=5", "x.friction.presliding_stiffness_n_um=50"]),
        "test: x.friction.presliding_stiffness_n_um = 50: must not be given together: x.transmission.backlash_um and \
         x.friction.presliding_stiffness_n_um"
    );
}

#[test]
fn coupled_axes_have_no_gap() {
    let a = ["a.transmission.stiffness_nm_rad=2e6", "a.transmission.load_inertia_kg_m2=12"];
    let text = rejection(&[&a[..], &["a.transmission.load_friction=0.5", "workpiece.mass_kg=100"]].concat());
    assert_eq!(
        text,
        "test: workpiece.mass_kg = 100: must not be given together: a.transmission.load_friction and workpiece.mass_kg"
    );
}

#[test]
fn compensation_is_for_an_encoder_at_the_motor() {
    let text = with_elasticity(&["x.backlash_compensation.width_um=5", "x.position_loop.feedback=load"]);
    assert_eq!(
        text,
        "test: x.position_loop.feedback = load: must not be given together: a scale at the \
         load (x.position_loop.feedback) sees the backlash, x.backlash_compensation.width_um must be 0"
    );
}
