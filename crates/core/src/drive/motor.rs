//! The motor between two ticks, stepped without discretization error.

use std::f64::consts::TAU;

use nalgebra::SMatrix;

use super::DriveError;
use super::response::Response;
use crate::config::MotorConfig;
use crate::simd::{Number, limited, numbers};

/// Largest entry of the system matrix times the tick with which a motor is slow: no interval is halved.
const SLOW: f64 = 0.5;

numbers! {
    /// State of a motor: what the differential equation integrates.
    #[derive(Debug, Clone, Copy, Default, PartialEq)]
    pub struct MotorState {
        /// i, A.
        pub current: N,
        /// ω, rad/s (m/s for a linear motor).
        pub speed: N,
        /// θ, rad (m for a linear motor).
        pub angle: N,
    }
}

numbers! {
    /// Zero-order-hold discretization of Prévost eq. 1 over one tick.
    ///
    /// With voltage u and torque τ (everything but Kt·i) held,
    ///
    /// ```text
    /// [i ω]ₙ₊₁ = Φ [i ω]ₙ + Γu u + Γτ τ
    ///   θₙ₊₁   = θₙ + φ [i ω]ₙ + γu u + γτ τ
    /// ```
    ///
    /// where Φ, Γ are blocks of the exponential of the augmented system matrix times the tick.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct Motor {
        current: Row<N>,
        speed: Row<N>,
        angle: Row<N>,
        /// Torque per change of ω over one tick, (N·m)/(rad/s).
        torque_per_speed: N,
        /// What a torque that changes ω by 1 rad/s over one tick changes i and θ by, A and rad.
        current_per_speed: N,
        angle_per_speed: N,
    }
}

numbers! {
    /// One row of the discretized system: the weights of i, ω, u and τ.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub(super) struct Row {
        current: N,
        speed: N,
        voltage: N,
        torque: N,
    }
}

impl<N: Number> Row<N> {
    #[inline(always)]
    fn apply(&self, s: &MotorState<N>, voltage: N, torque: N) -> N {
        // The voltage is known last.
        let rest = self.current.mul_add(s.current, self.speed.mul_add(s.speed, self.torque * torque));
        self.voltage.mul_add(voltage, rest)
    }
}

impl Row {
    fn is_finite(&self) -> bool {
        [self.current, self.speed, self.voltage, self.torque].iter().all(|weight| weight.is_finite())
    }
}

/// The system matrix: states i, ω, θ, then the held inputs u and τ.
fn system(m: &MotorConfig) -> SMatrix<f64, 5, 5> {
    let mut a = SMatrix::zeros();
    a[(0, 0)] = -m.resistance / m.inductance;
    a[(0, 1)] = -m.emf_constant / m.inductance;
    a[(0, 3)] = 1.0 / m.inductance;
    a[(1, 0)] = m.torque_constant / m.inertia;
    a[(1, 4)] = 1.0 / m.inertia;
    a[(2, 1)] = 1.0;
    a
}

/// The rows of a slow motor, by the approximant of Padé that nalgebra takes where it need not halve.
fn approximant(system: &SMatrix<f64, 5, 5>) -> [Row; 3] {
    let e = system.exp();
    [0, 1, 2].map(|k| Row { current: e[(k, 0)], speed: e[(k, 1)], voltage: e[(k, 3)], torque: e[(k, 4)] })
}

/// The rows of any motor.
fn closed_form(m: &MotorConfig, response: &Response) -> [Row; 3] {
    let Response { impulse, step, ramp, slope, held, .. } = *response;
    let damping = m.resistance / m.inductance;
    let (per_current, per_speed) = (m.torque_constant / m.inertia, -m.emf_constant / m.inductance);
    // g′ + a g, integrated once and twice.
    let (once, twice) = (impulse + damping * step, step + damping * ramp);
    let row = |current, speed, voltage: f64, torque: f64| Row {
        current,
        speed,
        voltage: voltage / m.inductance,
        torque: torque / m.inertia,
    };
    [
        row(slope, per_speed * impulse, impulse, per_speed * step),
        row(per_current * impulse, held, per_current * step, once),
        row(per_current * step, once, per_current * ramp, twice),
    ]
}

impl Motor {
    /// Discretizes the motor over `period` seconds.
    ///
    /// # Errors
    /// [`DriveError::Discretization`] if the step is not finite; [`DriveError::Swings`] if it is so long that a
    /// torque would turn the motor against its own direction within it (friction could not be resolved then).
    pub fn new(motor: &MotorConfig, period: f64) -> Result<Self, DriveError> {
        let damping = motor.resistance / motor.inductance;
        let stiffness = motor.emf_constant / motor.inductance * (motor.torque_constant / motor.inertia);
        let response = Response::new(damping, stiffness, period);
        let system = system(motor) * period;
        let slow = system.iter().all(|entry| entry.abs() <= SLOW);
        let [current, speed, angle] = if slow { approximant(&system) } else { closed_form(motor, &response) };
        let torque_per_speed = 1.0 / speed.torque;
        if ![current, speed, angle].iter().all(Row::is_finite) || !torque_per_speed.is_finite() {
            return Err(DriveError::Discretization { period_s: period, speed_per_torque: speed.torque });
        }
        if !response.keeps_direction {
            let frequency_hz = (stiffness - damping * damping / 4.0).max(0.0).sqrt() / TAU;
            return Err(DriveError::Swings { period_s: period, frequency_hz });
        }
        Ok(Motor {
            current,
            speed,
            angle,
            torque_per_speed,
            current_per_speed: current.torque * torque_per_speed,
            angle_per_speed: angle.torque * torque_per_speed,
        })
    }

    /// Change of ω over a tick per torque that acts over it, (rad/s)/(N·m).
    pub(super) fn speed_per_torque(&self) -> f64 {
        self.speed.torque
    }
}

impl<N: Number> Motor<N> {
    /// State at the end of the tick under `voltage` and a held `torque`.
    #[inline(always)]
    pub fn step(&self, s: &MotorState<N>, voltage: N, torque: N) -> MotorState<N> {
        MotorState {
            current: self.current.apply(s, voltage, torque),
            speed: self.speed.apply(s, voltage, torque),
            angle: s.angle + self.angle.apply(s, voltage, torque),
        }
    }

    /// State at the end of the tick, and what friction takes from ω over it (rad/s): what ends the tick at
    /// standstill, limited to `slowing` (rad/s, not negative). Where it is not limited ω is 0.0 exactly, and
    /// rounding never turns ω round: what friction takes away is never more than there is.
    #[inline(always)]
    pub(super) fn step_with_friction(
        &self,
        s: &MotorState<N>,
        voltage: N,
        external: N,
        slowing: N,
    ) -> (MotorState<N>, N) {
        let free = self.step(s, voltage, external);
        let taken = limited(free.speed, slowing);
        let state = MotorState {
            current: taken.mul_add(-self.current_per_speed, free.current),
            speed: free.speed - taken,
            angle: taken.mul_add(-self.angle_per_speed, free.angle),
        };
        (state, taken)
    }

    /// The friction torque that takes `taken` from ω over a tick (rad/s), N·m.
    #[inline(always)]
    pub(super) fn torque_taking(&self, taken: N) -> N {
        taken * self.torque_per_speed
    }
}
