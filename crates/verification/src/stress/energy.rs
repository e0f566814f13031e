//! The energy of a drive, and what changes it over a tick.
//!
//! L di/dt = u − R i − Ke ω and J dω/dt = Kt i + τ, with τ = −C_friction − C_gravity + r F. The first times
//! (Kt/Ke) i and the second times ω, added, lose the conversion Kt i ω:
//!
//! ```text
//! d/dt [ ½ (Kt/Ke) L i² + ½ J ω² ]  =  (Kt/Ke) (u i − R i²)  +  τ ω
//! ```
//!
//! So Kt/Ke is the number of phases that work: 3 where both are per phase and rms. The right side is a quadratic
//! form of z = (i, ω, u, τ), of which u and τ are held over a tick: ż = M z. Its integral over a tick is zᵀ W z with
//!
//! ```text
//! W = ∫ e^{Mᵀs} Q e^{Ms} ds = F₃ᵀ G,      exp( [−Mᵀ Q; 0 M] T ) = [F₁ G; 0 F₃]      (Van Loan 1978)
//! ```
//!
//! and so it is exact: no step of the library's is in it.

use nalgebra::SMatrix;

use super::exponential::exponential;
use virtual_axes_core::config::AxisConfig;
use virtual_axes_core::drive::Plant;

/// What a drive is at the start of a tick, and what is held over it.
#[derive(Debug, Clone, Copy)]
pub struct Held {
    /// i, A.
    pub current: f64,
    /// ω, rad/s (m/s).
    pub speed: f64,
    /// u, V.
    pub voltage: f64,
    /// τ: all torques but Kt i, N·m (N).
    pub torque: f64,
}

impl Held {
    fn numbers(&self) -> [f64; 4] {
        [self.current, self.speed, self.voltage, self.torque]
    }
}

/// What a tick puts into a drive.
#[derive(Debug, Clone, Copy)]
pub struct Work {
    /// ∫ (Kt/Ke)(u i − R i²) + τ ω dt, J.
    pub done: f64,
    /// The sum of its terms by their sizes, J: what rounding is relative to.
    pub size: f64,
    /// ∫ ω dt, rad (m).
    pub turned: f64,
}

/// Energy of one drive.
#[derive(Debug, Clone)]
pub struct DriveEnergy {
    kinetic: f64,
    magnetic: f64,
    work: [[f64; 4]; 4],
    turned: [f64; 4],
    /// Kt T³ / (6 J L): see [`Self::uneven`].
    unevenness: f64,
    resistance: f64,
    emf_constant: f64,
    torque_constant: f64,
    inductance: f64,
    /// T, s.
    tick: f64,
}

/// Roundings between the torques of a tick and its speed: products, sums, and the division that makes the torque that
/// stops the axis.
const ROUNDINGS: f64 = 8.0;

impl DriveEnergy {
    /// The drive of `axis`, as it is with what it deviates by, over ticks of `tick` s.
    pub fn new(axis: &AxisConfig, tick: f64) -> Self {
        let motor = Plant::motor(axis);
        let phases = motor.torque_constant / motor.emf_constant;
        let mut moving = SMatrix::<f64, 4, 4>::zeros();
        moving[(0, 0)] = -motor.resistance / motor.inductance;
        moving[(0, 1)] = -motor.emf_constant / motor.inductance;
        moving[(0, 2)] = 1.0 / motor.inductance;
        moving[(1, 0)] = motor.torque_constant / motor.inertia;
        moving[(1, 3)] = 1.0 / motor.inertia;
        let mut power = SMatrix::<f64, 4, 4>::zeros();
        power[(0, 0)] = -phases * motor.resistance;
        (power[(0, 2)], power[(2, 0)]) = (0.5 * phases, 0.5 * phases);
        (power[(1, 3)], power[(3, 1)]) = (0.5, 0.5);
        let mut both = SMatrix::<f64, 8, 8>::zeros();
        both.fixed_view_mut::<4, 4>(0, 0).copy_from(&-moving.transpose());
        both.fixed_view_mut::<4, 4>(0, 4).copy_from(&power);
        both.fixed_view_mut::<4, 4>(4, 4).copy_from(&moving);
        let both = exponential(&(both * tick));
        let work = both.fixed_view::<4, 4>(4, 4).transpose() * both.fixed_view::<4, 4>(0, 4);
        let mut with_angle = SMatrix::<f64, 5, 5>::zeros();
        with_angle.fixed_view_mut::<4, 4>(0, 0).copy_from(&moving);
        with_angle[(4, 1)] = 1.0;
        let with_angle = exponential(&(with_angle * tick));
        DriveEnergy {
            kinetic: 0.5 * motor.inertia,
            magnetic: 0.5 * phases * motor.inductance,
            work: [0, 1, 2, 3].map(|i| [0, 1, 2, 3].map(|j| 0.5 * (work[(i, j)] + work[(j, i)]))),
            turned: [0, 1, 2, 3].map(|j| with_angle[(4, j)]),
            unevenness: motor.torque_constant * tick.powi(3) / (6.0 * motor.inertia * motor.inductance),
            resistance: motor.resistance,
            emf_constant: motor.emf_constant,
            torque_constant: motor.torque_constant,
            inductance: motor.inductance,
            tick,
        }
    }

    /// ½ (Kt/Ke) L i² + ½ J ω², J.
    pub fn stored(&self, current: f64, speed: f64) -> f64 {
        self.magnetic * current * current + self.kinetic * speed * speed
    }

    /// What a tick puts in.
    pub fn work(&self, held: &Held) -> Work {
        let z = held.numbers();
        let mut work = Work { done: 0.0, size: 0.0, turned: 0.0 };
        for i in 0..4 {
            work.turned += self.turned[i] * z[i];
            for j in i..4 {
                let part = self.work[i][j] * z[i] * z[j] * if i == j { 1.0 } else { 2.0 };
                work.done += part;
                work.size += part.abs();
            }
        }
        work
    }

    /// By how much the torque τ of a tick is rounded, N·m (N), where it is made of torques of these sizes in sum: at a
    /// standstill they cancel, with each other and with that of the motor, and each is rounded.
    pub fn torque_rounding(&self, held: &Held, torques: f64) -> f64 {
        let current = held.current.abs() + self.tick * held.voltage.abs() / self.inductance;
        ROUNDINGS * f64::EPSILON * (self.torque_constant * current + torques)
    }

    /// What a difference of τ makes of the work of a tick at most, J.
    pub fn work_of(&self, difference: f64, held: &Held) -> f64 {
        let crossed: f64 = self.work[3].iter().zip(held.numbers()).map(|(w, z)| (w * z).abs()).sum();
        difference * (2.0 * crossed + self.work[3][3].abs() * difference)
    }

    /// What a difference of τ makes of the speed at the end of a tick, rad/s (m/s).
    pub fn speed_of(&self, difference: f64) -> f64 {
        difference * self.tick / (2.0 * self.kinetic)
    }

    /// By how much the way over a tick may differ from that of a speed that goes evenly from its first to its last
    /// value, rad (m).
    ///
    /// The trapezoidal rule is off by T³/12 max|ω̈|, and ω̈ = Kt/J di/dt while τ is held; the voltage that drives the
    /// current is at most twice its sum by sizes at the start, a tick being short against the motor's time constants.
    pub fn uneven(&self, held: &Held) -> f64 {
        let voltage =
            held.voltage.abs() + self.resistance * held.current.abs() + self.emf_constant * held.speed.abs();
        self.unevenness * voltage
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use virtual_axes_core::config::Parameters;

    /// By Simpson's rule on the motion in a thousand parts, each by a series of its own.
    #[test]
    fn the_work_of_a_tick_is_the_integral_of_its_power() {
        let machine = Parameters::embedded_default().and_then(|p| p.machine_config()).expect("valid");
        let (tick, parts) = (125e-6, 1000);
        for axis in machine.axes() {
            let m = Plant::motor(axis);
            let phases = m.torque_constant / m.emf_constant;
            let held = Held { current: 12.0, speed: -30.0, voltage: 150.0, torque: -4.0 };
            let derivative = |i: f64, w: f64| {
                let di = (held.voltage - m.resistance * i - m.emf_constant * w) / m.inductance;
                (di, (m.torque_constant * i + held.torque) / m.inertia)
            };
            let power = |i: f64, w: f64| phases * (held.voltage * i - m.resistance * i * i) + held.torque * w;
            let (mut i, mut w) = (held.current, held.speed);
            let (mut done, mut turned) = (0.0, 0.0);
            let h = tick / f64::from(parts);
            for _ in 0..parts {
                // Taylor series of the linear motion to the third order: exact to h⁴.
                let at = |t: f64| {
                    let (d, e) = derivative(i, w);
                    let d2 = (
                        -(m.resistance * d + m.emf_constant * e) / m.inductance,
                        m.torque_constant * d / m.inertia,
                    );
                    let d3 = (
                        -(m.resistance * d2.0 + m.emf_constant * d2.1) / m.inductance,
                        m.torque_constant * d2.0 / m.inertia,
                    );
                    let series = |x: f64, a: f64, b: f64, c: f64| x + t * (a + t / 2.0 * (b + t / 3.0 * c));
                    (series(i, d, d2.0, d3.0), series(w, e, d2.1, d3.1))
                };
                let (middle, end) = (at(h / 2.0), at(h));
                done += h / 6.0 * (power(i, w) + 4.0 * power(middle.0, middle.1) + power(end.0, end.1));
                turned += h / 6.0 * (w + 4.0 * middle.1 + end.1);
                (i, w) = end;
            }
            let energy = DriveEnergy::new(axis, tick);
            let work = energy.work(&held);
            assert!(
                (work.done - done).abs() <= 1e-12 * work.size,
                "{}: {} J, not {done} J",
                axis.name(),
                work.done
            );
            assert!((work.turned - turned).abs() <= 1e-12 * turned.abs());
            let change = energy.stored(i, w) - energy.stored(held.current, held.speed);
            assert!((work.done - change).abs() <= 1e-11 * work.size, "{} J, not {change} J", work.done);
            let even = 0.5 * tick * (held.speed + w);
            assert!((turned - even).abs() <= energy.uneven(&held));
        }
    }
}
