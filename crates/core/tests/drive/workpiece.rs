//! Workpiece on the tables of A and C: torques and motion against MuJoCo, energy, and machines with friction and control.
//!
//! `tools/golden_bodies.py` computes the reference data.

use std::sync::Arc;

use nalgebra::{Matrix2, Rotation3, Vector2, Vector3};
use virtual_axes_core::config::{KinematicsConfig, MachineConfig, RotaryChain, WorkpieceConfig};
use virtual_axes_core::drive::{Plant, STANDARD_GRAVITY, WorkpieceDynamics};
use virtual_axes_core::machine::{Machine, MachineParameters, SimdWidth};
use virtual_axes_core::trial::{Measures, Trial, run, run_variants};
use virtual_axes_verification::fixtures::machines::{AXES, configured_with, program, setpoints};

use crate::bits::bits;
use crate::parameter_ranges::golden;
use crate::unpowered::{machine, unpowered};

const A: usize = 3;
const C: usize = 4;
/// Workpiece and pivots of `workpiece_motion.csv`.
pub const WORKPIECE: [&str; 12] = [
    "kinematics.pivot_a_y_mm=30",
    "kinematics.pivot_a_z_mm=-50",
    "kinematics.pivot_c_x_mm=10",
    "kinematics.pivot_c_y_mm=20",
    "kinematics.workpiece_z_mm=100",
    "workpiece.mass_kg=400",
    "workpiece.center_of_mass_x_mm=200",
    "workpiece.center_of_mass_y_mm=30",
    "workpiece.center_of_mass_z_mm=50",
    "workpiece.inertia_x_kg_m2=12",
    "workpiece.inertia_y_kg_m2=9",
    "workpiece.inertia_z_kg_m2=15",
];
/// Time of the torques in `workpiece_motion.csv`, and between its rows, in position cycles of 6 ms.
const INTERVAL: usize = 8;

/// Returns the machine with A and C without friction, current and tilt of the table.
fn free_tables(tick_us: f64, workpiece: &[&str]) -> MachineConfig {
    let own = ["a.gravity.tilt_nm=0".to_owned(), format!("periods.current_us={tick_us}")];
    let own = own.iter().map(String::as_str).chain(workpiece.iter().copied());
    unpowered(["a", "c"], &Vec::from_iter(own))
}

#[test]
fn inertia_gravity_and_velocity_torques_are_those_of_mujoco() {
    let (mut worst, mut count) = (0.0_f64, 0);
    for row in golden("workpieces.csv") {
        let kinematics = KinematicsConfig {
            chain: RotaryChain::default(),
            pivot_b: [0.0; 2],
            tool_length: 0.2,
            pivot_a: [row[0], row[1]],
            pivot_c: [row[2], row[3]],
            workpiece: [row[4], row[5], row[6]],
        };
        let workpiece = WorkpieceConfig {
            mass: row[7],
            center_of_mass: [row[8], row[9], row[10]],
            moments: [row[11], row[12], row[13]],
        };
        let dynamics = WorkpieceDynamics::new(&kinematics, &workpiece);
        let (angles, velocities) = ([row[14], row[15]], [row[16], row[17]]);
        let matrix = dynamics.mass_matrix(angles[1]);
        let gravity = dynamics.gravity_torques(angles);
        let motion = dynamics.velocity_torques(angles[1], velocities);
        let found = [
            matrix[0][0],
            matrix[0][1],
            matrix[1][0],
            matrix[1][1],
            gravity[0],
            gravity[1],
            gravity[0] + motion[0],
            gravity[1] + motion[1],
        ];
        for (column, (found, wanted)) in found.iter().zip(&row[18..]).enumerate() {
            let scale = row[7] * if column < 4 { 1.0 } else { 10.0 };
            worst = worst.max((found - wanted).abs() / scale);
            assert!((found - wanted).abs() <= 1e-9 * scale, "column {column}: {found}, not {wanted}");
        }
        count += 1;
    }
    println!("{count} workpieces, largest error {worst:.1e} of the mass at 1 m and of its weight there");
    assert_eq!(count, 40);
}

/// Returns the largest differences from the motion of MuJoCo: angles, rad, and velocities, rad/s.
fn error_of_motion(tick_us: f64) -> [f64; 2] {
    let mut machine = machine(&free_tables(tick_us, &WORKPIECE));
    let mut largest = [0.0_f64; 2];
    machine.set_load(A, 900.0);
    machine.set_load(C, -500.0);
    for row in golden("workpiece_motion.csv") {
        (0..INTERVAL).for_each(|_| machine.advance(&[0.0; AXES], &[]));
        machine.set_load(A, 0.0);
        machine.set_load(C, 0.0);
        for (k, axis) in [A, C].into_iter().enumerate() {
            let [position, velocity, _] = machine.motion_at_end(axis);
            largest[0] = largest[0].max((position - row[k]).abs());
            largest[1] = largest[1].max((velocity - row[2 + k]).abs());
        }
    }
    largest
}

#[test]
fn coupled_motion_approaches_that_of_mujoco_with_second_order() {
    let errors = [250.0, 125.0, 62.5].map(error_of_motion);
    println!("ticks of 250, 125 and 62.5 µs: largest errors {errors:?} rad, rad/s");
    for pair in errors.windows(2) {
        for (coarse, fine) in pair[0].iter().zip(pair[1]) {
            let order = (coarse / fine).log2();
            assert!((order - 2.0).abs() < 0.05, "order {order} of the errors {errors:?}");
        }
    }
    assert!(errors[1][0] < 1e-6 && errors[1][1] < 1e-6, "{errors:?}");
}

/// Returns the energy of the workpiece and both axes at the end of the last position cycle, J, by the position of the
/// center of mass and the angular velocity.
fn energy(machine: &Machine, config: &MachineConfig) -> f64 {
    let [[a, va, _], [c, vc, _]] = [A, C].map(|axis| machine.motion_at_end(axis));
    let (geometry, workpiece) = (config.kinematics(), config.workpiece().expect("a workpiece"));
    let pivot_a = Vector3::new(0.0, geometry.pivot_a[0], geometry.pivot_a[1]);
    let pivot_c = Vector3::new(geometry.pivot_c[0], geometry.pivot_c[1], 0.0);
    let center = Vector3::from(geometry.workpiece) + Vector3::from(workpiece.center_of_mass) - pivot_c;
    let (ra, rc) = (
        Rotation3::from_axis_angle(&Vector3::x_axis(), -a),
        Rotation3::from_axis_angle(&Vector3::z_axis(), -c),
    );
    let from_c = ra * (rc * center);
    let from_a = from_c + ra * (pivot_c - pivot_a);
    let (omega_a, omega_c) = (-va * Vector3::x(), -vc * (ra * Vector3::z()));
    let velocity = omega_a.cross(&from_a) + omega_c.cross(&from_c);
    let local = (ra * rc).inverse() * (omega_a + omega_c);
    let rotation: f64 = (0..3).map(|k| workpiece.moments[k] * local[k] * local[k]).sum();
    let axes: f64 = [(A, va), (C, vc)]
        .iter()
        .map(|(axis, velocity)| {
            let axis = &config.axes()[*axis];
            Plant::deviating_motor(axis).inertia / axis.transmission_ratio.powi(2) * velocity * velocity
        })
        .sum();
    let kinetic = 0.5 * (workpiece.mass * velocity.norm_squared() + rotation + axes);
    kinetic + workpiece.mass * STANDARD_GRAVITY * (pivot_a + from_a).z
}

/// Returns the largest change of energy over 5 s of free motion after the torques of `workpiece_motion.csv` times `factor`, J.
fn drift(config: &MachineConfig, factor: f64) -> f64 {
    let mut machine = machine(config);
    machine.set_load(A, factor * 900.0);
    machine.set_load(C, factor * -500.0);
    (0..INTERVAL).for_each(|_| machine.advance(&[0.0; AXES], &[]));
    machine.set_load(A, 0.0);
    machine.set_load(C, 0.0);
    let (first, mut largest, mut fastest) = (energy(&machine, config), 0.0_f64, 0.0_f64);
    for _ in 0..833 {
        machine.advance(&[0.0; AXES], &[]);
        largest = largest.max((energy(&machine, config) - first).abs());
        fastest = fastest.max(machine.motion_at_end(A)[1].abs());
    }
    assert!(fastest > 5.0, "the tables move: {fastest} rad/s");
    largest
}

/// The workpiece has an inertia of up to 3000 kg·m², the tables have 32 and 14 kg·m².
#[test]
fn a_workpiece_much_heavier_than_the_tables_keeps_its_energy() {
    let heavy =
        ["workpiece.mass_kg=40000", "workpiece.inertia_x_kg_m2=1200", "workpiece.inertia_y_kg_m2=900"];
    let config = free_tables(125.0, &[&WORKPIECE[..], &heavy, &["workpiece.inertia_z_kg_m2=1500"]].concat());
    let found = drift(&config, 100.0);
    println!("mass of 40 t: largest change of energy {found:.1e} J");
    assert!(found < 0.1, "{found}");
}

#[test]
fn free_motion_keeps_its_energy_with_second_order() {
    let drifts = [250.0, 125.0, 62.5].map(|tick_us| drift(&free_tables(tick_us, &WORKPIECE), 1.0));
    println!("5 s free, ticks of 250, 125 and 62.5 µs: largest change of energy {drifts:?} J");
    for pair in drifts.windows(2) {
        assert!((3.7..4.3).contains(&(pair[0] / pair[1])), "{drifts:?}");
    }
    assert!(drifts[1] < 1e-4, "{drifts:?}");
}

#[test]
fn a_machine_at_rest_holds_the_weight_of_the_workpiece() {
    let config = configured_with("mikron_ucp710", &[], &WORKPIECE);
    let mut machine = machine(&config);
    let positions = [0.0, 0.0, 0.0, 0.5, 0.9];
    machine.reset(&positions);
    let dynamics = WorkpieceDynamics::new(config.kinematics(), config.workpiece().expect("a workpiece"));
    let weight = dynamics.gravity_torques([0.5, 0.9]);
    let tilt = config.axes()[A].gravity.tilt * 0.5_f64.sin();
    for cycle in 0..200 {
        for (axis, torque) in [(A, weight[0] + tilt), (C, weight[1])] {
            let s = machine.axis(axis).sample();
            assert!((s.effort / torque - 1.0).abs() < 1e-9, "cycle {cycle}: {} N·m, not {torque}", s.effort);
            assert!((s.position - positions[axis]).abs() < 1e-12, "cycle {cycle}: {}", s.position);
        }
        machine.advance(&positions, &[]);
    }
}

/// Setpoints of a motion of both tables, with standstill in between.
fn psec(k: usize) -> [f64; AXES] {
    let time = 6e-3 * k as f64;
    let phase = if k % 100 < 60 { time } else { time - 6e-3 * (k % 100 - 60) as f64 };
    [0.01, 0.02, 0.005, 0.4, 0.6].map(|size| size * (1.0 - (3.0 * phase).cos()))
}

/// The forces are compared with the dynamics in the middle of each tick, with friction, presliding, elastic tables and
/// standstill.
#[test]
fn forces_agree_with_the_motion_of_every_tick() {
    let elastic = ["a.transmission.stiffness_nm_rad=2e6", "a.transmission.load_inertia_kg_m2=12"];
    let presliding =
        ["a.friction.presliding_stiffness_nm_rad=1e6", "c.friction.presliding_stiffness_nm_rad=1e6"];
    let elements =
        [&presliding[..], &["a.friction.presliding_elements=4", "c.friction.presliding_elements=6"]].concat();
    let combined = [&presliding[..], &elements].map(|friction| [&elastic[..], friction].concat());
    for changes in [&[][..], &elastic, &presliding, &elements, &combined[0], &combined[1]] {
        let config = configured_with("mikron_ucp710", &[], &[&WORKPIECE[..], changes].concat());
        let dynamics = WorkpieceDynamics::new(config.kinematics(), config.workpiece().expect("a workpiece"));
        let mut machine = machine(&config);
        let (mut worst, mut ticks_at_rest) = (0.0_f64, 0);
        let mut state = [A, C].map(|axis| machine.motion_at_end(axis));
        for tick in 0..600 * 48 {
            machine.advance_ticks(1, &psec(tick / 48), &[]);
            let next = [A, C].map(|axis| machine.motion_at_end(axis));
            let middle = |k: usize| [0, 1].map(|axis| 0.5 * (state[axis][k] + next[axis][k]));
            let (angles, velocities) = (middle(0), middle(1));
            let acceleration = Vector2::from_fn(|axis, _| (next[axis][1] - state[axis][1]) / 125e-6);
            let matrix = dynamics.mass_matrix(angles[1]);
            let inertia = Matrix2::from_fn(|row, column| matrix[row][column]) * acceleration;
            let gravity = dynamics.gravity_torques(angles);
            let motion = dynamics.velocity_torques(angles[1], velocities);
            for (k, axis) in [A, C].into_iter().enumerate() {
                let s = machine.sample_at_end(axis);
                let config = &config.axes()[axis];
                let torque = s.load_current * config.motor.torque_constant / config.transmission_ratio;
                let wanted = inertia[k] + gravity[k] + motion[k];
                worst = worst.max((torque - wanted).abs());
                assert!((torque - wanted).abs() < 1e-6, "tick {tick}, {changes:?}: {torque}, not {wanted}");
                ticks_at_rest += u32::from(next[k][1] == 0.0 && state[k][1] == 0.0);
            }
            state = next;
        }
        println!("{changes:?}: largest difference {worst:.1e} N·m, {ticks_at_rest} ticks at rest");
        assert!(!changes.is_empty() || ticks_at_rest > 1000, "{ticks_at_rest} ticks at rest");
    }
}

#[test]
fn bits_are_those_of_every_width_and_of_every_part_of_a_cycle() {
    let config = configured_with("mikron_ucp710", &[], &WORKPIECE);
    let without = configured_with("mikron_ucp710", &[], &[]);
    for axis in 0..AXES {
        let wanted = bits(&config, axis, SimdWidth::Widest, &[48]);
        for width in [SimdWidth::Widest, SimdWidth::Four, SimdWidth::Baseline] {
            for parts in [&[48][..], &[1, 20, 27], &[47, 1]] {
                assert!(bits(&config, axis, width, parts) == wanted, "axis {axis}, {width:?}, {parts:?}");
            }
        }
        let is_other = bits(&without, axis, SimdWidth::Widest, &[48]) != wanted;
        assert_eq!(is_other, [A, C].contains(&axis), "axis {axis}");
    }
}

#[test]
fn several_machines_and_stored_states_have_the_bits_of_one() {
    let configs = [&[][..], &WORKPIECE].map(|changes| configured_with("mikron_ucp710", &[], changes));
    let parameters =
        configs.map(|config| Arc::new(MachineParameters::new(&config).expect("can be discretized")));
    let all = [&parameters[1], &parameters[0], &parameters[1]].map(Arc::clone);
    let beside = Arc::new(MachineParameters::concatenate(&all).expect("equal periods"));
    let (mut one, mut several) = (Machine::new(parameters[1].clone()), Machine::new(beside));
    let mut read = one.clone();
    for k in 0..150 {
        one.advance(&psec(k), &[]);
        several.advance(&psec(k).repeat(3), &[]);
        read.advance_ticks(if k == 100 { 20 } else { 48 }, &psec(k), &[]);
        if k == 100 {
            let bytes = read.state_bytes();
            read = Machine::from_state_bytes(parameters[1].clone(), &bytes).expect("it is a state");
            read.advance_ticks(28, &psec(k), &[]);
        }
        for axis in 0..AXES {
            let wanted = one.motion_at_end(axis);
            assert_eq!(several.motion_at_end(axis), wanted, "cycle {k}, axis {axis}");
            assert_eq!(several.motion_at_end(2 * AXES + axis), wanted, "cycle {k}, axis {axis}");
            assert_eq!(read.motion_at_end(axis), wanted, "cycle {k}, axis {axis}");
        }
    }
}

#[test]
fn variants_of_one_table_have_the_figures_of_separate_runs() {
    let variant = |gain: &str| {
        let gain = format!("a.position_loop.gain={gain}");
        configured_with("mikron_ucp710", &[], &[&WORKPIECE[..], &[&gain]].concat())
    };
    let (base, variants) = (variant("1.5"), ["2.0", "1.2", "1.8"].map(variant));
    let program = program("five-axis", &base);
    let trial = |machine| Trial {
        machine,
        program: Some(Arc::clone(&program)),
        allow_nonzero_end_velocity: false,
        record: false,
        measures: Measures::ALL,
    };
    let setpoints = |machine| setpoints("five-axis", Arc::clone(&program), machine);
    let together = run_variants(&trial(&base), setpoints(&base), &variants, &[A], || Ok(())).expect("a run");
    for (variant, figures) in variants.iter().zip(&together) {
        let alone = run(&trial(variant), setpoints(variant), |_| Ok(())).expect("a run").figures;
        assert_eq!(*figures, alone);
    }
    assert_ne!(together[0].contour, together[1].contour);
}
