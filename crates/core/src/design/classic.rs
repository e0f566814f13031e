//! P, PI and PID position controllers as RST triples.

use super::DesignError;
use super::polynomial::{product, sum};
use crate::control::Rst;

/// Largest gain, s⁻¹: a hundred times what the loop of a feed drive takes.
pub const MAX_GAIN: f64 = 1e4;
/// Longest time of an integral part, s: a slower one does nothing during a motion.
const MAX_INTEGRAL_TIME: f64 = 100.0;
/// Longest time of a derivative part and of its filter, s.
const MAX_DERIVATIVE_TIME: f64 = 1.0;
/// Largest weight of the velocity feedforward; 1 feeds the setpoint's velocity forward.
const MAX_FEEDFORWARD: f64 = 2.0;
/// Longest position period, s.
const MAX_PERIOD: f64 = 1.0;
/// 1 − q⁻¹.
const DIFFERENCE: [f64; 2] = [1.0, -1.0];

/// A PID position controller with filtered derivative.
///
/// The proportional and the integral part act on θ* − θ, the derivative part on −θ only: a corner of the
/// path is no impulse to it, and what it lacks of the setpoint's velocity is the feedforward's to give.
///
/// ```text
/// I(k) = I(k−1) + Kp Tsp/Ti (θ* − θ)(k)         D(k) = ρ D(k−1) − Kp Td/(Tf + Tsp) (θ(k) − θ(k−1))
/// Ω*(k) = Kp (θ* − θ)(k) + I(k) + D(k) + w (θ*(k) − θ*(k−1))/Tsp         ρ = Tf/(Tf + Tsp)
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pid {
    /// Kp, s⁻¹.
    pub gain: f64,
    /// Ti, s.
    pub integral_time: f64,
    /// Td, s; 0: no derivative part.
    pub derivative_time: f64,
    /// Tf, s; 0: a plain difference.
    pub filter_time: f64,
    /// w, weight of the velocity feedforward; 0: none.
    pub velocity_feedforward: f64,
}

/// The proportional controller Ω* = Kp (θ* − θ) + w (θ*(k) − θ*(k−1))/Tsp (Prévost fig. 3).
///
/// `gain` is Kp in s⁻¹, `velocity_feedforward` w, `period` Tsp in s.
///
/// # Errors
/// [`DesignError::OutOfRange`] naming the parameter.
pub fn p(gain: f64, velocity_feedforward: f64, period: f64) -> Result<Rst, DesignError> {
    check_common(gain, velocity_feedforward, period)?;
    with_feedforward(&[gain], &[1.0], &[gain], velocity_feedforward, period)
}

/// The PI controller: a [`Pid`] without its derivative part.
///
/// # Errors
/// [`DesignError::OutOfRange`] naming the parameter.
pub fn pi(gain: f64, integral_time: f64, velocity_feedforward: f64, period: f64) -> Result<Rst, DesignError> {
    check_common(gain, velocity_feedforward, period)?;
    check_positive("integral_time", integral_time, MAX_INTEGRAL_TIME, " s")?;
    let on_error = proportional_integral(gain, integral_time, period);
    with_feedforward(&on_error, &DIFFERENCE, &on_error, velocity_feedforward, period)
}

/// The PID controller; `period` is Tsp in s.
///
/// # Errors
/// [`DesignError::OutOfRange`] naming the parameter.
pub fn pid(tuning: &Pid, period: f64) -> Result<Rst, DesignError> {
    let Pid { gain, integral_time, derivative_time, filter_time, velocity_feedforward } = *tuning;
    check_common(gain, velocity_feedforward, period)?;
    check_positive("integral_time", integral_time, MAX_INTEGRAL_TIME, " s")?;
    check_range("derivative_time", derivative_time, MAX_DERIVATIVE_TIME, " s")?;
    check_range("filter_time", filter_time, MAX_DERIVATIVE_TIME, " s")?;
    if derivative_time == 0.0 {
        return pi(gain, integral_time, velocity_feedforward, period);
    }
    let filter = [1.0, -filter_time / (filter_time + period)];
    let on_error = product(&filter, &proportional_integral(gain, integral_time, period));
    let slope = gain * derivative_time / (filter_time + period);
    let derivative = product(&[slope, -slope], &DIFFERENCE);
    let s = product(&filter, &DIFFERENCE);
    with_feedforward(&sum(&on_error, &derivative), &s, &on_error, velocity_feedforward, period)
}

/// (1 − q⁻¹) times the proportional and the integral part.
fn proportional_integral(gain: f64, integral_time: f64, period: f64) -> [f64; 2] {
    [gain * (1.0 + period / integral_time), -gain]
}

/// R, S and `t`, a polynomial in q⁻¹, with S w/Tsp (1 − q⁻¹) added to T: that feeds w times the
/// setpoint's velocity forward to Ω* and leaves T(1) as it is.
pub(super) fn with_feedforward(
    r: &[f64],
    s: &[f64],
    t: &[f64],
    weight: f64,
    period: f64,
) -> Result<Rst, DesignError> {
    let mut t = t.to_vec();
    if weight != 0.0 {
        t = sum(&t, &product(s, &DIFFERENCE.map(|c| c * weight / period)));
    }
    // Rst takes T in rising powers of q.
    t.reverse();
    Ok(Rst::new(r, s, &t, 1 - t.len() as i64)?)
}

fn check_common(gain: f64, velocity_feedforward: f64, period: f64) -> Result<(), DesignError> {
    check_positive("gain", gain, MAX_GAIN, " s⁻¹")?;
    check_feedforward(velocity_feedforward)?;
    check_positive("period", period, MAX_PERIOD, " s")
}

/// That w is a weight.
pub(super) fn check_feedforward(weight: f64) -> Result<(), DesignError> {
    check_range("velocity_feedforward", weight, MAX_FEEDFORWARD, "")
}

fn check_range(name: &'static str, value: f64, max: f64, unit: &str) -> Result<(), DesignError> {
    if (0.0..=max).contains(&value) {
        return Ok(());
    }
    Err(DesignError::OutOfRange { name, value, allowed: format!("lie in 0 … {max}{unit}") })
}

fn check_positive(name: &'static str, value: f64, max: f64, unit: &str) -> Result<(), DesignError> {
    if value > 0.0 && value <= max {
        return Ok(());
    }
    Err(DesignError::OutOfRange { name, value, allowed: format!("be above 0 and at most {max}{unit}") })
}
