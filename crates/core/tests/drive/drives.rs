//! Screw drive, linear motor, saturation and parameter changes.

use std::f64::consts::TAU;
use std::sync::Arc;

use virtual_axes_core::config::Parameters;
use virtual_axes_core::machine::{Machine, MachineParameters};
use virtual_axes_verification::fixtures::machines::{RestToRestProfile, assert_near, machine, parameters};

const X: usize = 0;
const Z: usize = 2;

/// Creates a machine with the default X axis only, with a screw or as the equivalent linear motor.
///
/// With r in m/rad, mass J/r² and force constant Kt/r describe the same drive at the axis.
fn single_axis(direct: bool) -> Machine {
    let r: f64 = 0.020 / TAU;
    let (transmission, motor, gain, torque) = if direct {
        (
            "direct: true".to_owned(),
            format!(
                "mass_kg: {}, force_constant_n_a: {}, emf_constant_v_s_m: {}, max_speed_m_min: 40.0",
                0.028 / (r * r),
                2.64 / r,
                0.88 / r
            ),
            5.0 / (r * r),
            format!("torque_kg: {}", 0.002034 / (r * r)),
        )
    } else {
        (
            "screw_lead_mm: 20.0".to_owned(),
            "inertia_kg_m2: 0.028, torque_constant_nm_a: 2.64, emf_constant_v_s_rad: 0.88, \
             max_speed_rpm: 2000.0"
                .to_owned(),
            5.0,
            "torque_kg_m2: 0.002034".to_owned(),
        )
    };
    let yaml = format!(
        "/**:
  ros__parameters:
    machine: one axis
    joints: [x]
    periods: {{position_ms: 6.0, velocity_us: 250.0, current_us: 125.0}}
    x:
      type: linear
      transmission: {{{transmission}}}
      motor: {{{motor}, resistance_ohm: 0.46, inductance_mh: 8.5, max_current_a: 54.0, max_voltage_v: 245.0}}
      friction: {{a: 1.576, b: 0.01965, c: -0.5332, d: -0.2801, i0: 1.043}}
      gravity: {{weight_n: 150.0}}
      position_loop: {{controller: cascade, gain: 1.5}}
      velocity_loop: {{gain: {gain}, integral_time_ms: 4.0}}
      current_loop: {{gain: 13.0, integral_time_ms: 2.0}}
      feedforward: {{velocity: 1.0, {torque}}}
      delays: {{alpha_ms: 9.0, beta_ms: 9.0, gamma_ms: 9.0}}
      limits: {{velocity_m_min: 30.0, acceleration_m_s2: 2.5, jerk_m_s3: 50.0}}
"
    );
    let config = Parameters::from_yaml(&yaml, "test").and_then(|p| p.machine_config()).expect("valid");
    Machine::new(Arc::new(MachineParameters::new(&config).expect("can be discretized")))
}

#[test]
fn linear_motor_equals_the_equivalent_screw_drive() {
    let profile = RestToRestProfile::new(0.2, 10.0 / 60.0, 2.5, 50.0);
    let (mut screw, mut linear) = (single_axis(false), single_axis(true));
    let mut largest: f64 = 0.0;
    for k in 0..300 {
        let psec = [profile.at(f64::from(k) * 0.006)];
        screw.advance(&psec, &[]);
        linear.advance(&psec, &[]);
        let (s, l) = (screw.axis(0).sample(), linear.axis(0).sample());
        largest = largest.max(s.current.abs());
        assert!((s.position - l.position).abs() < 1e-10, "instant {k}: {} and {}", s.position, l.position);
        assert!((s.current - l.current).abs() < 1e-7, "instant {k}: {} A and {} A", s.current, l.current);
        assert!((s.effort - l.effort).abs() < 1e-4, "instant {k}: {} N and {} N", s.effort, l.effort);
    }
    assert!(largest > 5.0, "the axis did not move");
}

#[test]
fn cascade_recovers_from_saturation_by_a_step_of_100_mm() {
    let mut m = machine(&[]);
    let mut saturated = 0;
    for _ in 0..500 {
        m.advance_with(&[0.1, 0.0, 0.0, 0.0, 0.0], &[], |m| {
            let s = m.axis(X).sample();
            assert!(s.current_setpoint.abs() <= 54.0 && s.voltage.abs() <= 245.0, "{s:?}");
            assert!(s.velocity_setpoint.abs() <= 2000.0 * TAU / 60.0, "{s:?}");
            saturated += usize::from(s.saturated);
        });
    }
    assert!(saturated > 10, "the step is too small");
    // Anti-windup: the axis comes to rest at the setpoint.
    assert_near("position, m", m.axis(X).sample().position, 0.1, 2e-6);
    assert_near("velocity, m/s", m.axis(X).sample().velocity, 0.0, 1e-9);
}

#[test]
fn cascade_recovers_from_a_load_that_saturates_the_current() {
    let mut m = machine(&[]);
    let rest = [0.0; 5];
    // 54 A hold 45 kN at X: a larger load moves the axis.
    m.set_load(X, 60e3);
    for _ in 0..3 {
        m.advance(&rest, &[]);
    }
    assert!(m.axis(X).sample().saturated && m.axis(X).sample().position > 1e-4);
    m.set_load(X, 0.0);
    for _ in 0..500 {
        m.advance(&rest, &[]);
    }
    assert_near("position, m", m.axis(X).sample().position, 0.0, 2e-6);
}

#[test]
fn an_offset_of_the_velocity_setpoint_moves_an_axis_at_rest_by_offset_over_gain() {
    let mut m = machine(&[]);
    m.set_velocity_offset(X, 0.5);
    for _ in 0..1000 {
        m.advance(&[0.0; 5], &[]);
    }
    // At rest 0 = offset − K θ, with K = 1.5 m/min/mm = 25 1/s. 1 µrad is a hundredth of the position error that
    // friction holds.
    assert_near("angle, rad", m.axis(X).sample().position * TAU / 0.020, 0.5 / 25.0, 1e-6);
    assert!(m.axis(Z).sample().position.abs() < 1e-15);
    m.set_velocity_offset(X, 1e6);
    m.advance(&[0.0; 5], &[]);
    assert_near("speed limit, rad/s", m.axis(X).sample().velocity_setpoint, 2000.0 * TAU / 60.0, 1e-9);
    m.reset(&[0.0; 5]);
    m.advance(&[0.0; 5], &[]);
    assert_near("Ω* after a reset, rad/s", m.axis(X).sample().velocity_setpoint, 0.0, 1e-12);
}

#[test]
fn vertical_axis_stays_at_rest_under_gravity() {
    let mut m = machine(&[]);
    for _ in 0..1000 {
        m.advance(&[0.0; 5], &[]);
    }
    for axis in m.axes() {
        assert!(axis.sample().position.abs() < 1e-15, "{:?}", axis.sample());
        assert_eq!(axis.sample().velocity, 0.0);
    }
    assert_near("Z current, A", m.axis(Z).sample().current, 400.0 * 0.020 / TAU / 2.64, 1e-9);
}

#[test]
fn changing_gains_at_rest_causes_no_motion() {
    let mut m = machine(&[]);
    for _ in 0..10 {
        m.advance(&[0.0; 5], &[]);
    }
    let changes = [("z.velocity_loop.gain", 3.0), ("z.position_loop.gain", 1.0), ("z.delays.alpha_ms", 40.0)];
    let config = parameters(&changes).machine_config().expect("valid");
    m.update_parameters(Arc::new(MachineParameters::new(&config).expect("can be discretized")))
        .expect("same machine");
    for _ in 0..100 {
        m.advance(&[0.0; 5], &[]);
    }
    assert!(m.axis(Z).sample().position.abs() < 1e-15);
}

#[test]
fn parameters_with_other_periods_are_rejected() {
    let mut m = machine(&[]);
    let other = single_axis(false);
    let before = m.clone();
    let config = parameters(&[("periods.position_ms", 3.0)]).machine_config().expect("valid");
    let parameters = Arc::new(MachineParameters::new(&config).expect("can be discretized"));
    assert!(m.update_parameters(parameters).is_err());
    assert_eq!(m, before);
    assert_eq!(other.axis_count(), 1);
}
