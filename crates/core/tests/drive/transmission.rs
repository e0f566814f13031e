//! Elastic transmission: steps against matrix exponentials with 120 digits, resonances against closed forms, energy,
//! and machines with rigid and elastic axes.

use std::sync::Arc;

use nalgebra::SMatrix;
use proptest::prelude::*;
use virtual_axes_core::config::{
    MachineConfig, MotorConfig, Parameters, TransmissionConfig, ValueSource, parse_assignment,
};
use virtual_axes_core::drive::{LoadState, Motor, MotorState, Plant, Transmission};
use virtual_axes_core::machine::{Machine, MachineParameters, SimdWidth, prediction_model};
use virtual_axes_verification::fixtures::machines::{AXES, configured_with};

use crate::bits::{assert_bits_of_every_width_and_part, bits, psec};
use crate::parameter_ranges::{golden, run_demanding_setpoints};

pub const X: usize = 0;
/// X with a table of 1200 kg behind 200 N/µm: antiresonance 65 Hz, resonance 86 Hz.
pub const ELASTIC_X: [&str; 3] = [
    "x.transmission.stiffness_n_um=200",
    "x.transmission.damping_n_s_m=15000",
    "x.transmission.load_mass_kg=1200",
];
/// A with a table behind a worm gear.
const ELASTIC_A: [&str; 2] = ["a.transmission.stiffness_nm_rad=2e6", "a.transmission.load_inertia_kg_m2=12"];
/// Without friction and gravity on X.
pub const FRICTIONLESS: [&str; 3] = ["x.friction.a=0", "x.friction.c=0", "x.friction.i0=0"];

pub fn machine(changes: &[&str]) -> MachineConfig {
    configured_with("mikron_ucp710", &[], changes)
}

fn motor_config([inertia, torque_constant, emf_constant, resistance, inductance]: [f64; 5]) -> MotorConfig {
    MotorConfig {
        inertia,
        torque_constant,
        emf_constant,
        resistance,
        inductance,
        max_current: 1.0,
        max_voltage: 1.0,
        max_speed: 1.0,
    }
}

/// States i, ω, δ, ω_load and θ after a step from a state under a voltage and a torque at the load.
fn after(
    (motor, transmission): &(Motor, Transmission),
    state: [f64; 4],
    voltage: f64,
    torque: f64,
) -> [f64; 5] {
    let [current, speed, wind_up, load_speed] = state;
    let (s, load) = transmission.step(
        motor,
        &MotorState { current, speed, angle: 0.0 },
        &LoadState { wind_up, speed: load_speed },
        voltage,
        torque,
    );
    [s.current, s.speed, load.wind_up, load.speed, s.angle]
}

/// Returns the columns by i, ω, δ, ω_load, u and the torque at the load.
fn columns(drive: &(Motor, Transmission)) -> [[f64; 5]; 6] {
    let unit = |k: usize| std::array::from_fn(|row| if row == k { 1.0 } else { 0.0 });
    std::array::from_fn(|k| match k {
        4 => after(drive, [0.0; 4], 1.0, 0.0),
        5 => after(drive, [0.0; 4], 0.0, 1.0),
        _ => after(drive, unit(k), 0.0, 0.0),
    })
}

#[test]
fn a_step_is_the_matrix_exponential() {
    // Index of a column of the table for each column of the step; its column 5 is the torque at the motor.
    const OF: [usize; 6] = [0, 1, 2, 3, 4, 6];
    let (mut worst, mut count) = (0.0_f64, 0);
    for row in golden("transmissions.csv") {
        let motor = motor_config(std::array::from_fn(|k| row[k]));
        let elastic = TransmissionConfig {
            stiffness: row[6],
            damping: row[7],
            load_inertia: row[8],
            ..TransmissionConfig::default()
        };
        let drive = Transmission::new(&motor, &elastic, row[5]).expect("can be discretized");
        for (column, found) in columns(&drive).into_iter().enumerate() {
            for (state, found) in found.into_iter().enumerate() {
                let exact = row[9 + 7 * state + OF[column]];
                let error = ((found - exact) / exact).abs();
                worst = worst.max(error);
                assert!(error <= 1e-9, "{elastic:?}, state {state}, column {column}: {found}, not {exact}");
            }
        }
        count += 1;
    }
    println!("{count} drives, largest relative error of an entry {worst:.1e}");
    assert_eq!(count, 60);
}

/// Returns the transition matrix of i, ω, δ and ω_load over a tick.
fn transition(drive: &(Motor, Transmission)) -> SMatrix<f64, 4, 4> {
    let columns = columns(drive);
    SMatrix::from_fn(|row, column| columns[column][row])
}

/// Returns the angles of the complex eigenvalues over the tick, rad/s, in the upper half plane.
fn frequencies(matrix: &nalgebra::DMatrix<f64>, tick: f64) -> Vec<f64> {
    let angles =
        matrix.complex_eigenvalues().iter().map(|value| value.im.atan2(value.re)).collect::<Vec<_>>();
    angles.into_iter().filter(|angle| *angle > 0.0).map(|angle| angle / tick).collect()
}

#[test]
fn resonance_and_antiresonance_are_those_of_two_masses() {
    // Without winding and back-EMF.
    let motor = motor_config([0.028, 1e-12, 0.0, 0.5, 8e-3]);
    let (tick, load) = (125e-6, 0.012);
    for stiffness in [20.0, 2000.0, 2e5] {
        let elastic = TransmissionConfig { stiffness, load_inertia: load, ..TransmissionConfig::default() };
        let free = transition(&Transmission::new(&motor, &elastic, tick).expect("can be discretized"));
        let resonance = (stiffness / load + stiffness / (0.028 - load)).sqrt();
        let found = frequencies(&nalgebra::DMatrix::from_iterator(4, 4, free.iter().copied()), tick);
        assert!((found[0] / resonance - 1.0).abs() < 1e-6, "{found:?}, wanted {resonance}");
        // The antiresonance is the resonance of the load with the motor held: with an infinite inertia of the motor.
        let held = motor_config([1e12, 1e-12, 0.0, 0.5, 8e-3]);
        let held = transition(&Transmission::new(&held, &elastic, tick).expect("can be discretized"));
        let found = frequencies(&nalgebra::DMatrix::from_iterator(4, 4, held.iter().copied()), tick);
        let antiresonance = (stiffness / load).sqrt();
        assert!((found[0] / antiresonance - 1.0).abs() < 1e-6, "{found:?}, wanted {antiresonance}");
    }
}

/// Solves the equations of two masses with constant friction by the classical Runge–Kutta method with 1000 steps a tick.
fn runge_kutta(
    m: &MotorConfig,
    t: &TransmissionConfig,
    start: [f64; 5],
    [voltage, friction, torque]: [f64; 3],
    tick: f64,
) -> [f64; 5] {
    let own = m.inertia - t.load_inertia;
    let slope = |s: [f64; 5]| {
        let spring = t.stiffness * s[2] + t.damping * (s[1] - s[3]);
        [
            (voltage - m.resistance * s[0] - m.emf_constant * s[1]) / m.inductance,
            (m.torque_constant * s[0] - spring - friction) / own,
            s[1] - s[3],
            (spring + torque) / t.load_inertia,
            s[1],
        ]
    };
    let plus = |s: [f64; 5], d: [f64; 5], h: f64| std::array::from_fn(|k| s[k] + h * d[k]);
    let (mut s, h) = (start, tick / 1000.0);
    for _ in 0..1000 {
        let first = slope(s);
        let second = slope(plus(s, first, h / 2.0));
        let third = slope(plus(s, second, h / 2.0));
        let fourth = slope(plus(s, third, h));
        s = std::array::from_fn(|k| s[k] + h / 6.0 * (first[k] + 2.0 * (second[k] + third[k]) + fourth[k]));
    }
    s
}

#[test]
fn friction_and_load_are_those_of_a_small_step_integration() {
    const FRICTION: f64 = 3.0;
    let tick = 125e-6;
    let changes = ["x.friction.a=3", "x.friction.b=0", "x.friction.c=0", "x.friction.i0=3"];
    let config = machine(&[&ELASTIC_X[..], &changes].concat());
    let axis = &config.axes()[X];
    let elastic = axis.transmission.expect("elastic");
    let plant = Plant::new(axis, tick).expect("can be discretized");
    let (mut motor, mut load) = (MotorState { current: 4.0, speed: 20.0, angle: 0.1 }, LoadState::default());
    load.speed = 19.0;
    let mut exact = [4.0, 20.0, 0.0, 19.0, 0.1];
    let torque = axis.motor.torque_constant * FRICTION;
    let force = 5000.0;
    for n in 0..400 {
        let voltage = 30.0 + 40.0 * (0.03 * f64::from(n)).sin();
        plant.step_with_load(&mut motor, &mut load, &mut 0.0, voltage, force);
        let outer = force * axis.transmission_ratio;
        exact = runge_kutta(&axis.motor, &elastic, exact, [voltage, torque, outer], tick);
        assert!(exact[1] > 1.0, "the motor does not reverse");
        let found = [motor.current, motor.speed, load.wind_up, load.speed, motor.angle];
        for (k, scale) in [10.0, 20.0, 1e-2, 20.0, 1.0].into_iter().enumerate() {
            assert!((found[k] - exact[k]).abs() < 1e-9 * scale, "tick {n}, state {k}: {found:?}, {exact:?}");
        }
    }
}

/// Trajectories of a plant in the energy test: 200 000 in all.
const TRAJECTORIES: usize = 100;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn friction_and_damping_do_not_create_energy(
        stiffness in -1.0..6.5_f64,
        ratio in 0.0..0.3_f64,
        share in 0.02..0.98_f64,
        friction in 0.0..20.0_f64,
        amplitude in -4.0..0.0_f64,
        starts in prop::collection::vec(prop::array::uniform4(-1.0..1.0_f64), TRAJECTORIES),
    ) {
        let inertia = 0.028;
        let load_inertia = share * inertia;
        let stiffness = 10_f64.powf(stiffness);
        let damping = 2.0 * ratio * (stiffness * load_inertia * (1.0 - share)).sqrt();
        let text = |key: &str, value: f64| format!("x.{key}={value}");
        let per_axis = 1.0 / (0.02 / std::f64::consts::TAU).powi(2);
        let changes = [
            text("transmission.stiffness_n_um", stiffness * per_axis * 1e-6),
            text("transmission.damping_n_s_m", damping * per_axis),
            text("transmission.load_mass_kg", load_inertia * per_axis),
            text("motor.emf_constant_v_s_rad", 2.64),
            text("friction.a", friction),
            text("friction.b", 0.0),
            text("friction.c", 0.0),
            text("friction.i0", friction),
        ];
        let config = machine(&changes.each_ref().map(String::as_str));
        let axis = &config.axes()[X];
        let elastic = axis.transmission.expect("elastic");
        // A resonance that a tick does not resolve is rejected.
        let plant = Plant::new(axis, 125e-6);
        prop_assume!(plant.is_ok());
        let plant = plant.expect("can be discretized");
        let energy = |motor: &MotorState, load: &LoadState| {
            let own = inertia - elastic.load_inertia;
            axis.motor.inductance * motor.current.powi(2) / 2.0
                + own * motor.speed.powi(2) / 2.0
                + elastic.load_inertia * load.speed.powi(2) / 2.0
                + elastic.stiffness * load.wind_up.powi(2) / 2.0
        };
        let amplitude = 10_f64.powf(amplitude);
        for start in starts {
            let [current, speed, wind_up, load_speed] = start.map(|x| amplitude * x);
            let mut motor = MotorState { current: 30.0 * current, speed: 100.0 * speed, angle: 0.0 };
            let mut load = LoadState { wind_up: wind_up / stiffness.sqrt(), speed: 100.0 * load_speed };
            let first = energy(&motor, &load);
            let mut before = first;
            for tick in 0..100 {
                plant.step_with_load(&mut motor, &mut load, &mut 0.0, 0.0, 0.0);
                let now = energy(&motor, &load);
                prop_assert!(now <= before + 1e-13 * first, "{now} after {before}, tick {tick}, {start:?}");
                before = now;
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn random_transmissions_run_or_are_rejected_with_a_reason(
        stiffness in -3.0..6.0_f64,
        damping in 0.0..9.0_f64,
        mass in -6.0..6.0_f64,
        gain in -2.0..1.0_f64,
        feedback in prop::bool::ANY,
        backlash in prop_oneof![Just(0.0), 0.0..1e4_f64],
        load_friction in prop_oneof![Just(0.0), 0.0..1.0_f64],
        structure in prop::option::of((-3.0..9.0_f64, -1.0..4.0_f64)),
    ) {
        let mut changes = vec![
            format!("x.transmission.backlash_um={backlash}"),
            format!("x.transmission.load_friction={load_friction}"),
            format!("x.transmission.stiffness_n_um={}", 10_f64.powf(stiffness)),
            format!("x.transmission.damping_n_s_m={}", 10_f64.powf(damping)),
            format!("x.transmission.load_mass_kg={}", 10_f64.powf(mass)),
            format!("x.position_loop.gain={}", 10_f64.powf(gain)),
            format!("x.position_loop.feedback={}", if feedback { "load" } else { "motor" }),
        ];
        if let Some((mass, frequency)) = structure {
            changes.push(format!("x.structure.mass_kg={}", 10_f64.powf(mass)));
            changes.push(format!("x.structure.frequency_hz={}", 10_f64.powf(frequency)));
        }
        let mut parameters = Parameters::embedded_default().expect("shipped");
        let source = ValueSource::named("test");
        let assignments = changes
            .iter()
            .map(|change| parse_assignment(change, &source).expect("an assignment"))
            .collect();
        match parameters.set_all(assignments) {
            Ok(_) => {
                let config = parameters.machine_config().expect("valid");
                match MachineParameters::new(&config) {
                    Ok(parameters) => run_demanding_setpoints(&mut Machine::new(parameters.into()), &|| {
                        format!("{changes:?}")
                    }),
                    Err(rejection) => {
                        prop_assert!(rejection.to_string().starts_with("axis x: "), "{rejection}");
                    }
                }
            }
            Err(rejection) => prop_assert!(
                rejection.to_string().contains("load_mass_kg") && rejection.to_string().contains("must be below"),
                "{rejection}"
            ),
        }
    }
}

#[test]
fn bits_are_those_of_every_width_and_of_every_part_of_a_cycle() {
    let config = machine(&[&ELASTIC_X[..], &ELASTIC_A].concat());
    assert_bits_of_every_width_and_part(&config);
}

#[test]
fn rigid_axes_beside_elastic_ones_keep_their_bits() {
    let (rigid, mixed) = (machine(&[]), machine(&[&ELASTIC_X[..], &ELASTIC_A].concat()));
    for axis in [1, 2, 4] {
        let wanted = bits(&rigid, axis, SimdWidth::Widest, &[48]);
        assert!(bits(&mixed, axis, SimdWidth::Widest, &[48]) == wanted, "axis {axis}");
    }
    assert!(bits(&mixed, X, SimdWidth::Widest, &[48]) != bits(&rigid, X, SimdWidth::Widest, &[48]));
}

#[test]
fn a_stiff_transmission_is_a_rigid_axis() {
    let stiff = machine(&["x.transmission.stiffness_n_um=1e6", "x.transmission.load_mass_kg=1200"]);
    let [mut one, mut other] = [&machine(&[]), &stiff]
        .map(|config| Machine::new(Arc::new(MachineParameters::new(config).expect("can be discretized"))));
    let mut largest = 0.0_f64;
    for k in 0..200 {
        one.advance(&psec(k), &[]);
        other.advance(&psec(k), &[]);
        largest = largest.max((one.axis(X).sample().position - other.axis(X).sample().position).abs());
    }
    // Compliance 1 nm/kN: wind-up and its effect on the loops are far below a micrometer.
    assert!(largest < 1e-7 && largest > 0.0, "{largest}");
}

#[test]
fn gravity_displaces_the_load_unless_its_scale_is_controlled() {
    let z =
        ["z.transmission.stiffness_n_um=50", "z.transmission.load_mass_kg=300", "z.gravity.weight_n=2000"];
    for (feedback, wanted) in [("motor", -2000.0 / 50e6), ("load", 0.0)] {
        let feedback = format!("z.position_loop.feedback={feedback}");
        let config = machine(&[&z[..], &[&feedback]].concat());
        let mut machine =
            Machine::new(Arc::new(MachineParameters::new(&config).expect("can be discretized")));
        let at_start = *machine.axis(2).sample();
        for _ in 0..300 {
            machine.advance(&[0.0; AXES], &[]);
        }
        let s = machine.axis(2).sample();
        assert!((s.position - wanted).abs() < 1e-10, "{feedback}: {}", s.position);
        assert!((at_start.position - wanted).abs() < 1e-15, "{feedback}: {}", at_start.position);
        assert!((s.wind_up - 2000.0 / 50e6).abs() < 1e-10, "{feedback}: {}", s.wind_up);
    }
}

/// The prediction model, iterated in the position loop of a proportional controller, against the machine.
#[test]
fn the_prediction_model_is_the_elastic_axis_without_friction() {
    for feedback in ["motor", "load"] {
        let feedback = format!("x.position_loop.feedback={feedback}");
        let none = ["x.feedforward.velocity=0", "x.feedforward.torque_kg_m2=0", "x.delays.alpha_ms=0"];
        let config = machine(&[&ELASTIC_X[..], &FRICTIONLESS, &none, &[&feedback]].concat());
        let axis = &config.axes()[X];
        let model = prediction_model(axis, &config.periods()).expect("a model");
        let mut machine =
            Machine::new(Arc::new(MachineParameters::new(&config).expect("can be discretized")));
        let (step, ratio) = (1e-4, axis.transmission_ratio);
        let (mut angles, mut outputs) = (Vec::new(), Vec::<f64>::new());
        for k in 0..150 {
            let past = |values: &[f64], weights: &[f64]| -> f64 {
                (1..weights.len().min(k + 1)).map(|j| weights[j] * values[k - j]).sum()
            };
            let angle = past(&outputs, model.b()) - past(&angles, model.a());
            angles.push(angle);
            outputs.push(axis.position_loop.gain * (step / ratio - angle));
            machine.advance(&[step, 0.0, 0.0, 0.0, 0.0], &[]);
            let s = machine.axis(X).sample();
            let controlled = if feedback.ends_with("motor") { s.position + s.wind_up } else { s.position };
            let error = (controlled - ratio * angle).abs();
            assert!(error < 1e-9 * step, "{feedback}, cycle {k}: {controlled}, model {}", ratio * angle);
        }
    }
}
