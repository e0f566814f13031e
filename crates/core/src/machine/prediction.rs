//! Prediction model: linear inner loops of an axis over one position cycle as a discrete transfer function.

use nalgebra::{DMatrix, DVector, SMatrix, SVector};

use crate::config::{AxisConfig, MotorConfig, Periods, PositionFeedback, TransmissionConfig};
use crate::control::{BiquadState, CurrentFilterState, CurrentFilters, Pi, PiState};
use crate::design::polynomial::product;
use crate::design::{DesignError, PredictionModel};
use crate::drive::{LoadState, Motor, MotorState, Plant, Transmission};
use crate::units::seconds;

use super::AxisError;

/// Growth of the Markov parameters beyond which the inner loops count as unstable: the first parameter is lost to
/// rounding.
const MAX_GROWTH: f64 = 1e9;
/// States of a rigid axis from one position cycle to the next: i, ω, the two integrals, and θ.
const RIGID_STATES: usize = 5;
/// Index of the state θ.
const ANGLE: usize = 4;
/// States of an elastic axis: wind-up and speed of the load in addition.
const ELASTIC_STATES: usize = 7;
/// States of the filters of the current setpoint, in addition to those of a rigid or elastic axis.
const FILTER_STATES: usize = 4;
/// States of a rigid axis with filters.
const FILTERED_STATES: usize = RIGID_STATES + FILTER_STATES;
/// States of an elastic axis with filters.
const FILTERED_ELASTIC_STATES: usize = ELASTIC_STATES + FILTER_STATES;
/// Hankel singular values of the velocity, relative to the largest, up to which states are left out: their share of θ
/// is far below 1e-9.
const NEGLIGIBLE_SINGULAR_VALUE: f64 = 1e-12;

/// Computes the exact discrete transfer from Ω* to θ over one Tsp, `A(q⁻¹) θ = B(q⁻¹) Ω*` (Prévost section 5).
///
/// Velocity loop, current loop and motor are stepped through one position cycle as in the simulation, without
/// friction, gravity, load and limits: the result is linear in state and Ω*. States whose Hankel singular values are
/// negligible are left out.
///
/// # Errors
/// [`AxisError`] if the motor cannot be discretized, or the inner loops are unstable or have no gain.
pub fn prediction_model(axis: &AxisConfig, periods: &Periods) -> Result<PredictionModel, AxisError> {
    model_with_drive(axis, &axis.motor, axis.transmission.as_ref(), periods)
}

/// Computes the prediction model of the plant with its deviation, under inner loops tuned for the nominal plant.
///
/// # Errors
/// [`AxisError`] if the motor cannot be discretized, or the inner loops are unstable or have no gain.
pub fn deviating_plant_model(axis: &AxisConfig, periods: &Periods) -> Result<PredictionModel, AxisError> {
    let transmission = Plant::deviating_transmission(axis);
    model_with_drive(axis, &Plant::deviating_motor(axis), transmission.as_ref(), periods)
}

/// Computes the prediction model of `axis` with another motor and transmission.
fn model_with_drive(
    axis: &AxisConfig,
    motor: &MotorConfig,
    transmission: Option<&TransmissionConfig>,
    periods: &Periods,
) -> Result<PredictionModel, AxisError> {
    let loops = LinearInnerLoops::new(axis, motor, transmission, periods)?;
    let (poles, numerator) = match (loops.transmission.is_elastic(), loops.filters.is_enabled()) {
        (false, false) => loops.realization::<RIGID_STATES>()?,
        (true, false) => loops.realization::<ELASTIC_STATES>()?,
        (false, true) => loops.realization::<FILTERED_STATES>()?,
        (true, true) => loops.realization::<FILTERED_ELASTIC_STATES>()?,
    };
    let a = product(&[1.0, -1.0], &poles);
    Ok(PredictionModel::new(a, numerator, seconds(periods.position))?)
}

/// Inner loops without limits, motor and load.
pub(super) struct LinearInnerLoops {
    pub motor: Motor,
    pub transmission: Transmission,
    feedback: PositionFeedback,
    pub velocity: Pi,
    pub filters: CurrentFilters,
    pub current: Pi,
    ticks_per_position: u64,
    ticks_per_velocity: u64,
}

/// Largest number of iterations of the singular value decomposition (at most 10×10); about ten are usual.
const SVD_ITERATIONS: usize = 1000;

impl LinearInnerLoops {
    pub fn new(
        axis: &AxisConfig,
        motor: &MotorConfig,
        transmission: Option<&TransmissionConfig>,
        periods: &Periods,
    ) -> Result<Self, AxisError> {
        let tick = seconds(periods.current);
        let (motor, transmission) = match transmission {
            Some(elastic) => Transmission::new(motor, elastic, tick)?,
            None => (Motor::new(motor, tick)?, Transmission::rigid()),
        };
        let (unlimited, torque_constant) = (f64::INFINITY, axis.motor.torque_constant);
        Ok(LinearInnerLoops {
            motor,
            transmission,
            feedback: axis.position_loop.feedback,
            velocity: Pi::new(
                &axis.velocity_loop,
                seconds(periods.velocity),
                1.0 / torque_constant,
                unlimited,
            ),
            filters: CurrentFilters::new(&axis.current_filters, seconds(periods.velocity)),
            current: Pi::new(&axis.current_loop, tick, 1.0, unlimited),
            ticks_per_position: periods.ticks_per_position(),
            ticks_per_velocity: periods.ticks_per_velocity(),
        })
    }

    /// Computes denominator and numerator of the increments of θ.
    fn realization<const STATES: usize>(&self) -> Result<(Vec<f64>, Vec<f64>), DesignError> {
        let (transition, input) = self.state_space::<STATES>(self.ticks_per_position);
        // θ(k + 1) − θ(k) = C x(k) + D Ω*(k) has no integrator: it depends on all states but θ.
        let order = STATES - 1;
        let output = |state: &SVector<f64, STATES>| match (self.feedback, STATES) {
            (PositionFeedback::Load, ELASTIC_STATES | FILTERED_ELASTIC_STATES) => state[4] - state[5],
            _ => state[4],
        };
        minimal_realization(&increment_markov_parameters(&transition, &input, output, 2 * order + 1), order)
    }

    /// Returns the transition matrix of all states but θ over one velocity cycle with the velocity loop closed.
    pub fn velocity_loop_transition(&self) -> DMatrix<f64> {
        match (self.transmission.is_elastic(), self.filters.is_enabled()) {
            (false, false) => self.transition_without_angle::<RIGID_STATES>(),
            (true, false) => self.transition_without_angle::<ELASTIC_STATES>(),
            (false, true) => self.transition_without_angle::<FILTERED_STATES>(),
            (true, true) => self.transition_without_angle::<FILTERED_ELASTIC_STATES>(),
        }
    }

    fn transition_without_angle<const STATES: usize>(&self) -> DMatrix<f64> {
        let (transition, _) = self.state_space::<STATES>(self.ticks_per_velocity);
        // A filter that is not enabled keeps its state.
        let is_constant = |index: usize| {
            let filter = (index + FILTER_STATES).checked_sub(STATES).map(|state| state / 2);
            filter.is_some_and(|filter| STATES > ELASTIC_STATES && !self.filters.enabled()[filter])
        };
        let kept: Vec<usize> = (0..STATES).filter(|&index| index != ANGLE && !is_constant(index)).collect();
        DMatrix::from_fn(kept.len(), kept.len(), |row, column| transition[(kept[row], kept[column])])
    }

    /// Returns the state after `ticks` under `setpoint` (Ω*, rad/s).
    fn state_after<const STATES: usize>(
        &self,
        ticks: u64,
        state: &SVector<f64, STATES>,
        setpoint: f64,
    ) -> SVector<f64, STATES> {
        let mut motor = MotorState { current: state[0], speed: state[1], angle: state[4] };
        let mut load = match STATES {
            ELASTIC_STATES | FILTERED_ELASTIC_STATES => LoadState { wind_up: state[5], speed: state[6] },
            _ => LoadState::default(),
        };
        let mut filters = CurrentFilterState::default();
        if let FILTERED_STATES | FILTERED_ELASTIC_STATES = STATES {
            let filter = |index| BiquadState { first: state[index], second: state[index + 1] };
            let first = STATES - FILTER_STATES;
            filters = CurrentFilterState { first: filter(first), second: filter(first + 2) };
        }
        let mut velocity = PiState { integral: state[2], excess: 0.0 };
        let mut current = PiState { integral: state[3], excess: 0.0 };
        let mut current_setpoint = 0.0;
        for tick in 0..ticks {
            if tick.is_multiple_of(self.ticks_per_velocity) {
                let filter = |current| self.filters.update(&mut filters, current);
                let error = setpoint - motor.speed;
                current_setpoint = self.velocity.update_with_filter(&mut velocity, error, 0.0, filter);
            }
            let voltage = self.current.update(&mut current, current_setpoint - motor.current);
            (motor, load) = self.transmission.step(&self.motor, &motor, &load, voltage, 0.0);
        }
        let rigid = [motor.current, motor.speed, velocity.integral, current.integral, motor.angle];
        let elastic = match STATES {
            ELASTIC_STATES | FILTERED_ELASTIC_STATES => [Some(load.wind_up), Some(load.speed)],
            _ => [None, None],
        };
        let CurrentFilterState { first, second } = filters;
        let filters = [first.first, first.second, second.first, second.second];
        SVector::from_iterator(rigid.into_iter().chain(elastic.into_iter().flatten()).chain(filters))
    }

    /// Returns Φ and Γ of `x(k + 1) = Φ x(k) + Γ Ω*(k)` over `ticks`, a multiple of the velocity cycle.
    fn state_space<const STATES: usize>(
        &self,
        ticks: u64,
    ) -> (SMatrix<f64, STATES, STATES>, SVector<f64, STATES>) {
        let column = |k: usize| {
            self.state_after(ticks, &SVector::from_fn(|row, _| if row == k { 1.0 } else { 0.0 }), 0.0)
        };
        let columns: [_; STATES] = std::array::from_fn(column);
        (SMatrix::from_columns(&columns), self.state_after(ticks, &SVector::zeros(), 1.0))
    }
}

/// Computes the first `count` Markov parameters of the increments of `output`, θ(k) − θ(k − 1).
fn increment_markov_parameters<const STATES: usize>(
    transition: &SMatrix<f64, STATES, STATES>,
    input: &SVector<f64, STATES>,
    output: impl Fn(&SVector<f64, STATES>) -> f64,
    count: usize,
) -> Vec<f64> {
    let mut state = *input;
    let mut angle = 0.0;
    let mut markov = Vec::with_capacity(count);
    for _ in 0..count {
        markov.push(output(&state) - angle);
        angle = output(&state);
        state = transition * state;
    }
    markov
}

/// Computes denominator and numerator, in rising powers of q⁻¹, of the minimal realization of Markov parameters.
///
/// The first parameter is the feedthrough; the others are realized by the Ho–Kalman algorithm from the singular value
/// decomposition of their Hankel matrix. The numerator contains one more q⁻¹, since an increment ends one position
/// cycle later.
fn minimal_realization(markov: &[f64], order: usize) -> Result<(Vec<f64>, Vec<f64>), DesignError> {
    let hankel = |shift: usize| DMatrix::from_fn(order, order, |i, j| markov[i + j + shift]);
    if !markov.iter().all(|h| h.is_finite()) {
        return Err(DesignError::UnstableInnerLoops("diverge within a position cycle".to_owned()));
    }
    if markov.iter().all(|h| *h == 0.0) {
        let no_gain = "velocity_loop.gain or current_loop.gain is 0; both must be above 0";
        return Err(DesignError::Model(no_gain.to_owned()));
    }
    let (first, largest) = (markov[0].abs(), markov.iter().fold(0.0, |m: f64, h| m.max(h.abs())));
    if largest > MAX_GROWTH * first {
        return Err(DesignError::UnstableInnerLoops(format!(
            "are unstable: their response to Ω* grows by a factor of {:.1e} within {} position \
             cycles; change velocity_loop, current_loop or the periods",
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
    let kept: Vec<usize> = (0..order).filter(|&k| values[k] > NEGLIGIBLE_SINGULAR_VALUE * largest).collect();
    let root = DVector::from_iterator(kept.len(), kept.iter().map(|&k| values[k].sqrt()));
    let (left, right) = (u.select_columns(&kept), vt.select_rows(&kept));
    let mut transition = left.transpose() * hankel(2) * right.transpose();
    for i in 0..kept.len() {
        for j in 0..kept.len() {
            transition[(i, j)] /= root[i] * root[j];
        }
    }
    let denominator = characteristic_polynomial(&transition);
    // A·(h₀ + h₁q⁻¹ + …) has as many terms as the realization has states, and one more.
    let coefficient = |k: usize| (0..=k).map(|i| denominator[i] * markov[k - i]).sum();
    let numerator = std::iter::once(0.0).chain((0..=kept.len()).map(coefficient)).collect();
    Ok((denominator, numerator))
}

/// Computes det(I − q⁻¹ A) in rising powers of q⁻¹ (Faddeev–LeVerrier algorithm).
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
