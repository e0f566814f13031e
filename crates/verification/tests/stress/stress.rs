//! Random trajectories: every check passes, each check detects an injected violation, and the digest depends on the
//! seed only.

use std::process::{Command, Output};
use std::sync::LazyLock;

use virtual_axes_core::machine::{AxisSample, SimdWidth};
use virtual_axes_verification::stress::{
    Check, StressOptions, StressSummary, TestMachines, TrajectoryKind, TrajectoryTest, run,
};

/// Number of trajectories per test.
const COUNT: u64 = if cfg!(debug_assertions) { 400 } else { 4000 };

static MACHINES: LazyLock<TestMachines> =
    LazyLock::new(|| TestMachines::shipped().expect("the shipped machines take all controllers"));

fn options(count: u64) -> StressOptions {
    StressOptions { seed: 7, first: 0, count, threads: 2, width: SimdWidth::Widest }
}

fn stressed(options: StressOptions) -> StressSummary {
    run(&MACHINES, &options, |_| Ok(())).expect("the stress test runs to its end")
}

#[test]
fn random_trajectories_pass_every_check() {
    let summary = stressed(options(COUNT));
    assert!(summary.violations.is_empty(), "{:#?}", summary.violations);
    assert_eq!(summary.run, COUNT);
    // Each kind and each machine variant occurs.
    assert_eq!(summary.kinds.len(), TrajectoryKind::ALL.len());
    assert!(summary.variants.iter().all(|count| *count > 0), "{:?}", summary.variants);
    assert!(summary.limited > COUNT / 100 && summary.limited < COUNT, "{}", summary.limited);
    assert!(summary.bounded * 5 > summary.axes * 4, "{} of {}", summary.bounded, summary.axes);
    // The bound is tight.
    assert!(summary.error.0 > 0.3 && summary.error.0 <= 1.0 + 1e-6, "{:?}", summary.error);
    assert!(summary.dissipated > 1e3 * summary.returned, "{} J, {} J", summary.dissipated, summary.returned);
}

#[test]
fn digest_depends_on_the_seed_only() {
    let count = COUNT / 4;
    let digest = |options: StressOptions| stressed(options).digest();
    let one = digest(options(count));
    assert_eq!(one, digest(options(count)));
    assert_eq!(one, digest(StressOptions { threads: 1, ..options(count) }));
    assert_eq!(one, digest(StressOptions { threads: 5, ..options(count) }));
    assert!(one != digest(StressOptions { seed: 8, ..options(count) }));
    let few = digest(options(count / 4));
    for width in [SimdWidth::Four, SimdWidth::Baseline] {
        assert_eq!(few, digest(StressOptions { width, ..options(count / 4) }), "{width:?}");
    }
}

#[test]
fn single_trajectory_is_bit_identical_to_the_one_of_a_series() {
    let mut test = TrajectoryTest::new(&MACHINES, 7, SimdWidth::Widest);
    let all: Vec<_> = (0..100).map(|number| test.run(number).expect("runs")).collect();
    for number in (0..100).rev().step_by(7) {
        let alone = TrajectoryTest::new(&MACHINES, 7, SimdWidth::Widest).run(number).expect("runs");
        assert_eq!(alone, all[number as usize]);
    }
}

/// Asserts that `check` detects what `alter` does to the samples of one of many valid trajectories.
#[track_caller]
fn assert_found(check: Check, mut alter: impl FnMut(usize, usize, &mut AxisSample)) {
    let mut test = TrajectoryTest::new(&MACHINES, 7, SimdWidth::Widest);
    let mut found = |number: u64| {
        let record = test.run_altered(number, &mut alter).expect("runs");
        record.violations.iter().any(|violation| violation.check == check)
    };
    assert!((0..200).any(&mut found), "{check:?} is not found");
}

#[test]
fn non_finite_signal_is_detected() {
    assert_found(Check::Finite, |axis, tick, s| {
        if (axis, tick) == (1, 200) {
            s.voltage = f64::NAN
        }
    });
    assert_found(Check::Energy, |axis, tick, s| {
        if (axis, tick) == (1, 200) {
            s.voltage = f64::NAN
        }
    });
}

#[test]
fn exceeded_or_unreported_limit_is_detected() {
    assert_found(Check::Limits, |_, tick, s| {
        if tick == 99 {
            s.current_setpoint = 1e3
        }
    });
    assert_found(Check::Reported, |_, _, s| s.saturated = false);
    assert_found(Check::Reported, |axis, tick, s| {
        if (axis, tick) == (4, 150) {
            s.saturated = true
        }
    });
    assert_found(Check::Counted, |axis, tick, s| {
        if (axis, tick) == (0, 150) {
            s.current += 100.0
        }
    });
    assert_found(Check::SetpointSpeed, |axis, tick, s| {
        if (axis, tick) == (2, 96) {
            s.psec += 0.1
        }
    });
}

#[test]
fn driving_friction_is_detected() {
    assert_found(Check::FrictionSign, |_, _, s| s.friction_current = -s.friction_current);
    assert_found(Check::FrictionWork, |_, _, s| s.friction_current = -s.friction_current);
    assert_found(Check::FrictionLaw, |_, _, s| s.friction_current *= 1.0 + 1e-9);
}

#[test]
fn energy_imbalance_is_detected() {
    // A part in 10¹⁰ of the speed at one tick.
    assert_found(Check::Energy, |_, tick, s| {
        if tick == 500 {
            s.velocity *= 1.0 + 1e-10
        }
    });
    assert_found(Check::Energy, |_, _, s| s.friction_current *= 0.999);
    assert_found(Check::Position, |_, tick, s| {
        if tick == 500 {
            s.position += 1e-14
        }
    });
}

#[test]
fn following_error_off_the_linear_model_is_detected() {
    // A nanometer.
    assert_found(Check::Superposition, |_, _, s| s.delayed_psec += 1e-9);
    assert_found(Check::Bound, |_, _, s| s.delayed_psec += 0.1);
}

fn command(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_virtual_axes_stress")).args(arguments).output().expect("it starts")
}

#[test]
fn command_runs_many_trajectories_and_prints_one() {
    let output = command(&["--count", "200", "--seed", "7", "--json"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let object: serde_json::Value = serde_json::from_slice(&output.stdout).expect("one JSON object");
    assert_eq!((&object["run"], &object["faulty"]), (&200.into(), &0.into()));
    assert_eq!(object["digest"], stressed(options(200)).digest());
    let one = command(&["--only", "12", "--seed", "7", "--machine", "linear_motor_center"]);
    let text = String::from_utf8_lossy(&one.stdout);
    assert!(one.status.success() && text.contains("number: 12"), "{text}");
    let unknown = command(&["--machine", "no/such.yaml"]);
    assert_eq!(unknown.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&unknown.stderr).starts_with("no/such.yaml: "));
}

#[test]
fn options_out_of_range_are_rejected_by_name() {
    for [name, number] in [
        ["--count", "0"],
        ["--first", "18446744073709551615"],
        ["--threads", "0"],
        ["--threads", "1025"],
        ["--seed", "-1"],
    ] {
        let output = command(&[name, number]);
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{message}");
        assert!(message.contains(name) && message.contains(number), "{message}");
    }
}
