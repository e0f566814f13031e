//! Round trip: axes identified from simulated recordings of a campaign, compared with their true parameters.

use virtual_axes_core::config::{AxisKind, MachineConfig, Parameters, Value};
use virtual_axes_identify::identify::campaign::CampaignOptions as Campaign;
use virtual_axes_identify::identify::{
    FeedforwardMode, Identification, IdentificationInput, IdentificationOptions, IdentifiedValue, identify,
    update_parameters,
};
use virtual_axes_identify::recording::{Conditioning, Severity, Signals, condition};
use virtual_axes_verification::fixtures::recordings::{
    Disturbance, axis_index, initial_parameters, record_campaign, true_parameters,
};

fn conditioned(parameters: &Parameters, axis: &str, seed: u64) -> Vec<Signals> {
    let machine = parameters.machine_config().expect("a machine");
    let config = &machine.axes()[axis_index(&machine, axis)];
    let disturbance = Disturbance::usual(config.kind(), seed);
    record_campaign(parameters, axis, &FeedforwardMode::ALL, &Campaign::default(), &disturbance)
        .iter()
        .map(|(_, raw)| {
            condition(raw, config, &machine.periods(), &Conditioning::default()).expect("a recording").0
        })
        .collect()
}

struct Found {
    axis: String,
    identification: Identification,
    values: Vec<IdentifiedValue>,
    machine: Parameters,
}

impl Found {
    fn from(signals: &[Signals], start: &Parameters, axis: &str) -> Self {
        let machine = start.machine_config().expect("a machine");
        let modes = FeedforwardMode::ALL.into_iter().map(Some);
        let inputs: Vec<IdentificationInput> = signals
            .iter()
            .zip(modes)
            .map(|(signals, feedforward)| IdentificationInput { signals, feedforward })
            .collect();
        let config = &machine.axes()[axis_index(&machine, axis)];
        let identification = identify(&inputs, config, &machine.periods(), &IdentificationOptions::default());
        let values = identification.values(start, axis);
        let mut machine = start.clone();
        update_parameters(&mut machine, axis, &values).expect("values in range");
        Found { axis: axis.to_owned(), identification, values, machine }
    }

    fn number(&self, key: &str) -> f64 {
        number(&self.machine, &format!("{}.{key}", self.axis))
    }

    fn value(&self, key: &str) -> &IdentifiedValue {
        let key = format!("{}.{key}", self.axis);
        self.values.iter().find(|value| value.key == key).unwrap_or_else(|| panic!("{key} is not identified"))
    }

    fn codes(&self, severity: Severity) -> Vec<&'static str> {
        let findings = self.identification.findings.iter();
        findings.filter(|finding| finding.severity == severity).map(|finding| finding.code).collect()
    }

    /// Returns the friction current at V (m/min or rev/min), A.
    fn friction(&self, v: f64) -> f64 {
        let [a, b, c, d] = ["a", "b", "c", "d"].map(|name| self.number(&format!("friction.{name}")));
        a * (b * v).exp() + c * (d * v).exp()
    }
}

fn number(parameters: &Parameters, key: &str) -> f64 {
    match parameters.get(key) {
        Some(Value::Double(value)) => value,
        other => panic!("{key} is {other:?}"),
    }
}

/// True parameters of an axis (model.md).
struct Axis {
    name: &'static str,
    inertia: f64,
    /// Friction parameters a, b, c, d, i0.
    friction: [f64; 5],
    torque_feedforward: f64,
    /// Largest speed of the axis in a campaign: 20, or the reduced Vmax.
    top: f64,
}

const AXES: [Axis; 5] = [
    Axis {
        name: "x",
        inertia: 0.028,
        friction: [1.576, 0.01965, -0.5332, -0.2801, 1.043],
        torque_feedforward: 0.002034,
        top: 20.0,
    },
    Axis {
        name: "y",
        inertia: 0.024,
        friction: [1.253, 0.01895, -0.3629, -0.4026, 0.890],
        torque_feedforward: 0.002030,
        top: 20.0,
    },
    Axis {
        name: "z",
        inertia: 0.0225,
        friction: [1.420, 0.01650, -0.6301, -0.2625, 0.790],
        torque_feedforward: 0.002030,
        top: 20.0,
    },
    Axis {
        name: "a",
        inertia: 0.001,
        friction: [0.6, 0.019, -0.2, -0.3, 0.4],
        torque_feedforward: 0.0,
        top: 14.25,
    },
    Axis {
        name: "c",
        inertia: 0.001,
        friction: [0.6, 0.019, -0.2, -0.3, 0.4],
        torque_feedforward: 0.0,
        top: 19.0,
    },
];

fn round_trip(number: usize) -> Found {
    let axis = &AXES[number];
    let signals = conditioned(&true_parameters(), axis.name, 11 + number as u64);
    let found = Found::from(&signals, &initial_parameters(axis.name), axis.name);
    let relative = |found: f64, truth: f64| found / truth - 1.0;

    let inertia = relative(found.number("motor.inertia_kg_m2"), axis.inertia);
    let [a, b, c, d, i0] = axis.friction;
    let law = |v: f64| a * (b * v).exp() + c * (d * v).exp();
    let speeds = (1..=40).map(|k| f64::from(k) * 0.5);
    let friction = speeds.map(|v| relative(found.friction(v), law(v)).abs()).fold(0.0, f64::max);
    let breakaway = relative(found.number("friction.i0"), i0);
    println!(
        "{}: Jeq {:+.3} %, friction up to {:.3} % over 0.5 … 20 (moved at up to {}), i0 {:+.2} %",
        axis.name,
        100.0 * inertia,
        100.0 * friction,
        axis.top,
        100.0 * breakaway
    );
    assert!(inertia.abs() < 0.01);
    assert!(friction < 0.02);
    assert!(breakaway.abs() < 0.03);

    assert!(relative(found.number("feedforward.velocity"), 1.0).abs() < 0.005);
    let [alpha, beta] = ["alpha", "beta"].map(|name| found.value(&format!("delays.{name}_ms")));
    let [low, high] = alpha.interval.expect("an interval");
    println!("   alpha {low} … {high} ms, beta {:?} ms as {}", beta.interval, beta.value);
    assert!(low < 9.0 && 9.0 <= high, "alpha {low} … {high}");
    // The interval is at most one period of the position comparator.
    assert!(high - low < 6.0 + 1e-9);
    assert!((beta.value - 9.0).abs() <= 0.25, "beta {}", beta.value);
    if axis.torque_feedforward == 0.0 {
        assert_eq!(found.number("feedforward.torque_kg_m2"), 0.0);
        assert_eq!(found.number("delays.gamma_ms"), 1.0, "left as it was");
        assert!(found.codes(Severity::Note).contains(&"unseen-delay"));
    } else {
        assert!(relative(found.number("feedforward.torque_kg_m2"), axis.torque_feedforward).abs() < 0.005);
        let [low, high] = found.value("delays.gamma_ms").interval.expect("an interval");
        println!("   gamma {low} … {high} ms");
        assert!(low < 9.0 && 9.0 <= high, "gamma {low} … {high}");
    }
    assert_eq!(found.codes(Severity::Missing), [""; 0]);
    found
}

#[test]
fn x_and_y_are_identified_and_their_ballbar_matches() {
    let (x, y) = (round_trip(0), round_trip(1));
    assert_eq!((x.number("gravity.weight_n"), y.number("gravity.weight_n")), (0.0, 0.0));
    let mut machine = x.machine.clone();
    update_parameters(&mut machine, "y", &y.values).expect("values in range");
    let radial = |parameters: &Parameters| {
        let config = parameters.machine_config().expect("a machine");
        let figures = ballbar(&config);
        println!("ballbar: mean {:.2}, {:.2} … {:.2} µm", figures[0], figures[1], figures[2]);
        figures
    };
    let (found, truth) = (radial(&machine), radial(&true_parameters()));
    for (found, truth) in found.iter().zip(truth) {
        assert!((found - truth).abs() < 1.0, "{found} against {truth} µm");
    }
}

/// Returns the radial deviation on the ballbar: mean, min, max, µm.
fn ballbar(machine: &MachineConfig) -> [f64; 3] {
    let figures = virtual_axes_verification::fixtures::machines::trace_scenario("ballbar", machine, |_| {});
    let circle = &figures.circles[0];
    [circle.mean, circle.min, circle.max].map(|meters| meters * 1e6)
}

#[test]
fn z_and_its_weight_are_identified() {
    let found = round_trip(2);
    let weight = found.number("gravity.weight_n");
    println!("   weight {weight} N");
    assert!((weight / 400.0 - 1.0).abs() < 0.02, "{weight} N");
}

#[test]
fn a_and_its_tilting_torque_are_identified() {
    let found = round_trip(3);
    let (tilt, phase) = (found.number("gravity.tilt_nm"), found.number("gravity.tilt_phase_deg"));
    let [of_tilt, of_phase] = ["gravity.tilt_nm", "gravity.tilt_phase_deg"].map(|key| found.value(key));
    assert!(of_tilt.source.ends_with("; refined on the closed loop") && of_phase.source == of_tilt.source);
    // Of a phase near 0, k times the error is that of k sin φ, which the refinement knows as well as k cos φ.
    let ratio = of_phase.error.expect("an error").to_radians() * tilt / of_tilt.error.expect("an error");
    assert!((0.1..10.0).contains(&ratio), "{ratio}");
    println!("   k {tilt} N·m, φ {phase}°");
    assert!((tilt / 30.0 - 1.0).abs() < 0.02, "{tilt} N·m");
    // 2 % of a radian; the true value is 0.
    assert!(phase.to_radians().abs() < 0.02, "{phase}°");
}

#[test]
fn c_is_identified_without_gravity() {
    let found = round_trip(4);
    let gravity = found.identification.gravity.as_ref().expect("gravity is looked for");
    assert_eq!(gravity.tilt.map(|(tilt, _)| tilt), Some(0.0));
    let machine = found.machine.machine_config().expect("a machine");
    assert_eq!(machine.axes()[axis_index(&machine, "c")].kind(), AxisKind::Rotary);
}

#[test]
fn feedforward_weights_and_delays_are_identified_without_recorded_feedforward() {
    let mut start = initial_parameters("x");
    for (key, value) in [("delays.beta_ms", 15.0), ("delays.gamma_ms", 3.0), ("friction.a", 2.0)] {
        let source = virtual_axes_core::config::ValueSource::named("the test");
        start.set(&format!("x.{key}"), Value::Double(value), &source).expect("a value in range");
    }
    let mut signals = conditioned(&true_parameters(), "x", 31);
    for span in signals.iter_mut().flat_map(|signals| &mut signals.spans) {
        (span.velocity_feedforward, span.torque_feedforward) = (None, None);
    }
    let found = Found::from(&signals, &start, "x");
    let [velocity, torque, inertia] =
        ["feedforward.velocity", "feedforward.torque_kg_m2", "motor.inertia_kg_m2"]
            .map(|key| found.number(key));
    let beta = found.value("delays.beta_ms");
    let [low, high] = found.value("delays.gamma_ms").interval.expect("an interval");
    println!("VFFW {velocity:.5}, TFFW {torque:.6}, beta {}, gamma {low} … {high}", beta.value);
    assert!((velocity - 1.0).abs() < 0.005, "VFFW {velocity}");
    // Identified from positions and currents only: a few per cent of a feedforward of 7 % of the inertia.
    assert!((torque / 0.002034 - 1.0).abs() < 0.1, "TFFW {torque}");
    assert!((inertia / 0.028 - 1.0).abs() < 0.01, "Jeq {inertia}");
    assert!((beta.value - 9.0).abs() <= 0.25, "beta {}", beta.value);
    assert!(low < 9.0 && 9.0 <= high, "gamma {low} … {high}");
}
