//! Position cycles in parts: bit-identity with whole cycles, and loads that change within a cycle.

use std::sync::Arc;

use proptest::prelude::*;
use virtual_axes_core::machine::{Machine, MachineParameters, SimdWidth};
use virtual_axes_verification::fixtures::machines::{AXES, TSP, configured_with};

/// Position cycles of a run.
const CYCLES: usize = 80;

/// Returns a machine with changes on every axis.
fn machine(changes: &[&str]) -> Machine {
    let config = configured_with("mikron_ucp710", changes, &[]);
    Machine::new(Arc::new(MachineParameters::new(&config).expect("can be discretized")))
}

/// Returns setpoints that reach limits and reverse, different for each axis.
fn psec(axis: usize, k: usize) -> f64 {
    let size = if axis < 3 { 0.02 } else { 0.3 };
    size * (1.0 - (9.0 * TSP * k as f64 + axis as f64).cos())
}

/// Advances by one position cycle in parts of the given lengths and returns the bits of all signals.
fn bits_of_cycle(machine: &mut Machine, k: usize, parts: &[usize]) -> Vec<u64> {
    let now: Vec<f64> = (0..AXES).map(|axis| psec(axis, k)).collect();
    let horizon = machine.preview_length();
    let ahead: Vec<f64> = (0..AXES).flat_map(|axis| (1..=horizon).map(move |j| psec(axis, k + j))).collect();
    (0..AXES).for_each(|axis| machine.set_load(axis, if k % 20 < 5 { 40.0 * axis as f64 } else { 0.0 }));
    match parts {
        [] => machine.advance(&now, &ahead),
        parts => parts.iter().for_each(|&count| machine.advance_ticks(count, &now, &ahead)),
    }
    let mut bits = vec![machine.tick()];
    for axis in 0..AXES {
        let (s, activity) = (machine.axis(axis).sample(), machine.activity(axis));
        bits.extend(
            [s.position, s.current, s.voltage, s.friction_current, s.gravity_current].map(f64::to_bits),
        );
        bits.extend((0..machine.ticks_per_period()).map(|tick| machine.position(axis, tick).to_bits()));
        bits.extend(machine.motion_at_end(axis).map(f64::to_bits));
        bits.extend([activity.peak_current.to_bits(), activity.saturated_ticks]);
    }
    bits
}

/// Returns the lengths of the parts of `whole` ticks that are cut after tick `n` where bit `n` of `cuts` is set.
fn parts(whole: usize, cuts: u64) -> Vec<usize> {
    let ends = (1..whole).filter(|tick| cuts >> (tick - 1) & 1 == 1).chain([whole]);
    let mut start = 0;
    ends.map(|end| end - std::mem::replace(&mut start, end)).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    #[test]
    fn a_cycle_in_parts_equals_the_whole_cycle(cuts in prop::collection::vec(any::<u64>(), CYCLES)) {
        let gpc = ["position_loop.controller=gpc"];
        let compensated = ["feedforward.friction=0.8"];
        for changes in [&[] as &[&str], &gpc, &compensated] {
            for width in [SimdWidth::Widest, SimdWidth::Four, SimdWidth::Baseline] {
                let (mut whole, mut parted) = (machine(changes), machine(changes));
                parted.set_simd_width(width);
                for (k, &cuts) in cuts.iter().enumerate() {
                    // Few parts and many parts.
                    let parts = parts(whole.ticks_per_period(), if k % 2 == 0 { cuts } else { cuts & cuts >> 13 & cuts >> 29 });
                    let wanted = bits_of_cycle(&mut whole, k, &[]);
                    prop_assert!(bits_of_cycle(&mut parted, k, &parts) == wanted, "{changes:?}, cycle {k}, {parts:?}");
                }
            }
        }
    }
}

#[test]
fn ticks_beyond_a_cycle_continue_in_the_next_one() {
    let (mut whole, mut parted) = (machine(&[]), machine(&[]));
    let psec = [0.001, 0.002, -0.001, 0.01, 0.02];
    (0..10).for_each(|_| whole.advance(&psec, &[]));
    let ticks = whole.ticks_per_period();
    for count in [7, 2 * ticks, ticks - 7, 6 * ticks + 5] {
        parted.advance_ticks(count, &psec, &[]);
    }
    assert!(!parted.is_at_cycle_start());
    // From within a cycle, a step of one period ends within the next one.
    parted.advance_ticks(ticks - 5, &psec, &[]);
    assert_eq!(parted.tick(), whole.tick());
    (0..AXES).for_each(|axis| assert_eq!(parted.motion_at_end(axis), whole.motion_at_end(axis)));
}

#[test]
fn a_load_within_a_cycle_acts_from_its_tick_on() {
    let (mut free, mut loaded) = (machine(&[]), machine(&[]));
    let psec = [0.0; AXES];
    free.advance_ticks(20, &psec, &[]);
    loaded.advance_ticks(20, &psec, &[]);
    loaded.set_load(0, 5_000.0);
    free.advance_ticks(1, &psec, &[]);
    loaded.advance_ticks(1, &psec, &[]);
    (0..=20).for_each(|tick| assert_eq!(free.position(0, tick), loaded.position(0, tick)));
    // Beyond breakaway: within one tick the load accelerates the axis by less than F/m, friction taken off.
    let [free, loaded] = [free.motion_at_end(0)[1], loaded.motion_at_end(0)[1]];
    assert!(loaded > free, "{loaded} {free}");
    assert!(loaded.is_finite());
}

#[test]
fn the_sample_at_the_end_is_that_of_the_next_start() {
    let mut machine = machine(&[]);
    let psec = [0.005, 0.0, 0.001, 0.1, 0.0];
    for _ in 0..5 {
        machine.advance_ticks(machine.ticks_per_period(), &psec, &[]);
        let ends: Vec<_> = (0..AXES).map(|axis| machine.sample_at_end(axis)).collect();
        let mut next = machine.clone();
        next.advance_ticks(1, &psec, &[]);
        for (axis, end) in ends.iter().enumerate() {
            let start = next.axis(axis).sample();
            // State of the motor, and torques over the tick before.
            assert_eq!(end.position, start.position);
            assert_eq!(end.velocity, start.velocity);
            assert_eq!(end.current, start.current);
            assert_eq!(end.friction_current, start.friction_current);
            assert_eq!(end.gravity_current, start.gravity_current);
        }
    }
}
