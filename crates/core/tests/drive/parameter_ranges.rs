//! Numerical robustness: drives at the limits of their parameter ranges are accurate, or rejected with a reason.
//!
//! `tools/golden_drives.py` computes the reference data: matrix exponentials with 120 digits, independent of the library.

use std::cell::Cell;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::sync::Arc;

use proptest::prelude::*;
use proptest::test_runner::{RngSeed, TestRunner};
use virtual_axes_core::config::{
    Assignment, MachineConfig, MotorConfig, ParameterDefinition, ParameterKind, Parameters, Scope, Value,
    ValueSource,
};
use virtual_axes_core::drive::{Motor, MotorState, Plant};
use virtual_axes_core::machine::{Machine, MachineParameters, prediction_model};
use virtual_axes_core::units::seconds;

/// Reads a table of `tests/golden`, one row per line.
pub fn golden(file: &str) -> Vec<Vec<f64>> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(file);
    let text = fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let number = |field: &str| field.parse().unwrap_or_else(|_| panic!("{file}: {field}"));
    text.lines().skip(1).map(|line| line.split(',').map(number).collect()).collect()
}

/// Row of `drives.csv`: motor, tick, true if it must be rejected, rows of i, ω and θ by i, ω, u and τ.
struct Drive {
    motor: MotorConfig,
    tick: f64,
    is_rejected: bool,
    step: [[f64; 4]; 3],
}

fn drives() -> Vec<Drive> {
    let drive = |row: Vec<f64>| Drive {
        motor: MotorConfig {
            inertia: row[0],
            torque_constant: row[1],
            emf_constant: row[2],
            resistance: row[3],
            inductance: row[4],
            max_current: 1.0,
            max_voltage: 1.0,
            max_speed: 1.0,
        },
        tick: row[5],
        is_rejected: row[6] == 1.0,
        step: [0, 1, 2].map(|k| [0, 1, 2, 3].map(|l| row[7 + 4 * k + l])),
    };
    golden("drives.csv").into_iter().map(drive).collect()
}

/// Returns the matrix of one motor step, from its responses to unit inputs.
fn matrix(motor: &Motor) -> [[f64; 4]; 3] {
    let nothing = MotorState::default();
    let columns = [
        motor.step(&MotorState { current: 1.0, ..nothing }, 0.0, 0.0),
        motor.step(&MotorState { speed: 1.0, ..nothing }, 0.0, 0.0),
        motor.step(&nothing, 1.0, 0.0),
        motor.step(&nothing, 0.0, 1.0),
    ];
    [columns.map(|s| s.current), columns.map(|s| s.speed), columns.map(|s| s.angle)]
}

/// Largest relative error of an entry of the step matrix.
const ENTRY_TOLERANCE: f64 = 3e-12;
/// Growth of the response of a prediction model within 12 position cycles from which on the inner loops count as unstable.
const UNSTABLE_GROWTH: f64 = 1e6;
/// Largest error of the response of unstable inner loops, relative to its maximum.
const UNSTABLE_MODEL_TOLERANCE: f64 = 1e-4;
/// Largest error per tick, in roundings of the largest value.
const ROUNDINGS: f64 = 8.0;
/// Entry of a step matrix below which it counts as 0; significant entries are at least of the order of (1 µs)³.
const NEGLIGIBLE_ENTRY: f64 = 1e-60;
/// Largest error of the response of a prediction model, relative to its maximum.
const MODEL_TOLERANCE: f64 = 1e-7;

#[test]
fn motor_step_equals_the_matrix_exponential() {
    let (mut ran, mut rejected, mut worst) = (0, 0, (0.0, String::new()));
    for drive in drives() {
        let context = format!("{:?} over {} s", drive.motor, drive.tick);
        let motor = match Motor::new(&drive.motor, drive.tick) {
            Err(error) => {
                assert!(drive.is_rejected, "{context}: {error}");
                rejected += 1;
                continue;
            }
            Ok(motor) => motor,
        };
        assert!(!drive.is_rejected, "{context}: the speed response changes its sign within the tick");
        ran += 1;
        let found = matrix(&motor);
        for (k, l) in (0..3).flat_map(|k| (0..4).map(move |l| (k, l))) {
            let (found, exact) = (found[k][l], drive.step[k][l]);
            // Entries that have decayed to 0 are not compared digit by digit.
            let off = if exact.abs() < NEGLIGIBLE_ENTRY {
                f64::from(u8::from(found.abs() > NEGLIGIBLE_ENTRY))
            } else {
                (found / exact - 1.0).abs()
            };
            // NaN is the worst error.
            if off.is_nan() || off > worst.0 {
                worst = (off, format!("row {k}, column {l} of {context}: {found:e}, not {exact:e}"));
            }
        }
    }
    println!("matrices of one tick: {ran} accurate to {:.1e}, {rejected} rejected; {}", worst.0, worst.1);
    assert!(worst.0 <= ENTRY_TOLERANCE, "{:e}: {}", worst.0, worst.1);
    assert!(ran > 300 && rejected > 50, "{ran} and {rejected}");
}

/// Parameters of `loops.csv`, in the order of the columns.
const LOOPS: [&str; 9] = [
    "motor.inertia_kg_m2",
    "motor.torque_constant_nm_a",
    "motor.emf_constant_v_s_rad",
    "motor.resistance_ohm",
    "motor.inductance_mh",
    "velocity_loop.gain",
    "velocity_loop.integral_time_ms",
    "current_loop.gain",
    "current_loop.integral_time_ms",
];

/// Returns θ at the position cycles after an impulse of Ω*, from A and B.
fn impulse_response(a: &[f64], b: &[f64], count: usize) -> Vec<f64> {
    let mut angles: Vec<f64> = Vec::new();
    for k in 1..=count {
        let back: f64 = (1..a.len()).filter(|i| *i < k).map(|i| a[i] * angles[k - 1 - i]).sum();
        angles.push(b.get(k).copied().unwrap_or(0.0) - back);
    }
    angles
}

#[test]
fn prediction_model_equals_inner_loops_computed_with_80_digits() {
    let (mut ran, mut rejected, mut unstable) = (0, 0, 0);
    let mut worst = [(0.0, String::new()), (0.0, String::new())];
    for row in golden("loops.csv") {
        let (values, rest) = row.split_at(LOOPS.len());
        let (tick_us, ticks, instants, wanted) = (rest[0] * 1e-3, rest[1], rest[2], &rest[3..]);
        let mut changes: Vec<(String, f64)> =
            LOOPS.iter().zip(values).map(|(key, value)| (format!("x.{key}"), *value)).collect();
        changes.extend([
            ("periods.position_ms".to_owned(), tick_us * ticks * instants * 1e-3),
            ("periods.velocity_us".to_owned(), tick_us * ticks),
            ("periods.current_us".to_owned(), tick_us),
            ("publish_rate".to_owned(), 1.0),
        ]);
        let context = format!("{values:?} at {tick_us} µs, {ticks}, {instants}");
        let model = config_with(&changes).and_then(|config| {
            prediction_model(&config.axes()[0], &config.periods()).map_err(|e| format!("axis x: {e}"))
        });
        let model = match model {
            Ok(model) => model,
            Err(rejection) => {
                println!("{context}: {rejection}");
                assert!(is_reason(&rejection), "{rejection}");
                rejected += 1;
                continue;
            }
        };
        ran += 1;
        let largest = wanted.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
        // The response of unstable inner loops grows beyond its first value.
        let group = usize::from(largest > UNSTABLE_GROWTH * wanted[0].abs());
        unstable += group;
        for (k, (found, exact)) in
            impulse_response(model.a(), model.b(), wanted.len()).iter().zip(wanted).enumerate()
        {
            let off = (found - exact).abs() / largest;
            if off.is_nan() || off > worst[group].0 {
                worst[group] = (off, format!("period {k} of {context}: {found:e}, not {exact:e}"));
            }
        }
    }
    let [stable_worst, unstable_worst] = &worst;
    println!(
        "prediction models: {ran} accurate to {:.1e}, {unstable} of them to {:.1e}",
        stable_worst.0, unstable_worst.0
    );
    println!("{rejected} rejected; {}; {}", stable_worst.1, unstable_worst.1);
    assert!(stable_worst.0 <= MODEL_TOLERANCE && unstable_worst.0 <= UNSTABLE_MODEL_TOLERANCE, "{worst:?}");
    assert!(ran > 100, "{ran} and {rejected}");
}

#[test]
fn ticks_over_one_second_equal_one_step_of_one_second() {
    // One second of the shortest ticks takes long: for a few motors only.
    const MOST: f64 = 20_000.0;
    let (mut ran, mut longest, mut worst) = (0, 5, (0.0, String::new()));
    for drive in drives().into_iter().filter(|drive| !drive.is_rejected) {
        let ticks = (1.0 / drive.tick).round();
        let (Ok(motor), Ok(whole)) = (Motor::new(&drive.motor, drive.tick), Motor::new(&drive.motor, 1.0))
        else {
            continue;
        };
        // Both must cover exactly one second.
        if ticks * drive.tick != 1.0 || (ticks > MOST && longest == 0) {
            continue;
        }
        longest -= i32::from(ticks > MOST);
        ran += 1;
        let start = MotorState { current: 1.0, speed: 1.0, angle: 0.0 };
        let (mut s, mut largest) = (start, MotorState::default());
        for _ in 0..ticks as u64 {
            s = motor.step(&s, 1.0, -0.3);
            largest.current = s.current.abs().max(largest.current);
            largest.speed = s.speed.abs().max(largest.speed);
            largest.angle = s.angle.abs().max(largest.angle);
        }
        let wanted = whole.step(&start, 1.0, -0.3);
        let pairs = [
            ("i", s.current, wanted.current, largest.current),
            ("ω", s.speed, wanted.speed, largest.speed),
            ("θ", s.angle, wanted.angle, largest.angle),
        ];
        for (name, found, exact, scale) in pairs {
            // Each tick rounds once, and its matrix is rounded; errors add up.
            let off = (found - exact).abs() / scale / (ticks * f64::EPSILON);
            if off.is_nan() || off > worst.0 {
                worst = (off, format!("{name} of {:?}: {found:e}, not {exact:e} after {ticks}", drive.motor));
            }
        }
    }
    println!("a second: {ran} motors, off by {:.1} roundings a tick at most; {}", worst.0, worst.1);
    assert!(worst.0 <= ROUNDINGS, "{}", worst.1);
    assert!(ran > 30 && longest == 0, "{ran}, {longest}");
}

/// Returns true if the text of a rejection names the axis or the allowed range.
fn is_reason(rejection: &str) -> bool {
    !rejection.contains(char::is_control)
        && rejection.len() < 2000
        && (rejection.starts_with("axis ") || rejection.contains("must"))
}

/// Returns the default machine with changed parameters.
fn config_with(changes: &[(String, f64)]) -> Result<MachineConfig, String> {
    let mut parameters = Parameters::embedded_default().expect("shipped");
    let source = ValueSource::named("test");
    let change = |(key, value): &(String, f64)| Assignment {
        key: key.clone(),
        value: Value::Double(*value),
        source: source.clone(),
    };
    parameters.set_all(changes.iter().map(change).collect()).map_err(|e| e.to_string())?;
    parameters.machine_config().map_err(|e| e.to_string())
}

/// Creates the machine, or returns the text of its rejection.
fn machine_with(changes: &[(String, f64)]) -> Result<Machine, String> {
    let config = config_with(changes)?;
    Ok(Machine::new(Arc::new(MachineParameters::new(&config).map_err(|e| e.to_string())?)))
}

/// Simulated ticks per machine, at least two position cycles.
const TICKS: usize = 1000;

/// Runs setpoints that jump, creep and reverse under loads; all signals must be finite.
pub fn run_demanding_setpoints(machine: &mut Machine, context: &dyn Fn() -> String) {
    let periods = (TICKS / machine.ticks_per_period()).clamp(2, 200);
    for k in 0..periods {
        let t = k as f64;
        let psec = [0.3 * (0.7 * t).sin(), -0.2, 1e-6 * t, 2.0 * (0.3 * t).cos(), 50.0 * (t / 7.0).floor()];
        for axis in 0..machine.axis_count() {
            machine.set_load(axis, 1e5 * (t + axis as f64).sin());
        }
        machine.advance_with(&psec, &[], |machine| {
            for axis in machine.axes() {
                let s = axis.sample();
                let seen = [
                    s.position,
                    s.velocity,
                    s.current,
                    s.current_setpoint,
                    s.voltage,
                    s.velocity_setpoint,
                    s.velocity_feedforward,
                    s.torque_feedforward,
                    s.friction_current,
                    s.gravity_current,
                    s.load_current,
                    s.effort,
                ];
                assert!(seen.iter().all(|v| v.is_finite()), "{}: period {k}: {s:?}", context());
            }
        });
    }
}

/// Returns the numeric parameters of the axes X, A and C and the periods, with their ranges.
fn ranges() -> Vec<(String, f64, f64)> {
    let parameters = Parameters::embedded_default().expect("shipped");
    let number = |(key, definition): (String, &'static ParameterDefinition)| match definition.kind {
        ParameterKind::Number { min, max } if definition.scope != Scope::Node => Some((key, min, max)),
        _ => None,
    };
    let is_meant = |(key, ..): &(String, f64, f64)| {
        ["x.", "a.", "c.", "periods."].iter().any(|start| key.starts_with(start))
            && !key.contains("tolerances")
            && !key.contains("travel")
            && !key.contains("direct")
            // They need each other: `transmission.rs`, `gms_machine.rs`.
            && !["stiffness", "damping", "attraction", "load_", "transmission.backlash", "structure"].iter().any(|name| key.contains(name))
    };
    let ranges: Vec<_> = parameters.definitions().filter_map(number).filter(is_meant).collect();
    assert!(ranges.len() > 90, "{} parameters", ranges.len());
    ranges
}

#[test]
fn limits_of_every_parameter_run_or_are_rejected_with_a_reason() {
    let (mut ran, mut rejected) = (0, 0);
    for (key, min, max) in ranges() {
        for value in [min, max] {
            match machine_with(&[(key.clone(), value)]) {
                Ok(mut machine) => {
                    run_demanding_setpoints(&mut machine, &|| format!("{key} = {value}"));
                    ran += 1;
                }
                Err(rejection) => {
                    println!("{key} = {value:e}: {rejection}");
                    assert!(is_reason(&rejection), "{key} = {value}: {rejection}");
                    rejected += 1;
                }
            }
        }
    }
    println!("limits of one parameter: {ran} run, {rejected} rejected");
    assert!(ran > 10 * rejected && rejected > 10, "{ran}, {rejected}");
}

/// Returns a value of the range at a logarithmic `share`.
fn logarithmic(min: f64, max: f64, share: f64, negative: bool) -> f64 {
    // Lower limit of ranges that begin with 0.
    const SMALLEST: f64 = 1e-9;
    let positive = if min < 0.0 { SMALLEST } else { min.max(SMALLEST) };
    if negative && min < 0.0 {
        return -SMALLEST * (-min / SMALLEST).powf(share);
    }
    (positive * (max / positive).powf(share)).clamp(min, max)
}

/// Checks that friction opposes motion and never reverses it, and that all states are finite.
fn check_friction(config: &MachineConfig) {
    let tick = seconds(config.periods().current);
    for axis in config.axes() {
        let plant = Plant::new(axis, tick).expect("the machine has been built");
        let motor = Motor::new(&Plant::deviating_motor(axis), tick).expect("the machine has been built");
        for speed in [0.0, 1e-300, 1e-9, -1e-3, 1.0, -50.0, 1e3, -1e6] {
            for (current, voltage) in [(0.0, 0.0), (1.0, 10.0), (-1e4, 1e5), (1e4, -1e5)] {
                let start = MotorState { current, speed, angle: 0.1 };
                let mut with = start;
                let torques = plant.step(&mut with, voltage, 10.0);
                let without = motor.step(&start, voltage, torques.load - torques.gravity);
                let context = format!("{}: {start:?} to {with:?} by {torques:?}", axis.name());
                assert!(torques.friction * with.speed >= 0.0, "friction drives {context}");
                assert!(with.speed.abs() <= without.speed.abs(), "faster than {without:?}: {context}");
                assert!(with.speed * without.speed >= 0.0, "reversed {context}");
                assert!([with.current, with.speed, with.angle].iter().all(|v| v.is_finite()), "{context}");
            }
        }
    }
}

/// Returns random values for the parameters of `ranges`, with separate periods.
fn random_parameters() -> impl Strategy<Value = Vec<(String, f64)>> {
    let share = prop_oneof![Just(0.0), Just(1.0), 0.0..1.0f64, 0.0..1.0f64];
    let shares = prop::collection::vec((share, any::<bool>(), 0u32..8), ranges().len());
    let tick_us = prop::sample::select(vec![1.0, 2.5, 62.5, 125.0, 1000.0, 50e3]);
    let ratios = prop::sample::select(vec![(1.0, 1.0), (1.0, 24.0), (2.0, 24.0), (50.0, 1.0), (1.0, 1000.0)]);
    // Number of changed parameters out of eight.
    (shares, 1u32..8, tick_us, ratios).prop_map(|(shares, changed, tick_us, (velocity, position))| {
        let velocity_us = f64::min(tick_us * velocity, 50e3);
        let position_ms = f64::min(velocity_us * position * 1e-3, 50.0);
        let periods = [
            ("periods.position_ms", position_ms),
            ("periods.velocity_us", velocity_us),
            ("periods.current_us", tick_us),
            ("publish_rate", 1.0),
        ];
        let drawn =
            ranges().into_iter().zip(shares).filter_map(|((key, min, max), (share, negative, turn))| {
                (turn < changed && !key.starts_with("periods"))
                    .then(|| (key, logarithmic(min, max, share, negative)))
            });
        let mut changes: BTreeMap<String, f64> = drawn.collect();
        changes.extend(periods.map(|(key, value)| (key.to_owned(), value)));
        // Friction that drives is rejected; avoid it in most machines.
        for axis in ["x", "a", "c"] {
            let a = *changes.entry(format!("{axis}.friction.a")).and_modify(|a| *a = a.abs()).or_insert(1.5);
            changes.entry(format!("{axis}.friction.c")).and_modify(|c| *c = c.max(-a)).or_insert(-0.5 * a);
        }
        changes.into_iter().collect()
    })
}

#[test]
fn random_parameters_run_or_are_rejected_with_a_reason() {
    let config = ProptestConfig {
        cases: 400,
        failure_persistence: None,
        // Shrinking a whole machine takes too long.
        max_shrink_iters: 0,
        rng_seed: RngSeed::Fixed(8),
        ..ProptestConfig::default()
    };
    let (ran, rejected) = (Cell::new(0), Cell::new(0));
    let outcome = TestRunner::new(config).run(&random_parameters(), |changes| {
        match machine_with(&changes) {
            Ok(mut machine) => {
                ran.set(ran.get() + 1);
                check_friction(&config_with(&changes).expect("the machine has been built"));
                run_demanding_setpoints(&mut machine, &|| format!("{changes:?}"));
            }
            Err(rejection) => {
                rejected.set(rejected.get() + 1);
                prop_assert!(is_reason(&rejection), "{rejection}");
            }
        }
        Ok(())
    });
    if let Err(failure) = outcome {
        panic!("{failure}");
    }
    println!("random parameters: {} machines run, {} rejected", ran.get(), rejected.get());
    assert!(ran.get() > 50 && rejected.get() > 20, "{} and {}", ran.get(), rejected.get());
}
