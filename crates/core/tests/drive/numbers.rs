//! Numbers under stress: drives at the edges of their ranges are right, or refused with the reason.
//!
//! What is right comes from `tools/golden_drives.py`: matrix exponentials of 120 digits, made without the library.

use std::cell::Cell;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::sync::Arc;

use proptest::prelude::*;
use proptest::test_runner::{RngSeed, TestRunner};
use virtual_axes_core::config::{
    Assignment, ParameterDefinition, ParameterKind, MachineConfig, MotorConfig, Parameters, Scope, ValueSource, Value,
};
use virtual_axes_core::drive::{Motor, MotorState, Plant};
use virtual_axes_core::machine::{Machine, MachineParameters, prediction_model};
use virtual_axes_core::units::seconds;

/// A table of `tests/golden`: its rows by the names of the columns.
fn golden(file: &str) -> Vec<Vec<f64>> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(file);
    let text = fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let number = |field: &str| field.parse().unwrap_or_else(|_| panic!("{file}: {field}"));
    text.lines().skip(1).map(|line| line.split(',').map(number).collect()).collect()
}

/// Inertia, Kt, Ke, R, L, tick; whether it must be refused; then the rows of i, ω and θ by i, ω, u and τ.
struct Drive {
    motor: MotorConfig,
    tick: f64,
    refused: bool,
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
        refused: row[6] == 1.0,
        step: [0, 1, 2].map(|k| [0, 1, 2, 3].map(|l| row[7 + 4 * k + l])),
    };
    golden("drives.csv").into_iter().map(drive).collect()
}

/// The step of a motor as a matrix, taken off its answers to one unit at a time.
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

/// How far an entry of the matrix of a tick may be off, relative to itself.
const ENTRY: f64 = 3e-12;
/// Growth of that answer within twelve periods from which on the inner loops count as unstable.
const RUNAWAY: f64 = 1e6;
/// How far it may be off then, relative to its largest: what is stable in it is lost beside what grows.
const MODEL_RUNAWAY: f64 = 1e-4;
/// By how many roundings each tick may be off, relative to the largest value on the way.
const ROUNDINGS: f64 = 8.0;
/// An entry of such a matrix below which it is nothing: the least that is not comes from cubes of 1 µs.
const NOTHING: f64 = 1e-60;
/// How far the answer of a prediction model may be off, relative to its largest.
const MODEL: f64 = 1e-7;

#[test]
fn a_tick_of_any_motor_is_the_matrix_exponential() {
    let (mut ran, mut refused, mut worst) = (0, 0, (0.0, String::new()));
    for drive in drives() {
        let told = format!("{:?} over {} s", drive.motor, drive.tick);
        let motor = match Motor::new(&drive.motor, drive.tick) {
            Err(error) => {
                assert!(drive.refused, "{told}: {error}");
                refused += 1;
                continue;
            }
            Ok(motor) => motor,
        };
        assert!(!drive.refused, "{told}: a torque turns it against itself within the tick");
        ran += 1;
        let found = matrix(&motor);
        for (k, l) in (0..3).flat_map(|k| (0..4).map(move |l| (k, l))) {
            let (found, exact) = (found[k][l], drive.step[k][l]);
            // What has decayed to nothing is so small that no digit of it counts.
            let off = if exact.abs() < NOTHING {
                f64::from(u8::from(found.abs() > NOTHING))
            } else {
                (found / exact - 1.0).abs()
            };
            // NaN is worse than anything.
            if off.is_nan() || off > worst.0 {
                worst = (off, format!("row {k}, column {l} of {told}: {found:e}, not {exact:e}"));
            }
        }
    }
    println!("matrices of one tick: {ran} right to {:.1e}, {refused} refused; {}", worst.0, worst.1);
    assert!(worst.0 <= ENTRY, "{:e}: {}", worst.0, worst.1);
    assert!(ran > 300 && refused > 50, "{ran} and {refused}");
}

/// Velocity-loop gain and the others of the golden loops, in the order of their columns.
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

/// θ at the position instants after an impulse of Ω*, by A and B.
fn impulse(a: &[f64], b: &[f64], count: usize) -> Vec<f64> {
    let mut angles: Vec<f64> = Vec::new();
    for k in 1..=count {
        let back: f64 = (1..a.len()).filter(|i| *i < k).map(|i| a[i] * angles[k - 1 - i]).sum();
        angles.push(b.get(k).copied().unwrap_or(0.0) - back);
    }
    angles
}

#[test]
fn the_prediction_model_is_the_loops_folded_with_80_digits() {
    let (mut ran, mut refused, mut runaway) = (0, 0, 0);
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
        let told = format!("{values:?} at {tick_us} µs, {ticks}, {instants}");
        let model = config_with(&changes).and_then(|config| {
            prediction_model(&config.axes()[0], &config.periods()).map_err(|e| format!("axis x: {e}"))
        });
        let model = match model {
            Ok(model) => model,
            Err(refusal) => {
                println!("{told}: {refusal}");
                assert!(is_a_reason(&refusal), "{refusal}");
                refused += 1;
                continue;
            }
        };
        ran += 1;
        let largest = wanted.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
        // Inner loops that are unstable themselves leave the range of their own first answer.
        let place = usize::from(largest > RUNAWAY * wanted[0].abs());
        runaway += place;
        for (k, (found, exact)) in impulse(model.a(), model.b(), wanted.len()).iter().zip(wanted).enumerate()
        {
            let off = (found - exact).abs() / largest;
            if off.is_nan() || off > worst[place].0 {
                worst[place] = (off, format!("period {k} of {told}: {found:e}, not {exact:e}"));
            }
        }
    }
    let [stable, unstable] = &worst;
    println!("prediction models: {ran} right to {:.1e}, {runaway} of them to {:.1e}", stable.0, unstable.0);
    println!("{refused} refused; {}; {}", stable.1, unstable.1);
    assert!(stable.0 <= MODEL && unstable.0 <= MODEL_RUNAWAY, "{worst:?}");
    assert!(ran > 100, "{ran} and {refused}");
}

#[test]
fn a_second_of_ticks_is_one_step_of_a_second() {
    // A second of the shortest ticks takes its time: of a few motors only.
    const MOST: f64 = 20_000.0;
    let (mut ran, mut longest, mut worst) = (0, 5, (0.0, String::new()));
    for drive in drives().into_iter().filter(|drive| !drive.refused) {
        let ticks = (1.0 / drive.tick).round();
        let (Ok(motor), Ok(whole)) = (Motor::new(&drive.motor, drive.tick), Motor::new(&drive.motor, 1.0))
        else {
            continue;
        };
        // Between the two a second must be the same number.
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
            // Each tick rounds once, and its matrix is rounded: both add up.
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

/// What a refusal may say instead of a machine.
fn is_a_reason(refusal: &str) -> bool {
    !refusal.contains(char::is_control)
        && refusal.len() < 2000
        && (refusal.starts_with("axis ") || refusal.contains("must"))
}

/// The default machine with other numbers.
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

/// The machine, or what refuses it.
fn machine_with(changes: &[(String, f64)]) -> Result<Machine, String> {
    let config = config_with(changes)?;
    Ok(Machine::new(Arc::new(MachineParameters::new(&config).map_err(|e| e.to_string())?)))
}

/// Ticks for which a machine is run, at least one position period.
const TICKS: usize = 1000;

/// Runs setpoints that jump, creep and reverse against loads; everything that can be seen must be a number.
fn run_hard(machine: &mut Machine, what: &dyn Fn() -> String) {
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
                assert!(seen.iter().all(|v| v.is_finite()), "{}: period {k}: {s:?}", what());
            }
        });
    }
}

/// The parameters of the X, A and C axes and the periods that are numbers, with their edges.
fn edges() -> Vec<(String, f64, f64)> {
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
    };
    let edges: Vec<_> = parameters.definitions().filter_map(number).filter(is_meant).collect();
    assert!(edges.len() > 90, "{} parameters", edges.len());
    edges
}

#[test]
fn every_edge_is_refused_with_the_reason_or_runs() {
    let (mut ran, mut refused) = (0, 0);
    for (key, min, max) in edges() {
        for value in [min, max] {
            match machine_with(&[(key.clone(), value)]) {
                Ok(mut machine) => {
                    run_hard(&mut machine, &|| format!("{key} = {value}"));
                    ran += 1;
                }
                Err(refusal) => {
                    println!("{key} = {value:e}: {refusal}");
                    assert!(is_a_reason(&refusal), "{key} = {value}: {refusal}");
                    refused += 1;
                }
            }
        }
    }
    println!("edges of one parameter: {ran} run, {refused} refused");
    assert!(ran > 10 * refused && refused > 10, "{ran}, {refused}");
}

/// A number of the range, by its digits before and behind the point alike.
fn drawn(min: f64, max: f64, share: f64, negative: bool) -> f64 {
    // Of a range that begins with nothing.
    const LEAST: f64 = 1e-9;
    let positive = if min < 0.0 { LEAST } else { min.max(LEAST) };
    if negative && min < 0.0 {
        return -LEAST * (-min / LEAST).powf(share);
    }
    (positive * (max / positive).powf(share)).clamp(min, max)
}

/// Friction of any plant opposes motion, never reverses it, and ends a tick at 0.0 where it can.
fn stops_and_never_reverses(config: &MachineConfig) {
    let tick = seconds(config.periods().current);
    for axis in config.axes() {
        let plant = Plant::new(axis, tick).expect("the machine has been built");
        let motor = Motor::new(&Plant::deviating_motor(axis), tick).expect("likewise");
        for speed in [0.0, 1e-300, 1e-9, -1e-3, 1.0, -50.0, 1e3, -1e6] {
            for (current, voltage) in [(0.0, 0.0), (1.0, 10.0), (-1e4, 1e5), (1e4, -1e5)] {
                let start = MotorState { current, speed, angle: 0.1 };
                let mut with = start;
                let torques = plant.step(&mut with, voltage, 10.0);
                let without = motor.step(&start, voltage, torques.load - torques.gravity);
                let told = format!("{}: {start:?} to {with:?} by {torques:?}", axis.name());
                assert!(torques.friction * with.speed >= 0.0, "friction drives {told}");
                assert!(with.speed.abs() <= without.speed.abs(), "faster than {without:?}: {told}");
                assert!(with.speed * without.speed >= 0.0, "reversed {told}");
                assert!([with.current, with.speed, with.angle].iter().all(|v| v.is_finite()), "{told}");
            }
        }
    }
}

/// Numbers for the parameters of `edges`, periods apart.
fn anywhere() -> impl Strategy<Value = Vec<(String, f64)>> {
    let share = prop_oneof![Just(0.0), Just(1.0), 0.0..1.0f64, 0.0..1.0f64];
    let shares = prop::collection::vec((share, any::<bool>(), 0u32..8), edges().len());
    let tick_us = prop::sample::select(vec![1.0, 2.5, 62.5, 125.0, 1000.0, 50e3]);
    let ratios = prop::sample::select(vec![(1.0, 1.0), (1.0, 24.0), (2.0, 24.0), (50.0, 1.0), (1.0, 1000.0)]);
    // Of eight parameters so many are changed.
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
            edges().into_iter().zip(shares).filter_map(|((key, min, max), (share, negative, turn))| {
                (turn < changed && !key.starts_with("periods"))
                    .then(|| (key, drawn(min, max, share, negative)))
            });
        let mut changes: BTreeMap<String, f64> = drawn.collect();
        changes.extend(periods.map(|(key, value)| (key.to_owned(), value)));
        // Friction that drives is refused: not every second machine is to be one of those.
        for axis in ["x", "a", "c"] {
            let a = *changes.entry(format!("{axis}.friction.a")).and_modify(|a| *a = a.abs()).or_insert(1.5);
            changes.entry(format!("{axis}.friction.c")).and_modify(|c| *c = c.max(-a)).or_insert(-0.5 * a);
        }
        changes.into_iter().collect()
    })
}

#[test]
fn any_numbers_within_the_ranges_are_refused_with_the_reason_or_run() {
    let config = ProptestConfig {
        cases: 400,
        failure_persistence: None,
        // What is found is a whole machine: to look for a smaller one takes too long.
        max_shrink_iters: 0,
        rng_seed: RngSeed::Fixed(8),
        ..ProptestConfig::default()
    };
    let (ran, refused) = (Cell::new(0), Cell::new(0));
    let outcome = TestRunner::new(config).run(&anywhere(), |changes| {
        match machine_with(&changes) {
            Ok(mut machine) => {
                ran.set(ran.get() + 1);
                stops_and_never_reverses(&config_with(&changes).expect("the machine has been built"));
                run_hard(&mut machine, &|| format!("{changes:?}"));
            }
            Err(refusal) => {
                refused.set(refused.get() + 1);
                prop_assert!(is_a_reason(&refusal), "{refusal}");
            }
        }
        Ok(())
    });
    if let Err(failure) = outcome {
        panic!("{failure}");
    }
    println!("any numbers: {} machines run, {} refused", ran.get(), refused.get());
    assert!(ran.get() > 50 && refused.get() > 20, "{} and {}", ran.get(), refused.get());
}
