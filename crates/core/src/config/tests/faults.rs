//! Each test is named after the fault it guards against, and asserts the message a user reads.

use super::{assert_refused, line_of, mikron_with, refusal};
use crate::config::Parameters;

#[test]
fn negative_inertia() {
    let text = mikron_with("inertia_kg_m2: 0.028", "inertia_kg_m2: -0.028");
    assert_refused(
        &text,
        "-0.028",
        "my.yaml:{line}: x.motor.inertia_kg_m2 = -0.028: must lie in 1e-9 … 1e3 kg·m²",
    );
}

#[test]
fn negative_tool_length() {
    let text = mikron_with("tool_length_mm: 100.0", "tool_length_mm: -100.0");
    assert_refused(
        &text,
        "tool_length_mm",
        "my.yaml:{line}: kinematics.tool_length_mm = -100: must lie in 0 … 1e5 mm",
    );
}

#[test]
fn misspelt_key() {
    let text = mikron_with("inertia_kg_m2: 0.028", "inertia_kgm2: 0.028");
    assert_refused(
        &text,
        "inertia_kgm2",
        "my.yaml:{line}: unknown parameter x.motor.inertia_kgm2; the nearest known one is \
         x.motor.inertia_kg_m2",
    );
}

#[test]
fn misspelt_type_is_not_reported_as_missing() {
    let text = mikron_with("    x:\n      type: linear", "    x:\n      typ: linear");
    assert_refused(
        &text,
        " typ:",
        "my.yaml:{line}: unknown parameter x.typ; the nearest known one is x.type",
    );
}

#[test]
fn misspelt_joints_is_not_reported_as_missing() {
    let text = mikron_with("    joints:", "    jonts:");
    assert_refused(
        &text,
        "jonts:",
        "my.yaml:{line}: unknown parameter jonts; the nearest known one is joints",
    );
}

#[test]
fn key_like_no_other_gets_no_misleading_advice() {
    let text = mikron_with("    periods:", "    color: red\n    periods:");
    assert_refused(&text, "color", "my.yaml:{line}: unknown parameter color");
}

#[test]
fn not_a_number() {
    for (written, read) in [(".nan", "NaN"), (".inf", "inf"), ("-.inf", "-inf"), ("1e999", "inf")] {
        let text = mikron_with("inertia_kg_m2: 0.028", &format!("inertia_kg_m2: {written}"));
        assert_refused(
            &text,
            written,
            &format!("my.yaml:{{line}}: x.motor.inertia_kg_m2 = {read}: must lie in 1e-9 … 1e3 kg·m²"),
        );
    }
}

#[test]
fn text_where_a_number_is_wanted() {
    let text = mikron_with("inertia_kg_m2: 0.028", "inertia_kg_m2: abc");
    assert_refused(&text, "abc", "my.yaml:{line}: x.motor.inertia_kg_m2: found text \"abc\", number wanted");
}

#[test]
fn missing_parameter() {
    let text = mikron_with("        inertia_kg_m2: 0.028\n", "");
    assert_refused(
        &text,
        "",
        "my.yaml: x.motor.inertia_kg_m2 is missing: Jeq, equivalent inertia at the motor shaft \
         (Prévost eqs. 1 and 5) (1e-9 … 1e3 kg·m²)",
    );
}

#[test]
fn missing_joints() {
    assert_eq!(
        refusal("/**:\n  ros__parameters:\n    machine: mill\n"),
        "my.yaml: joints is missing: Names of the axes, in the order of messages and tables (list \
         of texts)"
    );
}

#[test]
fn key_without_a_value() {
    let text = mikron_with("inertia_kg_m2: 0.028", "inertia_kg_m2:");
    assert_refused(
        &text,
        "inertia_kg_m2:",
        "my.yaml:{line}: x.motor.inertia_kg_m2: found nothing, a value wanted",
    );
}

#[test]
fn fraction_for_an_integer() {
    for (written, read) in [("1000.5", "1000.5"), ("1e6", "1e6")] {
        let text = mikron_with("    periods:", &format!("    max_points: {written}\n    periods:"));
        assert_refused(
            &text,
            "max_points",
            &format!("my.yaml:{{line}}: max_points: found number {read}, integer wanted"),
        );
    }
}

#[test]
fn screw_on_a_rotary_axis() {
    let text = mikron_with("gear_ratio: 180.0", "screw_lead_mm: 180.0");
    assert_refused(
        &text,
        "screw_lead_mm: 180.0",
        "my.yaml:{line}: a.transmission.screw_lead_mm does not apply: it is for linear axes, and \
         a.type = rotary",
    );
}

#[test]
fn key_of_a_linear_motor_on_a_screw_axis() {
    let text = mikron_with("inertia_kg_m2: 0.028", "mass_kg: 250.0");
    assert_refused(
        &text,
        "mass_kg",
        "my.yaml:{line}: x.motor.mass_kg does not apply: it is for linear motors; x has a rotating \
         one (a linear axis has a linear motor where x.transmission.direct = true)",
    );
}

#[test]
fn key_of_a_joint_that_is_not_there() {
    let text = mikron_with("\"a\", \"c\"]", "\"a\"]");
    let line = line_of(&text, "      type: rotary\n      transmission:\n        gear_ratio: 120.0");
    assert_eq!(
        refusal(&text),
        format!("my.yaml:{line}: c.type does not apply: there is no joint c; joints = [x, y, z, a]")
    );
}

#[test]
fn two_transmissions() {
    let text = mikron_with("gear_ratio: 180.0", "direct: true\n        gear_ratio: 180.0");
    assert_refused(
        &text,
        "gear_ratio: 180.0",
        "my.yaml:{line}: a.transmission.gear_ratio = 180: must be the only transmission of a: \
         a.transmission.gear_ratio and a.transmission.direct = true are given",
    );
}

#[test]
fn no_transmission() {
    let text = mikron_with("gear_ratio: 180.0", "direct: false");
    assert_refused(
        &text,
        "",
        "my.yaml: a.transmission is missing: one of a.transmission.gear_ratio and \
         a.transmission.direct = true",
    );
}

#[test]
fn joint_twice() {
    let text = mikron_with("\"a\", \"c\"]", "\"a\", \"a\"]");
    assert_refused(
        &text,
        "joints:",
        "my.yaml:{line}: joints = [x, y, z, a, a]: must hold each name once, not a twice",
    );
}

#[test]
fn joint_with_the_name_of_another_parameter() {
    for name in ["time", "periods", "machine", "publish_rate", "kinematics", "qos"] {
        let text = mikron_with("\"a\", \"c\"]", &format!("\"a\", \"{name}\"]"));
        assert_refused(
            &text,
            "joints:",
            &format!(
                "my.yaml:{{line}}: joints = [x, y, z, a, {name}]: must not hold {name}, the name \
                 of another parameter"
            ),
        );
    }
}

#[test]
fn joint_name_that_no_parameter_can_have() {
    for name in ["", "1x", "x.y", "x y", "ä", "x/y"] {
        let text = mikron_with("\"a\", \"c\"]", &format!("\"a\", \"{name}\"]"));
        let message = refusal(&text);
        let expected =
            format!("must hold names of letters, digits and _ that begin with a letter, not \"{name}\"");
        assert!(message.ends_with(&expected), "{message}");
    }
}

#[test]
fn no_joints_at_all() {
    assert_eq!(
        refusal("/**:\n  ros__parameters:\n    joints: []\n"),
        "my.yaml:3: joints = []: must hold at least one name"
    );
}

#[test]
fn unquoted_y_is_a_joint_and_no_flag() {
    let text = mikron_with("[\"x\", \"y\", \"z\", \"a\", \"c\"]", "[x, y, z, a, c]");
    assert_eq!(
        Parameters::from_yaml(&text, "my.yaml").map(|parameters| parameters.get("joints")),
        Ok(super::mikron().get("joints"))
    );
}

#[test]
fn periods_that_do_not_fit_into_one_another() {
    let text = mikron_with("current_us: 125.0", "current_us: 120.0");
    assert_refused(
        &text,
        "current_us: 120.0",
        "my.yaml:{line}: periods.current_us = 120: must keep periods.velocity_us an integer \
         multiple of periods.current_us: they are 250000 ns and 120000 ns",
    );
    let text = mikron_with("position_ms: 6.0", "position_ms: 6.1");
    assert_refused(
        &text,
        "velocity_us:",
        "my.yaml:{line}: periods.velocity_us = 250: must keep periods.position_ms an integer \
         multiple of periods.velocity_us: they are 6100000 ns and 250000 ns",
    );
}

#[test]
fn home_outside_the_travel_limits() {
    let text = mikron_with("travel_min_mm: -355.0", "travel_min_mm: 5.0");
    assert_refused(
        &text,
        "travel_min_mm: 5.0",
        "my.yaml:{line}: x.limits.travel_min_mm = 5: must lie in -1e6 … 0 mm",
    );
}

#[test]
fn stroke_without_length() {
    let text = mikron_with("travel_min_mm: -355.0", "travel_min_mm: 0.0")
        .replace("travel_max_mm: 355.0", "travel_max_mm: 0");
    assert_refused(
        &text,
        "travel_max_mm: 0",
        "my.yaml:{line}: x.limits.travel_max_mm = 0: must leave a stroke: x.limits.travel_min_mm < \
         x.limits.travel_max_mm",
    );
}

#[test]
fn friction_that_drives() {
    let text = mikron_with("c: -0.5332", "c: -1.6");
    assert_refused(
        &text,
        "c: -1.6",
        "my.yaml:{line}: x.friction.c = -1.6: must keep a + c ≥ 0, since friction does not drive: \
         a = 1.576, c = -1.6",
    );
}

#[test]
fn integral_time_of_zero_divides_by_zero() {
    let text = mikron_with(
        "integral_time_ms: 4.0\n      current_loop:\n        gain: 13.0",
        "integral_time_ms: 0.0\n      current_loop:\n        gain: 13.0",
    );
    assert_refused(
        &text,
        "integral_time_ms: 0.0",
        "my.yaml:{line}: x.velocity_loop.integral_time_ms = 0: must lie in 1e-3 … 1e6 ms",
    );
}

#[test]
fn publishing_faster_than_the_position_loop() {
    let text = mikron_with("    periods:", "    publish_rate: 250\n    periods:");
    assert_refused(
        &text,
        "publish_rate",
        "my.yaml:{line}: publish_rate = 250: must be at most one per position period, 166.67 Hz \
         with periods.position_ms = 6",
    );
}

#[test]
fn publishing_a_clock_and_following_it() {
    let text = mikron_with("    periods:", "    time: fast\n    use_sim_time: true\n    periods:");
    assert_refused(
        &text,
        "use_sim_time",
        "my.yaml:{line}: use_sim_time = true: must leave the clock to one: time = fast publishes \
         /clock, use_sim_time = true follows it",
    );
}
