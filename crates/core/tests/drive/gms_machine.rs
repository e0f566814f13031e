//! Machines with axes whose friction has elements (generalized Maxwell-slip model): bits, stored states, memory.

use std::sync::Arc;

use proptest::prelude::*;
use virtual_axes_core::config::MachineConfig;
use virtual_axes_core::machine::{Machine, MachineParameters, SimdWidth};
use virtual_axes_verification::fixtures::machines::{AXES, configured_with};

use crate::bits::{assert_bits_of_every_width_and_part, bits, psec};
use crate::parameter_ranges::run_demanding_setpoints;
use crate::transmission::ELASTIC_X;

const X: usize = 0;
const ELEMENTS_X: [&str; 3] = [
    "x.friction.presliding_stiffness_n_um=50",
    "x.friction.presliding_elements=6",
    "x.friction.presliding_attraction_n_s=3e4",
];
const ELEMENTS_A: [&str; 2] =
    ["a.friction.presliding_stiffness_nm_rad=3e6", "a.friction.presliding_elements=4"];
const BRISTLES_Z: [&str; 2] =
    ["z.friction.presliding_stiffness_n_um=50", "z.friction.presliding_damping_n_s_m=3e4"];
const STRIBECK_X: [&str; 3] =
    ["x.friction.stribeck=1.5", "x.friction.stribeck_velocity_m_min=0.2", "x.friction.viscous=0.03"];

fn machine(changes: &[&str]) -> MachineConfig {
    configured_with("mikron_ucp710", &[], changes)
}

#[test]
fn bits_are_those_of_every_width_and_of_every_part_of_a_cycle() {
    let changes = [&ELEMENTS_X[..], &ELEMENTS_A, &BRISTLES_Z, &STRIBECK_X, &ELASTIC_X].concat();
    assert_bits_of_every_width_and_part(&machine(&changes));
}

#[test]
fn axes_beside_others_with_elements_keep_their_bits() {
    let shared = [&BRISTLES_Z[..], &ELASTIC_X].concat();
    let without = machine(&shared);
    let mixed = machine(&[&shared[..], &ELEMENTS_X, &ELEMENTS_A].concat());
    for axis in 0..AXES {
        let wanted = bits(&without, axis, SimdWidth::Widest, &[48]);
        let is_equal = bits(&mixed, axis, SimdWidth::Widest, &[48]) == wanted;
        assert_eq!(is_equal, ![X, 3].contains(&axis), "axis {axis}");
    }
}

#[test]
fn a_state_within_a_motion_goes_on_with_the_same_bits() {
    let config = machine(&[&ELEMENTS_X[..], &ELEMENTS_A, &STRIBECK_X].concat());
    let parameters = Arc::new(MachineParameters::new(&config).expect("can be discretized"));
    let mut machine = Machine::new(parameters.clone());
    for k in 0..60 {
        machine.advance(&psec(k), &[]);
    }
    machine.advance_ticks(17, &psec(60), &[]);
    let mut read = Machine::from_state_bytes(parameters, &machine.state_bytes()).expect("it is a state");
    let mut copy = machine.clone();
    for k in 60..120 {
        let ticks = if k == 60 { 31 } else { 48 };
        for machine in [&mut machine, &mut read, &mut copy] {
            machine.advance_ticks(ticks, &psec(k), &[]);
        }
        assert!(read.state_bytes() == machine.state_bytes(), "position cycle {k}");
        assert!(copy.state_bytes() == machine.state_bytes(), "position cycle {k}");
    }
}

#[test]
fn a_reset_discards_the_forces_of_the_elements() {
    let config = machine(&[&ELEMENTS_X[..], &ELEMENTS_A].concat());
    let mut fresh = Machine::new(Arc::new(MachineParameters::new(&config).expect("can be discretized")));
    let mut used = fresh.clone();
    for k in 0..60 {
        used.advance(&psec(k), &[]);
    }
    used.reset(&[0.0; AXES]);
    for k in 0..60 {
        for machine in [&mut fresh, &mut used] {
            machine.advance(&psec(k), &[]);
        }
        for axis in 0..AXES {
            let [wanted, found] =
                [&fresh, &used].map(|machine| machine.motion_at(axis, 47).map(f64::to_bits));
            assert_eq!(found, wanted, "axis {axis}, position cycle {k}");
        }
    }
}

/// A load that is taken back and put on again brings the axis back to the same position.
#[test]
fn a_held_axis_gives_way_under_a_load_and_returns_to_the_same_point() {
    // The loops are so soft that the elements carry the load.
    let soft =
        ["x.position_loop.gain=0", "x.velocity_loop.gain=1e-6", "x.velocity_loop.integral_time_ms=1e6"];
    let elastic = [&ELASTIC_X[..], &["x.position_loop.feedback=motor"]].concat();
    for transmission in [&[][..], &elastic] {
        let config = machine(&[&ELEMENTS_X[..2], &soft, transmission].concat());
        let mut machine =
            Machine::new(Arc::new(MachineParameters::new(&config).expect("can be discretized")));
        let mut position_after = |from: f64, to: f64| {
            for k in 0..4000 {
                machine.set_load(X, from + (to - from) * f64::min(f64::from(k) / 3000.0, 1.0));
                machine.advance(&[0.0; AXES], &[]);
            }
            let sample = machine.axis(X).sample();
            sample.position + sample.wind_up
        };
        let axis = &config.axes()[X];
        let law = axis.motor.torque_constant * (axis.friction.a + axis.friction.c) / axis.transmission_ratio;
        // A first loading curve has half the length of the curve after a reversal, with the same slope.
        let (length, force) = (law / (2.0 * 50e6), law / 2.0);
        // Knot 3 of 6 of the first loading curve; the branches after a reversal are twice as large (Masing).
        let there = position_after(0.0, force);
        let exact = length * 2.0_f64.ln();
        // Unloading by half the friction: a quarter on the first loading curve, between knots 1 and 2.
        let (first, second) = ((6.0 / 5.0_f64).ln(), (6.0 / 4.0_f64).ln());
        let exact_back = exact - 2.0 * length * (first + (second - first) * (0.25 - 1.0 / 6.0) * 6.0);
        let back = position_after(force, 0.0);
        let again = position_after(0.0, force);
        println!("{there} m, {back} m, {again} m; closed form {exact} m, {exact_back} m");
        assert!((there / exact - 1.0).abs() < 0.01, "{there} m, not {exact} m");
        assert!((back - exact_back).abs() < 0.01 * exact, "{back} m, not {exact_back} m");
        assert!((again / there - 1.0).abs() < 1e-4, "{again} m, not {there} m");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn elements_over_the_whole_range_have_finite_signals(
        is_elastic in prop::bool::ANY,
        count in 1..=10_usize,
        stiffness in -9.0..6.0_f64,
        attraction in prop::option::of(-9.0..12.0_f64),
        friction in prop_oneof![Just(0.0), 1e-9..10_f64, Just(1e4)],
        stribeck in prop_oneof![Just(0.0), 1e-9..10_f64],
        period_us in prop::sample::select(vec![25.0, 125.0, 1000.0]),
    ) {
        let mut changes = vec![
            format!("x.friction.presliding_stiffness_n_um={}", 10_f64.powf(stiffness)),
            format!("x.friction.presliding_elements={count}"),
            format!("x.friction.presliding_attraction_n_s={}", attraction.map_or(0.0, |power| 10_f64.powf(power))),
            format!("x.friction.a={friction}"),
            "x.friction.c=0".to_owned(),
            format!("x.friction.stribeck={stribeck}"),
            format!("periods.current_us={period_us}"),
            format!("periods.velocity_us={period_us}"),
            "periods.position_ms=6".to_owned(),
        ];
        if is_elastic {
            changes.extend(ELASTIC_X.map(str::to_owned));
        }
        let config = machine(&changes.iter().map(String::as_str).collect::<Vec<_>>());
        // Loops that are too slow for the cycles are rejected.
        if let Ok(parameters) = MachineParameters::new(&config) {
            run_demanding_setpoints(&mut Machine::new(Arc::new(parameters)), &|| format!("{changes:?}"));
        }
    }
}
