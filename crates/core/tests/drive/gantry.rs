//! Gantry: two linear axes coupled by a beam, against closed forms.

use virtual_axes_core::config::{MachineConfig, Parameters, ValueSource, parse_assignment};
use virtual_axes_core::machine::Machine;
use virtual_axes_verification::fixtures::machines::AXES;

use crate::unpowered::{machine, unpowered};

const X: usize = 0;
const Y: usize = 1;
const BEAM: [&str; 3] = ["gantry.axes=[x, y]", "gantry.stiffness_n_um=200", "gantry.damping_n_s_m=60000"];

/// Returns the machine with X and Y without friction and current.
fn free_axes(tick_us: f64, beam: &[&str]) -> MachineConfig {
    let own = ["y.motor.inertia_kg_m2=0.011".to_owned(), format!("periods.current_us={tick_us}")];
    let own = own.iter().map(String::as_str).chain(beam.iter().copied());
    unpowered(["x", "y"], &Vec::from_iter(own))
}

/// Returns the mass of an axis, kg.
fn mass(config: &MachineConfig, axis: usize) -> f64 {
    let axis = &config.axes()[axis];
    axis.motor.inertia / axis.transmission_ratio.powi(2)
}

/// Returns the force of the beam on an axis over the last tick, N.
fn beam_force(machine: &Machine, config: &MachineConfig, axis: usize) -> f64 {
    let load_current = machine.sample_at_end(axis).load_current;
    let axis = &config.axes()[axis];
    -load_current * axis.motor.torque_constant / axis.transmission_ratio
}

/// Returns the largest difference from the closed form in a position cycle, relative to the largest stretch of the beam,
/// after a constant force on X; and the share of the force that Y gets through the beam at the end.
fn step_response(tick_us: f64) -> (f64, f64) {
    const FORCE: f64 = 1000.0;
    let config = free_axes(tick_us, &BEAM);
    let (stiffness, damping) = (200e6, 60e3);
    let (one, other) = (mass(&config, X), mass(&config, Y));
    let (total, reduced) = (one + other, one * other / (one + other));
    let rest = FORCE * other / total / stiffness;
    let (decay, frequency) = (damping / (2.0 * reduced), (stiffness / reduced).sqrt());
    assert!(decay < frequency, "the beam oscillates");
    let damped = (frequency * frequency - decay * decay).sqrt();
    let mut machine = machine(&config);
    machine.set_load(X, FORCE);
    let mut error = 0.0_f64;
    for k in 1..=60 {
        machine.advance(&[0.0; AXES], &[]);
        let time = 6e-3 * f64::from(k);
        let (sin, cos) = (damped * time).sin_cos();
        let stretch = rest * (1.0 - (-decay * time).exp() * (cos + decay / damped * sin));
        let center = FORCE * time * time / (2.0 * total);
        let [x, y] = [X, Y].map(|axis| machine.motion_at_end(axis)[0]);
        error = error.max((x - y - stretch).abs()).max(((one * x + other * y) / total - center).abs());
    }
    (error / rest, beam_force(&machine, &config, Y) / FORCE)
}

#[test]
fn a_force_on_one_axis_is_shared_as_the_closed_form_says() {
    let runs = [250.0, 125.0, 62.5].map(step_response);
    println!("ticks of 250, 125 and 62.5 µs: errors and share {runs:?}");
    for pair in runs.windows(2) {
        let order = (pair[0].0 / pair[1].0).log2();
        assert!((order - 2.0).abs() < 0.1, "order {order} of {runs:?}");
    }
    assert!(runs[1].0 < 1e-3, "{runs:?}");
    let config = free_axes(125.0, &BEAM);
    let share = mass(&config, Y) / (mass(&config, X) + mass(&config, Y));
    for (_, found) in runs {
        assert!((found - share).abs() < 1e-4, "share {found}, not {share}");
    }
}

#[test]
fn without_a_beam_the_other_axis_gets_nothing() {
    let config = free_axes(125.0, &[]);
    let mut machine = machine(&config);
    machine.set_load(X, 1000.0);
    (0..60).for_each(|_| machine.advance(&[0.0; AXES], &[]));
    assert_eq!(machine.motion_at_end(Y)[0], 0.0);
    assert!(machine.motion_at_end(X)[0] > 0.0);
}

/// Returns the default machine whose Y is like X, with changes.
fn equal_axes(changes: &[&str]) -> MachineConfig {
    let mut parameters = Parameters::load("mikron_ucp710", virtual_axes_builtin::MACHINES).expect("shipped");
    let source = ValueSource::named("test");
    let of_y = Vec::from_iter(parameters.definitions().filter_map(|(key, _)| {
        let suffix = key.strip_prefix("x.")?;
        Some(format!("y.{suffix}={}", parameters.get(&key)?))
    }));
    let texts = of_y.iter().map(String::as_str).chain(changes.iter().copied());
    let assignments = texts.map(|text| parse_assignment(text, &source).expect("an assignment")).collect();
    parameters.set_all(assignments).expect("valid");
    parameters.machine_config().expect("valid")
}

#[test]
fn equal_axes_follow_one_setpoint_without_a_force_between_them() {
    let configs = [equal_axes(&BEAM), equal_axes(&[])];
    let [mut coupled, mut free] = configs.each_ref().map(machine);
    let mut farthest = 0.0_f64;
    for k in 0..300 {
        let setpoint = 0.05 * (1.0 - (0.03 * f64::from(k)).cos());
        let psec = [setpoint, setpoint, 0.0, 0.0, 0.0];
        coupled.advance(&psec, &[]);
        free.advance(&psec, &[]);
        let [x, y] = [X, Y].map(|axis| coupled.motion_at_end(axis));
        assert_eq!(x, y, "cycle {k}");
        assert_eq!(x, free.motion_at_end(X), "cycle {k}");
        assert_eq!(beam_force(&coupled, &configs[0], X), 0.0, "cycle {k}");
        farthest = farthest.max(x[0]);
    }
    assert!(farthest > 0.09, "{farthest}");
}

/// With integrating velocity controllers both axes are at their setpoints at rest, so that the motors hold the beam.
#[test]
fn a_difference_of_the_setpoints_stretches_the_beam() {
    let config = equal_axes(&[&BEAM[..], &["x.friction.a=0", "x.friction.c=0", "x.friction.i0=0"]].concat());
    let mut machine = machine(&config);
    for _ in 0..400 {
        machine.advance(&[20e-6, 0.0, 0.0, 0.0, 0.0], &[]);
    }
    let [x, y] = [X, Y].map(|axis| machine.motion_at_end(axis)[0]);
    let force = 200e6 * (x - y);
    assert!((x - 20e-6).abs() < 1e-9 && force > 3900.0, "{x}, {force} N");
    assert!((machine.sample_at_end(X).effort - force).abs() < 1e-4 * force);
    assert!((beam_force(&machine, &config, X) + force).abs() < 1e-6 * force);
    assert!((beam_force(&machine, &config, Y) - force).abs() < 1e-6 * force);
}
