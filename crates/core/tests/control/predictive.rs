//! Predictive control on the model page's trials, and the model that it predicts with.

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

/// The default machine under predictive control with this tuning.
fn tuned(n1: usize, n2: usize, nu: usize, lambda_rel: f64) -> MachineConfig {
    let values = [("n1", n1 as f64), ("n2", n2 as f64), ("nu", nu as f64), ("lambda_rel", lambda_rel)];
    let texts = values.map(|(name, value)| format!("position_loop.gpc.{name}={value}"));
    let mut all = vec![GPC];
    all.extend(texts.iter().map(String::as_str));
    configured(DEFAULT, &all)
}

fn figures(scenario: &str, machine: &MachineConfig) -> Figures {
    watch_scenario(scenario, machine, |_| ())
}

/// What a scenario leaves at every tick of one axis.
fn samples(scenario: &str, machine: &MachineConfig, place: usize) -> Vec<AxisSample> {
    let mut samples = Vec::new();
    watch_scenario(scenario, machine, |tick: Tick<'_>| samples.push(*tick.machine.axis(place).sample()));
    samples
}

#[test]
fn the_prediction_model_is_the_simulation_without_friction() {
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
        // Gravity that depends on the position is no part of a linear model.
        let config = configured_with(name, &frictionless, &["a.gravity.tilt_nm=0"]);
        for (place, axis) in config.axes().iter().enumerate() {
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
                advance_axis(&mut machine, place, k, psec, |m| {
                    if std::mem::take(&mut first) {
                        let s = m.axis(place).sample();
                        assert!(!s.saturated);
                        input.push(s.velocity_setpoint);
                        output.push(s.position);
                    }
                });
                // Alone from the first instant on, by what was asked for.
                let k = k as usize;
                let back = |values: &[f64], weights: &[f64]| -> f64 {
                    (1..weights.len()).filter(|&i| i <= k).map(|i| weights[i] * values[k - i]).sum()
                };
                predicted.push(back(&input, b) - back(&predicted, a));
            }
            // θ in units of the axis: the ratio is what the two differ by, the same at every instant.
            let largest = output.iter().fold(0.0f64, |m, v| m.max(v.abs()));
            let at = output.iter().position(|v| v.abs() == largest).expect("it moved");
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

/// Meters or radians of the axis per radian (or meter) of its motor, from the machine files' text.
fn transmission(machine: &str, axis: &str) -> f64 {
    match (machine, axis) {
        ("mikron_ucp710", "a") => 1.0 / 180.0,
        ("mikron_ucp710", "c") => 1.0 / 120.0,
        ("mikron_ucp710", _) => 0.020 / TAU,
        _ => 1.0,
    }
}

#[test]
fn the_prediction_model_leaves_out_no_state_that_counts() {
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

/// Radial deviation on the steady circle: mean, min, max, µm.
fn ballbar(machine: &MachineConfig) -> [f64; 3] {
    let figures = figures("ballbar", machine);
    let circle = figures.circles.first().expect("a circle");
    [circle.mean, circle.min, circle.max].map(|v| v / MICROMETER)
}

#[test]
fn the_ballbar_lands_on_the_model_pages_rows() {
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
fn the_preset_of_the_machine_file_is_that_of_the_model_page() {
    let preset = configured(DEFAULT, &[GPC]);
    assert_eq!(preset, tuned(1, 14, 12, 0.005));
}

#[test]
fn compensated_friction_leaves_no_spikes_on_the_circle() {
    let config = configured(DEFAULT, &[GPC, "feedforward.friction=1", "delays.friction_ms=11.75"]);
    let [_, min, max] = ballbar(&config);
    assert_near("min, µm", min, -1.4, 0.2);
    assert_near("max, µm", max, 0.4, 0.2);
    assert!(min >= -2.0 && max <= 2.0);
    // The cascade's spikes, 21 µm from its mean without it, are gone as well.
    let cascade = configured(DEFAULT, &["feedforward.friction=1", "delays.friction_ms=11.75"]);
    let [mean, min, max] = ballbar(&cascade);
    assert!(max - mean < 2.0 && mean - min < 2.0, "{mean} {min} {max}");
}

#[test]
fn corners_land_on_the_model_pages_numbers() {
    // Against the cascade's 146.6 and 103.7 µm.
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
fn a_proportional_controller_by_its_polynomials_is_the_cascade_without_feedforward() {
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
    assert!(cascade.iter().any(|s| s.velocity.abs() > 0.1), "nothing moves");
    for (r, c) in rst.iter().zip(&cascade) {
        assert!((r.position - c.position).abs() < 1e-12, "{r:?} {c:?}");
        assert!((r.current - c.current).abs() < 1e-7, "{r:?} {c:?}");
    }
    assert_eq!((rst[0].controller, cascade[0].controller), ("rst", "cascade"));
}

#[test]
fn the_axis_does_not_know_whether_a_controller_is_predictive() {
    use virtual_axes_core::design::{GpcTuning, ControlWeight, gpc};

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
fn a_controller_that_goes_elsewhere_or_has_no_gain_is_refused_by_axis_and_number() {
    use virtual_axes_core::machine::MachineParameters;

    let refusal = |texts: &[&str]| {
        let mut all = vec!["position_loop.controller=rst", "position_loop.rst.s=[1]"];
        all.extend(texts);
        MachineParameters::new(&configured(DEFAULT, &all)).expect_err("refused").to_string()
    };
    let text = refusal(&["position_loop.rst.r=[25]", "position_loop.rst.t=[24]"]);
    assert!(text.starts_with("axis x: position_loop") && text.contains("T(1) = 24 and R(1) = 25"), "{text}");
    let text = refusal(&["position_loop.rst.r=[25, -25]", "position_loop.rst.t=[0]"]);
    assert!(text.contains("R(1) = 0"), "{text}");
    let text =
        refusal(&["position_loop.rst.s=[0, 1]", "position_loop.rst.r=[25]", "position_loop.rst.t=[25]"]);
    assert!(text.contains("s[0] = 0"), "{text}");
}

#[test]
fn an_unstable_loop_is_refused_with_its_pole_unless_it_is_forced() {
    use virtual_axes_core::machine::MachineParameters;

    // A gain that the lag of the velocity loop cannot bear.
    let unstable = [
        "position_loop.controller=rst",
        "position_loop.rst.r=[250]",
        "position_loop.rst.s=[1]",
        "position_loop.rst.t=[250]",
    ];
    let text = MachineParameters::new(&configured(DEFAULT, &unstable)).expect_err("refused").to_string();
    assert!(
        text.starts_with("axis x: position_loop") && text.contains("unstable") && text.contains("pole"),
        "{text}"
    );
    let mut forced = unstable.to_vec();
    forced.push("position_loop.allow_unstable=true");
    let config = configured(DEFAULT, &forced);
    // It is told the truth: without a limit the oscillation would grow for ever.
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
    assert!(saturated, "the loop is stable after all");
}

#[test]
fn inner_loops_that_diverge_are_refused_where_a_model_of_them_is_needed_only() {
    use virtual_axes_core::machine::MachineParameters;

    for gain in
        ["current_loop.gain=500", "current_loop.gain=1e9", "velocity_loop.gain=1e5", "velocity_loop.gain=0"]
    {
        let cascade = MachineParameters::new(&configured(DEFAULT, &[gain]));
        assert!(cascade.is_ok(), "{gain}: the cascade is simulated as it is");
        let text = MachineParameters::new(&configured(DEFAULT, &[GPC, gain])).expect_err(gain).to_string();
        assert!(text.starts_with("axis x: position_loop"), "{gain}: {text}");
    }
}

#[test]
fn coefficients_that_overflow_are_refused_and_an_overflow_that_is_left_stops_the_axis() {
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
fn a_shift_of_a_compensation_that_is_off_delays_nothing() {
    let delay = |changes: &[&str]| at_rest(&configured(DEFAULT, changes)).longest_delay();
    let long = "delays.friction_ms=100";
    assert_eq!(delay(&[long]), delay(&[]));
    assert!(delay(&[long, "feedforward.friction=1"]) > delay(&[]));
}
