//! Predictive control on the scenarios of the model page, and its prediction model.

use std::f64::consts::TAU;

use virtual_axes_core::config::{AxisKind, MachineConfig};
use virtual_axes_core::machine::{AxisSample, prediction_model};
use virtual_axes_core::trial::{Figures, Tick};
use virtual_axes_core::units::seconds;
use virtual_axes_verification::fixtures::machines::*;

const MACHINES: [&str; 2] = ["mikron_ucp710", "linear_motor_center"];
const DEFAULT: &str = MACHINES[0];
const GPC: &str = "position_loop.controller=gpc";
const MICROMETER: f64 = 1e-6;

/// Returns the default machine with a GPC tuning.
fn tuned(n1: usize, n2: usize, nu: usize, lambda_rel: f64) -> MachineConfig {
    let values = [("n1", n1 as f64), ("n2", n2 as f64), ("nu", nu as f64), ("lambda_rel", lambda_rel)];
    let texts = values.map(|(name, value)| format!("position_loop.gpc.{name}={value}"));
    let mut all = vec![GPC];
    all.extend(texts.iter().map(String::as_str));
    configured(DEFAULT, &all)
}

fn figures(scenario: &str, machine: &MachineConfig) -> Figures {
    trace_scenario(scenario, machine, |_| ())
}

/// Returns the samples of one axis at every tick of a scenario.
fn samples(scenario: &str, machine: &MachineConfig, index: usize) -> Vec<AxisSample> {
    let mut samples = Vec::new();
    trace_scenario(scenario, machine, |tick: Tick<'_>| samples.push(*tick.machine.axis(index).sample()));
    samples
}

#[test]
fn prediction_model_equals_the_simulation_without_friction() {
    let frictionless = [
        "friction.a=0",
        "friction.c=0",
        "friction.i0=0",
        // Proportional, without feedforward.
        "position_loop.controller=rst",
        "position_loop.rst.r=[25]",
        "position_loop.rst.s=[1]",
        "position_loop.rst.t=[25]",
    ];
    for name in MACHINES {
        // Tilt gravity is not linear.
        let config = configured_with(name, &frictionless, &["a.gravity.tilt_nm=0"]);
        for (index, axis) in config.axes().iter().enumerate() {
            let model = prediction_model(axis, &config.periods()).expect("a model");
            let (a, b) = (model.a(), model.b());
            let mut machine = at_rest(&config);
            let period = seconds(config.periods().position);
            let psec = |k: i64| {
                let t = k as f64 * period;
                1e-4 * ((17.0 * t).sin() + 0.3 * (113.0 * t).sin() * (5.0 * t).sin())
            };
            let (mut input, mut output, mut predicted) = (Vec::new(), Vec::new(), Vec::new());
            for k in 0..1500 {
                let mut first = true;
                advance_axis(&mut machine, index, k, psec, |m| {
                    if std::mem::take(&mut first) {
                        let s = m.axis(index).sample();
                        assert!(!s.saturated);
                        input.push(s.velocity_setpoint);
                        output.push(s.position);
                    }
                });
                // Open-loop prediction from the recorded Ω*.
                let k = k as usize;
                let back = |values: &[f64], weights: &[f64]| -> f64 {
                    (1..weights.len()).filter(|&i| i <= k).map(|i| weights[i] * values[k - i]).sum()
                };
                predicted.push(back(&input, b) - back(&predicted, a));
            }
            // θ is in motor units: the positions differ by the transmission ratio.
            let largest = output.iter().fold(0.0f64, |m, v| m.max(v.abs()));
            let at = output.iter().position(|v| v.abs() == largest).expect("the axis moves");
            let ratio = output[at] / predicted[at];
            let wanted = transmission(name, axis.name());
            assert!((ratio / wanted - 1.0).abs() < 1e-9, "{name} {}: ratio {ratio}", axis.name());
            for (k, (o, p)) in output.iter().zip(&predicted).enumerate() {
                let error = (o - wanted * p).abs();
                assert!(error <= 1e-9 * largest, "{name} {} instant {k}: {error} of {largest}", axis.name());
            }
        }
    }
}

/// Returns the transmission ratio of the machine files, m or rad per rad (or m) of the motor.
fn transmission(machine: &str, axis: &str) -> f64 {
    match (machine, axis) {
        ("mikron_ucp710", "a") => 1.0 / 180.0,
        ("mikron_ucp710", "c") => 1.0 / 120.0,
        ("mikron_ucp710", _) => 0.020 / TAU,
        _ => 1.0,
    }
}

#[test]
fn prediction_model_keeps_all_significant_states() {
    for name in MACHINES {
        let config = configured(name, &[]);
        for axis in config.axes() {
            let model = prediction_model(axis, &config.periods()).expect("a model");
            // The integrator of θ and at most the four states of the inner loops.
            assert!((3..=6).contains(&model.a().len()), "{name} {}: {:?}", axis.name(), model.a());
            assert!(model.a().iter().sum::<f64>().abs() < 1e-9, "an axis integrates its velocity");
        }
    }
}

/// Returns the radial deviation at steady feed: mean, min, max, µm.
fn ballbar(machine: &MachineConfig) -> [f64; 3] {
    let figures = figures("ballbar", machine);
    let circle = figures.circles.first().expect("a circle");
    [circle.mean, circle.min, circle.max].map(|v| v / MICROMETER)
}

#[test]
fn gpc_ballbar_reproduces_the_model_page() {
    let rows = [
        ((1, 8, 6, 1e-3), [0.0, -9.5, 10.4]),
        ((1, 8, 6, 1e-2), [-1.6, -10.4, 10.9]),
        ((1, 14, 12, 0.005), [-0.4, -8.5, 13.2]),
        ((1, 8, 1, 1.0), [-136.3, -142.4, -120.9]),
    ];
    for ((n1, n2, nu, lambda_rel), wanted) in rows {
        let found = ballbar(&tuned(n1, n2, nu, lambda_rel));
        for ((what, tolerance), (found, wanted)) in
            [("mean", 0.2), ("min", 1.0), ("max", 1.0)].into_iter().zip(found.into_iter().zip(wanted))
        {
            assert_near(&format!("{n1}, {n2}, {nu}, {lambda_rel}: {what}, µm"), found, wanted, tolerance);
        }
    }
}

#[test]
fn preset_of_the_machine_file_equals_the_model_page() {
    let preset = configured(DEFAULT, &[GPC]);
    assert_eq!(preset, tuned(1, 14, 12, 0.005));
}

#[test]
fn friction_compensation_removes_reversal_spikes() {
    let config = configured(DEFAULT, &[GPC, "feedforward.friction=1", "delays.friction_ms=11.75"]);
    let [_, min, max] = ballbar(&config);
    assert_near("min, µm", min, -1.4, 0.2);
    assert_near("max, µm", max, 0.4, 0.2);
    assert!(min >= -2.0 && max <= 2.0);
    // The reversal spikes of the cascade, 21 µm without compensation, disappear too.
    let cascade = configured(DEFAULT, &["feedforward.friction=1", "delays.friction_ms=11.75"]);
    let [mean, min, max] = ballbar(&cascade);
    assert!(max - mean < 2.0 && mean - min < 2.0, "{mean} {min} {max}");
}

#[test]
fn gpc_corners_reproduce_the_model_page() {
    // The cascade has 146.6 and 103.7 µm.
    let rows = [
        ("corner-90", 1e-3, 6.6),
        ("corner-45", 1e-3, 4.0),
        ("corner-90", 1e-2, 13.1),
        ("corner-45", 1e-2, 14.8),
    ];
    for (scenario, lambda_rel, wanted) in rows {
        let figures = figures(scenario, &tuned(1, 8, 6, lambda_rel));
        let corner = figures.corners.first().expect("a corner").max_contour_error / MICROMETER;
        assert_near(&format!("{scenario} with {lambda_rel}, µm"), corner, wanted, 0.01 * wanted + 0.05);
    }
}

#[test]
fn proportional_rst_equals_the_cascade_without_feedforward() {
    // 1.5 (m/min)/mm.
    let gain = 25.0;
    let texts = [
        "position_loop.controller=rst".to_owned(),
        format!("position_loop.rst.r=[{gain}]"),
        "position_loop.rst.s=[1]".to_owned(),
        format!("position_loop.rst.t=[{gain}]"),
    ];
    let texts: Vec<&str> = texts.iter().map(String::as_str).collect();
    let rst = samples("x-there-and-back", &configured(DEFAULT, &texts), 0);
    let off = ["feedforward.velocity=0", "feedforward.torque_kg_m2=0"];
    let cascade = samples("x-there-and-back", &configured(DEFAULT, &off), 0);
    assert_eq!(rst.len(), cascade.len());
    assert!(cascade.iter().any(|s| s.velocity.abs() > 0.1), "the axis does not move");
    for (r, c) in rst.iter().zip(&cascade) {
        assert!((r.position - c.position).abs() < 1e-12, "{r:?} {c:?}");
        assert!((r.current - c.current).abs() < 1e-7, "{r:?} {c:?}");
    }
    assert_eq!((rst[0].controller, cascade[0].controller), ("rst", "cascade"));
}

#[test]
fn gpc_given_as_rst_coefficients_is_bit_identical() {
    use virtual_axes_core::design::{ControlWeight, GpcTuning, gpc};

    let config = configured(DEFAULT, &[GPC]);
    let x = &config.axes()[0];
    assert_eq!(x.kind(), AxisKind::Linear);
    let model = prediction_model(x, &config.periods()).expect("a model");
    let tuning = GpcTuning { n1: 1, n2: 14, nu: 12, weight: ControlWeight::Relative(0.005) };
    let rst = gpc(&model, &tuning).expect("a controller");
    let list = |numbers: &[f64]| {
        let numbers: Vec<String> = numbers.iter().map(f64::to_string).collect();
        format!("[{}]", numbers.join(", "))
    };
    let texts = [
        "position_loop.controller=rst".to_owned(),
        format!("position_loop.rst.r={}", list(rst.r())),
        format!("position_loop.rst.s={}", list(rst.s())),
        format!("position_loop.rst.t={}", list(rst.t())),
        format!("position_loop.rst.t_first={}", rst.t_first()),
    ];
    let texts: Vec<&str> = texts.iter().map(String::as_str).collect();
    let by_numbers = samples("x-there-and-back", &configured(DEFAULT, &texts), 0);
    let designed = samples("x-there-and-back", &config, 0);
    assert_eq!(by_numbers.len(), designed.len());
    for (n, d) in by_numbers.iter().zip(&designed) {
        assert_eq!((n.position, n.current, n.voltage), (d.position, d.current, d.voltage));
    }
}

#[test]
fn rst_with_wrong_static_gain_is_rejected_by_axis_and_value() {
    use virtual_axes_core::machine::MachineParameters;

    let rejection = |texts: &[&str]| {
        let mut all = vec!["position_loop.controller=rst", "position_loop.rst.s=[1]"];
        all.extend(texts);
        MachineParameters::new(&configured(DEFAULT, &all)).expect_err("rejected").to_string()
    };
    let text = rejection(&["position_loop.rst.r=[25]", "position_loop.rst.t=[24]"]);
    assert!(text.starts_with("axis x: position_loop") && text.contains("T(1) = 24 and R(1) = 25"), "{text}");
    let text = rejection(&["position_loop.rst.r=[25, -25]", "position_loop.rst.t=[0]"]);
    assert!(text.contains("R(1) = 0"), "{text}");
    let text =
        rejection(&["position_loop.rst.s=[0, 1]", "position_loop.rst.r=[25]", "position_loop.rst.t=[25]"]);
    assert!(text.contains("s[0] = 0"), "{text}");
}

#[test]
fn unstable_position_loop_is_rejected_unless_allowed() {
    use virtual_axes_core::machine::MachineParameters;

    // A gain that is unstable with the lag of the velocity loop.
    let unstable = [
        "position_loop.controller=rst",
        "position_loop.rst.r=[250]",
        "position_loop.rst.s=[1]",
        "position_loop.rst.t=[250]",
    ];
    let text = MachineParameters::new(&configured(DEFAULT, &unstable)).expect_err("rejected").to_string();
    assert!(
        text.starts_with("axis x: position_loop") && text.contains("unstable") && text.contains("pole"),
        "{text}"
    );
    let mut forced = unstable.to_vec();
    forced.push("position_loop.allow_unstable=true");
    let config = configured(DEFAULT, &forced);
    // The oscillation grows to the limits.
    let mut machine = at_rest(&config);
    let mut saturated = false;
    for k in 0..500 {
        advance_axis(
            &mut machine,
            0,
            k,
            |k| if k < 10 { 0.0 } else { 1e-3 },
            |m| {
                saturated |= m.axis(0).sample().saturated;
            },
        );
    }
    assert!(saturated, "the loop is stable");
}

#[test]
fn diverging_inner_loops_are_rejected_only_with_a_prediction_model() {
    use virtual_axes_core::machine::MachineParameters;

    for gain in
        ["current_loop.gain=500", "current_loop.gain=1e9", "velocity_loop.gain=1e5", "velocity_loop.gain=0"]
    {
        let cascade = MachineParameters::new(&configured(DEFAULT, &[gain]));
        assert!(cascade.is_ok(), "{gain}: the cascade is simulated without a model");
        let text = MachineParameters::new(&configured(DEFAULT, &[GPC, gain])).expect_err(gain).to_string();
        assert!(text.starts_with("axis x: position_loop"), "{gain}: {text}");
    }
}

#[test]
fn overflowing_coefficients_are_rejected_and_a_remaining_overflow_stops_the_axis() {
    use virtual_axes_core::machine::MachineParameters;

    let forced = |r: &str, s: &str| {
        let texts = [
            "position_loop.controller=rst".to_owned(),
            "position_loop.allow_unstable=true".to_owned(),
            format!("position_loop.rst.r={r}"),
            format!("position_loop.rst.s={s}"),
            format!("position_loop.rst.t={r}"),
        ];
        let texts: Vec<&str> = texts.iter().map(String::as_str).collect();
        configured(DEFAULT, &texts)
    };
    for (r, s, named) in
        [("[1]", "[1e-310]", "r[0]"), ("[1e307]", "[1]", "r[0]"), ("[1]", "[1, 1e12]", "s[1]")]
    {
        let text = MachineParameters::new(&forced(r, s)).expect_err(r).to_string();
        assert!(text.contains(named) && text.contains("at most"), "{text}");
    }
    let mut machine = at_rest(&forced("[1e9]", "[1, 1e9, 1e9]"));
    for k in 0..300 {
        advance_axis(
            &mut machine,
            0,
            k,
            |k| if k < 5 { 0.0 } else { 0.001 },
            |m| {
                let s = m.axis(0).sample();
                assert!(s.position.abs() < 10.0 && s.velocity_setpoint.is_finite(), "{s:?}");
            },
        );
    }
}

#[test]
fn delay_of_disabled_friction_compensation_does_not_count() {
    let delay = |changes: &[&str]| at_rest(&configured(DEFAULT, changes)).longest_delay();
    let long = "delays.friction_ms=100";
    assert_eq!(delay(&[long]), delay(&[]));
    assert!(delay(&[long, "feedforward.friction=1"]) > delay(&[]));
}
