//! P, PI and PID position controllers in RST form.

use super::DesignError;
use super::polynomial::{product, sum};
use crate::control::Rst;

/// Largest gain, s⁻¹: about a hundred times the usual gain of a feed drive.
pub const MAX_GAIN: f64 = 1e4;
/// Longest integral time, s: longer ones have no effect during a motion.
const MAX_INTEGRAL_TIME: f64 = 100.0;
/// Longest derivative time and filter time, s.
const MAX_DERIVATIVE_TIME: f64 = 1.0;
/// Largest weight of the velocity feedforward; 1 feeds the setpoint's velocity forward.
const MAX_FEEDFORWARD: f64 = 2.0;
/// Longest position cycle, s.
const MAX_PERIOD: f64 = 1.0;
/// 1 − q⁻¹.
const DIFFERENCE: [f64; 2] = [1.0, -1.0];

/// Tuning of a PID position controller with filtered derivative.
///
/// The proportional and the integral part act on θ* − θ, the derivative part acts on −θ only, so that a corner of the
/// path causes no impulse. The velocity feedforward supplies the derivative of the setpoint.
///
/// ```text
/// I(k) = I(k−1) + Kp Tsp/Ti (θ* − θ)(k)         D(k) = ρ D(k−1) − Kp Td/(Tf + Tsp) (θ(k) − θ(k−1))
/// Ω*(k) = Kp (θ* − θ)(k) + I(k) + D(k) + w (θ*(k) − θ*(k−1))/Tsp         ρ = Tf/(Tf + Tsp)
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PidTuning {
    /// Kp, s⁻¹.
    pub gain: f64,
    /// Ti, s.
    pub integral_time: f64,
    /// Td, s; 0 disables the derivative part.
    pub derivative_time: f64,
    /// Tf, s; 0 disables the filter.
    pub filter_time: f64,
    /// w, weight of the velocity feedforward; 0 disables it.
    pub velocity_feedforward: f64,
}

/// Designs the proportional controller Ω* = Kp (θ* − θ) + w (θ*(k) − θ*(k−1))/Tsp (Prévost fig. 3).
///
/// `gain` is Kp in s⁻¹, `velocity_feedforward` w, `period` Tsp in s.
///
/// # Errors
/// [`DesignError::OutOfRange`] with the name of the parameter.
pub fn p_controller(gain: f64, velocity_feedforward: f64, period: f64) -> Result<Rst, DesignError> {
    check_common(gain, velocity_feedforward, period)?;
    with_feedforward(&[gain], &[1.0], &[gain], velocity_feedforward, period)
}

/// Designs the PI controller: [`PidTuning`] without derivative part; `period` is Tsp in s.
///
/// # Errors
/// [`DesignError::OutOfRange`] with the name of the parameter.
pub fn pi_controller(
    gain: f64,
    integral_time: f64,
    velocity_feedforward: f64,
    period: f64,
) -> Result<Rst, DesignError> {
    check_common(gain, velocity_feedforward, period)?;
    check_positive("integral_time", integral_time, MAX_INTEGRAL_TIME, " s")?;
    let on_error = proportional_integral(gain, integral_time, period);
    with_feedforward(&on_error, &DIFFERENCE, &on_error, velocity_feedforward, period)
}

/// Designs the PID controller; `period` is Tsp in s.
///
/// # Errors
/// [`DesignError::OutOfRange`] with the name of the parameter.
pub fn pid_controller(tuning: &PidTuning, period: f64) -> Result<Rst, DesignError> {
    let PidTuning { gain, integral_time, derivative_time, filter_time, velocity_feedforward } = *tuning;
    check_common(gain, velocity_feedforward, period)?;
    check_positive("integral_time", integral_time, MAX_INTEGRAL_TIME, " s")?;
    check_range("derivative_time", derivative_time, MAX_DERIVATIVE_TIME, " s")?;
    check_range("filter_time", filter_time, MAX_DERIVATIVE_TIME, " s")?;
    if derivative_time == 0.0 {
        return pi_controller(gain, integral_time, velocity_feedforward, period);
    }
    let filter = [1.0, -filter_time / (filter_time + period)];
    let on_error = product(&filter, &proportional_integral(gain, integral_time, period));
    let slope = gain * derivative_time / (filter_time + period);
    let derivative = product(&[slope, -slope], &DIFFERENCE);
    let s = product(&filter, &DIFFERENCE);
    with_feedforward(&sum(&on_error, &derivative), &s, &on_error, velocity_feedforward, period)
}

/// Returns the proportional and the integral part, multiplied by 1 − q⁻¹.
fn proportional_integral(gain: f64, integral_time: f64, period: f64) -> [f64; 2] {
    [gain * (1.0 + period / integral_time), -gain]
}

/// Creates the controller R, S and T, with S w/Tsp (1 − q⁻¹) added to T: velocity feedforward of weight w, which keeps
/// T(1). `t` is in rising powers of q⁻¹.
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

/// Checks the weight of the velocity feedforward.
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
