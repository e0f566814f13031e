//! Friction by elements against an independent solution of the equations of its authors (`tools/golden_friction.py`).

use std::f64::consts::TAU;

use virtual_axes_core::drive::{Friction, MaxwellSlip, MaxwellSlipElement, MaxwellSlipState};

use crate::gms::PER_FORCE;
use crate::parameter_ranges::golden;
use crate::presliding::published_axis;

/// Elements of `tools/golden_friction.py`.
const ELEMENTS: [MaxwellSlipElement; 4] = [
    MaxwellSlipElement { stiffness: 5e4, share: 0.2 },
    MaxwellSlipElement { stiffness: 2.5e4, share: 0.25 },
    MaxwellSlipElement { stiffness: 1.5e4, share: 0.25 },
    MaxwellSlipElement { stiffness: 1e4, share: 0.3 },
];
const ATTRACTION: f64 = 40.0;

/// Largest differences to the golden rows of a case, relative to the largest values: position, friction.
#[derive(Default)]
struct Difference {
    worst: [f64; 2],
    largest: [f64; 2],
}

impl Difference {
    fn add(&mut self, found: [f64; 2], exact: [f64; 2]) {
        for k in 0..2 {
            self.worst[k] = self.worst[k].max((found[k] - exact[k]).abs());
            self.largest[k] = self.largest[k].max(exact[k].abs());
        }
    }

    fn relative(&self) -> [f64; 2] {
        [self.worst[0] / self.largest[0], self.worst[1] / self.largest[1]]
    }
}

/// Simulates a mass of 1 kg under `force(time, position)` until the times of the golden rows of a case.
fn errors_with_mass(case: f64, viscosity: f64, period: f64, force: impl Fn(f64, f64) -> f64) -> [f64; 2] {
    let per_force = period * period / 2.0;
    let (law, _) = Friction::of_axis(&published_axis(), 1.0).of_presliding();
    let model = MaxwellSlip::new(&ELEMENTS, Some(ATTRACTION), viscosity, period, per_force);
    let mut state = MaxwellSlipState::default();
    let (mut position, mut speed, mut step) = (0.0, 0.0, 0);
    let mut difference = Difference::default();
    for row in golden("gms.csv").iter().filter(|row| row[0] == case) {
        let mut friction = 0.0;
        while (f64::from(step) + 0.5) * period < row[1] {
            let outer = force((f64::from(step) + 0.5) * period, position + period / 2.0 * speed);
            let free = period * speed + per_force * outer;
            let drop = model.step(free, per_force * law.bound(speed), speed, &mut state);
            friction = drop / per_force;
            position += free - drop;
            speed += period * (outer - friction);
            step += 1;
        }
        difference.add([position, friction], [row[2], row[4]]);
    }
    difference.relative()
}

fn two_frequencies(time: f64, _position: f64) -> f64 {
    let angle = TAU * time / 4.0;
    1.9 * (0.65 * angle.sin() + 0.35 * (3.0 * angle).sin())
}

#[test]
fn presliding_under_two_frequencies_converges_to_the_equations_of_the_authors() {
    let errors = [1e-4, 5e-5, 2.5e-5].map(|period| errors_with_mass(0.0, 200.0, period, two_frequencies));
    println!(
        "two frequencies, relative errors of position and friction at 0.1, 0.05 and 0.025 ms: {errors:?}"
    );
    for k in 0..2 {
        assert!(errors[1][k] < 1e-2, "{errors:?}");
        assert!((errors[1][k] / errors[2][k] - 2.0).abs() < 0.3, "{errors:?}");
    }
}

/// The forces of slipping elements are limited as in case 3; without the limit (case 1) the equations of the authors
/// can supply energy at the end of a slip.
#[test]
fn stick_slip_converges_to_the_equations_with_limited_growth() {
    let spring = |time: f64, position: f64| 200.0 * (0.001 * time - position);
    let errors = [1e-4, 5e-5, 2.5e-5].map(|period| errors_with_mass(3.0, 40.0, period, spring));
    let unlimited = errors_with_mass(1.0, 40.0, 2.5e-5, spring);
    println!("stick-slip, relative errors of position and friction at 0.1, 0.05 and 0.025 ms: {errors:?}");
    println!("stick-slip, relative differences to the equations without limit at 0.025 ms: {unlimited:?}");
    for k in 0..2 {
        assert!(errors[1][k] < 1e-2, "{errors:?}");
        assert!((errors[1][k] / errors[2][k] - 2.0).abs() < 0.4, "{errors:?}");
        assert!(unlimited[k] < 0.02, "{unlimited:?}");
    }
}

/// Returns the largest difference of the friction at a sinusoidal velocity, relative to the largest; the elements
/// follow the law at once without an `attraction`.
fn lag_error(period: f64, attraction: Option<f64>) -> f64 {
    let (law, _) = Friction::of_axis(&published_axis(), 1.0).of_presliding();
    let model = MaxwellSlip::new(&ELEMENTS, attraction, 0.4, period, PER_FORCE);
    let mut state = MaxwellSlipState::default();
    let position = |time: f64| 1.5e-3 * time + 1.2e-3 / TAU * (1.0 - (TAU * time).cos());
    let velocity = |time: f64| 1.5e-3 + 1.2e-3 * (TAU * time).sin();
    let (mut difference, mut step) = (Difference::default(), 0);
    for row in golden("gms.csv").iter().filter(|row| row[0] == 2.0) {
        while (f64::from(step) + 0.5) * period < row[1] {
            let [from, to] = [step, step + 1].map(|k| f64::from(k) * period);
            let (distance, speed) = (position(to) - position(from), velocity(from));
            model.step(distance, PER_FORCE * law.bound(speed), speed, &mut state);
            step += 1;
        }
        let friction = state.forces.iter().sum::<f64>() + 0.4 * velocity(row[1]);
        difference.add([position(row[1]), friction], [row[2], row[4]]);
    }
    difference.relative()[1]
}

#[test]
fn frictional_lag_converges_to_the_equations_of_the_authors() {
    let errors = [4e-4, 2e-4, 1e-4, 5e-5].map(|period| lag_error(period, Some(ATTRACTION)));
    let without = lag_error(5e-5, None);
    println!("lag, relative errors of friction at 0.4 to 0.05 ms: {errors:?}, without attraction {without}");
    assert!(errors[3] < 1e-3 && without > 0.02, "{errors:?}, {without}");
    for pair in errors.windows(2) {
        assert!((pair[0] / pair[1] - 2.0).abs() < 0.3, "{errors:?}");
    }
}
