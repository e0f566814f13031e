//! Backlash, friction at the load and vibration of the structure: exact solutions, energy, closed forms, and machines.

use std::sync::Arc;

use virtual_axes_core::config::{AxisConfig, MotorConfig, StructureConfig, TransmissionConfig};
use virtual_axes_core::drive::{ContactState, EventDrivenTransmission, LoadState, MotorState, Plant};
use virtual_axes_core::machine::{Machine, MachineParameters, SimdWidth, closed_loop_response};
use virtual_axes_verification::fixtures::machines::AXES;

use crate::bits::{assert_bits_of_every_width_and_part, bits, psec};
use crate::parameter_ranges::golden;
use crate::transmission::{ELASTIC_X, FRICTIONLESS, X, machine};

pub(crate) const TICK: f64 = 125e-6;
/// Gap of 10 µm on X, with all friction at the table.
const BACKLASH_X: [&str; 2] = ["x.transmission.backlash_um=10", "x.transmission.load_friction=1"];

/// State of a plant.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct DriveStates {
    pub(crate) motor: MotorState,
    pub(crate) load: LoadState,
    pub(crate) contact: ContactState,
}

impl DriveStates {
    pub(crate) fn step(&mut self, transmission: &EventDrivenTransmission, voltage: f64, torque: f64) -> f64 {
        transmission.step(&mut self.motor, &mut self.load, &mut self.contact, voltage, torque)
    }
}

/// Returns an axis without friction with a transmission and a motor, in units of the motor.
fn frictionless_axis(motor: MotorConfig, transmission: TransmissionConfig) -> AxisConfig {
    let mut axis = machine(&FRICTIONLESS).axes()[X].clone();
    axis.motor = MotorConfig { max_current: 1.0, max_voltage: 1.0, max_speed: 1.0, ..motor };
    axis.transmission = Some(transmission);
    axis
}

/// Case of the table of exact solutions.
struct Case {
    axis: AxisConfig,
    voltage: f64,
    torque: f64,
    mean_torque: f64,
}

impl Case {
    fn new(row: &[f64]) -> Self {
        let motor = MotorConfig {
            inductance: row[0],
            resistance: row[1],
            torque_constant: row[2],
            emf_constant: row[3],
            inertia: row[4] + row[7],
            max_current: 1.0,
            max_voltage: 1.0,
            max_speed: 1.0,
        };
        let structure = StructureConfig {
            inertia: row[9],
            frequency: row[10],
            damping_ratio: row[11],
            carries_motor: row[12] > 0.0,
        };
        let transmission = TransmissionConfig {
            stiffness: row[5],
            damping: row[6],
            load_inertia: row[7],
            backlash: row[8],
            load_friction: 0.0,
            structure: (row[9] > 0.0).then_some(structure),
        };
        Case {
            axis: frictionless_axis(motor, transmission),
            voltage: row[13],
            torque: row[14],
            mean_torque: row[15],
        }
    }
}

#[test]
fn steps_are_the_exact_solution_from_event_to_event() {
    let cases: Vec<Case> = golden("backlash_cases.csv").iter().map(|row| Case::new(row)).collect();
    let rows = golden("backlash.csv");
    for (number, case) in cases.iter().enumerate() {
        let transmission = EventDrivenTransmission::new(&case.axis, TICK)
            .expect("can be discretized")
            .expect("has backlash");
        let mut states = DriveStates::default();
        let (mut tick, mut worst, mut count, mut sides) = (0, 0.0_f64, 0, 0);
        for row in rows.iter().filter(|row| row[0] == number as f64) {
            while f64::from(tick) < row[1] {
                let torque = case.torque.mul_add((0.031 * f64::from(tick)).sin(), case.mean_torque);
                let side = states.contact.side;
                states.step(&transmission, case.voltage * (0.02 * f64::from(tick)).sin(), torque);
                sides += usize::from(side != states.contact.side);
                tick += 1;
            }
            // A revolution of the ball screw of X is 20 mm; the linear motor of the last case has meters.
            let meters = if case.axis.motor.inertia > 1.0 { 1.0 } else { 0.02 / std::f64::consts::TAU };
            let angle = (states.motor.angle - row[6]).abs() * meters;
            let load = (states.motor.angle - states.load.wind_up - (row[6] - row[4])).abs() * meters;
            worst = worst.max(angle).max(load);
            assert!(angle < 1e-9 && load < 1e-9, "case {number}, tick {tick}: {angle:e} m, {load:e} m");
            assert!((states.motor.current - row[2]).abs() < 1e-6, "case {number}, tick {tick}");
            count += 1;
        }
        println!("case {number}: {count} rows, {sides} changes of the contact, largest error {worst:.1e} m");
        assert!(count == 79 && sides > 10);
    }
}

#[test]
fn friction_at_the_load_only_changes_the_place_of_friction() {
    // Almost no friction at the load: the axis of the other method.
    let elastic = machine(&ELASTIC_X);
    let shared = machine(&[&ELASTIC_X[..], &["x.transmission.load_friction=1e-12"]].concat());
    let [mut one, mut other] = [&elastic, &shared]
        .map(|config| Machine::new(Arc::new(MachineParameters::new(config).expect("can be discretized"))));
    for k in 0..400 {
        one.advance(&psec(k), &[]);
        other.advance(&psec(k), &[]);
        let difference = one.axis(X).sample().position - other.axis(X).sample().position;
        // The methods differ by rounding; a hold of friction can begin a tick later.
        assert!(difference.abs() < 1e-9, "cycle {k}: {difference:e}");
    }
}

#[test]
fn bits_are_those_of_every_width_and_of_every_part_of_a_cycle() {
    let structure = ["a.structure.frequency_hz=40", "a.structure.inertia_kg_m2=500"];
    let elastic_a = ["a.transmission.stiffness_nm_rad=2e6", "a.transmission.load_inertia_kg_m2=12"];
    let config = machine(&[&ELASTIC_X[..], &BACKLASH_X, &elastic_a, &structure].concat());
    assert_bits_of_every_width_and_part(&config);
    // Axes without any of it keep their bits.
    let rigid = machine(&[]);
    for axis in [1, 2, 4] {
        assert!(
            bits(&config, axis, SimdWidth::Widest, &[48]) == bits(&rigid, axis, SimdWidth::Widest, &[48]),
            "axis {axis}"
        );
    }
}

/// Runs X slowly forth and back; returns position of the motor and of the load at the end of both ways at the same
/// setpoint, m.
fn slow_reversal(changes: &[&str]) -> [[f64; 2]; 2] {
    let none = ["x.feedforward.velocity=0", "x.feedforward.torque_kg_m2=0", "x.delays.alpha_ms=0"];
    let config = machine(&[&ELASTIC_X[..], &none, changes].concat());
    let mut machine = Machine::new(Arc::new(MachineParameters::new(&config).expect("can be discretized")));
    // 1 mm/s: forth over 2 mm, back over 1 mm.
    let (cycles, step) = (334, 6e-6);
    let mut ends = Vec::new();
    for k in 0..cycles + cycles / 2 {
        let distance = if k <= cycles { k } else { 2 * cycles - k };
        machine.advance(&[f64::from(distance) * step, 0.0, 0.0, 0.0, 0.0], &[]);
        if k == cycles / 2 || k + 1 == cycles + cycles / 2 {
            let s = machine.axis(X).sample();
            ends.push([s.position + s.wind_up, s.position]);
        }
    }
    [ends[0], ends[1]]
}

/// Lost motion of the load against the motor: the gap and the twist by the friction at the load, in both directions.
#[test]
fn lost_motion_is_the_gap_and_the_twist_by_friction_at_the_load() {
    for (gap, share) in [(0.0, 1.0), (10.0, 1.0), (10.0, 0.5), (25.0, 0.0)] {
        let changes = [
            format!("x.transmission.backlash_um={gap}"),
            format!("x.transmission.load_friction={share}"),
            // Constant friction of 3 A.
            "x.friction.a=3".to_owned(),
            "x.friction.b=0".to_owned(),
            "x.friction.c=0".to_owned(),
            "x.friction.i0=3".to_owned(),
        ];
        let changes = changes.each_ref().map(String::as_str);
        let [forth, back] = slow_reversal(&changes);
        let lost = (forth[0] - forth[1]) - (back[0] - back[1]);
        let config = machine(&[&ELASTIC_X[..], &changes].concat());
        let axis = &config.axes()[X];
        let force = 3.0 * axis.motor.torque_constant / axis.transmission_ratio;
        let wanted = gap * 1e-6 + 2.0 * share * force / 200e6;
        if share > 0.0 {
            assert!((lost - wanted).abs() < 2e-8, "gap {gap}, share {share}: {lost:e}, not {wanted:e}");
        } else {
            // Nothing keeps a load without friction at a side.
            assert!(lost.abs() < wanted + 1e-8, "{lost:e}");
        }
    }
}

#[test]
fn compensation_removes_the_gap_from_the_error_of_the_load() {
    let friction = ["x.friction.a=0.5", "x.friction.b=0", "x.friction.c=0", "x.friction.i0=0.5"];
    let base = [&BACKLASH_X[..], &friction].concat();
    let config = machine(&[&ELASTIC_X[..], &base].concat());
    let axis = &config.axes()[X];
    let lost = 10e-6 + 2.0 * 0.5 * axis.motor.torque_constant / axis.transmission_ratio / 200e6;
    let error = |changes: &[&str]| {
        let [forth, back] = slow_reversal(&[&base[..], changes].concat());
        let motor = forth[0] - back[0];
        let load = forth[1] - back[1];
        (motor, load)
    };
    let (motor, load) = error(&[]);
    let (compensated_motor, compensated_load) = error(&["x.backlash_compensation.width_um=10"]);
    assert!((motor - load - lost).abs() < 1e-8, "{motor:e}, {load:e}, {lost:e}");
    // The motor is shifted by the width, so that the load has the positions that the motor had.
    assert!((compensated_motor - motor - 10e-6).abs() < 1e-9, "{compensated_motor:e}, {motor:e}");
    assert!((compensated_load - load - 10e-6).abs() < 1e-9, "{compensated_load:e}, {load:e}");
}

#[test]
fn compensation_moves_at_its_velocity() {
    let none = ["x.feedforward.velocity=0", "x.delays.alpha_ms=0"];
    let velocity = ["x.backlash_compensation.width_um=40", "x.backlash_compensation.velocity_m_min=0.05"];
    let config = machine(&[&none[..], &velocity].concat());
    let plain = machine(&none);
    let [mut compensated, mut plain] = [&config, &plain]
        .map(|config| Machine::new(Arc::new(MachineParameters::new(config).expect("can be discretized"))));
    let gain = config.axes()[X].position_loop.gain;
    let ratio = config.axes()[X].transmission_ratio;
    // At the first motion the offset goes to 20 µm, at 5 µm a cycle.
    let psec = [1e-3, 0.0, 0.0, 0.0, 0.0];
    for machine in [&mut compensated, &mut plain] {
        machine.advance(&[0.0; AXES], &[]);
        machine.advance(&psec, &[]);
    }
    let difference =
        compensated.axis(X).sample().velocity_setpoint - plain.axis(X).sample().velocity_setpoint;
    assert!((difference * ratio / gain - 5e-6).abs() < 1e-12, "{}", difference * ratio / gain);
}

#[test]
fn gravity_keeps_a_vertical_axis_at_one_side() {
    let z = [
        "z.transmission.stiffness_n_um=50",
        "z.transmission.load_mass_kg=300",
        "z.gravity.weight_n=2000",
        "z.transmission.backlash_um=8",
    ];
    let config = machine(&z);
    let mut machine = Machine::new(Arc::new(MachineParameters::new(&config).expect("can be discretized")));
    let wanted = -2000.0 / 50e6 - 4e-6;
    assert!((machine.axis(2).sample().position - wanted).abs() < 1e-15);
    for _ in 0..300 {
        machine.advance(&[0.0; AXES], &[]);
        let s = machine.axis(2).sample();
        assert!((s.position - wanted).abs() < 1e-10, "{}", s.position);
    }
}

#[test]
fn a_vertical_axis_on_a_structure_stays_at_rest() {
    let z = [
        "z.transmission.stiffness_n_um=50",
        "z.transmission.load_mass_kg=300",
        "z.gravity.weight_n=2000",
        "z.structure.frequency_hz=20",
        "z.structure.mass_kg=3000",
    ];
    let displacement = 2000.0 / (3000.0 * (20.0 * std::f64::consts::TAU).powi(2));
    for (feedback, wanted) in [("motor", -2000.0 / 50e6 - displacement), ("load", -displacement)] {
        let feedback = format!("z.position_loop.feedback={feedback}");
        let config = machine(&[&z[..], &[&feedback]].concat());
        let mut machine =
            Machine::new(Arc::new(MachineParameters::new(&config).expect("can be discretized")));
        for _ in 0..300 {
            let position = machine.motion_at_end(2)[0];
            assert!((position - wanted).abs() < 1e-12, "{feedback}: {position:e}, not {wanted:e}");
            machine.advance(&[0.0; AXES], &[]);
        }
    }
}

/// The closed loop for learning is that of an axis in contact.
#[test]
fn the_closed_loop_leaves_out_the_gap() {
    let elastic = machine(&ELASTIC_X);
    let gap = machine(&[&ELASTIC_X[..], &BACKLASH_X, &["x.backlash_compensation.width_um=10"]].concat());
    let [wanted, found] = [elastic, gap]
        .map(|config| closed_loop_response(&config.axes()[X], &config.periods()).expect("settles"));
    assert_eq!(found, wanted);
}

/// Static deflection of the structure under a force at the load: the scale of the axis does not see it.
#[test]
fn a_force_displaces_the_structure_unseen_by_the_scale() {
    let structure =
        ["x.structure.frequency_hz=50", "x.structure.mass_kg=2000", "x.position_loop.feedback=load"];
    let config = machine(&[&ELASTIC_X[..], &structure].concat());
    let mut machine = Machine::new(Arc::new(MachineParameters::new(&config).expect("can be discretized")));
    machine.set_load(X, 1000.0);
    for _ in 0..2000 {
        machine.advance(&[0.0; AXES], &[]);
    }
    let stiffness = 2000.0 * (50.0 * std::f64::consts::TAU).powi(2);
    let position = machine.axis(X).sample().position;
    // The position controller has no integral: friction or its droop keep the scale within some tenths of a micrometer.
    let droop = machine.motion_at_end(X)[0];
    assert!((position - droop).abs() < 1e-10);
    let mut seen = Machine::new(Arc::new(
        MachineParameters::new(&self::machine(
            &[&ELASTIC_X[..], &["x.position_loop.feedback=load"]].concat(),
        ))
        .expect("can be discretized"),
    ));
    seen.set_load(X, 1000.0);
    for _ in 0..2000 {
        seen.advance(&[0.0; AXES], &[]);
    }
    let rigid = seen.axis(X).sample().position;
    assert!((position - rigid - 1000.0 / stiffness).abs() < 1e-8, "{position:e}, {rigid:e}");
}

#[test]
fn oscillations_that_a_tick_does_not_resolve_are_rejected() {
    let config = machine(&[
        "x.transmission.stiffness_n_um=1e6",
        "x.transmission.load_mass_kg=0.001",
        "x.transmission.backlash_um=1",
    ]);
    let error = MachineParameters::new(&config).expect_err("too fast").to_string();
    assert!(error.starts_with("axis x: the transmission changes within"), "{error}");
    assert!(Plant::new(&config.axes()[X], TICK).is_ok());
}
