//! Parameters of friction with presliding: rejections with the complete messages, and units.

use super::super::plant::PreslidingConfig;
use crate::config::{Parameters, ValueSource, parse_assignment};

const STIFFNESS: &str = "x.friction.presliding_stiffness_n_um=50";
const ELEMENTS: &str = "x.friction.presliding_elements=4";

/// Returns the default machine with changes.
fn changed(changes: &[&str]) -> Result<Parameters, String> {
    let mut parameters = Parameters::embedded_default().expect("the embedded machine is valid");
    let source = ValueSource::named("test");
    let assignment = |change: &&str| parse_assignment(change, &source).expect("an assignment");
    let assignments = changes.iter().map(assignment).collect();
    match parameters.set_all(assignments) {
        Ok(()) => Ok(parameters),
        Err(rejection) => Err(rejection.to_string()),
    }
}

fn rejection(changes: &[&str]) -> String {
    changed(changes).expect_err("rejected")
}

#[test]
fn elements_need_a_stiffness_and_have_no_damping() {
    assert_eq!(
        rejection(&[ELEMENTS]),
        "test: x.friction.presliding_stiffness_n_um is missing: expected it above 0 beside \
         x.friction.presliding_elements"
    );
    assert_eq!(
        rejection(&[STIFFNESS, "x.friction.presliding_damping_n_s_m=5", ELEMENTS]),
        "test: x.friction.presliding_elements = 4: must not be given together: x.friction.presliding_elements and \
         x.friction.presliding_damping_n_s_m; the generalized Maxwell-slip model has no damping"
    );
    assert_eq!(
        rejection(&[STIFFNESS, "x.friction.presliding_elements=11"]),
        "test: x.friction.presliding_elements = 11: must lie in 0 … 10"
    );
}

#[test]
fn an_attraction_needs_elements() {
    assert_eq!(
        rejection(&[STIFFNESS, "x.friction.presliding_attraction_n_s=1e4"]),
        "test: x.friction.presliding_elements is missing: expected it above 0 beside \
         x.friction.presliding_attraction_n_s"
    );
}

#[test]
fn elements_have_no_gap() {
    let elastic = ["x.transmission.stiffness_n_um=200", "x.transmission.load_mass_kg=1200"];
    for (key, more) in [
        ("x.transmission.backlash_um", None),
        ("x.transmission.load_friction", None),
        ("x.structure.frequency_hz", Some("x.structure.mass_kg=4000")),
    ] {
        let gap = format!("{key}=0.5");
        let changes: Vec<&str> =
            elastic.into_iter().chain([STIFFNESS, ELEMENTS]).chain(more).chain([gap.as_str()]).collect();
        let text = rejection(&changes);
        assert!(text.contains("must not be given together") && text.contains("presliding"), "{text}");
    }
}

#[test]
fn elements_and_attraction_are_those_of_the_motor() {
    let presliding = |changes: &[&str], axis: usize| -> Option<PreslidingConfig> {
        changed(changes).expect("accepted").machine_config().expect("a machine").axes()[axis].presliding
    };
    assert_eq!(presliding(&[STIFFNESS], 0).map(|found| (found.elements, found.attraction)), Some((0, None)));
    let ratio = 0.02 / std::f64::consts::TAU;
    let found =
        presliding(&[STIFFNESS, ELEMENTS, "x.friction.presliding_attraction_n_s=1e4"], 0).expect("elements");
    assert_eq!(found.elements, 4);
    assert!((found.attraction.expect("an attraction") / (1e4 * ratio) - 1.0).abs() < 1e-12);
    assert!((found.stiffness / (50e6 * ratio * ratio) - 1.0).abs() < 1e-12);
    let rotary = [
        "c.friction.presliding_stiffness_nm_rad=3e6",
        "c.friction.presliding_elements=1",
        "c.friction.presliding_attraction_nm_s=100",
    ];
    let config = changed(&rotary).expect("accepted").machine_config().expect("a machine");
    let axis = &config.axes()[4];
    let found = axis.presliding.expect("elements");
    assert_eq!(found.elements, 1);
    assert!(
        (found.attraction.expect("an attraction") / (100.0 * axis.transmission_ratio) - 1.0).abs() < 1e-12
    );
}
