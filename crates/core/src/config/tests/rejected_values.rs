//! Rejected parameter values, with the complete messages.

use super::{assert_rejected, line_of, mikron_with, rejection};
use crate::config::Parameters;

#[test]
fn negative_inertia() {
    let text = mikron_with("inertia_kg_m2: 0.028", "inertia_kg_m2: -0.028");
    assert_rejected(
        &text,
        "-0.028",
        "my.yaml:{line}: x.motor.inertia_kg_m2 = -0.028: must lie in 1e-9 … 1e3 kg·m²",
    );
}

#[test]
fn negative_tool_length() {
    let text = mikron_with("tool_length_mm: 100.0", "tool_length_mm: -100.0");
    assert_rejected(
        &text,
        "tool_length_mm",
        "my.yaml:{line}: kinematics.tool_length_mm = -100: must lie in 0 … 1e5 mm",
    );
}

#[test]
fn misspelt_key() {
    let text = mikron_with("inertia_kg_m2: 0.028", "inertia_kgm2: 0.028");
    assert_rejected(
        &text,
        "inertia_kgm2",
        "my.yaml:{line}: unknown parameter x.motor.inertia_kgm2; the nearest is x.motor.inertia_kg_m2",
    );
}

#[test]
fn misspelt_type_is_not_reported_as_missing() {
    let text = mikron_with("    x:\n      type: linear", "    x:\n      typ: linear");
    assert_rejected(&text, " typ:", "my.yaml:{line}: unknown parameter x.typ; the nearest is x.type");
}

#[test]
fn misspelt_joints_is_not_reported_as_missing() {
    let text = mikron_with("    joints:", "    jonts:");
    assert_rejected(&text, "jonts:", "my.yaml:{line}: unknown parameter jonts; the nearest is joints");
}

#[test]
fn unknown_key_without_a_similar_key_has_no_suggestion() {
    let text = mikron_with("    periods:", "    hue: red\n    periods:");
    assert_rejected(&text, "hue", "my.yaml:{line}: unknown parameter hue");
}

#[test]
fn not_a_number() {
    for (written, read) in [(".nan", "NaN"), (".inf", "inf"), ("-.inf", "-inf"), ("1e999", "inf")] {
        let text = mikron_with("inertia_kg_m2: 0.028", &format!("inertia_kg_m2: {written}"));
        assert_rejected(
            &text,
            written,
            &format!("my.yaml:{{line}}: x.motor.inertia_kg_m2 = {read}: must lie in 1e-9 … 1e3 kg·m²"),
        );
    }
}

#[test]
fn text_for_a_number() {
    let text = mikron_with("inertia_kg_m2: 0.028", "inertia_kg_m2: abc");
    assert_rejected(
        &text,
        "abc",
        "my.yaml:{line}: x.motor.inertia_kg_m2: found text \"abc\", expected number",
    );
}

#[test]
fn missing_parameter() {
    let text = mikron_with("        inertia_kg_m2: 0.028\n", "");
    assert_rejected(
        &text,
        "",
        "my.yaml: x.motor.inertia_kg_m2 is missing: Jeq, equivalent inertia at the motor shaft \
         (Prévost eqs. 1 and 5) (1e-9 … 1e3 kg·m²)",
    );
}

#[test]
fn missing_joints() {
    assert_eq!(
        rejection("/**:\n  ros__parameters:\n    machine: mill\n"),
        "my.yaml: joints is missing: Names of the axes, in the order of messages and tables (list \
         of texts)"
    );
}

#[test]
fn key_without_a_value() {
    let text = mikron_with("inertia_kg_m2: 0.028", "inertia_kg_m2:");
    assert_rejected(
        &text,
        "inertia_kg_m2:",
        "my.yaml:{line}: x.motor.inertia_kg_m2: found nothing, expected a value",
    );
}

#[test]
fn fraction_for_an_integer() {
    for (written, read) in [("1000.5", "1000.5"), ("1e6", "1e6")] {
        let text = mikron_with("    periods:", &format!("    max_points: {written}\n    periods:"));
        assert_rejected(
            &text,
            "max_points",
            &format!("my.yaml:{{line}}: max_points: found number {read}, expected integer"),
        );
    }
}

#[test]
fn screw_on_a_rotary_axis() {
    let text = mikron_with("gear_ratio: 180.0", "screw_lead_mm: 180.0");
    assert_rejected(
        &text,
        "screw_lead_mm: 180.0",
        "my.yaml:{line}: a.transmission.screw_lead_mm does not apply: it is for linear axes, and \
         a.type = rotary",
    );
}

#[test]
fn key_of_a_linear_motor_on_a_screw_axis() {
    let text = mikron_with("inertia_kg_m2: 0.028", "mass_kg: 250.0");
    assert_rejected(
        &text,
        "mass_kg",
        "my.yaml:{line}: x.motor.mass_kg does not apply: it is for linear motors, and x has a rotary \
         motor (a linear axis has a linear motor if x.transmission.direct = true)",
    );
}

#[test]
fn key_of_an_unknown_joint() {
    let text = mikron_with("\"a\", \"c\"]", "\"a\"]");
    let line = line_of(&text, "      type: rotary\n      transmission:\n        gear_ratio: 120.0");
    assert_eq!(
        rejection(&text),
        format!("my.yaml:{line}: c.type does not apply: there is no joint c; joints = [x, y, z, a]")
    );
}

#[test]
fn two_transmissions() {
    let text = mikron_with("gear_ratio: 180.0", "direct: true\n        gear_ratio: 180.0");
    assert_rejected(
        &text,
        "gear_ratio: 180.0",
        "my.yaml:{line}: a.transmission.gear_ratio = 180: must be the only transmission of a, \
         found a.transmission.gear_ratio and a.transmission.direct = true",
    );
}

#[test]
fn no_transmission() {
    let text = mikron_with("gear_ratio: 180.0", "direct: false");
    assert_rejected(
        &text,
        "",
        "my.yaml: a.transmission is missing: expected a.transmission.gear_ratio or \
         a.transmission.direct = true",
    );
}

#[test]
fn duplicate_joint() {
    let text = mikron_with("\"a\", \"c\"]", "\"a\", \"a\"]");
    assert_rejected(
        &text,
        "joints:",
        "my.yaml:{line}: joints = [x, y, z, a, a]: must contain each name once, found a twice",
    );
}

#[test]
fn joint_with_the_name_of_a_parameter() {
    for name in ["time", "periods", "machine", "publish_rate", "kinematics", "qos"] {
        let text = mikron_with("\"a\", \"c\"]", &format!("\"a\", \"{name}\"]"));
        assert_rejected(
            &text,
            "joints:",
            &format!(
                "my.yaml:{{line}}: joints = [x, y, z, a, {name}]: must not contain {name}, the name \
                 of a parameter"
            ),
        );
    }
}

#[test]
fn invalid_joint_name() {
    for name in ["", "1x", "x.y", "x y", "ä", "x/y"] {
        let text = mikron_with("\"a\", \"c\"]", &format!("\"a\", \"{name}\"]"));
        let message = rejection(&text);
        let expected =
            format!("must contain names of letters, digits and _ that begin with a letter, found \"{name}\"");
        assert!(message.ends_with(&expected), "{message}");
    }
}

#[test]
fn no_joints_at_all() {
    assert_eq!(
        rejection("/**:\n  ros__parameters:\n    joints: []\n"),
        "my.yaml:3: joints = []: must contain at least one name"
    );
}

#[test]
fn unquoted_y_is_a_joint_and_not_a_flag() {
    let text = mikron_with("[\"x\", \"y\", \"z\", \"a\", \"c\"]", "[x, y, z, a, c]");
    assert_eq!(
        Parameters::from_yaml(&text, "my.yaml").map(|parameters| parameters.get("joints")),
        Ok(super::mikron().get("joints"))
    );
}

#[test]
fn periods_that_are_not_integer_multiples() {
    let text = mikron_with("current_us: 125.0", "current_us: 120.0");
    assert_rejected(
        &text,
        "current_us: 120.0",
        "my.yaml:{line}: periods.current_us = 120: must keep periods.velocity_us an integer \
         multiple of periods.current_us, found 250000 ns and 120000 ns",
    );
    let text = mikron_with("position_ms: 6.0", "position_ms: 6.1");
    assert_rejected(
        &text,
        "velocity_us:",
        "my.yaml:{line}: periods.velocity_us = 250: must keep periods.position_ms an integer \
         multiple of periods.velocity_us, found 6100000 ns and 250000 ns",
    );
}

#[test]
fn home_outside_the_travel_limits() {
    let text = mikron_with("travel_min_mm: -355.0", "travel_min_mm: 5.0");
    assert_rejected(
        &text,
        "travel_min_mm: 5.0",
        "my.yaml:{line}: x.limits.travel_min_mm = 5: must lie in -1e6 … 0 mm",
    );
}

#[test]
fn equal_travel_limits() {
    let text = mikron_with("travel_min_mm: -355.0", "travel_min_mm: 0.0")
        .replace("travel_max_mm: 355.0", "travel_max_mm: 0");
    assert_rejected(
        &text,
        "travel_max_mm: 0",
        "my.yaml:{line}: x.limits.travel_max_mm = 0: must keep x.limits.travel_min_mm < \
         x.limits.travel_max_mm",
    );
}

#[test]
fn negative_friction_at_standstill() {
    let text = mikron_with("c: -0.5332", "c: -1.6");
    assert_rejected(
        &text,
        "c: -1.6",
        "my.yaml:{line}: x.friction.c = -1.6: must keep a + c ≥ 0, the friction at \
         standstill, found a = 1.576 and c = -1.6",
    );
}

#[test]
fn integral_time_of_zero() {
    let text = mikron_with(
        "integral_time_ms: 4.0\n      current_loop:\n        gain: 13.0",
        "integral_time_ms: 0.0\n      current_loop:\n        gain: 13.0",
    );
    assert_rejected(
        &text,
        "integral_time_ms: 0.0",
        "my.yaml:{line}: x.velocity_loop.integral_time_ms = 0: must lie in 1e-3 … 1e6 ms",
    );
}

#[test]
fn publish_rate_above_the_rate_of_position_cycles() {
    let text = mikron_with("    periods:", "    publish_rate: 250\n    periods:");
    assert_rejected(
        &text,
        "publish_rate",
        "my.yaml:{line}: publish_rate = 250: must be at most 166.667 Hz, one message per \
         position cycle of 6 ms",
    );
}

#[test]
fn fast_time_with_use_sim_time() {
    let text = mikron_with("    periods:", "    time: fast\n    use_sim_time: true\n    periods:");
    assert_rejected(
        &text,
        "use_sim_time",
        "my.yaml:{line}: use_sim_time = true: must not be combined: time = fast publishes \
         /clock, use_sim_time = true subscribes to it",
    );
}

/// Returns the default machine with a filter of the current setpoint of X.
fn filtered(filter: &str) -> String {
    mikron_with(
        "    x:\n      type: linear",
        &format!("    x:\n      current_filter_1: {filter}\n      type: linear"),
    )
}

#[test]
fn filter_frequency_at_half_the_rate_of_velocity_cycles() {
    assert_rejected(
        &filtered("{type: low_pass, frequency_hz: 2500}"),
        "current_filter_1",
        "my.yaml:{line}: x.current_filter_1.frequency_hz = 2500: must keep x.current_filter_1.frequency_hz below \
         2000 Hz, half the rate of velocity cycles of 250 µs",
    );
}

#[test]
fn unknown_filter_type_and_bandwidth_of_zero() {
    assert_rejected(
        &filtered("{type: band_pass}"),
        "current_filter_1",
        "my.yaml:{line}: x.current_filter_1.type = band_pass: must be none or low_pass or notch",
    );
    assert_rejected(
        &filtered("{type: notch, bandwidth_hz: 0}"),
        "current_filter_1",
        "my.yaml:{line}: x.current_filter_1.bandwidth_hz = 0: must lie in 1 … 5e5 Hz",
    );
}

#[test]
fn parameter_of_another_profile_of_the_control() {
    let text = mikron_with("    periods:", "    control:\n      wait_ms: 2.5\n    periods:");
    assert_rejected(
        &text,
        "wait_ms",
        "my.yaml:{line}: control.wait_ms = 2.5: must not be given with control.profile own: set control.profile to linuxcnc, \
         or remove control.wait_ms",
    );
}
