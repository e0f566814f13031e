//! Random trajectories: every check passes, and the digest depends on the seed only.

use std::process::{Command, Output};
use std::sync::LazyLock;

use virtual_axes_core::machine::SimdWidth;
use virtual_axes_verification::stress::{
    StressOptions, StressSummary, TestMachines, TrajectoryKind, TrajectoryTest, run,
};

/// Number of trajectories per test.
const COUNT: u64 = if cfg!(debug_assertions) { 400 } else { 4000 };

static MACHINES: LazyLock<TestMachines> =
    LazyLock::new(|| TestMachines::shipped().expect("the shipped machines take all controllers"));

fn options(count: u64) -> StressOptions {
    StressOptions { seed: 7, first: 0, count, threads: 2, width: SimdWidth::Widest }
}

fn stressed(options: StressOptions) -> StressSummary {
    run(&MACHINES, &options).expect("the stress test runs to its end")
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
    for [name, number] in [["--count", "0"], ["--first", "18446744073709551615"], ["--threads", "1025"]] {
        let output = command(&[name, number]);
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{message}");
        assert!(message.contains(name) && message.contains(number), "{message}");
    }
}
