//! Elastic transmission: motor and load as two masses with a spring and a damper between them, stepped by exact
//! zero-order-hold discretization.
//!
//! Inertia, stiffness and damping are those at the motor, as the states:
//!
//! ```text
//!   L di/dt = u − R i − Ke ω
//! Jm dω/dt  = Kt i − τ − C_friction           τ = k δ + d (ω − ω_load)
//! Jl dω_load/dt = τ − C_gravity + r F_load
//!   dδ/dt   = ω − ω_load                      dθ/dt = ω       θ_load = θ − δ
//! ```

use nalgebra::SMatrix;

use super::DriveError;
use super::motor::{Motor, MotorState, TransitionRow};
use crate::config::{MotorConfig, TransmissionConfig};
use crate::simd::{SimdReal, soa_struct};

/// Order of the augmented system: states i, ω, δ, ω_load, θ, then the held inputs u, τ at the motor and τ at the load.
const ORDER: usize = 8;
/// Column of the state δ, whose scale balances the matrix.
const WIND_UP: usize = 2;

soa_struct! {
    /// State of the load behind an elastic transmission; 0 without one.
    #[derive(Debug, Clone, Copy, Default, PartialEq)]
    pub struct LoadState {
        /// Wind-up δ = θ − θ_load, rad (m for a linear motor) at the motor.
        pub wind_up: N,
        /// ω_load, rad/s (m/s for a linear motor) at the motor.
        pub speed: N,
    }
}

soa_struct! {
    /// Weights of the state of the load in a row of the discretized motor.
    #[derive(Debug, Clone, Copy, PartialEq)]
    struct LoadWeights {
        wind_up: N,
        speed: N,
    }
}

soa_struct! {
    /// Row of a state of the load in the discretized system.
    #[derive(Debug, Clone, Copy, PartialEq)]
    struct LoadRow {
        motor: TransitionRow<N>,
        load: LoadWeights<N>,
        /// Change by a friction torque that changes ω by 1 rad/s over one tick.
        per_speed: N,
    }
}

soa_struct! {
    /// Row of a state of the load with the motor held by friction.
    #[derive(Debug, Clone, Copy, PartialEq)]
    struct HeldRow {
        load: LoadWeights<N>,
        torque: N,
    }
}

soa_struct! {
    /// Discretized system with the motor held by friction: ω = 0, θ constant.
    #[derive(Debug, Clone, Copy, PartialEq)]
    struct HeldMotor {
        /// Weight of i in the next i.
        current: N,
        /// Weight of u in the next i.
        voltage: N,
        wind_up: HeldRow<N>,
        load_speed: HeldRow<N>,
    }
}

soa_struct! {
    /// Discretized elastic transmission: the parts of the system that a rigid axis does not have.
    ///
    /// A rigid axis has weights of −0 and rows of 0: its wind-up and load speed remain +0, and its motor has the bits of
    /// [`Motor::step`].
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct Transmission {
        current: LoadWeights<N>,
        speed: LoadWeights<N>,
        angle: LoadWeights<N>,
        wind_up: LoadRow<N>,
        load_speed: LoadRow<N>,
        held: HeldMotor<N>,
        /// Wind-up by a torque at the load at rest, rad/(N·m).
        compliance: N,
    }
}

/// Matrix of the augmented system, or its exponential.
type SystemMatrix = SMatrix<f64, ORDER, ORDER>;

/// Returns the augmented system matrix with the state δ multiplied by `scale`.
fn system_matrix(m: &MotorConfig, t: &TransmissionConfig, scale: f64) -> SystemMatrix {
    let motor_inertia = m.inertia - t.load_inertia;
    let mut a = SMatrix::zeros();
    a[(0, 0)] = -m.resistance / m.inductance;
    a[(0, 1)] = -m.emf_constant / m.inductance;
    a[(0, 5)] = 1.0 / m.inductance;
    a[(1, 0)] = m.torque_constant / motor_inertia;
    a[(1, 6)] = 1.0 / motor_inertia;
    a[(3, 7)] = 1.0 / t.load_inertia;
    for (row, sign, inertia) in [(1, -1.0, motor_inertia), (3, 1.0, t.load_inertia)] {
        a[(row, WIND_UP)] = sign * (t.stiffness / inertia / scale);
        a[(row, 1)] = sign * (t.damping / inertia);
        a[(row, 3)] = -sign * (t.damping / inertia);
    }
    a[(WIND_UP, 1)] = scale;
    a[(WIND_UP, 3)] = -scale;
    a[(4, 1)] = 1.0;
    a
}

/// Computes the exponential of a system matrix times the period, with the state δ in its own unit again.
fn exponential(system: SystemMatrix, period: f64, scale: f64) -> SystemMatrix {
    let mut e = (system * period).exp();
    for other in (0..ORDER).filter(|&other| other != WIND_UP) {
        e[(other, WIND_UP)] *= scale;
        e[(WIND_UP, other)] /= scale;
    }
    e
}

impl HeldMotor {
    /// Creates the system from the exponential of the matrix without the row of ω.
    fn new(e: &SystemMatrix) -> Self {
        let row = |k: usize| HeldRow {
            load: LoadWeights { wind_up: e[(k, WIND_UP)], speed: e[(k, 3)] },
            torque: e[(k, 7)],
        };
        HeldMotor { current: e[(0, 0)], voltage: e[(0, 5)], wind_up: row(WIND_UP), load_speed: row(3) }
    }
}

impl Transmission {
    /// Returns the transmission of a rigid axis.
    pub fn rigid() -> Self {
        let none = LoadWeights { wind_up: -0.0, speed: -0.0 };
        let row = LoadRow {
            motor: TransitionRow { current: 0.0, speed: 0.0, voltage: 0.0, torque: 0.0 },
            load: LoadWeights { wind_up: 0.0, speed: 0.0 },
            per_speed: 0.0,
        };
        Transmission {
            current: none,
            speed: none,
            angle: none,
            wind_up: row,
            load_speed: row,
            held: HeldMotor::new(&SystemMatrix::zeros()),
            compliance: 0.0,
        }
    }

    /// Discretizes motor and transmission over `period` seconds. The torque of the [`Motor`] acts at the load, friction
    /// at the motor.
    ///
    /// # Errors
    /// [`DriveError::Discretization`] if a coefficient is not finite, or a torque at the motor does not accelerate it
    /// over the period, so that friction cannot be computed.
    pub fn new(
        motor: &MotorConfig,
        t: &TransmissionConfig,
        period: f64,
    ) -> Result<(Motor, Self), DriveError> {
        let motor_inertia = motor.inertia - t.load_inertia;
        // A power of 2, so that the scale does not round.
        let resonance = (t.stiffness / motor_inertia + t.stiffness / t.load_inertia).sqrt();
        let scale = resonance.log2().round().exp2();
        let mut system = system_matrix(motor, t, scale);
        let e = exponential(system, period, scale);
        system.row_mut(1).fill(0.0);
        let held = exponential(system, period, scale);
        let speed_per_torque = e[(1, 6)];
        let is_finite = |e: &SystemMatrix| e.iter().all(|entry| entry.is_finite());
        if !is_finite(&e) || !is_finite(&held) || speed_per_torque <= 0.0 {
            return Err(DriveError::Discretization { period_s: period, speed_per_torque });
        }
        let motor_row = |k: usize| TransitionRow {
            current: e[(k, 0)],
            speed: e[(k, 1)],
            voltage: e[(k, 5)],
            torque: e[(k, 7)],
        };
        let weights = |k: usize| LoadWeights { wind_up: e[(k, WIND_UP)], speed: e[(k, 3)] };
        let row = |k: usize| LoadRow {
            motor: motor_row(k),
            load: weights(k),
            per_speed: e[(k, 6)] / speed_per_torque,
        };
        let rows = [motor_row(0), motor_row(1), motor_row(4)];
        let discretized = Motor::from_rows(rows, [0, 1, 4].map(|k| e[(k, 6)]));
        let transmission = Transmission {
            current: weights(0),
            speed: weights(1),
            angle: weights(4),
            wind_up: row(WIND_UP),
            load_speed: row(3),
            held: HeldMotor::new(&held),
            compliance: 1.0 / t.stiffness,
        };
        Ok((discretized, transmission))
    }

    /// Returns true if the transmission is elastic.
    #[inline]
    pub fn is_elastic(&self) -> bool {
        self.compliance > 0.0
    }

    /// Returns the wind-up at rest under a `torque` at the load (N·m at the motor), rad.
    pub fn wind_up_at_rest(&self, torque: f64) -> f64 {
        torque * self.compliance
    }
}

impl<N: SimdReal> LoadWeights<N> {
    /// Adds the weighted state of the load to `rest`.
    #[inline(always)]
    fn add(&self, load: &LoadState<N>, rest: N) -> N {
        self.wind_up.mul_add(load.wind_up, self.speed.mul_add(load.speed, rest))
    }
}

impl<N: SimdReal> LoadRow<N> {
    #[inline(always)]
    fn apply(&self, s: &MotorState<N>, load: &LoadState<N>, voltage: N, torque: N) -> N {
        self.motor.apply_to(s, voltage, self.load.add(load, self.motor.torque * torque))
    }
}

impl<N: SimdReal> Transmission<N> {
    /// Steps motor and load by one tick without friction; `torque` acts at the load, N·m at the motor.
    #[inline(always)]
    pub fn step(
        &self,
        motor: &Motor<N>,
        s: &MotorState<N>,
        load: &LoadState<N>,
        voltage: N,
        torque: N,
    ) -> (MotorState<N>, LoadState<N>) {
        let (change, next) = self.change(motor, s, load, voltage, torque);
        (MotorState { angle: s.angle + change.angle, ..change }, next)
    }

    /// Returns the state after [`step`](Self::step), with the change of θ over the tick in place of θ.
    #[inline(always)]
    fn change(
        &self,
        motor: &Motor<N>,
        s: &MotorState<N>,
        load: &LoadState<N>,
        voltage: N,
        torque: N,
    ) -> (MotorState<N>, LoadState<N>) {
        let row = |row: &TransitionRow<N>, weights: &LoadWeights<N>| {
            row.apply_to(s, voltage, weights.add(load, row.torque * torque))
        };
        let state = MotorState {
            current: row(&motor.current, &self.current),
            speed: row(&motor.speed, &self.speed),
            angle: row(&motor.angle, &self.angle),
        };
        let next = LoadState {
            wind_up: self.wind_up.apply(s, load, voltage, torque),
            speed: self.load_speed.apply(s, load, voltage, torque),
        };
        (state, next)
    }

    /// Steps motor and load by one tick with friction at the motor; returns the speed drop by friction over the tick,
    /// rad/s.
    ///
    /// `external` is load minus gravity, N·m at the motor. Friction is that of a rigid axis, a constant torque over the
    /// tick, with two exceptions, in which it would supply energy: a motor at rest at both ends of the tick is held over
    /// the whole tick, and where the constant torque would act along the motion of the motor over the tick, friction acts
    /// at its end. The work of a constant torque is the torque times the change of θ, so that energy never increases.
    ///
    /// `friction` returns the speed drop (rad/s) from the state without friction, with the change of θ. A lane has no exceptions where
    /// `presliding`, the stiffness of the bristles, is above 0.
    #[inline(always)]
    pub(super) fn step_with_friction(
        &self,
        motor: &Motor<N>,
        s: &mut MotorState<N>,
        load: &mut LoadState<N>,
        [voltage, external, presliding]: [N; 3],
        friction: impl FnOnce(&MotorState<N>) -> N,
    ) -> N {
        let (change, free_load) = self.change(motor, s, load, voltage, external);
        let speed_drop = friction(&change);
        let zero = speed_drop.splat(0.0);
        // A rigid axis has no compliance, and the law no exception.
        let exceptions = zero.select(zero.simd_lt(presliding), self.compliance);
        let has_exceptions = zero.simd_lt(exceptions);
        let work = motor.brake(&change, speed_drop).angle * speed_drop;
        let acts_along_motion = work.select(has_exceptions, zero).simd_lt(zero);
        let constant = zero.select(acts_along_motion, speed_drop);
        let free = MotorState { angle: s.angle + change.angle, ..change };
        let brake = |row: &LoadRow<N>, free: N| constant.mul_add(-row.per_speed, free);
        let sliding = motor.brake(&free, constant);
        let sliding = MotorState { speed: free.speed - speed_drop, ..sliding };
        let sliding_load = LoadState {
            wind_up: brake(&self.wind_up, free_load.wind_up),
            speed: brake(&self.load_speed, free_load.speed),
        };
        // The motor is at rest at both ends.
        let is_held = (s.speed.abs() + sliding.speed.abs())
            .simd_lt(zero.splat(f64::MIN_POSITIVE).select(has_exceptions, zero));
        let held = &self.held;
        let hold = |row: &HeldRow<N>| row.load.add(load, row.torque * external);
        let held_motor = MotorState {
            current: held.current.mul_add(s.current, held.voltage * voltage),
            speed: zero,
            angle: s.angle,
        };
        let held_load = LoadState { wind_up: hold(&held.wind_up), speed: hold(&held.load_speed) };
        *s = held_motor.select(is_held, sliding);
        let next = held_load.select(is_held, sliding_load);
        // The sum with +0 turns the −0 of a rigid axis into +0.
        *load = LoadState { wind_up: next.wind_up + zero, speed: next.speed + zero };
        speed_drop
    }
}
