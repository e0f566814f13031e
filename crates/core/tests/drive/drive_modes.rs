//! Modes of a drive: velocity control, controlled stop, coasting and short circuit against closed forms.

use std::f64::consts::TAU;
use std::sync::Arc;

use virtual_axes_core::machine::{DriveMode, Machine, MachineParameters};
use virtual_axes_verification::fixtures::machines::{TSP, assert_near, configured_with, machine};

const X: usize = 0;
/// Meters per radian of the motor of X.
const RATIO: f64 = 0.020 / TAU;

/// Returns a machine whose X has no friction, at a velocity, m/s.
fn moving(velocity: f64) -> Machine {
    let free = ["x.friction.a=0", "x.friction.c=0", "x.friction.i0=0"];
    let config = configured_with("mikron_ucp710", &[], &free);
    let mut m = Machine::new(Arc::new(MachineParameters::new(&config).expect("can be discretized")));
    m.set_drive_mode(X, DriveMode::Velocity);
    m.set_velocity(X, velocity);
    advance(&mut m, 300);
    assert_near("velocity, m/s", m.motion_at_end(X)[1], velocity, 1e-9);
    m
}

fn advance(m: &mut Machine, cycles: usize) {
    (0..cycles).for_each(|_| m.advance(&[0.0; 5], &[]));
}

/// Returns i and ω of a motor with short-circuited windings, from ω with i = 0, by the eigenvalues of Prévost eq. 1.
fn short_circuited(speed: f64, time: f64) -> [f64; 2] {
    let [inertia, kt, ke, resistance, inductance] = [0.028, 2.64, 0.88, 0.46, 8.5e-3];
    let (half, stiffness) = (resistance / inductance / 2.0, kt * ke / (inertia * inductance));
    let frequency: f64 = f64::sqrt(stiffness - half * half);
    let decay = (-half * time).exp();
    let (sin, cos) = (frequency * time).sin_cos();
    [-ke / inductance * speed * decay * sin / frequency, speed * decay * (cos + half / frequency * sin)]
}

#[test]
fn short_circuited_windings_brake_as_the_closed_form() {
    let mut m = moving(0.1);
    m.set_drive_mode(X, DriveMode::ShortCircuit);
    for cycle in 1..=10 {
        advance(&mut m, 1);
        let [current, speed] = short_circuited(0.1 / RATIO, f64::from(cycle) * TSP);
        let [_, velocity, found] = m.motion_at_end(X);
        assert_near("velocity, m/s", velocity, speed * RATIO, 1e-9);
        assert_near("current, A", found, current, 1e-6);
        assert!(!m.axis(X).sample().saturated);
    }
}

#[test]
fn a_coasting_axis_without_friction_keeps_its_velocity_and_one_with_friction_stops() {
    let mut m = moving(0.1);
    m.set_drive_mode(X, DriveMode::Coast);
    advance(&mut m, 100);
    let [_, velocity, current] = m.motion_at_end(X);
    assert_near("velocity, m/s", velocity, 0.1, 1e-9);
    assert_near("current, A", current, 0.0, 1e-9);

    let mut m = machine(&[]);
    m.set_drive_mode(X, DriveMode::Coast);
    m.set_load(X, 5000.0);
    advance(&mut m, 20);
    let [_, velocity, _] = m.motion_at_end(X);
    // F − Kt i_f / r over J / r²: between the friction at standstill, 1.043 A, and 1.576 A at any speed.
    let [least, most] = [1.576, 1.043].map(|i| (5000.0 * RATIO - 2.64 * i) * RATIO / 0.028 * 20.0 * TSP);
    assert!((least..=most).contains(&velocity), "{velocity} m/s, {least} to {most} m/s");
    m.set_load(X, 0.0);
    advance(&mut m, 1000);
    assert_eq!(m.motion_at_end(X)[1], 0.0);
}

#[test]
fn a_controlled_stop_brakes_within_the_current_limit_and_holds_a_vertical_axis() {
    const Z: usize = 2;
    let mut m = machine(&[]);
    m.set_drive_mode(Z, DriveMode::Velocity);
    m.set_velocity(Z, 0.3);
    advance(&mut m, 200);
    m.set_velocity(Z, 0.0);
    let mut largest: f64 = 0.0;
    for _ in 0..200 {
        advance(&mut m, 1);
        largest = largest.max(m.activity(Z).peak_current);
    }
    let at = m.motion_at_end(Z);
    advance(&mut m, 500);
    assert_eq!(m.motion_at_end(Z)[1], 0.0);
    assert_near("position, m", m.motion_at_end(Z)[0], at[0], 1e-6);
    assert!(largest > 20.0, "{largest} A");
}

#[test]
fn an_axis_that_is_switched_on_follows_its_setpoints_again() {
    for mode in [DriveMode::Coast, DriveMode::ShortCircuit] {
        let mut m = moving(0.05);
        m.set_drive_mode(X, mode);
        m.set_velocity(X, 0.0);
        for _ in 0..400 {
            let at = m.motion_at_end(X)[0];
            m.advance(&[at, 0.0, 0.0, 0.0, 0.0], &[]);
        }
        let at = m.motion_at_end(X)[0];
        m.set_drive_mode(X, DriveMode::Position);
        for _ in 0..400 {
            m.advance(&[at, 0.0, 0.0, 0.0, 0.0], &[]);
        }
        assert_eq!(m.axis(X).mode(), DriveMode::Position);
        assert_near("position, m", m.motion_at_end(X)[0], at, 1e-6);
    }
}

#[test]
fn a_state_within_a_mode_goes_on_with_the_same_bits_and_a_reset_ends_the_mode() {
    for mode in DriveMode::ALL {
        let mut m = machine(&[]);
        m.set_drive_mode(X, DriveMode::Velocity);
        m.set_velocity(X, 0.1);
        advance(&mut m, 20);
        m.set_drive_mode(X, mode);
        m.advance_ticks(70, &[0.0; 5], &[]);
        let parameters = MachineParameters::new(&configured_with("mikron_ucp710", &[], &[])).expect("valid");
        let mut copy = Machine::from_state_bytes(Arc::new(parameters), &m.state_bytes()).expect("a state");
        for _ in 0..50 {
            m.advance_ticks(70, &[0.0; 5], &[]);
            copy.advance_ticks(70, &[0.0; 5], &[]);
            assert_eq!(
                m.motion_at_end(X).map(f64::to_bits),
                copy.motion_at_end(X).map(f64::to_bits),
                "{mode:?}"
            );
        }
        m.reset(&[0.0; 5]);
        let mut fresh = machine(&[]);
        for k in 0..200 {
            let psec = [1e-5 * f64::from(k), 0.0, 0.0, 0.0, 0.0];
            m.advance(&psec, &[]);
            fresh.advance(&psec, &[]);
            assert_eq!(
                m.motion_at_end(X).map(f64::to_bits),
                fresh.motion_at_end(X).map(f64::to_bits),
                "{mode:?}"
            );
        }
    }
}
