//! Friction with presliding by elements (generalized Maxwell-slip model): closed forms and energy.

use std::f64::consts::TAU;

use proptest::prelude::*;
use virtual_axes_core::config::{MachineConfig, PreslidingConfig};
use virtual_axes_core::drive::{
    LoadState, MaxwellSlip, MaxwellSlipElement, MaxwellSlipState, MotorState, Plant, Presliding,
};
use virtual_axes_verification::fixtures::machines::configured_with;

const X: usize = 0;
/// σ0, N/m.
const STIFFNESS: f64 = 1e5;
/// Sliding friction without velocity dependence, N.
const LAW: f64 = 1.2;
/// Displacement per force over a tick of moved elements: friction hardly changes the displacement.
pub(crate) const PER_FORCE: f64 = 1e-18;

fn machine(changes: &[&str]) -> MachineConfig {
    configured_with("mikron_ucp710", &[], changes)
}

/// Elements on a support that is moved.
pub(crate) struct MovedElements {
    model: MaxwellSlip,
    state: MaxwellSlipState,
    /// Sliding friction, N.
    law: f64,
    displacement: f64,
    /// Work on the elements, J.
    pub(crate) work: f64,
}

impl MovedElements {
    fn new(count: usize) -> Self {
        Self::of(&MaxwellSlipElement::of_loading_curve(count, STIFFNESS), LAW)
    }

    pub(crate) fn of(elements: &[MaxwellSlipElement], law: f64) -> Self {
        let model = MaxwellSlip::new(elements, None, 0.0, 1e-4, PER_FORCE);
        MovedElements { model, state: MaxwellSlipState::default(), law, displacement: 0.0, work: 0.0 }
    }

    /// Moves the support to a displacement in 100 steps and returns the force, N.
    pub(crate) fn move_to(&mut self, displacement: f64) -> f64 {
        let force = |state: &MaxwellSlipState| state.forces.iter().sum::<f64>();
        let from = self.displacement;
        for step in 1..=100 {
            let next = from + (displacement - from) * f64::from(step) / 100.0;
            let distance = next - self.displacement;
            let before = force(&self.state);
            self.model.step(distance, PER_FORCE * self.law, distance / 1e-4, &mut self.state);
            self.work += distance * (before + force(&self.state)) / 2.0;
            self.displacement = next;
        }
        force(&self.state)
    }

    /// Returns the force of the first loading at a displacement, N.
    fn first_loading(&self, displacement: f64) -> f64 {
        let force = |e: &MaxwellSlipElement| (e.stiffness * displacement).min(e.share * LAW);
        self.model.elements().iter().map(force).sum()
    }
}

#[test]
fn the_first_loading_curve_has_points_of_that_of_the_bristles() {
    for count in 1..=10_u32 {
        let elements = MaxwellSlipElement::of_loading_curve(count as usize, STIFFNESS);
        let number = f64::from(count);
        assert!((elements.iter().map(|e| e.share).sum::<f64>() - 1.0).abs() < 1e-14);
        let start = if count == 1 { 0.5 } else { -1.0 / (number * (1.0 - 1.0 / number).ln()) };
        let stiffness: f64 = elements.iter().map(|e| e.stiffness).sum();
        assert!((stiffness / STIFFNESS - start).abs() < 1e-14, "{count}: {stiffness} N/m");
        assert!(elements.iter().all(|e| e.stiffness > 0.0 && e.share > 0.0), "{elements:?}");
        let mut moved = MovedElements::new(count as usize);
        for j in 1..count {
            let level = f64::from(j) / number;
            let force = moved.move_to(-LAW / STIFFNESS * (1.0 - level).ln());
            assert!((force - LAW * level).abs() < 1e-9, "{count} elements, knot {j}: {force} N");
        }
        let last = LAW / STIFFNESS * (number.ln() + 2.0);
        assert!(count == 1 || moved.move_to(0.999 * last) < LAW * (1.0 - 1e-5));
        assert!((moved.move_to(last) - LAW).abs() < 1e-9 && (moved.move_to(2.0 * last) - LAW).abs() < 1e-9);
        // Beyond the knots of both curves the work is the same: the sum of LAW − F over the displacement.
        let lost = |e: &MaxwellSlipElement| (e.share * LAW).powi(2) / (2.0 * e.stiffness);
        let tail = -(1..count)
            .map(|j| {
                let knot = |j: u32| -(1.0 - f64::from(j) / number).ln();
                let (from, to) = (knot(j - 1), knot(j));
                // Chord minus curve.
                (to - from) * (1.0 - (f64::from(j) - 0.5) / number) - ((-from).exp() - (-to).exp())
            })
            .sum::<f64>();
        let exact = LAW * LAW / STIFFNESS * (1.0 - tail);
        let found: f64 = elements.iter().map(lost).sum();
        assert!((found / exact - 1.0).abs() < 1e-12, "{count}: {found} J, not {exact} J");
    }
}

#[test]
fn the_curve_of_an_axis_after_a_reversal_has_points_of_that_of_the_bristles() {
    for count in 2..=10_u32 {
        let elements = format!("x.friction.presliding_elements={count}");
        let config = machine(&["x.friction.presliding_stiffness_n_um=50", &elements]);
        let axis = &config.axes()[X];
        let plant = Plant::new(axis, 1e-4).expect("can be discretized");
        let own = MaxwellSlip::of_axis(axis, plant.angle_per_torque(), 1e-4).expect("elements");
        let mut moved = MovedElements::of(own.elements(), LAW);
        // g/σ0.
        let length = LAW / axis.presliding.expect("presliding").stiffness;
        let start = 10.0 * length;
        assert!((moved.move_to(start) - LAW).abs() < 1e-9);
        for j in 1..count {
            let level = f64::from(j) / f64::from(count);
            let distance = -length * (1.0 - level).ln();
            // g (1 − 2 exp(−σ0 u/g)) in the new direction.
            let wanted = -LAW * (1.0 - 2.0 * (-distance / length).exp());
            let force = moved.move_to(start - distance);
            assert!((force - wanted).abs() < 1e-9, "{count} elements, knot {j}: {force} N, not {wanted} N");
        }
    }
}

/// Masing's rule: a curve after a reversal is the first loading curve, twice as large, until it meets the curve
/// before the reversal before.
#[test]
fn curves_after_reversals_follow_masings_rule() {
    let mut moved = MovedElements::new(6);
    let mut worst = 0.0_f64;
    let (mut from, mut displacement) = (moved.move_to(3e-5), 3e-5);
    let first = (from - moved.first_loading(3e-5)).abs();
    // Amplitudes that decrease: no curve meets an older one.
    for reversal in 1..30 {
        let next = 3e-5 * 0.9_f64.powi(reversal) * if reversal % 2 == 1 { -1.0 } else { 1.0 };
        let mut force = from;
        for part in 1..=7 {
            let target = displacement + (next - displacement) * f64::from(part) / 7.0;
            force = moved.move_to(target);
            let distance = target - displacement;
            let exact = from + 2.0 * distance.signum() * moved.first_loading(distance.abs() / 2.0);
            worst = worst.max((force - exact).abs());
        }
        (from, displacement) = (force, next);
    }
    println!("largest difference to the first loading {first:e} N, and to Masing's rule {worst:e} N");
    assert!(first < 1e-9 && worst < 1e-9);
}

/// A minor loop returns to the point where it began, and the curve goes on as without it.
#[test]
fn minor_loops_are_closed_and_forgotten() {
    let path = |inner: &[f64]| {
        let mut moved = MovedElements::new(6);
        let forces = [3e-5, -2.5e-5, 0.8e-5].map(|to| moved.move_to(to));
        let back = inner.iter().map(|&to| moved.move_to(to)).last().unwrap_or(forces[2]);
        (forces[2], back, [1e-5, 2e-5, 2.9e-5, 4e-5].map(|to| moved.move_to(to)))
    };
    let (_, _, wanted) = path(&[]);
    let mut worst = 0.0_f64;
    for inner in [&[-1e-5, 0.8e-5][..], &[0.0, 0.5e-5, 0.2e-5, 0.5e-5, 0.8e-5], &[0.7e-5, 0.8e-5]] {
        let (before, after, found) = path(inner);
        worst = worst.max((after - before).abs());
        for (found, wanted) in found.iter().zip(wanted) {
            worst = worst.max((found - wanted).abs());
        }
    }
    // The bristles of the LuGre model have one state: the loop is not closed.
    let config = PreslidingConfig { stiffness: STIFFNESS, ..PreslidingConfig::NONE };
    let bristles = Presliding::new(&config, 0.0, 1e-4, PER_FORCE);
    let (mut deflection, mut at) = (0.0, 0.0);
    let mut forces = [3e-5, -2.5e-5, 0.8e-5, -1e-5, 0.8e-5].map(|to| {
        for _ in 0..10_000 {
            deflection = bristles.step((to - at) / 1e4, PER_FORCE * LAW, deflection).1;
        }
        at = to;
        STIFFNESS * deflection
    });
    forces[4] -= forces[2];
    println!("largest gap of a minor loop {worst:e} N, with bristles {} N", forces[4]);
    assert!(worst < 1e-9 && forces[4].abs() > 0.05);
}

/// Returns the mean positions of a mass of 1 kg over periods of a vibrating force, m; `friction` returns the
/// displacement by friction from that without, and the speed.
fn vibration(mut friction: impl FnMut(f64, f64) -> f64) -> Vec<f64> {
    let (period, per_force) = (1e-4, 0.5e-8);
    let (mut position, mut speed, mut means) = (0.0, 0.0, Vec::new());
    for cycle in 0..200 {
        let mut sum = 0.0;
        for tick in 0..1000 {
            let time = period * (f64::from(tick) + 0.5);
            // At most 60 % of the breakaway force, after the first period.
            let outer =
                (if cycle == 0 { time / 0.1 } else { 1.0 }) * (0.36 + 0.36 * (TAU * 10.0 * time).sin());
            let free = period * speed + per_force * outer;
            let drop = friction(free, speed);
            position += free - drop;
            speed += period * (outer - drop / per_force);
            sum += position;
        }
        means.push(sum / 1000.0);
    }
    means
}

#[test]
fn an_axis_does_not_creep_under_a_vibrating_load() {
    let per_force = 0.5e-8;
    // Viscous friction of 60 N/(m/s) lets the oscillation of the mass on the springs decay.
    let elements = MaxwellSlipElement::of_loading_curve(6, STIFFNESS);
    let model = MaxwellSlip::new(&elements, None, 60.0, 1e-4, per_force);
    let mut state = MaxwellSlipState::default();
    let found = vibration(|free, speed| model.step(free, per_force * LAW, speed, &mut state));
    let config = PreslidingConfig { stiffness: STIFFNESS, ..PreslidingConfig::NONE };
    let bristles = Presliding::new(&config, 60.0, 1e-4, per_force);
    let mut deflection = 0.0;
    let lugre = vibration(|free, _| {
        let (drop, next) = bristles.step(free, per_force * LAW, deflection);
        deflection = next;
        drop
    });
    let drift = |means: &[f64]| 1e9 * (means[199] - means[20]);
    println!("drift over 180 periods: elements {:.2e} nm, bristles {:.0} nm", drift(&found), drift(&lugre));
    assert!(drift(&found).abs() < 1e-3 && drift(&lugre) > 1000.0, "{found:?}");
}

/// Trajectories of a plant in the energy test: 200 000 in all.
const TRAJECTORIES: usize = 100;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn elements_do_not_create_energy(
        is_elastic in prop::bool::ANY,
        stiffness in 1.0..5.0_f64,
        bristles in 0.0..5.0_f64,
        count in 1..=10_usize,
        friction in prop::array::uniform3(0.0..20.0_f64),
        attraction in prop::option::of(-1.0..6.0_f64),
        amplitude in -6.0..0.0_f64,
        starts in prop::collection::vec(prop::array::uniform6(-1.0..1.0_f64), TRAJECTORIES),
    ) {
        let (inertia, share) = (0.028, 0.4);
        let (stiffness, bristles) = (10_f64.powf(stiffness), 10_f64.powf(bristles));
        let load_inertia = share * inertia;
        let text = |key: &str, value: f64| format!("x.{key}={value}");
        let ratio = 0.02 / TAU;
        let per_axis = 1.0 / (ratio * ratio);
        let [coulomb, stribeck, viscous] = friction;
        let mut changes = vec![
            text("motor.emf_constant_v_s_rad", 2.64),
            text("friction.a", coulomb),
            text("friction.b", 0.02),
            text("friction.c", 0.0),
            text("friction.i0", coulomb),
            text("friction.stribeck", stribeck),
            text("friction.viscous", 0.01 * viscous),
            text("friction.presliding_stiffness_n_um", bristles * per_axis * 1e-6),
            format!("x.friction.presliding_elements={count}"),
        ];
        if let Some(attraction) = attraction {
            changes.push(text("friction.presliding_attraction_n_s", 10_f64.powf(attraction) / ratio));
        }
        if is_elastic {
            changes.push(text("transmission.stiffness_n_um", stiffness * per_axis * 1e-6));
            changes.push(text("transmission.load_mass_kg", load_inertia * per_axis));
        }
        let config = machine(&changes.iter().map(String::as_str).collect::<Vec<_>>());
        let axis = &config.axes()[X];
        let plant = Plant::new(axis, 125e-6).expect("can be discretized");
        let model = MaxwellSlip::of_axis(axis, plant.angle_per_torque(), 125e-6).expect("elements");
        let own = if is_elastic { inertia - load_inertia } else { inertia };
        let energy = |motor: &MotorState, load: &LoadState, state: &MaxwellSlipState| {
            let spring = axis.transmission.map_or(0.0, |t| t.stiffness * load.wind_up.powi(2) / 2.0);
            axis.motor.inductance * motor.current.powi(2) / 2.0
                + own * motor.speed.powi(2) / 2.0
                + load_inertia * load.speed.powi(2) / 2.0
                + spring
                + model.energy(state)
        };
        let limit = axis.motor.torque_constant * (coulomb + stribeck);
        let amplitude = 10_f64.powf(amplitude);
        for start in starts {
            let [current, speed, wind_up, load_speed] = [0, 1, 2, 3].map(|k| amplitude * start[k]);
            let mut motor = MotorState { current: 30.0 * current, speed: 100.0 * speed, angle: 0.0 };
            let mut load = LoadState::default();
            if is_elastic {
                load = LoadState { wind_up: wind_up / stiffness.sqrt(), speed: 100.0 * load_speed };
            }
            let mut state = MaxwellSlipState::default();
            for (k, element) in model.elements().iter().enumerate() {
                // Also above the limit, and of both signs.
                state.forces[k] = 1.5 * limit * element.share * start[4 + k % 2];
                state.is_slipping[k] = (k + usize::from(start[5] > 0.0)) % 3 == 0;
            }
            let first = energy(&motor, &load, &state);
            let mut before = first;
            for tick in 0..100 {
                plant.step_with_maxwell_slip(&mut motor, &mut load, (&model, &mut state), 0.0, 0.0);
                let now = energy(&motor, &load, &state);
                prop_assert!(now <= before + 1e-13 * first, "{now} after {before}, tick {tick}, {start:?}");
                before = now;
            }
        }
    }
}
