//! The linear inner loops of an axis over one position period, as a transfer function.

use nalgebra::{DMatrix, DVector, SMatrix, SVector};

use crate::config::{AxisConfig, MotorConfig, Periods};
use crate::control::{Pi, PiState};
use crate::design::polynomial::product;
use crate::design::{DesignError, PredictionModel};
use crate::drive::{Motor, MotorState, Plant};
use crate::units::seconds;

use super::AxisError;

/// Growth of the steps of θ after which nothing is left of the digits of the first one.
const RUNAWAY: f64 = 1e9;
/// What goes on from one position instant to the next: i, ω, the two integrals, and θ.
const STATES: usize = 5;
/// What of that the steps of θ depend on: all but θ itself.
const VELOCITY_STATES: usize = STATES - 1;
/// Hankel singular values of the velocity, relative to the largest, up to which the states behind them
/// are left out: their part of θ is far below 1e-9 of the whole.
const NEGLIGIBLE: f64 = 1e-12;

/// The exact discrete transfer from Ω* to θ over one Tsp, `A(q⁻¹) θ = B(q⁻¹) Ω*` (Prévost section 5).
///
/// The loops of current and velocity and the motor are run through one position period as the simulation
/// runs them, without friction, gravity, load and limits: what comes out is linear in state and Ω*. States
/// whose Hankel singular values are negligible are left out.
///
/// # Errors
/// [`AxisError`] if the motor cannot be discretized, or nothing moves.
pub fn prediction_model(axis: &AxisConfig, periods: &Periods) -> Result<PredictionModel, AxisError> {
    model(axis, &axis.motor, periods)
}

/// The same of the plant as it is, with what it deviates by; the controllers inside know nothing of that.
///
/// # Errors
/// As [`prediction_model`].
pub fn deviating_model(axis: &AxisConfig, periods: &Periods) -> Result<PredictionModel, AxisError> {
    model(axis, &Plant::motor(axis), periods)
}

/// The loops of `axis` about a motor.
fn model(axis: &AxisConfig, motor: &MotorConfig, periods: &Periods) -> Result<PredictionModel, AxisError> {
    let loops = InnerLoops::new(axis, motor, periods)?;
    let (transition, input) = loops.over_one_period();
    // θ(k + 1) − θ(k) = C x(k) + D Ω*(k) has no integrator.
    let markov = step_markov(&transition, &input, 2 * VELOCITY_STATES + 1);
    let (poles, numerator) = minimal(&markov)?;
    let a = product(&[1.0, -1.0], &poles);
    Ok(PredictionModel::new(a, numerator, seconds(periods.position))?)
}

/// The loops inside the position loop, without their limits.
struct InnerLoops {
    motor: Motor,
    velocity: Pi,
    current: Pi,
    ticks_per_position: u64,
    ticks_per_velocity: u64,
}

/// Iterations for the singular values of a matrix of four rows; it takes some ten.
const SVD_ITERATIONS: usize = 1000;

type State = SVector<f64, STATES>;

impl InnerLoops {
    fn new(axis: &AxisConfig, motor: &MotorConfig, periods: &Periods) -> Result<Self, AxisError> {
        let tick = seconds(periods.current);
        let (unlimited, torque_constant) = (f64::INFINITY, axis.motor.torque_constant);
        Ok(InnerLoops {
            motor: Motor::new(motor, tick)?,
            velocity: Pi::new(
                &axis.velocity_loop,
                seconds(periods.velocity),
                1.0 / torque_constant,
                unlimited,
            ),
            current: Pi::new(&axis.current_loop, tick, 1.0, unlimited),
            ticks_per_position: periods.ticks_per_position(),
            ticks_per_velocity: periods.ticks_per_velocity(),
        })
    }

    /// The state after one position period under `setpoint` (Ω*, rad/s).
    fn after_one_period(&self, state: &State, setpoint: f64) -> State {
        let mut motor = MotorState { current: state[0], speed: state[1], angle: state[4] };
        let mut velocity = PiState { integral: state[2], excess: 0.0 };
        let mut current = PiState { integral: state[3], excess: 0.0 };
        let mut current_setpoint = 0.0;
        for tick in 0..self.ticks_per_position {
            if tick.is_multiple_of(self.ticks_per_velocity) {
                current_setpoint = self.velocity.update_with(&mut velocity, setpoint - motor.speed, 0.0);
            }
            let voltage = self.current.update(&mut current, current_setpoint - motor.current);
            motor = self.motor.step(&motor, voltage, 0.0);
        }
        State::new(motor.current, motor.speed, velocity.integral, current.integral, motor.angle)
    }

    /// Φ and Γ of `x(k + 1) = Φ x(k) + Γ Ω*(k)`.
    fn over_one_period(&self) -> (SMatrix<f64, STATES, STATES>, State) {
        let column = |k: usize| self.after_one_period(&State::ith(k, 1.0), 0.0);
        (SMatrix::from_columns(&[0, 1, 2, 3, 4].map(column)), self.after_one_period(&State::zeros(), 1.0))
    }
}

/// The first `count` Markov parameters of the steps of θ, θ(k) − θ(k − 1).
fn step_markov(transition: &SMatrix<f64, STATES, STATES>, input: &State, count: usize) -> Vec<f64> {
    let mut state = *input;
    let mut angle = 0.0;
    let mut markov = Vec::with_capacity(count);
    for _ in 0..count {
        markov.push(state[4] - angle);
        angle = state[4];
        state = transition * state;
    }
    markov
}

/// Denominator and numerator, in rising powers of q⁻¹, of the smallest system with these Markov
/// parameters: the first is the feedthrough, the others are realized after Ho and Kalman from the singular
/// values of their Hankel matrix. The numerator has one more q⁻¹, since the step ends a period later.
fn minimal(markov: &[f64]) -> Result<(Vec<f64>, Vec<f64>), DesignError> {
    const SIZE: usize = VELOCITY_STATES;
    let hankel = |shift: usize| DMatrix::from_fn(SIZE, SIZE, |i, j| markov[i + j + shift]);
    if !markov.iter().all(|h| h.is_finite()) {
        return Err(DesignError::Model("the inner loops diverge within a position period".to_owned()));
    }
    if markov.iter().all(|h| *h == 0.0) {
        let still = "nothing moves: with velocity_loop.gain or current_loop.gain 0 the drive does not answer";
        return Err(DesignError::Model(still.to_owned()));
    }
    let (first, largest) = (markov[0].abs(), markov.iter().fold(0.0, |m: f64, h| m.max(h.abs())));
    if largest > RUNAWAY * first {
        return Err(DesignError::Model(format!(
            "the inner loops are unstable: what they make of a step of Ω* grows {:.1e} times within {} position \
             periods; mend velocity_loop, current_loop or the periods",
            largest / first,
            markov.len()
        )));
    }
    let no_model =
        || DesignError::Model("the singular values of the inner loops cannot be computed".to_owned());
    let decomposition = hankel(1).try_svd(true, true, f64::EPSILON, SVD_ITERATIONS).ok_or_else(no_model)?;
    let (u, vt) = (decomposition.u.ok_or_else(no_model)?, decomposition.v_t.ok_or_else(no_model)?);
    let values = decomposition.singular_values;
    let largest = values.max();
    let kept: Vec<usize> = (0..SIZE).filter(|&k| values[k] > NEGLIGIBLE * largest).collect();
    let root = DVector::from_iterator(kept.len(), kept.iter().map(|&k| values[k].sqrt()));
    let (left, right) = (u.select_columns(&kept), vt.select_rows(&kept));
    let mut transition = left.transpose() * hankel(2) * right.transpose();
    for i in 0..kept.len() {
        for j in 0..kept.len() {
            transition[(i, j)] /= root[i] * root[j];
        }
    }
    let denominator = characteristic_polynomial(&transition);
    // A·(h₀ + h₁q⁻¹ + …) ends after as many terms as there are states.
    let coefficient = |k: usize| (0..=k).map(|i| denominator[i] * markov[k - i]).sum();
    let numerator = std::iter::once(0.0).chain((0..=kept.len()).map(coefficient)).collect();
    Ok((denominator, numerator))
}

/// det(I − q⁻¹ A) in rising powers of q⁻¹ (recursion of Faddeev and Le Verrier).
fn characteristic_polynomial(a: &DMatrix<f64>) -> Vec<f64> {
    let n = a.nrows();
    let mut polynomial = vec![1.0];
    let mut m = DMatrix::identity(n, n);
    for k in 1..=n {
        let am = a * &m;
        let coefficient = -am.trace() / k as f64;
        polynomial.push(coefficient);
        m = am + DMatrix::identity(n, n) * coefficient;
    }
    polynomial
}
