//! Elastic transmission against two masses with a spring and a damper in MuJoCo.
//!
//! `tools/golden_bodies.py` computes the reference data.

use virtual_axes_core::config::{MotorConfig, TransmissionConfig};
use virtual_axes_core::drive::{LoadState, Motor, MotorState, Transmission};

use crate::parameter_ranges::golden;

const TICK: f64 = 125e-6;
const TICKS_PER_INTERVAL: usize = 20;

/// Motor whose current stays at its setpoint: without back-EMF, under the voltage `R i`.
const MOTOR: MotorConfig = MotorConfig {
    inertia: 0.016 + 0.012,
    torque_constant: 1.0,
    emf_constant: 0.0,
    resistance: 0.5,
    inductance: 8e-3,
    max_current: 1.0,
    max_voltage: 1.0,
    max_speed: 1.0,
};
const ELASTIC: TransmissionConfig = TransmissionConfig {
    stiffness: 2000.0,
    damping: 0.15,
    load_inertia: 0.012,
    backlash: 0.0,
    load_friction: 0.0,
    structure: None,
};

/// Returns angle, speed, wind-up and speed of the load after an interval under torques at the motor and at the load.
fn after_interval(
    (motor, transmission): &(Motor, Transmission),
    [angle, speed, wind_up, load_speed]: [f64; 4],
    [torque, load_torque]: [f64; 2],
) -> [f64; 4] {
    let mut s = MotorState { current: torque / MOTOR.torque_constant, speed, angle };
    let mut load = LoadState { wind_up, speed: load_speed };
    for _ in 0..TICKS_PER_INTERVAL {
        let voltage = MOTOR.resistance * s.current;
        (s, load) = transmission.step(motor, &s, &load, voltage, load_torque);
    }
    [s.angle, s.speed, load.wind_up, load.speed]
}

/// Returns the largest difference from MuJoCo with a number of steps in a tick, relative to the largest value of each state.
fn error_of_run(order: f64, steps: f64) -> f64 {
    let drive = Transmission::new(&MOTOR, &ELASTIC, TICK).expect("can be discretized");
    let (mut state, mut scale, mut error) = ([0.0; 4], [0.0_f64; 4], [0.0_f64; 4]);
    let rows = golden("two_masses.csv");
    let mut rows = rows.iter().filter(|row| row[..2] == [order, steps]).peekable();
    assert!(rows.peek().is_some(), "no run of order {order} with {steps} steps");
    for row in rows {
        state = after_interval(&drive, state, [row[2], row[3]]);
        for (k, wanted) in row[4..].iter().enumerate() {
            error[k] = error[k].max((state[k] - wanted).abs());
            scale[k] = scale[k].max(wanted.abs());
        }
    }
    error.iter().zip(scale).map(|(error, scale)| error / scale).fold(0.0, f64::max)
}

#[test]
fn an_elastic_axis_is_the_limit_of_mujoco_with_small_steps() {
    for (order, steps, bound) in [(1.0, [16.0, 32.0, 64.0], 1e-3), (4.0, [1.0, 2.0, 4.0], 2e-8)] {
        let errors = steps.map(|steps| error_of_run(order, steps));
        println!("order {order}, {steps:?} steps in a tick: relative errors {errors:?}");
        for pair in errors.windows(2) {
            let found = (pair[0] / pair[1]).log2();
            assert!((found - order).abs() < 0.05, "order {found} of the errors {errors:?}, wanted {order}");
        }
        assert!(errors[2] < bound, "{errors:?}");
    }
}
