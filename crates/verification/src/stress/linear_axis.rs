//! Linear reference simulation of an axis without friction and limits, independent of the library's step
//! (Prévost fig. 3, eqs. 1 and 6 to 9).

use nalgebra::SMatrix;

use super::exponential::exponential;
use virtual_axes_core::config::{AxisConfig, Periods, PositionControllerConfig};
use virtual_axes_core::control::Rst;
use virtual_axes_core::drive::Plant;
use virtual_axes_core::machine::{AxisError, design_controller, prediction_model};
use virtual_axes_core::units::{Nanoseconds, seconds};

/// Number of states: i, ω, θ and the integrals of the velocity and the current controller.
pub const STATES: usize = 5;
/// State of the three loops.
pub type LoopState = [f64; STATES];

/// Linear model of one axis, sampled at three rates.
#[derive(Debug, Clone)]
pub struct LinearAxis {
    /// Transition matrix of a tick: (i, ω, θ, u, τ) → (i, ω, θ).
    step: [[f64; 5]; 3],
    ratio: f64,
    velocity_gain: f64,
    velocity_integral_gain: f64,
    inverse_torque_constant: f64,
    current_gain: f64,
    current_integral_gain: f64,
    law: Rst,
    velocity_feedforward: f64,
    torque_feedforward: f64,
    alpha: i64,
    beta: i64,
    gamma: i64,
    /// Ticks per position cycle.
    pub ticks: usize,
    /// Ticks per velocity period.
    pub velocity_ticks: usize,
}

impl LinearAxis {
    /// Creates the model of `axis` with its position controller.
    ///
    /// # Errors
    /// [`AxisError`] if the controller cannot be designed.
    pub fn new(axis: &AxisConfig, periods: &Periods) -> Result<Self, AxisError> {
        let (motor, nominal) = (Plant::deviating_motor(axis), &axis.motor);
        let tick = seconds(periods.current);
        let mut moving = SMatrix::<f64, 5, 5>::zeros();
        moving[(0, 0)] = -motor.resistance / motor.inductance;
        moving[(0, 1)] = -motor.emf_constant / motor.inductance;
        moving[(0, 3)] = 1.0 / motor.inductance;
        moving[(1, 0)] = motor.torque_constant / motor.inertia;
        moving[(1, 4)] = 1.0 / motor.inertia;
        moving[(2, 1)] = 1.0;
        let step = exponential(&(moving * tick));
        let law = design_controller(axis, &prediction_model(axis, periods)?)?;
        let is_cascade = axis.position_loop.controller == PositionControllerConfig::Cascade;
        let weight = |weight: f64| if is_cascade { weight } else { 0.0 };
        let (period, r) = (seconds(periods.position), axis.transmission_ratio);
        let (velocity, current) = (&axis.velocity_loop, &axis.current_loop);
        let in_ticks = |delay: Nanoseconds| (delay + periods.current / 2) / periods.current;
        Ok(LinearAxis {
            step: [0, 1, 2].map(|i| [0, 1, 2, 3, 4].map(|j| step[(i, j)])),
            ratio: r,
            velocity_gain: velocity.gain,
            velocity_integral_gain: velocity.gain * seconds(periods.velocity) / velocity.integral_time,
            inverse_torque_constant: 1.0 / nominal.torque_constant,
            current_gain: current.gain,
            current_integral_gain: current.gain * tick / current.integral_time,
            law,
            velocity_feedforward: weight(axis.feedforward.velocity) / period / r,
            // With friction compensation both feedforward torques are an input of the response.
            torque_feedforward: if axis.feedforward.friction == 0.0 {
                weight(axis.feedforward.torque) / (period * period) / r
            } else {
                0.0
            },
            alpha: in_ticks(axis.delays.alpha),
            beta: in_ticks(axis.delays.beta),
            gamma: in_ticks(axis.delays.gamma),
            ticks: periods.ticks_per_position() as usize,
            velocity_ticks: periods.ticks_per_velocity() as usize,
        })
    }

    /// Returns the preview: setpoints ahead of the present one that the controller reads.
    pub fn preview(&self) -> usize {
        let delay = -(-self.alpha).div_euclid(self.ticks as i64);
        (self.law.preview() - delay).max(0) as usize
    }

    /// Returns true if the controller has integral action, and so a nonlinear fallback controller.
    pub fn has_fallback(&self) -> bool {
        self.law.has_integral_action()
    }

    /// Returns the delay-compensated following error at the first `periods` position cycles, m or rad, from rest at 0
    /// with setpoints `psec(k)`, m or rad.
    pub fn errors(&self, periods: usize, psec: impl Fn(i64) -> f64) -> Vec<f64> {
        self.run([0.0; STATES], periods, psec, |_| 0.0, |_| 0.0).0
    }

    /// Returns the free response: the error from `state` with setpoints 0 and an empty controller history, m or rad.
    pub fn free(&self, state: LoopState, periods: usize) -> Vec<f64> {
        self.run(state, periods, |_| 0.0, |_| 0.0, |_| 0.0).0
    }

    /// Returns the state after a position cycle with 1 N·m at the motor during tick `at`.
    pub fn after_torque(&self, at: usize) -> LoopState {
        self.run([0.0; STATES], 1, |_| 0.0, |n| if n == at { 1.0 } else { 0.0 }, |_| 0.0).1
    }

    /// Returns the state after a position cycle with 1 N·m of torque feedforward at velocity cycle `at`.
    pub fn after_feedforward(&self, at: usize) -> LoopState {
        self.run([0.0; STATES], 1, |_| 0.0, |_| 0.0, |m| if m == at { 1.0 } else { 0.0 }).1
    }

    /// Returns the errors and the final state. `torque(n)` is an additional motor torque during tick n, N·m;
    /// `feedforward(m)` is an additional torque feedforward at velocity cycle m, N·m.
    fn run(
        &self,
        state: LoopState,
        periods: usize,
        psec: impl Fn(i64) -> f64,
        torque: impl Fn(usize) -> f64,
        feedforward: impl Fn(usize) -> f64,
    ) -> (Vec<f64>, LoopState) {
        let ticks = self.ticks as i64;
        let [current, speed, angle, mut integral, mut voltage_integral] = state;
        let mut motor = [current, speed, angle];
        let (mut angles, mut commands) = (vec![0.0; self.law.r().len()], vec![0.0; self.law.s().len()]);
        let mut errors = Vec::with_capacity(periods);
        for k in 0..periods as i64 {
            let delayed = (k * ticks - self.alpha).div_euclid(ticks);
            errors.push(psec(delayed) - self.ratio * motor[2]);
            angles.rotate_right(1);
            angles[0] = motor[2];
            let preview = (delayed + self.law.t_first()..).map(|j| psec(j) / self.ratio);
            let setpoint: f64 = self.law.t().iter().zip(preview).map(|(weight, value)| weight * value).sum();
            let command =
                setpoint - weighted(self.law.r(), &angles) - weighted(&self.law.s()[1..], &commands);
            commands.rotate_right(1);
            commands[0] = command;
            let mut current_setpoint = 0.0;
            for tick in 0..self.ticks {
                let now = k * ticks + tick as i64;
                if tick.is_multiple_of(self.velocity_ticks) {
                    let v = (now - self.beta).div_euclid(ticks);
                    let t = (now - self.gamma).div_euclid(ticks);
                    let speed = self.velocity_feedforward * (psec(v) - psec(v - 1));
                    let own = self.torque_feedforward * (psec(t) - 2.0 * psec(t - 1) + psec(t - 2));
                    let error = command + speed - motor[1];
                    integral += self.velocity_integral_gain * error;
                    let more = feedforward(now as usize / self.velocity_ticks);
                    let torque_setpoint = self.velocity_gain * error + integral + own + more;
                    current_setpoint = torque_setpoint * self.inverse_torque_constant;
                }
                let error = current_setpoint - motor[0];
                voltage_integral += self.current_integral_gain * error;
                let voltage = self.current_gain * error + voltage_integral;
                let before = [motor[0], motor[1], motor[2], voltage, torque(now as usize)];
                motor = self.step.map(|row| weighted(&row, &before));
            }
        }
        let [current, speed, angle] = motor;
        (errors, [current, speed, angle, integral, voltage_integral])
    }
}

fn weighted(weights: &[f64], values: &[f64]) -> f64 {
    weights.iter().zip(values).map(|(weight, value)| weight * value).sum()
}
