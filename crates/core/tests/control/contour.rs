//! Cross-coupled control: estimate of the contour error against closed forms, stability, and machines.

use std::f64::consts::TAU;
use std::sync::Arc;

use virtual_axes_core::config::MachineConfig;
use virtual_axes_core::control::{CONTOUR_LOOKBACK, ContourVector, contour_error};
use virtual_axes_core::machine::{Machine, MachineError, MachineParameters};
use virtual_axes_verification::fixtures::machines::*;

const DEFAULT: &str = "mikron_ucp710";
const LOOKBACK: i64 = CONTOUR_LOOKBACK as i64;

fn with_gain(gain: f64, changes: &[&str]) -> MachineConfig {
    configured_with(DEFAULT, &[], &[changes, &[&format!("contour_control.gain={gain}")]].concat())
}

fn machine(config: &MachineConfig) -> Machine {
    Machine::new(Arc::new(MachineParameters::new(config).expect("stable")))
}

fn size(vector: ContourVector) -> f64 {
    vector.iter().map(|value| value * value).sum::<f64>().sqrt()
}

#[test]
fn on_a_line_the_estimate_is_the_distance() {
    let direction = [2.0 / 3.0, -1.0 / 3.0, 2.0 / 3.0];
    // Perpendicular to the line.
    let normal = [1.0 / 5.0_f64.sqrt(), 2.0 / 5.0_f64.sqrt(), 0.0];
    let setpoint = |j: i64| direction.map(|share| share * 1e-3 * j as f64);
    for along in [-20.3, -2.5, -0.4, 0.0, 0.7, -60.0] {
        for across in [-4e-5, 0.0, 3e-3] {
            let position = std::array::from_fn(|k| 1e-3 * along * direction[k] + across * normal[k]);
            let error = contour_error(setpoint, position);
            for k in 0..3 {
                assert!((error[k] + across * normal[k]).abs() < 1e-16, "{error:?} at {along}, {across}");
            }
        }
    }
}

/// Returns the largest difference of the estimate to the radial deviation on a circle of 150 mm with `step` m between two
/// setpoints.
fn circle_difference(step: f64) -> f64 {
    const RADIUS: f64 = 0.15;
    let on_circle = |radius: f64, angle: f64| [radius * angle.cos(), radius * angle.sin(), 0.0];
    let mut worst = 0.0_f64;
    for k in 0..200 {
        let at = |j: f64| (f64::from(k) * 0.1 + j) * step / RADIUS;
        let setpoint = |j: i64| on_circle(RADIUS, at(j as f64));
        for lag in [0.0, 0.3, 2.4, 7.9] {
            for deviation in [-2e-5, 0.0, 5e-5] {
                let error = contour_error(setpoint, on_circle(RADIUS + deviation, at(-lag)));
                worst = worst.max((size(error) - f64::abs(deviation)).abs());
            }
        }
    }
    worst
}

#[test]
fn on_a_circle_the_estimate_is_the_radial_deviation() {
    let errors = [1.5e-3, 0.75e-3, 0.375e-3].map(circle_difference);
    println!("largest difference to the radial deviation with steps of 1.5, 0.75 and 0.375 mm: {errors:?} m");
    // The third difference of the setpoints, h³/R², over 9√3: the error of a parabola through three points.
    assert!(errors[0] < 1.5e-3_f64.powi(3) / 0.15_f64.powi(2) / 15.0, "{errors:?}");
    // Third order at least.
    assert!(errors.windows(2).all(|pair| pair[0] / pair[1] > 7.0), "{errors:?}");
}

#[test]
fn beside_a_corner_the_estimate_is_the_distance_to_the_nearer_line() {
    // Along x to the origin, then along y, 1 mm per cycle; the delayed setpoint is 5 mm behind the corner.
    let setpoint = |j: i64| {
        let travelled = 1e-3 * (j + 5) as f64;
        if travelled < 0.0 { [travelled, 0.0, 0.0] } else { [0.0, travelled, 0.0] }
    };
    for (position, wanted) in [
        ([-3.5e-3, 1e-4, 0.0], [0.0, -1e-4, 0.0]),
        ([-5e-5, 2.5e-3, 0.0], [5e-5, 0.0, 0.0]),
        ([-2e-5, 0.5e-3, 0.0], [2e-5, 0.0, 0.0]),
    ] {
        let error = contour_error(setpoint, position);
        assert!((0..3).all(|k| (error[k] - wanted[k]).abs() < 1e-15), "{error:?} at {position:?}");
    }
}

#[test]
fn standing_setpoints_have_no_contour_error() {
    assert_eq!(contour_error(|_| [0.1, 0.2, 0.3], [0.0; 3]), [0.0; 3]);
    // At rest after a motion within the last cycles, the path is still known.
    let stopped = |j: i64| [1e-3 * j.min(-LOOKBACK / 2) as f64, 0.0, 0.0];
    let error = contour_error(stopped, [-0.02, 1e-5, 0.0]);
    assert_eq!(error, [0.0, -1e-5, 0.0]);
}

/// Returns the largest contour error of a scenario, m.
fn contour(scenario: &str, config: &MachineConfig) -> f64 {
    trace_scenario(scenario, config, |_| ()).contour.expect("a contour").max
}

#[test]
fn the_contour_error_of_circles_and_corners_is_smaller() {
    for (scenario, factor) in [("ballbar", 0.5), ("corner-90", 0.95), ("bspline-3d", 0.8)] {
        let [without, with] = [0.0, 4.0].map(|gain| contour(scenario, &with_gain(gain, &[])));
        println!("{scenario}: {without:e} m without, {with:e} m with cross-coupled control");
        assert!(with < factor * without, "{scenario}: {with} with, {without} without");
    }
}

/// Returns the largest contour error within the given cycles of a line under 45° at 6 m/min after a disturbance of 2000 N.
fn disturbed(config: &MachineConfig, cycles: std::ops::Range<usize>) -> f64 {
    let mut machine = machine(config);
    let mut worst = 0.0_f64;
    for k in 0..cycles.end {
        machine.set_load(0, if (100..105).contains(&k) { 2000.0 } else { 0.0 });
        let along = 0.6e-3 * k as f64 * 0.5_f64.sqrt();
        machine.advance(&[along, along, 0.0, 0.0, 0.0], &[]);
        if cycles.contains(&k) {
            let [x, y] = [0, 1].map(|axis| machine.axis(axis).sample().position);
            worst = worst.max((x - y).abs() / 2.0_f64.sqrt());
        }
    }
    worst
}

#[test]
fn the_limit_of_the_gain_is_that_of_the_simulation() {
    // All axes alike: the loop across the path is that of one axis. Without friction, which damps.
    let alike = |gain: f64, changes: &[&str]| {
        let mut all: Vec<String> = vec![];
        for axis in ["x", "y", "z"] {
            all.extend(
                [
                    "friction.a=0",
                    "friction.c=0",
                    "friction.i0=0",
                    "position_loop.gain=1.5",
                    "motor.inertia_kg_m2=0.028",
                    "motor.max_current_a=500",
                    "motor.max_voltage_v=5000",
                    "velocity_loop.gain=10",
                    "velocity_loop.integral_time_ms=8",
                ]
                .map(|change| format!("{axis}.{change}")),
            );
        }
        all.extend(changes.iter().map(ToString::to_string));
        with_gain(gain, &all.iter().map(String::as_str).collect::<Vec<_>>())
    };
    let is_accepted = |gain: f64| MachineParameters::new(&alike(gain, &[])).is_ok();
    let (mut low, mut high) = (1.0, 100.0);
    assert!(is_accepted(low) && !is_accepted(high));
    while high - low > 1e-3 {
        let middle = (low + high) / 2.0;
        if is_accepted(middle) { low = middle } else { high = middle }
    }
    println!("largest stable gain {low:.3} (m/min)/mm");
    let error = MachineParameters::new(&alike(high, &[])).expect_err("unstable");
    assert!(matches!(error, MachineError::Axis { .. }), "{error}");
    assert!(error.to_string().starts_with("axis x: contour_control.gain = "), "{error}");
    let unstable = ["x", "y", "z"].map(|axis| format!("{axis}.position_loop.allow_unstable=true"));
    let unstable = unstable.each_ref().map(String::as_str);
    for (factor, grows) in [(0.95, false), (1.05, true)] {
        let config = alike(factor * low, &unstable);
        let [early, late] = [120..170, 400..450].map(|cycles| disturbed(&config, cycles));
        println!("{factor} of the limit: {early:e} m after the disturbance, {late:e} m later");
        assert_eq!(late > early, grows, "{factor}: {early} m, then {late} m");
    }
}

fn psec(k: usize) -> [f64; AXES] {
    let angle = TAU * k as f64 / 300.0;
    [0.05 * (1.0 - angle.cos()), 0.05 * angle.sin(), 0.01 * angle.sin(), 0.1 * angle.sin(), 0.0]
}

/// Returns the bits of the positions of all axes over a motion.
fn bits(machine: &mut Machine, from: usize, axes: std::ops::Range<usize>) -> Vec<u64> {
    let mut bits = Vec::new();
    for k in from..200 {
        let all: Vec<f64> =
            std::iter::repeat_n(psec(k), machine.axis_count().div_ceil(AXES)).flatten().collect();
        machine.advance(&all[..machine.axis_count()], &[]);
        bits.extend(axes.clone().map(|axis| machine.motion_at_end(axis)[0].to_bits()));
    }
    bits
}

#[test]
fn machines_side_by_side_and_stored_ones_have_the_same_bits() {
    let (with, without) = (with_gain(4.0, &[]), with_gain(0.0, &[]));
    let wanted = bits(&mut machine(&with), 0, 0..AXES);
    assert!(wanted != bits(&mut machine(&without), 0, 0..AXES));
    let parts = [&without, &with].map(|config| Arc::new(MachineParameters::new(config).expect("stable")));
    let both = Arc::new(MachineParameters::concatenate(&parts).expect("equal periods"));
    assert!(bits(&mut Machine::new(Arc::clone(&both)), 0, AXES..2 * AXES) == wanted);
    assert!(bits(&mut Machine::new(both), 0, 0..AXES) == bits(&mut machine(&without), 0, 0..AXES));
    // From a state in the middle.
    let mut first = machine(&with);
    for k in 0..77 {
        first.advance(&psec(k), &[]);
    }
    let stored = first.state_bytes();
    let mut second = Machine::from_state_bytes(Arc::clone(&parts[1]), &stored).expect("its own state");
    assert!(bits(&mut second, 77, 0..AXES) == wanted[77 * AXES..]);
    // The rotary axes are not changed.
    let rotary = bits(&mut machine(&without), 0, 3..AXES);
    assert!(bits(&mut machine(&with), 0, 3..AXES) == rotary);
}

#[test]
fn the_gain_can_change_during_a_motion() {
    let [off, on] =
        [0.0, 4.0].map(|gain| Arc::new(MachineParameters::new(&with_gain(gain, &[])).expect("stable")));
    let mut machine = Machine::new(Arc::clone(&off));
    let mut velocities = Vec::new();
    for k in 0..400 {
        let next = if (k / 100) % 2 == 0 { &off } else { &on };
        machine.update_parameters(Arc::clone(next)).expect("the same machine");
        machine.advance(&psec(k), &[]);
        velocities.push(machine.motion_at_end(0)[1]);
    }
    // 0.05 m/cycle² of the circle, and far below a jump of the velocity.
    let largest = velocities
        .windows(2)
        .map(|pair| (pair[1] - pair[0]).abs())
        .fold(0.0, |most: f64, step| most.max(step));
    assert!(largest < 0.02, "{largest} m/s between two position cycles");
}
