//! The shipped URDF, and machines without a URDF. Its content is tested in test_py/test_urdf.py with an independent
//! parser and the kinematics.

use virtual_axes_core::config::Parameters;
use virtual_axes_io::urdf::urdf;

const DEFAULT: &str = include_str!("../../../../config/mikron_ucp710.yaml");

fn of(machine: &str, prefix: &str) -> Result<String, String> {
    let config = Parameters::from_yaml(machine, "test")
        .expect("the machine is valid")
        .machine_config()
        .expect("valid");
    urdf(&config, prefix).map_err(|error| error.to_string())
}

/// Returns the default machine file with `from` replaced by `to`.
fn changed(from: &str, to: &str) -> String {
    assert!(DEFAULT.contains(from), "{from}");
    DEFAULT.replacen(from, to, 1)
}

#[test]
fn the_shipped_urdf_equals_the_output_of_the_command() {
    let shipped = include_str!("../../../../urdf/mikron_ucp710.urdf");
    let written = of(DEFAULT, "").expect("a URDF");
    assert!(shipped == written, "urdf/mikron_ucp710.urdf: put the output of `virtual_axes urdf` there");
}

#[test]
fn a_joint_outside_the_chain_is_named() {
    let machine = changed(r#""a", "c"]"#, r#""a", "b"]"#).replacen("\n    c:\n", "\n    b:\n", 1);
    let error = of(&machine, "").expect_err("B is not in the chain");
    assert!(error.contains("joint b (rotary)") && error.contains("x, y, z"), "{error}");
}

#[test]
fn a_role_that_no_joint_has_is_fixed() {
    let end = DEFAULT.find("\n    a:\n").expect("A is there");
    let machine = DEFAULT[..end].replacen(r#""z", "a", "c"]"#, r#""z"]"#, 1);
    let text = of(&machine, "").expect("a URDF");
    assert!(text.contains(r#"<joint name="a_held" type="fixed">"#), "{text}");
    assert!(text.contains(r#"<joint name="x" type="prismatic">"#), "{text}");
}

#[test]
fn texts_are_escaped_and_invalid_xml_characters_are_rejected() {
    let machine = changed("machine: Mikron UCP 710", "machine: 'a < b & \"c\"'");
    let text = of(&machine, "<&>").expect("a URDF");
    assert!(text.contains(r#"<robot name="a &lt; b &amp; &quot;c&quot;">"#), "{text}");
    assert!(text.contains(r#"<joint name="&lt;&amp;&gt;x""#), "{text}");
    let error = of(DEFAULT, "a\u{1}").expect_err("not in XML");
    assert!(error.contains("'\\u{1}'") && error.contains("joint"), "{error}");
}
