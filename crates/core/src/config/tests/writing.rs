//! Round trips of written machine files.

use proptest::prelude::*;

use super::mikron;
use crate::config::{ParameterKind, Parameters, Value, ValueSource};

fn source() -> ValueSource {
    ValueSource::named("test")
}

/// Asserts that writing and reading `parameters` yields the same values.
fn assert_reads_back(parameters: &Parameters) -> Result<(), TestCaseError> {
    let text = parameters.to_yaml("", |_| None);
    let again =
        Parameters::from_yaml(&text, "new.yaml").map_err(|e| TestCaseError::fail(format!("{e}\n{text}")))?;
    prop_assert_eq!(again.machine_config(), parameters.machine_config());
    let values = |p: &Parameters| format!("{:?}", p.iter().collect::<Vec<_>>());
    prop_assert_eq!(values(&again), values(parameters), "{}", text);
    Ok(())
}

#[test]
fn builtin_machines_are_unchanged_by_a_round_trip() {
    for name in virtual_axes_builtin::MACHINES.iter().map(|(name, _)| *name) {
        let parameters = Parameters::load(name, virtual_axes_builtin::MACHINES).expect("a built-in machine");
        assert_reads_back(&parameters).expect(name);
    }
}

#[test]
fn written_files_have_the_layout_of_the_builtin_files() {
    let mut parameters = mikron();
    parameters.set_text("max_points=7", &source()).expect("valid");
    parameters.set_text("x.position_loop.rst.r=[1.0, -2, 1e-9]", &source()).expect("valid");
    let text = parameters
        .to_yaml("Two\nlines", |key| (key == "x.position_loop.gain").then(|| "tuned: 12.5 µm".to_owned()));
    assert!(
        text.starts_with("# Two\n# lines\n/**:\n  ros__parameters:\n    machine: \"Mikron UCP 710\"\n"),
        "{text}"
    );
    assert!(
        text.contains(
            "    joints: [\"x\", \"y\", \"z\", \"a\", \"c\"]\n    periods:\n      position_ms: 6.0\n"
        )
    );
    assert!(
        text.contains(
            "      position_loop:\n        controller: cascade\n        gain: 1.5  # tuned: 12.5 µm\n        \
             gpc:\n          n1: 1\n"
        ),
        "{text}"
    );
    assert!(text.contains("\n        rst:\n          r: [1.0, -2.0, 1.0e-9]\n"), "{text}");
    // Without quotation marks, YAML 1.1 readers read y as true.
    assert!(text.contains("\n\n    \"y\":\n      type: linear\n"), "{text}");
    assert!(text.ends_with("\n\n    max_points: 7\n"), "{text}");
    // Parameters at their defaults are not written.
    assert!(!text.contains("t_first") && !text.contains("qos"), "{text}");
}

#[test]
fn line_breaks_in_comments_are_replaced() {
    let text = mikron().to_yaml("a\u{2028}b\rc", |_| Some("x\nmachine: other".to_owned()));
    let again = Parameters::from_yaml(&text, "new.yaml").expect("valid");
    assert_eq!(again.machine_config(), mikron().machine_config());
}

#[test]
fn joint_names_that_are_yaml_booleans_are_quoted() {
    let text = super::MIKRON.replace("[\"x\", \"y\"", "[\"x\", \"on\"").replace("    y:\n", "    \"on\":\n");
    let parameters = Parameters::from_yaml(&text, "my.yaml").expect("valid");
    assert_reads_back(&parameters).expect("the same");
}

proptest! {
    #[test]
    fn changed_values_are_bit_identical_after_a_round_trip(
        machine in prop::sample::select(virtual_axes_builtin::MACHINES.iter().map(|(name, _)| *name).collect::<Vec<_>>()),
        name in any::<String>(),
        changes in prop::collection::vec((any::<prop::sample::Index>(), 0.0..1.0f64, -300i32..300), 1..40),
        list in prop::collection::vec(-1e300..1e300f64, 1..32),
    ) {
        let mut parameters = Parameters::load(machine, virtual_axes_builtin::MACHINES).expect("a built-in machine");
        parameters.set("machine", Value::Text(name), &source()).expect("any text");
        let all: Vec<_> = parameters.definitions().collect();
        for (index, fraction, exponent) in changes {
            let (key, definition) = &all[index.index(all.len())];
            let value = match definition.kind {
                // Of any magnitude in the range, with all digits.
                ParameterKind::Number { min, max } => {
                    Value::Double((fraction * 10f64.powi(exponent)).clamp(min, max))
                }
                ParameterKind::Integer { min, max } => {
                    Value::Integer(min + ((max - min) as f64 * fraction) as i64)
                }
                ParameterKind::Flag => Value::Bool(fraction < 0.5),
                ParameterKind::NumberList { max_len, .. } => {
                    Value::DoubleList(list.iter().copied().take(max_len).collect())
                }
                ParameterKind::Choice(choices) => {
                    Value::Text(choices[(fraction * choices.len() as f64) as usize].to_owned())
                }
                ParameterKind::Text => Value::Text(format!("{fraction}")),
                ParameterKind::TextList => continue,
            };
            // A value that contradicts another parameter is rejected, and nothing is changed.
            let _ = parameters.set(key, value, &source());
        }
        assert_reads_back(&parameters)?;
    }
}
