//! Energy balance of a drive over one tick.
//!
//! L di/dt = u − R i − Ke ω and J dω/dt = Kt i + τ, with τ = −C_friction − C_gravity + r F. In the sum of the first
//! times (Kt/Ke) i and the second times ω, the conversion term Kt i ω cancels:
//!
//! ```text
//! d/dt [ ½ (Kt/Ke) L i² + ½ J ω² ]  =  (Kt/Ke) (u i − R i²)  +  τ ω
//! ```
//!
//! Kt/Ke is the number of phases: 3 if both constants are per phase and rms. The right side is a quadratic form of
//! z = (i, ω, u, τ) with ż = M z, since u and τ are constant over a tick. Its integral over a tick is zᵀ W z with
//!
//! ```text
//! W = ∫ e^{Mᵀs} Q e^{Ms} ds = F₃ᵀ G,      exp( [−Mᵀ Q; 0 M] T ) = [F₁ G; 0 F₃]      (Van Loan 1978)
//! ```
//!
//! and is exact; it uses no step of the library.

use nalgebra::SMatrix;

use super::exponential::exponential;
use virtual_axes_core::config::AxisConfig;
use virtual_axes_core::drive::Plant;

/// Current and speed at the start of a tick, voltage and torque held over it.
#[derive(Debug, Clone, Copy)]
pub struct HeldInputs {
    /// i, A.
    pub current: f64,
    /// ω, rad/s (m/s).
    pub speed: f64,
    /// u, V.
    pub voltage: f64,
    /// τ: all torques but Kt i, N·m (N).
    pub torque: f64,
}

impl HeldInputs {
    fn numbers(&self) -> [f64; 4] {
        [self.current, self.speed, self.voltage, self.torque]
    }
}

/// Energy supplied to a drive and angle moved over one tick.
#[derive(Debug, Clone, Copy)]
pub struct TickWork {
    /// ∫ (Kt/Ke)(u i − R i²) + τ ω dt, J.
    pub done: f64,
    /// Sum of the magnitudes of its terms, J: reference of the rounding error.
    pub size: f64,
    /// ∫ ω dt, rad (m).
    pub turned: f64,
}

/// Energy model of one drive.
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

/// Rounding steps between the torques of a tick and its speed: products, sums, and the division of the torque that
/// stops the axis.
const ROUNDINGS: f64 = 8.0;

impl DriveEnergy {
    /// Creates the energy model of the drive of `axis`, with its deviations, for ticks of `tick` s.
    pub fn new(axis: &AxisConfig, tick: f64) -> Self {
        let motor = Plant::deviating_motor(axis);
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

    /// Returns the stored energy ½ (Kt/Ke) L i² + ½ J ω², J.
    pub fn stored(&self, current: f64, speed: f64) -> f64 {
        self.magnetic * current * current + self.kinetic * speed * speed
    }

    /// Returns the energy supplied over a tick.
    pub fn work(&self, held: &HeldInputs) -> TickWork {
        let z = held.numbers();
        let mut work = TickWork { done: 0.0, size: 0.0, turned: 0.0 };
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

    /// Returns the rounding error of the torque τ of a tick, N·m (N); `torques` is the sum of the magnitudes of its parts.
    /// At a standstill they cancel, with each other and with the motor torque, and each is rounded.
    pub fn torque_rounding(&self, held: &HeldInputs, torques: f64) -> f64 {
        let current = held.current.abs() + self.tick * held.voltage.abs() / self.inductance;
        ROUNDINGS * f64::EPSILON * (self.torque_constant * current + torques)
    }

    /// Returns the largest change of the work of a tick caused by a `difference` of τ, J.
    pub fn work_of(&self, difference: f64, held: &HeldInputs) -> f64 {
        let crossed: f64 = self.work[3].iter().zip(held.numbers()).map(|(w, z)| (w * z).abs()).sum();
        difference * (2.0 * crossed + self.work[3][3].abs() * difference)
    }

    /// Returns the change of the speed at the end of a tick caused by a `difference` of τ, rad/s (m/s).
    pub fn speed_of(&self, difference: f64) -> f64 {
        difference * self.tick / (2.0 * self.kinetic)
    }

    /// Returns the largest difference between the angle moved in a tick and the trapezoidal rule, rad (m).
    ///
    /// The error of the trapezoidal rule is T³/12 max|ω̈|, and ω̈ = Kt/J di/dt while τ is held. The voltage that changes the
    /// current is at most twice the sum of the magnitudes of its terms at the start, because a tick is short relative to
    /// the time constants of the motor.
    pub fn uneven(&self, held: &HeldInputs) -> f64 {
        let voltage =
            held.voltage.abs() + self.resistance * held.current.abs() + self.emf_constant * held.speed.abs();
        self.unevenness * voltage
    }
}
