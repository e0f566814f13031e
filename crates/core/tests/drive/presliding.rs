//! Friction with presliding (LuGre) and Stribeck curve: closed forms, the simulations of its authors, energy, and machines.

use std::f64::consts::TAU;
use std::sync::Arc;

use proptest::prelude::*;
use virtual_axes_core::config::{
    AxisConfig, MachineConfig, Parameters, PreslidingConfig, ValueSource, parse_assignment,
};
use virtual_axes_core::drive::{Friction, LoadState, MotorState, Plant, Presliding};
use virtual_axes_core::machine::{Machine, MachineParameters, SimdWidth};
use virtual_axes_verification::fixtures::machines::{AXES, configured_with};

use crate::bits::{assert_bits_of_every_width_and_part, bits};
use crate::parameter_ranges::golden;
use crate::transmission::ELASTIC_X;

const X: usize = 0;
/// Bristles of 50 N/µm on X: at most 17 µm before it slides.
const PRESLIDING_X: [&str; 2] =
    ["x.friction.presliding_stiffness_n_um=50", "x.friction.presliding_damping_n_s_m=3e4"];
const PRESLIDING_A: [&str; 2] =
    ["a.friction.presliding_stiffness_nm_rad=3e6", "a.friction.presliding_damping_nm_s_rad=2000"];
const STRIBECK_Y: [&str; 3] =
    ["y.friction.stribeck=1.5", "y.friction.stribeck_velocity_m_min=0.2", "y.friction.viscous=0.03"];

fn machine(changes: &[&str]) -> MachineConfig {
    configured_with("mikron_ucp710", &[], changes)
}

/// Bristles on a support that is moved: the displacement hardly depends on friction.
struct MovedBristles {
    bristles: Presliding,
    deflection: f64,
    displacement: f64,
}

impl MovedBristles {
    /// Displacement per force over a tick: friction changes the displacement, which is followed, and not the relation.
    const PER_FORCE: f64 = 1e-11;
    const STIFFNESS: f64 = 1e5;
    /// Sliding friction, N.
    const LAW: f64 = 1.2;

    fn new() -> Self {
        let config = PreslidingConfig { stiffness: Self::STIFFNESS, ..PreslidingConfig::NONE };
        let bristles = Presliding::new(&config, 0.0, 1e-4, Self::PER_FORCE);
        MovedBristles { bristles, deflection: 0.0, displacement: 0.0 }
    }

    /// Moves the support (m) and returns the force, N.
    fn step(&mut self, distance: f64) -> f64 {
        let (drop, next) = self.bristles.step(distance, Self::PER_FORCE * Self::LAW, self.deflection);
        self.deflection = next;
        self.displacement += distance - drop;
        drop / Self::PER_FORCE
    }
}

/// Returns the largest difference to the hysteresis loop in closed form (exponential of the displacement since the last
/// reversal), N, for displacements of ±`travel` in `steps` steps.
fn hysteresis_error(steps: u32) -> f64 {
    let (travel, law) = (2e-5, MovedBristles::LAW);
    let mut support = MovedBristles::new();
    let (mut worst, mut from, mut reversal) = (0.0_f64, 0.0, 0.0);
    for part in 0..9 {
        let direction = if part % 2 == 0 { 1.0 } else { -1.0 };
        let mut force = 0.0;
        for _ in 0..if part == 0 { steps } else { 2 * steps } {
            force = support.step(direction * travel / f64::from(steps));
            let travelled = direction * (support.displacement - reversal);
            let steady = direction * law;
            let exact = steady + (from - steady) * (-MovedBristles::STIFFNESS / law * travelled).exp();
            worst = worst.max((force - exact).abs());
        }
        (from, reversal) = (force, support.displacement);
    }
    worst
}

#[test]
fn the_hysteresis_loop_is_that_of_the_closed_form() {
    let errors = [500, 1000, 2000].map(hysteresis_error);
    println!("largest difference to the hysteresis loop at 500, 1000 and 2000 steps: {errors:?} N");
    // First order: half a step of displacement times the stiffness, 40 nm · 1e5 N/m at 500 steps, at most.
    assert!(errors[0] < 0.5 * 4e-8 * MovedBristles::STIFFNESS, "{errors:?}");
    for pair in errors.windows(2) {
        assert!((pair[0] / pair[1] - 2.0).abs() < 0.05, "{errors:?}");
    }
}

#[test]
fn the_first_micrometers_have_the_stiffness_of_the_bristles() {
    let mut support = MovedBristles::new();
    let force = support.step(1e-9);
    let stiffness = force / support.displacement;
    assert!((stiffness / MovedBristles::STIFFNESS - 1.0).abs() < 1e-3, "{stiffness} N/m");
}

/// Axis with the parameters of Canudas de Wit et al. (1995), table 1; V is in m/min and 1 A gives 1 N.
pub fn published_axis() -> AxisConfig {
    let text = |key: &str, value: f64| format!("x.friction.{key}={value}");
    let changes = [
        text("a", 1.0),
        text("b", 0.0),
        text("c", 0.0),
        text("i0", 1.5),
        text("stribeck", 0.5),
        text("stribeck_velocity_m_min", 0.001 * 60.0),
        text("viscous", 0.4 / 60.0),
    ];
    let config = machine(&changes.each_ref().map(String::as_str));
    let mut axis = config.axes()[X].clone();
    axis.transmission_ratio = 1.0;
    axis
}

/// Simulates a mass of 1 kg with the published parameters under `force(time, position)` until the times of the golden
/// rows of a case; returns the largest differences of position and friction, relative to the largest values.
fn published_errors(case: f64, period: f64, force: impl Fn(f64, f64) -> f64) -> [f64; 2] {
    // Displacement of a mass of 1 kg by a force of 1 N over a tick.
    let per_force = period * period / 2.0;
    let (law, viscosity) = Friction::of_axis(&published_axis(), 1.0).of_presliding();
    let config = PreslidingConfig { stiffness: 1e5, damping: 1e5_f64.sqrt(), ..PreslidingConfig::NONE };
    let bristles = Presliding::new(&config, viscosity, period, per_force);
    let (mut position, mut speed, mut deflection, mut step) = (0.0, 0.0, 0.0, 0);
    let (mut worst, mut largest) = ([0.0_f64; 2], [0.0_f64; 2]);
    for row in golden("presliding.csv").iter().filter(|row| row[0] == case) {
        let mut friction = 0.0;
        while (f64::from(step) + 0.5) * period < row[1] {
            let middle = (f64::from(step) + 0.5) * period;
            let outer = force(middle, position + period / 2.0 * speed);
            let free = period * speed + per_force * outer;
            let (drop, next) = bristles.step(free, per_force * law.bound(speed), deflection);
            friction = drop / per_force;
            position += free - drop;
            speed += period * (outer - friction);
            (deflection, step) = (next, step + 1);
        }
        for (k, (found, exact)) in [(position, row[2]), (friction, row[4])].into_iter().enumerate() {
            worst[k] = worst[k].max((found - exact).abs());
            largest[k] = largest[k].max(exact.abs());
        }
    }
    [worst[0] / largest[0], worst[1] / largest[1]]
}

fn alternating_force(time: f64, _position: f64) -> f64 {
    let phase = time % 4.0;
    1.425
        * match phase {
            phase if phase < 1.0 => phase,
            phase if phase < 3.0 => 2.0 - phase,
            phase => phase - 4.0,
        }
}

#[test]
fn presliding_under_an_alternating_force_is_that_of_the_authors() {
    let errors = [2e-4, 1e-4, 5e-5].map(|period| published_errors(0.0, period, alternating_force));
    println!("presliding, relative errors of position and friction at 0.2, 0.1 and 0.05 ms: {errors:?}");
    for k in 0..2 {
        assert!(errors[2][k] < 1e-3, "{errors:?}");
        // First order.
        assert!((errors[1][k] / errors[2][k] - 2.0).abs() < 0.2, "{errors:?}");
    }
}

#[test]
fn stick_slip_is_that_of_the_authors() {
    let errors = [2e-4, 1e-4]
        .map(|period| published_errors(1.0, period, |time, position| 2.0 * (0.1 * time - position)));
    println!("stick-slip, relative errors of position and friction at 0.2 and 0.1 ms: {errors:?}");
    for k in 0..2 {
        assert!(errors[1][k] < 0.01 && errors[1][k] < 0.6 * errors[0][k], "{errors:?}");
    }
}

#[test]
fn the_stribeck_curve_is_that_of_its_formula() {
    let config = machine(&STRIBECK_Y);
    let axis = &config.axes()[1];
    let law = Friction::of_axis(axis, 1.0);
    let unit = axis.transmission_ratio * 60.0;
    for k in 1..=100_000 {
        let v = 1e-3 * f64::from(k) * 0.4;
        let paper = &axis.friction;
        let exact = paper.a * (paper.b * v).exp()
            + paper.c * (paper.d * v).exp()
            + 1.5 * (-(v / 0.2).powi(2)).exp()
            + 0.03 * v;
        let found = law.bound(v / unit);
        assert!((found - exact).abs() < 1e-11, "{found} A at {v} m/min, not {exact} A");
        assert_eq!(found.to_bits(), law.bound(-v / unit).to_bits());
    }
    assert_eq!(law.bound(0.0), axis.friction.i0);
}

/// Trajectories of a plant in the energy test: 200 000 in all.
const TRAJECTORIES: usize = 100;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn presliding_does_not_create_energy(
        is_elastic in prop::bool::ANY,
        stiffness in 1.0..5.0_f64,
        bristles in 0.0..5.0_f64,
        ratio in 0.0..2.0_f64,
        friction in 0.0..20.0_f64,
        amplitude in -6.0..0.0_f64,
        starts in prop::collection::vec(prop::array::uniform5(-1.0..1.0_f64), TRAJECTORIES),
    ) {
        let (inertia, share) = (0.028, 0.4);
        let (stiffness, bristles) = (10_f64.powf(stiffness), 10_f64.powf(bristles));
        let load_inertia = share * inertia;
        let text = |key: &str, value: f64| format!("x.{key}={value}");
        let per_axis = 1.0 / (0.02 / TAU).powi(2);
        let mut changes = vec![
            text("motor.emf_constant_v_s_rad", 2.64),
            text("friction.a", friction),
            text("friction.b", 0.0),
            text("friction.c", 0.0),
            text("friction.i0", friction),
            text("friction.presliding_stiffness_n_um", bristles * per_axis * 1e-6),
            text("friction.presliding_damping_n_s_m", ratio * (bristles * inertia).sqrt() * per_axis),
        ];
        if is_elastic {
            changes.push(text("transmission.stiffness_n_um", stiffness * per_axis * 1e-6));
            changes.push(text("transmission.load_mass_kg", load_inertia * per_axis));
        }
        let config = machine(&changes.iter().map(String::as_str).collect::<Vec<_>>());
        let axis = &config.axes()[X];
        let plant = Plant::new(axis, 125e-6).expect("can be discretized");
        let presliding = axis.presliding.expect("presliding");
        let own = if is_elastic { inertia - load_inertia } else { inertia };
        let energy = |motor: &MotorState, load: &LoadState, deflection: f64| {
            let spring = axis.transmission.map_or(0.0, |t| t.stiffness * load.wind_up.powi(2) / 2.0);
            axis.motor.inductance * motor.current.powi(2) / 2.0
                + own * motor.speed.powi(2) / 2.0
                + load_inertia * load.speed.powi(2) / 2.0
                + spring
                + presliding.stiffness * deflection.powi(2) / 2.0
        };
        // The deflection at which the axis slides.
        let limit = axis.motor.torque_constant * friction / presliding.stiffness;
        let amplitude = 10_f64.powf(amplitude);
        for start in starts {
            let [current, speed, wind_up, load_speed] = [0, 1, 2, 3].map(|k| amplitude * start[k]);
            let mut motor = MotorState { current: 30.0 * current, speed: 100.0 * speed, angle: 0.0 };
            let mut load = LoadState::default();
            if is_elastic {
                load = LoadState { wind_up: wind_up / stiffness.sqrt(), speed: 100.0 * load_speed };
            }
            let mut deflection = limit * start[4];
            let first = energy(&motor, &load, deflection);
            let mut before = first;
            for tick in 0..100 {
                plant.step_with_load(&mut motor, &mut load, &mut deflection, 0.0, 0.0);
                let now = energy(&motor, &load, deflection);
                prop_assert!(now <= before + 1e-13 * first, "{now} after {before}, tick {tick}, {start:?}");
                before = now;
            }
        }
    }
}

#[test]
fn bits_are_those_of_every_width_and_of_every_part_of_a_cycle() {
    let config = machine(&[&PRESLIDING_X[..], &PRESLIDING_A, &STRIBECK_Y, &ELASTIC_X].concat());
    assert_bits_of_every_width_and_part(&config);
}

#[test]
fn axes_beside_others_with_presliding_keep_their_bits() {
    let elastic = &ELASTIC_X[..];
    let without = machine(elastic);
    let mixed = machine(&[elastic, &PRESLIDING_A, &STRIBECK_Y].concat());
    for axis in [X, 2, 4] {
        let wanted = bits(&without, axis, SimdWidth::Widest, &[48]);
        assert!(bits(&mixed, axis, SimdWidth::Widest, &[48]) == wanted, "axis {axis}");
    }
    for axis in [1, 3] {
        let wanted = bits(&without, axis, SimdWidth::Widest, &[48]);
        assert!(bits(&mixed, axis, SimdWidth::Widest, &[48]) != wanted, "axis {axis}");
    }
}

#[test]
fn a_held_axis_gives_way_under_a_load_and_comes_back_in_part() {
    // The loops are so soft that the bristles carry the load.
    let soft =
        ["x.position_loop.gain=0", "x.velocity_loop.gain=1e-6", "x.velocity_loop.integral_time_ms=1e6"];
    let config = machine(&[&PRESLIDING_X[..], &soft].concat());
    let mut machine = Machine::new(Arc::new(MachineParameters::new(&config).expect("can be discretized")));
    let mut position_after = |from: f64, to: f64| {
        for k in 0..4000 {
            machine.set_load(X, from + (to - from) * f64::min(f64::from(k) / 3000.0, 1.0));
            machine.advance(&[0.0; AXES], &[]);
        }
        machine.axis(X).sample().position
    };
    let axis = &config.axes()[X];
    let law = axis.motor.torque_constant * (axis.friction.a + axis.friction.c) / axis.transmission_ratio;
    let force = 0.5 * law;
    let there = position_after(0.0, force);
    // Closed form of the first loading, and of the unloading from there.
    let stiffness = 50e6;
    let exact = -law / stiffness * (1.0 - force / law).ln();
    let back = position_after(force, 0.0);
    let exact_back = exact - law / stiffness * (1.0 + force / law).ln();
    assert!((there / exact - 1.0).abs() < 0.03, "{there} m, not {exact} m");
    assert!((back / exact_back - 1.0).abs() < 0.1, "{back} m, not {exact_back} m");
}

#[test]
fn damping_without_stiffness_is_rejected() {
    let mut parameters = Parameters::embedded_default().expect("shipped");
    let change = parse_assignment(PRESLIDING_X[1], &ValueSource::named("test")).expect("an assignment");
    let rejection = parameters.set_all(vec![change]).expect_err("no stiffness").to_string();
    assert!(rejection.contains("x.friction.presliding_stiffness_n_um"), "{rejection}");
    assert!(rejection.contains("x.friction.presliding_damping_n_s_m"), "{rejection}");
}
