//! Motor stepped by exact zero-order-hold discretization (matrix exponential), without discretization error.

use std::f64::consts::TAU;

use nalgebra::SMatrix;

use super::DriveError;
use super::response::SecondOrderResponse;
use crate::config::MotorConfig;
use crate::simd::{SimdReal, clamp_abs, soa_struct};

/// Largest entry of system matrix × tick for which the Padé approximant needs no scaling and squaring.
const MAX_PADE_ENTRY: f64 = 0.5;

soa_struct! {
    /// State of a motor (Prévost eq. 1).
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

soa_struct! {
    /// Zero-order-hold discretization of Prévost eq. 1 over one tick.
    ///
    /// Voltage u and torque τ (all torques except Kt·i) are held over the tick:
    ///
    /// ```text
    /// [i ω]ₙ₊₁ = Φ [i ω]ₙ + Γu u + Γτ τ
    ///   θₙ₊₁   = θₙ + φ [i ω]ₙ + γu u + γτ τ
    /// ```
    ///
    /// Φ and Γ are blocks of the exponential of the augmented system matrix times the tick.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct Motor {
        pub(super) current: TransitionRow<N>,
        pub(super) speed: TransitionRow<N>,
        pub(super) angle: TransitionRow<N>,
        /// Change of ω over one tick per torque at the motor, (rad/s)/(N·m).
        speed_per_torque: N,
        /// Torque at the motor per change of ω over one tick, (N·m)/(rad/s).
        torque_per_speed: N,
        /// Change of i by a torque that changes ω by 1 rad/s over one tick, A/(rad/s).
        current_per_speed: N,
        /// Change of θ by a torque that changes ω by 1 rad/s over one tick, rad/(rad/s).
        angle_per_speed: N,
        /// Change of ω by a torque that changes θ by 1 rad over one tick, (rad/s)/rad.
        speed_per_angle: N,
    }
}

soa_struct! {
    /// One row of the discretized system: weights of i, ω, u and τ.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub(super) struct TransitionRow {
        pub current: N,
        pub speed: N,
        pub voltage: N,
        pub torque: N,
    }
}

impl<N: SimdReal> TransitionRow<N> {
    #[inline(always)]
    fn apply(&self, s: &MotorState<N>, voltage: N, torque: N) -> N {
        self.apply_to(s, voltage, self.torque * torque)
    }

    /// Adds the weighted i, ω and u to `rest`.
    #[inline(always)]
    pub fn apply_to(&self, s: &MotorState<N>, voltage: N, rest: N) -> N {
        // The voltage is the last operand to be computed.
        let rest = self.current.mul_add(s.current, self.speed.mul_add(s.speed, rest));
        self.voltage.mul_add(voltage, rest)
    }
}

impl TransitionRow {
    fn is_finite(&self) -> bool {
        [self.current, self.speed, self.voltage, self.torque].iter().all(|weight| weight.is_finite())
    }
}

/// Returns the augmented system matrix: states i, ω, θ, then the held inputs u and τ.
fn system_matrix(m: &MotorConfig) -> SMatrix<f64, 5, 5> {
    let mut a = SMatrix::zeros();
    a[(0, 0)] = -m.resistance / m.inductance;
    a[(0, 1)] = -m.emf_constant / m.inductance;
    a[(0, 3)] = 1.0 / m.inductance;
    a[(1, 0)] = m.torque_constant / m.inertia;
    a[(1, 4)] = 1.0 / m.inertia;
    a[(2, 1)] = 1.0;
    a
}

/// Computes the rows of a slow motor by the Padé approximant of nalgebra, without scaling and squaring.
fn pade_rows(system: &SMatrix<f64, 5, 5>) -> [TransitionRow; 3] {
    let e = system.exp();
    [0, 1, 2].map(|k| TransitionRow {
        current: e[(k, 0)],
        speed: e[(k, 1)],
        voltage: e[(k, 3)],
        torque: e[(k, 4)],
    })
}

/// Computes the rows of any motor in closed form.
fn closed_form_rows(m: &MotorConfig, response: &SecondOrderResponse) -> [TransitionRow; 3] {
    let SecondOrderResponse { impulse, step, ramp, slope, speed_decay, .. } = *response;
    let damping = m.resistance / m.inductance;
    let (per_current, per_speed) = (m.torque_constant / m.inertia, -m.emf_constant / m.inductance);
    // g′ + a g, integrated once and twice.
    let (once, twice) = (impulse + damping * step, step + damping * ramp);
    let row = |current, speed, voltage: f64, torque: f64| TransitionRow {
        current,
        speed,
        voltage: voltage / m.inductance,
        torque: torque / m.inertia,
    };
    [
        row(slope, per_speed * impulse, impulse, per_speed * step),
        row(per_current * impulse, speed_decay, per_current * step, once),
        row(per_current * step, once, per_current * ramp, twice),
    ]
}

impl Motor {
    /// Discretizes the motor over `period` seconds.
    ///
    /// # Errors
    /// [`DriveError::Discretization`] if a coefficient is not finite; [`DriveError::Oscillates`] if the period is so
    /// long that the speed response to a torque changes its sign within it, so that friction cannot be computed.
    pub fn new(motor: &MotorConfig, period: f64) -> Result<Self, DriveError> {
        let damping = motor.resistance / motor.inductance;
        let stiffness = motor.emf_constant / motor.inductance * (motor.torque_constant / motor.inertia);
        let response = SecondOrderResponse::new(damping, stiffness, period);
        let system = system_matrix(motor) * period;
        let is_slow = system.iter().all(|entry| entry.abs() <= MAX_PADE_ENTRY);
        let [current, speed, angle] =
            if is_slow { pade_rows(&system) } else { closed_form_rows(motor, &response) };
        let torque_per_speed = 1.0 / speed.torque;
        if ![current, speed, angle].iter().all(TransitionRow::is_finite) || !torque_per_speed.is_finite() {
            return Err(DriveError::Discretization { period_s: period, speed_per_torque: speed.torque });
        }
        if !response.has_constant_sign {
            let frequency_hz = (stiffness - damping * damping / 4.0).max(0.0).sqrt() / TAU;
            return Err(DriveError::Oscillates { period_s: period, frequency_hz });
        }
        Ok(Self::from_rows([current, speed, angle], [current, speed, angle].map(|row| row.torque)))
    }

    /// Creates the motor from its rows; `friction` contains the changes of i, ω and θ per torque at the motor, which
    /// differ from the weights of τ if τ acts behind an elastic transmission.
    pub(super) fn from_rows([current, speed, angle]: [TransitionRow; 3], friction: [f64; 3]) -> Self {
        let torque_per_speed = 1.0 / friction[1];
        Motor {
            current,
            speed,
            angle,
            speed_per_torque: friction[1],
            torque_per_speed,
            current_per_speed: friction[0] * torque_per_speed,
            angle_per_speed: friction[2] * torque_per_speed,
            speed_per_angle: friction[1] / friction[2],
        }
    }

    /// Returns the change of ω over one tick per torque at the motor, (rad/s)/(N·m).
    pub(super) fn speed_per_torque(&self) -> f64 {
        self.speed_per_torque
    }

    /// Returns the change of θ over one tick per torque at the motor, rad/(N·m).
    pub(super) fn angle_per_torque(&self) -> f64 {
        self.speed_per_torque * self.angle_per_speed
    }
}

impl<N: SimdReal> Motor<N> {
    /// Returns the state at the end of the tick for a held `voltage` (V) and `torque` (N·m).
    #[inline(always)]
    pub fn step(&self, s: &MotorState<N>, voltage: N, torque: N) -> MotorState<N> {
        MotorState {
            current: self.current.apply(s, voltage, torque),
            speed: self.speed.apply(s, voltage, torque),
            angle: s.angle + self.angle.apply(s, voltage, torque),
        }
    }

    /// Returns the state at the end of the tick with friction, and the speed drop by friction over the tick, rad/s.
    ///
    /// Friction is the torque that gives ω = 0 at the end of the tick, limited so that the speed drop is at most
    /// `max_speed_drop` (rad/s, not negative). Within the limit ω is exactly 0.0. Friction never reverses ω, also not
    /// by rounding: the speed drop never exceeds the speed.
    #[inline(always)]
    pub(super) fn step_with_friction(
        &self,
        s: &MotorState<N>,
        voltage: N,
        external: N,
        max_speed_drop: N,
    ) -> (MotorState<N>, N) {
        let free = self.step(s, voltage, external);
        let speed_drop = clamp_abs(free.speed, max_speed_drop);
        (self.brake(&free, speed_drop), speed_drop)
    }

    /// Returns the state `free` at the end of a tick with the speed drop by friction over it, rad/s.
    #[inline(always)]
    pub(super) fn brake(&self, free: &MotorState<N>, speed_drop: N) -> MotorState<N> {
        MotorState {
            current: speed_drop.mul_add(-self.current_per_speed, free.current),
            speed: free.speed - speed_drop,
            angle: speed_drop.mul_add(-self.angle_per_speed, free.angle),
        }
    }

    /// Returns the change of θ over a tick for a held `voltage` (V) and `torque` (N·m), rad.
    #[inline(always)]
    pub(super) fn displacement(&self, s: &MotorState<N>, voltage: N, torque: N) -> N {
        self.angle.apply(s, voltage, torque)
    }

    /// Returns the displacement (rad) by the torque of a speed drop over one tick (rad/s).
    #[inline(always)]
    pub(super) fn displacement_by_speed_drop(&self, speed_drop: N) -> N {
        speed_drop * self.angle_per_speed
    }

    /// Returns the speed drop over one tick (rad/s) by the torque of a displacement (rad).
    #[inline(always)]
    pub(super) fn speed_drop_by_displacement(&self, displacement: N) -> N {
        displacement * self.speed_per_angle
    }

    /// Returns the friction torque for a speed drop over one tick (rad/s), N·m.
    #[inline(always)]
    pub(super) fn torque_from_speed_drop(&self, speed_drop: N) -> N {
        speed_drop * self.torque_per_speed
    }
}
