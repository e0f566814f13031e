//! Energy of the axes: balance of electrical and mechanical side, and closed forms.

use std::f64::consts::TAU;
use std::sync::Arc;

use virtual_axes_core::config::MachineConfig;
use virtual_axes_core::drive::Plant;
use virtual_axes_core::machine::{Machine, MachineParameters};
use virtual_axes_core::trial::{AxisEnergy, Figures};
use virtual_axes_verification::fixtures::machines::{AXES, configured, trace_scenario};

/// Values of an axis at a tick: position at the motor, speed, and the torques over the tick before, rad, rad/s, N·m.
#[derive(Clone, Copy, Default)]
struct Mechanics {
    angle: f64,
    speed: f64,
    torque: f64,
}

/// Returns the figures of a scenario and the mechanical work of each axis, J: the change of its kinetic energy and the work
/// of the torques against it, of which each is held over a tick.
fn works(scenario: &str, config: &MachineConfig) -> (Figures, Vec<f64>) {
    let motors: Vec<_> = config.axes().iter().map(Plant::deviating_motor).collect();
    let count = motors.len();
    let (mut last, mut work) = (vec![None::<Mechanics>; count], vec![0.0; count]);
    let mut end = vec![Mechanics::default(); count];
    let mut add = |axis: usize, now: Mechanics| {
        let inertia = motors[axis].inertia;
        if let Some(before) = last[axis].replace(now) {
            let kinetic = 0.5 * inertia * (now.speed + before.speed) * (now.speed - before.speed);
            work[axis] += kinetic + now.torque * (now.angle - before.angle);
        }
    };
    let figures = trace_scenario(scenario, config, |tick| {
        for (axis, motor) in motors.iter().enumerate() {
            let ratio = config.axes()[axis].transmission_ratio;
            let mechanics = |position: f64, velocity: f64, currents: [f64; 3]| Mechanics {
                angle: position / ratio,
                speed: velocity / ratio,
                torque: motor.torque_constant * currents.iter().sum::<f64>(),
            };
            let s = tick.machine.axis(axis).sample();
            add(
                axis,
                mechanics(s.position, s.velocity, [s.friction_current, s.gravity_current, s.load_current]),
            );
            let s = tick.machine.sample_at_end(axis);
            let [position, velocity, _] = tick.machine.motion_at_end(axis);
            let currents = [s.friction_current, s.gravity_current, s.load_current];
            end[axis] = mechanics(position, velocity, currents);
        }
    });
    (0..count).for_each(|axis| add(axis, end[axis]));
    (figures, work)
}

fn energy(figures: &Figures, axis: usize) -> AxisEnergy {
    figures.axes[axis].energy.expect("it is evaluated")
}

#[test]
fn electrical_input_is_copper_loss_mechanical_work_and_stored_energy() {
    let mut largest = 0.0_f64;
    let all = ["ballbar", "corner-90", "five-axis"];
    // The linear motors have no travel for the ballbar.
    for (machine, scenarios) in [("mikron_ucp710", &all[..]), ("linear_motor_center", &all[1..2])] {
        for controller in ["cascade", "gpc"] {
            let config = configured(machine, &[&format!("position_loop.controller={controller}")]);
            for scenario in scenarios {
                let (figures, works) = works(scenario, &config);
                for (axis, work) in works.iter().enumerate() {
                    let found = energy(&figures, axis);
                    let size = found.input + 2.0 * found.returned + found.copper_loss;
                    let imbalance = found.input - found.copper_loss - work - found.magnetic;
                    assert!(
                        imbalance.abs() <= 1e-9 * size,
                        "{machine}, {controller}, {scenario}, axis {axis}: {imbalance} J of {size} J"
                    );
                    assert!(size == 0.0 || (found.mechanical_work - work).abs() <= 1e-9 * size);
                    largest = largest.max(size);
                }
            }
        }
    }
    assert!(largest > 100.0, "{largest} J");
}

#[test]
fn the_dc_link_balances_the_axes() {
    let config = configured("mikron_ucp710", &[]);
    let (figures, _) = works("ballbar", &config);
    let link = figures.dc_link.expect("it is evaluated");
    let energies: Vec<AxisEnergy> = (0..AXES).map(|axis| energy(&figures, axis)).collect();
    let input: f64 = energies.iter().map(|energy| energy.input).sum();
    let returned: f64 = energies.iter().map(|energy| energy.returned).sum();
    assert!((link.drawn - link.returned - input).abs() < 1e-9 * link.drawn);
    // What one axis feeds back, another one uses.
    assert!(link.returned < returned, "{} J of {returned} J", link.returned);
    assert!(link.peak_power <= energies.iter().map(|energy| energy.peak_power).sum());
    assert!(link.peak_power >= input / figures.duration);
}

/// At constant velocity the current is that of friction: P = n R i² + Kt i ω, with n = Kt/Ke = 3 phases.
#[test]
fn constant_velocity_under_friction_draws_the_power_of_the_friction_current() {
    let config = configured("mikron_ucp710", &[]);
    let mut machine = Machine::new(Arc::new(MachineParameters::new(&config).expect("valid")));
    machine.record_every_tick(true);
    // 10 m/min.
    let (velocity, period) = (10.0 / 60.0, 6e-3);
    for k in 0..200 {
        let psec = [-0.1 + velocity * period * f64::from(k), 0.0, 0.0, 0.0, 0.0];
        if k == 0 {
            machine.reset(&psec);
        }
        machine.advance(&psec, &[]);
    }
    let mut ticks = [0.0; 48];
    let found = machine.cycle_energy(0, &mut ticks);
    let friction = 1.576 * (0.01965_f64 * 10.0).exp() - 0.5332 * (-0.2801_f64 * 10.0).exp();
    let speed = velocity / 0.02 * TAU;
    let copper = 3.0 * 0.46 * friction * friction;
    let power = copper + 2.64 * friction * speed;
    assert!((found.copper_loss / (copper * period) - 1.0).abs() < 1e-6, "{found:?}");
    assert!((found.input / (power * period) - 1.0).abs() < 1e-6, "{found:?}");
    assert!((found.peak_power / power - 1.0).abs() < 1e-6 && found.returned == 0.0);
    assert!((ticks.iter().sum::<f64>() / found.input - 1.0).abs() < 1e-12);
}

/// Z holds 400 N by the current W r/Kt, with the loss n R i² and no other input.
#[test]
fn an_axis_at_rest_under_gravity_draws_its_copper_loss() {
    let config = configured("mikron_ucp710", &[]);
    let (figures, _) = works("ballbar", &config);
    let found = energy(&figures, 2);
    let current = 400.0 * (0.02 / TAU) / 2.64;
    let power = 3.0 * 0.46 * current * current;
    let holding = found.holding_power.expect("it rests");
    assert!((holding / power - 1.0).abs() < 1e-9, "{holding} W of {power} W");
    assert!((found.input / (power * figures.duration) - 1.0).abs() < 1e-9, "{found:?}");
    assert!((found.peak_power / power - 1.0).abs() < 1e-9 && found.returned == 0.0);
    assert!(found.mechanical_work.abs() < 1e-9 * found.input && !figures.axes[2].moves);
    // X moves, and has no gravity: at rest friction may keep a current, at most that of standstill.
    let most = 3.0 * 0.46 * 1.043 * 1.043;
    assert!(energy(&figures, 0).holding_power.is_some_and(|power| power < most));
}

#[test]
fn without_friction_the_mechanical_work_of_a_move_between_rests_returns() {
    let none = ["friction.a=0", "friction.c=0", "friction.i0=0"];
    let (figures, _) = works("corner-90", &configured("mikron_ucp710", &none));
    for axis in [0, 1] {
        let found = energy(&figures, axis);
        let flow = found.input + 2.0 * found.returned;
        assert!(found.mechanical_work.abs() < 1e-9 * flow, "{found:?}");
        assert!(
            (found.input / found.copper_loss - 1.0).abs() < 1e-6 && found.returned > 0.3 * found.copper_loss
        );
    }
    let (with_friction, _) = works("corner-90", &configured("mikron_ucp710", &[]));
    assert!(energy(&with_friction, 0).mechanical_work > 1.0);
}
