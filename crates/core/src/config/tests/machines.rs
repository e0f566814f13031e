//! Values of the built-in machines.

use std::f64::consts::{PI, TAU};

use super::{MIKRON, mikron};
use crate::config::{
    AxisConfig, AxisKind, KinematicsConfig, MachineConfig, Parameters, RotaryChain, ValueSource,
};

/// Relative tolerance for the conversion of units.
const ROUNDING: f64 = 1e-12;

fn assert_near(actual: f64, expected: f64, what: &str) {
    let tolerance = ROUNDING * expected.abs();
    assert!(
        actual == expected || (actual - expected).abs() <= tolerance,
        "{what}: {actual}, expected {expected}"
    );
}

fn machine(name: &str) -> MachineConfig {
    let parameters = Parameters::load(name, virtual_axes_builtin::MACHINES).expect("a built-in machine");
    parameters.machine_config().expect("a valid machine")
}

/// Parameters of one axis, in SI units (Prévost Appendix 2).
struct ExpectedAxis {
    name: &'static str,
    kind: AxisKind,
    ratio: f64,
    inertia: f64,
    position_gain: f64,
    velocity: (f64, f64),
    current: (f64, f64),
    friction: [f64; 5],
    torque_feedforward: f64,
    /// Kt, Ke, R, L, imax, umax, maximum speed.
    motor: [f64; 7],
    /// W, k, φ.
    gravity: [f64; 3],
    /// Vmax, Amax, Jmax.
    limits: [f64; 3],
    travel: (f64, f64),
}

/// 1FT7086-AC7, 2000 rpm.
const LARGE: [f64; 7] = [2.64, 0.88, 0.46, 0.0085, 54.0, 245.0, 2000.0 * TAU / 60.0];
/// 1FT7044-AK7, 6000 rpm.
const SMALL: [f64; 7] = [0.88, 0.293, 0.61, 0.0042, 30.0, 245.0, 6000.0 * TAU / 60.0];
const ROTARY_FRICTION: [f64; 5] = [0.6, 0.019, -0.2, -0.3, 0.4];
const LEAD: f64 = 0.020;

fn expected_axes() -> [ExpectedAxis; 5] {
    let turn = PI / 180.0;
    [
        ExpectedAxis {
            name: "x",
            kind: AxisKind::Linear,
            ratio: LEAD / TAU,
            inertia: 0.028,
            position_gain: 25.0,
            velocity: (5.0, 0.004),
            current: (13.0, 0.002),
            friction: [1.576, 0.01965, -0.5332, -0.2801, 1.043],
            torque_feedforward: 0.002034,
            motor: LARGE,
            gravity: [0.0; 3],
            limits: [0.5, 2.5, 50.0],
            travel: (-0.355, 0.355),
        },
        ExpectedAxis {
            name: "y",
            kind: AxisKind::Linear,
            ratio: LEAD / TAU,
            inertia: 0.024,
            position_gain: 25.0,
            velocity: (4.5, 0.006),
            current: (12.0, 0.002),
            friction: [1.253, 0.01895, -0.3629, -0.4026, 0.890],
            torque_feedforward: 0.002030,
            motor: LARGE,
            gravity: [0.0; 3],
            limits: [0.5, 3.0, 50.0],
            travel: (-0.275, 0.275),
        },
        ExpectedAxis {
            name: "z",
            kind: AxisKind::Linear,
            ratio: LEAD / TAU,
            inertia: 0.0225,
            position_gain: 3.5 * 1000.0 / 60.0,
            velocity: (5.5, 0.004),
            current: (12.0, 0.002),
            friction: [1.420, 0.01650, -0.6301, -0.2625, 0.790],
            torque_feedforward: 0.002030,
            motor: LARGE,
            gravity: [400.0, 0.0, 0.0],
            limits: [0.5, 2.1, 50.0],
            travel: (-0.250, 0.250),
        },
        ExpectedAxis {
            name: "a",
            kind: AxisKind::Rotary,
            ratio: 1.0 / 180.0,
            inertia: 0.001,
            position_gain: 25.0,
            velocity: (0.18, 0.006),
            current: (6.0, 0.002),
            friction: ROTARY_FRICTION,
            torque_feedforward: 0.0,
            motor: SMALL,
            gravity: [0.0, 30.0, 0.0],
            limits: [15.0 * TAU / 60.0, 0.83 * TAU, 50.0 * TAU],
            travel: (-30.0 * turn, 120.0 * turn),
        },
        ExpectedAxis {
            name: "c",
            kind: AxisKind::Rotary,
            ratio: 1.0 / 120.0,
            inertia: 0.001,
            position_gain: 25.0,
            velocity: (0.18, 0.006),
            current: (6.0, 0.002),
            friction: ROTARY_FRICTION,
            torque_feedforward: 0.0,
            motor: SMALL,
            gravity: [0.0; 3],
            limits: [20.0 * TAU / 60.0, 0.83 * TAU, 50.0 * TAU],
            travel: (f64::NEG_INFINITY, f64::INFINITY),
        },
    ]
}

impl ExpectedAxis {
    fn check(&self, axis: &AxisConfig) {
        assert_eq!(axis.name, self.name);
        assert_eq!(axis.kind, self.kind);
        let gain = axis.position_loop.gain;
        let motor = &axis.motor;
        let pairs = [
            ("r", axis.transmission_ratio, self.ratio),
            ("Jeq", motor.inertia, self.inertia),
            ("Kt", motor.torque_constant, self.motor[0]),
            ("Ke", motor.emf_constant, self.motor[1]),
            ("R", motor.resistance, self.motor[2]),
            ("L", motor.inductance, self.motor[3]),
            ("imax", motor.max_current, self.motor[4]),
            ("umax", motor.max_voltage, self.motor[5]),
            ("speed", motor.max_speed, self.motor[6]),
            ("Kp", gain, self.position_gain),
            ("Kv", axis.velocity_loop.gain, self.velocity.0),
            ("Tv", axis.velocity_loop.integral_time, self.velocity.1),
            ("Ki", axis.current_loop.gain, self.current.0),
            ("Ti", axis.current_loop.integral_time, self.current.1),
            ("a", axis.friction.a, self.friction[0]),
            ("b", axis.friction.b, self.friction[1]),
            ("c", axis.friction.c, self.friction[2]),
            ("d", axis.friction.d, self.friction[3]),
            ("i0", axis.friction.i0, self.friction[4]),
            ("VFFW", axis.feedforward.velocity, 1.0),
            ("TFFW", axis.feedforward.torque, self.torque_feedforward),
            ("W", axis.gravity.weight, self.gravity[0]),
            ("k", axis.gravity.tilt, self.gravity[1]),
            ("φ", axis.gravity.phase, self.gravity[2]),
            ("Vmax", axis.limits.velocity, self.limits[0]),
            ("Amax", axis.limits.acceleration, self.limits[1]),
            ("Jmax", axis.limits.jerk, self.limits[2]),
            ("travel min", axis.limits.travel_min, self.travel.0),
            ("travel max", axis.limits.travel_max, self.travel.1),
        ];
        for (what, actual, expected) in pairs {
            assert_near(actual, expected, &format!("{} {what}", self.name));
        }
        let delays = (axis.delays.alpha, axis.delays.beta, axis.delays.gamma);
        assert_eq!(delays, (9_000_000, 9_000_000, 9_000_000));
    }
}

#[test]
fn mikron_has_the_expected_values() {
    let machine = machine("mikron_ucp710");
    assert_eq!(machine.name(), "Mikron UCP 710");
    let periods = machine.periods();
    assert_eq!((periods.position, periods.velocity, periods.current), (6_000_000, 250_000, 125_000));
    let kinematics = KinematicsConfig { tool_length: 0.1, ..KinematicsConfig::default() };
    assert_eq!(machine.kinematics(), &kinematics);
    assert_eq!(machine.axes().len(), 5);
    for (expected, axis) in expected_axes().iter().zip(machine.axes()) {
        expected.check(axis);
    }
}

#[test]
fn linear_motors_have_units_of_meters_and_newtons() {
    let machine = machine("linear_motor_center");
    let x = &machine.axes()[0];
    assert_eq!((x.kind, x.transmission_ratio), (AxisKind::Linear, 1.0));
    assert_near(x.motor.inertia, 250.0, "mass");
    assert_near(x.motor.torque_constant, 70.0, "force constant");
    assert_near(x.motor.max_speed, 2.0, "120 m/min");
    assert_near(x.feedforward.torque, 250.0, "TFFW");
    assert_near(x.limits.acceleration, 18.0, "Amax");
    let a = &machine.axes()[3];
    assert_eq!((a.kind, a.transmission_ratio), (AxisKind::Rotary, 1.0));
    assert_near(a.motor.max_speed, 72.0 * TAU / 60.0, "72 rpm");
    assert_eq!(machine.periods().current, 62_500);
}

#[test]
fn each_kinematics_value_has_its_key() {
    let mut parameters = mikron();
    let keys = [
        "tool_length",
        "pivot_a_y",
        "pivot_a_z",
        "pivot_b_x",
        "pivot_b_z",
        "pivot_c_x",
        "pivot_c_y",
        "workpiece_x",
        "workpiece_y",
        "workpiece_z",
    ];
    for (index, key) in keys.iter().enumerate() {
        let text = format!("kinematics.{key}_mm={}", 1000 * (index + 1));
        assert_eq!(parameters.set_text(&text, &ValueSource::named("--set")), Ok(()));
    }
    let machine = parameters.machine_config().expect("a valid machine");
    let expected = KinematicsConfig {
        chain: RotaryChain::default(),
        tool_length: 1.0,
        pivot_a: [2.0, 3.0],
        pivot_b: [4.0, 5.0],
        pivot_c: [6.0, 7.0],
        workpiece: [8.0, 9.0, 10.0],
    };
    assert_eq!(machine.kinematics(), &expected);
}

#[test]
fn a_file_without_kinematics_has_zero_tool_length() {
    let (before, rest) = MIKRON.split_once("    kinematics:\n").expect("the section");
    let (_, after) = rest.split_once("\n\n").expect("an empty line after it");
    let parameters = Parameters::from_yaml(&format!("{before}\n{after}"), "my.yaml").expect("a machine");
    let machine = parameters.machine_config().expect("a valid machine");
    assert_eq!(machine.kinematics(), &KinematicsConfig::default());
}

#[test]
fn builtin_machines_are_valid_and_the_default_is_the_first() {
    let names: Vec<&str> = virtual_axes_builtin::MACHINES.iter().map(|(name, _)| *name).collect();
    assert_eq!(names[..2], ["mikron_ucp710", "linear_motor_center"]);
    let axes =
        |name: &str| machine(name).axes().iter().map(|axis| axis.name().to_owned()).collect::<String>();
    let axes: Vec<String> = names.iter().map(|name| axes(name)).collect();
    assert_eq!(axes, ["xyzac", "xyzac", "xyz", "xyzb", "xyz", "xyzbc", "xyzac", "xyza", "xyzac"]);
    assert_eq!(Parameters::load("mikron_ucp710", virtual_axes_builtin::MACHINES), Ok(mikron()));
}

#[test]
fn every_value_without_a_source_is_marked_assumed() {
    let unmarked = |text: &str, axis: &str, key: &str| {
        let line = text
            .split_once(&format!("\n    {axis}:\n"))
            .and_then(|(_, rest)| rest.lines().find(|line| line.trim_start().starts_with(key)))
            .map(str::to_owned);
        line.is_none_or(|line| !line.contains("# assumed: "))
    };
    for axis in ["x", "y", "z", "a", "c"] {
        for key in ["torque_constant_nm_a", "resistance_ohm", "max_speed", "velocity_"] {
            let key = if key == "velocity_" && ["x", "y", "z"].contains(&axis) {
                "velocity_m_min"
            } else if key == "velocity_" {
                "velocity_rpm"
            } else {
                key
            };
            assert!(!unmarked(MIKRON, axis, key), "{axis} {key}");
        }
    }
    // Every value of the linear-motor machine is assumed.
    let other = include_str!("../../../config/linear_motor_center.yaml");
    for line in other.lines().skip_while(|line| !line.contains("periods:")) {
        let has_value = line.split('#').next().and_then(|code| code.split_once(": ")).is_some();
        let structure = line.contains("type:") || line.contains("controller:");
        assert!(!has_value || structure || line.contains("# assumed: "), "{line}");
    }
}
