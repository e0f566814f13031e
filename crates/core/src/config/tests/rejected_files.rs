//! Rejected files: invalid YAML, no ROS 2 parameter file, malicious content.

use proptest::prelude::*;

use super::{MIKRON, assert_rejected, line_of, mikron, mikron_with, rejection};
use crate::config::{Parameters, ValueSource};

#[test]
fn duplicate_key_in_a_mapping() {
    let text = mikron_with("b: 0.01965", "b: 0.01965\n        b: 3");
    let first = line_of(&text, "b: 0.01965");
    let expected =
        format!("my.yaml:{{line}}: duplicate parameter x.friction.b, first set at my.yaml:{first}");
    assert_rejected(&text, "b: 3", &expected);
}

#[test]
fn duplicate_key_flat_and_nested() {
    let text = mikron_with("    periods:", "    x.friction.b: 0.5\n    periods:");
    let first = line_of(&text, "x.friction.b");
    assert_rejected(
        &text,
        "b: 0.01965",
        &format!("my.yaml:{{line}}: duplicate parameter x.friction.b, first set at my.yaml:{first}"),
    );
}

#[test]
fn invalid_yaml() {
    let text = mikron_with("    x:\n", "    x: [\n");
    let message = rejection(&text);
    assert!(message.starts_with("my.yaml:"), "{message}");
    assert!(message.contains(": invalid YAML: "), "{message}");
    assert!(!message.contains('\n'), "{message}");
}

#[test]
fn two_machines_in_one_file() {
    let mikron = mikron_with("    x:\n", "    x:\n");
    let message = rejection(&format!("{mikron}---\n{mikron}"));
    assert!(message.starts_with("my.yaml:"), "{message}");
    assert!(message.ends_with(": invalid YAML: more than one YAML document, expected one"), "{message}");
}

#[test]
fn not_a_ros_parameter_file() {
    let structure = "expected `/**:`, nested in it `ros__parameters:`, nested in that the parameters";
    for (text, expected) in [
        ("", "my.yaml:1: not a ROS 2 parameter file: not a mapping"),
        ("mill", "my.yaml:1: not a ROS 2 parameter file: not a mapping"),
        ("{}", "my.yaml: not a ROS 2 parameter file: empty mapping"),
        ("\nmachine: mill\n", "my.yaml:2: not a ROS 2 parameter file: no `ros__parameters` in `machine`"),
        (
            "/**:\n  ros_parameters:\n    machine: mill\n",
            "my.yaml:3: not a ROS 2 parameter file: `machine` is in `/**/ros_parameters`, \
             not in `ros__parameters`",
        ),
        (
            "ros__parameters:\n  machine: mill\n",
            "my.yaml:1: not a ROS 2 parameter file: no node name above `ros__parameters`",
        ),
    ] {
        assert_eq!(rejection(text), format!("{expected}; {structure}"));
    }
}

#[test]
fn unreadable_files() {
    let message = |path: &str| match Parameters::from_file(path) {
        Ok(_) => String::new(),
        Err(error) => error.to_string(),
    };
    assert!(message("no/such.yaml").starts_with("no/such.yaml: cannot be read: "));
    assert!(message(env!("CARGO_MANIFEST_DIR")).contains(": cannot be read: "));
}

#[test]
fn unknown_builtin_machine() {
    assert_eq!(
        Parameters::builtin_text("mikron", virtual_axes_builtin::MACHINES).map_err(|error| error.to_string()),
        Err("unknown machine mikron; the nearest is mikron_ucp710; built-in machines: mikron_ucp710, \
             linear_motor_center, vmc, hmc, gantry_router, bc_center, ac_center, vmc_a, fork_head"
            .to_owned())
    );
}

#[test]
fn alias_bomb() {
    let mut text = String::from("/**:\n  ros__parameters:\n    l0: &l0 [x, x, x, x, x, x, x, x]\n");
    for level in 1..12 {
        let below = level - 1;
        let items = vec![format!("*l{below}"); 8].join(", ");
        text.push_str(&format!("    l{level}: &l{level} [{items}]\n"));
    }
    assert!(rejection(&text).starts_with("my.yaml:"));
    assert!(mikron().overlay_yaml(&text, "site.yaml", Some("/mill")).is_err());
}

#[test]
fn long_keys_are_truncated_in_messages() {
    let garbage = "k".repeat(100_000);
    let message = rejection(&format!("/**:\n  ros__parameters:\n    ? {garbage}\n    : {garbage}\n"));
    assert!(message.len() < 1000, "{} bytes", message.len());
    let source = ValueSource::named("--set");
    for text in [garbage.clone(), format!("machine={garbage}=[")] {
        let result = super::mikron().set_text(&text, &source);
        let length = result.err().map_or(0, |error| error.to_string().len());
        assert!(length < 1000, "{length} bytes");
    }
}

proptest! {
    #[test]
    fn no_text_panics(text in "\\PC*|[-:\\[\\]{}&*!|>'\"%@`#,? \n\ta-c0-9./_]{0,300}") {
        let _ = Parameters::from_yaml(&text, "my.yaml");
        let _ = super::mikron().set_text(&text, &ValueSource::named("--set"));
    }

    #[test]
    fn no_damaged_machine_file_panics(
        position in 0..MIKRON.len(),
        length in 0_usize..40,
        patch in "[-:\\[\\]{}&*!|>'\"#,? \nxyzac0-9.e]{0,12}",
    ) {
        let mut bytes = MIKRON.as_bytes().to_vec();
        let end = (position + length).min(bytes.len());
        bytes.splice(position..end, patch.into_bytes());
        let text = String::from_utf8_lossy(&bytes);
        if let Ok(parameters) = Parameters::from_yaml(&text, "my.yaml") {
            prop_assert!(parameters.machine_config().is_ok());
        }
    }

    #[test]
    fn no_value_for_any_key_leaves_a_broken_machine(
        index in 0_usize..200,
        value in prop_oneof![
            Just("true".to_owned()), Just("0".to_owned()), Just("rotary".to_owned()),
            Just("[x, a]".to_owned()), Just("fast".to_owned()),
            any::<f64>().prop_map(|value| value.to_string()), any::<i64>().prop_map(|value| value.to_string()),
        ],
    ) {
        let mut parameters = super::mikron();
        let keys: Vec<String> = parameters.definitions().map(|(key, _)| key).collect();
        let before = parameters.clone();
        let key = &keys[index % keys.len()];
        match parameters.set_text(&format!("{key}={value}"), &ValueSource::named("--set")) {
            Ok(()) => prop_assert!(parameters.machine_config().is_ok()),
            Err(error) => {
                prop_assert_eq!(&parameters, &before);
                prop_assert!(error.to_string().starts_with("--set: ") || error.to_string().starts_with("mikron_ucp710.yaml:"), "{}", error);
            }
        }
    }
}
