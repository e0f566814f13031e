//! States as bytes: a machine that is read goes on with the same bits; bytes that are no state are rejected.

use std::sync::Arc;

use proptest::prelude::*;
use virtual_axes_core::machine::{Machine, MachineParameters, StateError};
use virtual_axes_verification::fixtures::machines::{AXES, TSP, configured_with};

fn parameters(changes: &[&str]) -> Arc<MachineParameters> {
    parameters_with(changes, &[])
}

/// Returns the parameters with changes of every axis, and changes of the machine.
fn parameters_with(of_axes: &[&str], of_machine: &[&str]) -> Arc<MachineParameters> {
    let config = configured_with("mikron_ucp710", of_axes, of_machine);
    Arc::new(MachineParameters::new(&config).expect("can be discretized"))
}

/// Advances by `ticks` with setpoints and loads that differ by axis, and returns the bits of all signals.
fn bits_of_ticks(machine: &mut Machine, ticks: usize) -> Vec<u64> {
    let time = TSP * (machine.tick() / machine.ticks_per_period() as u64) as f64;
    let psec = |axis: usize, ahead: usize| {
        (if axis < 3 { 0.02 } else { 0.3 }) * (1.0 - (9.0 * (time + TSP * ahead as f64) + axis as f64).cos())
    };
    let now = Vec::from_iter((0..AXES).map(|axis| psec(axis, 0)));
    let horizon = machine.preview_length();
    let ahead = Vec::from_iter((0..AXES).flat_map(|axis| (1..=horizon).map(move |j| psec(axis, j))));
    let load = if machine.tick() % 7 < 3 { 40.0 } else { 0.0 };
    (0..AXES).for_each(|axis| machine.set_load(axis, load * axis as f64));
    machine.advance_ticks(ticks, &now, &ahead);
    let mut bits = vec![machine.tick()];
    for axis in 0..AXES {
        let activity = machine.activity(axis);
        for s in [*machine.axis(axis).sample(), machine.sample_at_end(axis)] {
            let signals = [s.position, s.velocity, s.current, s.voltage, s.current_setpoint, s.load_current];
            let torques = [s.torque_feedforward, s.friction_current, s.gravity_current, s.delayed_psec];
            bits.extend(signals.into_iter().chain(torques).map(f64::to_bits));
        }
        bits.extend(machine.motion_at_end(axis).map(f64::to_bits));
        bits.extend([activity.peak_current.to_bits(), activity.saturated_ticks]);
    }
    bits
}

const VARIANTS: [&[&str]; 4] = [
    &[],
    &["position_loop.controller=gpc"],
    &["feedforward.friction=0.8"],
    &["feedforward.velocity=0.5", "delays.alpha_ms=20"],
];

/// X and Y with everything that the state of an axis can contain.
const EXTENDED: [&str; 11] = [
    "x.transmission.stiffness_n_um=200",
    "x.transmission.load_mass_kg=1200",
    "x.transmission.backlash_um=10",
    "x.transmission.load_friction=0.6",
    "x.structure.frequency_hz=40",
    "x.structure.mass_kg=5000",
    "x.backlash_compensation.width_um=8",
    "x.current_filter_1.type=low_pass",
    "y.friction.presliding_stiffness_n_um=50",
    "y.friction.presliding_elements=4",
    "y.friction.presliding_attraction_n_s=1e4",
];

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    #[test]
    fn a_machine_that_is_read_goes_on_with_the_same_bits(
        before in prop::collection::vec(1_usize..200, 0..40),
        after in prop::collection::vec(1_usize..200, 20),
    ) {
        let extended = (&[][..], &EXTENDED[..]);
        for changes in VARIANTS.into_iter().map(|of_axes| (of_axes, &[][..])).chain([extended]) {
            let parameters = parameters_with(changes.0, changes.1);
            let mut machine = Machine::new(parameters.clone());
            for &ticks in &before {
                bits_of_ticks(&mut machine, ticks);
            }
            let bytes = machine.state_bytes();
            let mut read = Machine::from_state_bytes(parameters, &bytes).expect("it is a state");
            prop_assert_eq!(read.state_bytes(), bytes);
            for &ticks in &after {
                let wanted = bits_of_ticks(&mut machine, ticks);
                prop_assert!(bits_of_ticks(&mut read, ticks) == wanted, "{:?}, tick {}", changes, machine.tick());
            }
        }
    }
}

#[test]
fn a_transfer_between_controllers_goes_on() {
    let (cascade, gpc) = (parameters(&[]), parameters(&["position_loop.controller=gpc"]));
    let mut machine = Machine::new(cascade);
    bits_of_ticks(&mut machine, 100 * 48);
    machine.update_parameters(gpc.clone()).expect("the same axes");
    bits_of_ticks(&mut machine, 48);
    let mut read = Machine::from_state_bytes(gpc, &machine.state_bytes()).expect("it is a state");
    for _ in 0..200 {
        assert_eq!(bits_of_ticks(&mut read, 31), bits_of_ticks(&mut machine, 31));
    }
}

#[test]
fn bytes_that_are_no_state_are_rejected() {
    let parameters_of_state = parameters(&[]);
    let mut machine = Machine::new(parameters_of_state.clone());
    bits_of_ticks(&mut machine, 1000);
    let bytes = machine.state_bytes();
    let read = |bytes: &[u8]| Machine::from_state_bytes(parameters_of_state.clone(), bytes);
    for length in (0..bytes.len()).step_by(61).chain([7, 8, 15, 16, 23, 24, bytes.len() - 1]) {
        let wanted = if length < 8 { StateError::Foreign(length) } else { StateError::Damaged(length) };
        assert_eq!(read(&bytes[..length]).err(), Some(wanted));
    }
    for position in (0..bytes.len()).step_by(37) {
        let mut changed = bytes.clone();
        changed[position] ^= 0x10;
        assert!(read(&changed).is_err(), "byte {position}");
    }
    let other = parameters(&["position_loop.gain=30"]);
    assert_eq!(Machine::from_state_bytes(other, &bytes).err(), Some(StateError::OtherParameters));
}
