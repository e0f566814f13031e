//! Energy and momentum of axes with backlash, friction at the load and a structure.

use proptest::prelude::*;
use virtual_axes_core::config::{AxisConfig, StructureConfig, TransmissionConfig};
use virtual_axes_core::drive::EventDrivenTransmission;

use crate::backlash::{DriveStates, TICK};
use crate::transmission::{X, machine};

/// Returns the energy of all states, J.
fn energy(axis: &AxisConfig, s: &DriveStates) -> f64 {
    let t = axis.transmission.expect("elastic");
    let own = axis.motor.inertia - t.load_inertia;
    let carries_motor = t.structure.is_some_and(|structure| structure.carries_motor);
    let carried = if carries_motor { s.contact.structure_speed } else { 0.0 };
    let structure = t.structure.map_or(0.0, |structure| {
        let spring = structure.frequency * s.contact.structure;
        structure.inertia * (s.contact.structure_speed.powi(2) + spring * spring) / 2.0
    });
    axis.motor.inductance * s.motor.current.powi(2) / 2.0
        + own * (s.motor.speed + carried).powi(2) / 2.0
        + t.load_inertia * s.load.speed.powi(2) / 2.0
        + t.stiffness * s.contact.twist.powi(2) / 2.0
        + structure
}

/// Trajectories of a plant in the energy test: 200 000 in all.
const TRAJECTORIES: usize = 100;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn backlash_and_friction_do_not_create_energy(
        stiffness in 2.0..5.0_f64,
        ratio in prop_oneof![Just(0.0), 0.001..0.5_f64],
        share in 0.05..0.95_f64,
        friction in prop_oneof![Just(0.0), 0.0..20.0_f64],
        load_friction in prop_oneof![Just(0.0), Just(1.0), 0.0..1.0_f64],
        backlash in prop_oneof![Just(0.0), 1e-5..1e-2_f64],
        structure in prop::option::of((0.3..30.0_f64, 50.0..2000.0_f64, 0.0..0.1_f64, prop::bool::ANY)),
        amplitude in -3.0..0.0_f64,
        starts in prop::collection::vec(prop::array::uniform6(-1.0..1.0_f64), TRAJECTORIES),
    ) {
        let inertia = 0.028;
        let load_inertia = share * inertia;
        let stiffness = 10_f64.powf(stiffness);
        let mut axis = machine(&[]).axes()[X].clone();
        axis.motor.inertia = inertia;
        axis.motor.emf_constant = axis.motor.torque_constant;
        (axis.friction.a, axis.friction.b, axis.friction.c, axis.friction.i0) = (friction, 0.0, 0.0, 1.2 * friction);
        axis.transmission = Some(TransmissionConfig {
            stiffness,
            damping: 2.0 * ratio * (stiffness * load_inertia * (1.0 - share)).sqrt(),
            load_inertia,
            backlash,
            load_friction,
            structure: structure.map(|(mass, frequency, damping_ratio, carries_motor)| StructureConfig {
                inertia: mass * inertia,
                frequency,
                damping_ratio,
                carries_motor,
            }),
        });
        let Ok(Some(transmission)) = EventDrivenTransmission::new(&axis, TICK) else {
            prop_assume!(false);
            return Ok(());
        };
        let amplitude = 10_f64.powf(amplitude);
        for start in starts {
            let [current, speed, twist, load_speed, gap, frame] = start;
            let mut s = DriveStates::default();
            s.motor.current = 30.0 * amplitude * current;
            // Some of them start at rest.
            s.motor.speed = if speed.abs() < 0.2 { 0.0 } else { 100.0 * amplitude * speed };
            let load_speed = if load_speed.abs() < 0.2 { 0.0 } else { 100.0 * amplitude * load_speed };
            if structure.is_some() {
                (s.contact.structure, s.contact.structure_speed) = (1e-3 * amplitude * frame, amplitude * frame);
            }
            s.load.speed = load_speed + s.contact.structure_speed;
            let twist = amplitude * twist.abs() / stiffness.sqrt();
            let wind_up = match backlash {
                0.0 => twist * gap.signum(),
                _ if gap.abs() < 0.5 => gap * backlash,
                _ => gap.signum() * (twist + backlash / 2.0),
            };
            let is_in_contact = backlash == 0.0 || gap.abs() >= 0.5;
            s.contact.twist = if is_in_contact { twist * gap.signum() } else { 0.0 };
            s.contact.side = if is_in_contact && backlash > 0.0 { gap.signum() } else { 0.0 };
            s.load.wind_up = wind_up - s.contact.structure;
            let first = energy(&axis, &s);
            let mut before = first;
            for tick in 0..60 {
                s.step(&transmission, 0.0, 0.0);
                let now = energy(&axis, &s);
                prop_assert!(now <= before + 1e-12 * first, "{now} after {before}, tick {tick}, {start:?}, {s:?}");
                before = now;
            }
        }
    }
}

/// Motor and load come to rest on a light structure in the same tick: each of the two frictions changes the speed at the
/// other place.
#[test]
fn frictions_at_motor_and_load_that_stop_together_keep_momentum_and_create_no_energy() {
    let (inertia, load_inertia) = (0.028, 0.028 * 0.5629405695499393);
    let structure =
        StructureConfig { inertia: 0.3 * inertia, frequency: 50.0, damping_ratio: 0.0, carries_motor: true };
    let mut axis = machine(&[]).axes()[X].clone();
    axis.motor.inertia = inertia;
    axis.motor.emf_constant = axis.motor.torque_constant;
    (axis.friction.a, axis.friction.b, axis.friction.c, axis.friction.i0) =
        (4.365996121267662, 0.0, 0.0, 5.239195345521194);
    axis.transmission = Some(TransmissionConfig {
        stiffness: 100.0,
        damping: 0.0,
        load_inertia,
        backlash: 0.0,
        load_friction: 0.14278764293427393,
        structure: Some(structure),
    });
    let transmission = EventDrivenTransmission::new(&axis, TICK).expect("discretized").expect("a structure");
    let mut s = DriveStates::default();
    (s.motor.speed, s.load.speed) = (-0.25288347435691433, -0.09547693044952316);
    let momentum = |s: &DriveStates| {
        let DriveStates { motor, load, contact } = s;
        let carried = (inertia - load_inertia) * (motor.speed + contact.structure_speed);
        carried + load_inertia * load.speed + structure.inertia * contact.structure_speed
    };
    let mut at_rest = [false; 2];
    for tick in 0..6 {
        let (before, first) = (energy(&axis, &s), momentum(&s));
        s.step(&transmission, 0.0, 0.0);
        let now = energy(&axis, &s);
        // The spring of the structure is the only torque from outside.
        let spring = structure.inertia * structure.frequency.powi(2) * s.contact.structure.abs() * TICK;
        let change = (momentum(&s) - first).abs();
        println!(
            "tick {tick}: energy {:+.2e} J, momentum {change:.2e}, by the spring {spring:.2e}",
            now - before
        );
        assert!(now <= before && change <= 1.01 * spring, "tick {tick}: {now} J after {before} J, {s:?}");
        at_rest = [s.motor.speed == 0.0, s.load.speed == s.contact.structure_speed];
    }
    assert_eq!(at_rest, [true; 2]);
}
