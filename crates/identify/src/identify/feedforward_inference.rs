//! Inference of the active velocity feedforward from the lag of the position.

use super::resample::CubicSpline;
use super::validate::constant_lag;
use crate::recording::Signals;
use virtual_axes_core::statistics::rms;
use virtual_axes_core::units::POSITION_GAIN;

/// Gains of the first-order lag that are tried, (m/min)/mm.
const GAINS: [f64; 12] = [0.5, 0.7, 0.9, 1.2, 1.5, 1.8, 2.2, 2.7, 3.3, 4.0, 5.0, 7.0];
/// Ratio of the residuals from which one of both explanations is certain.
const CLEAR: f64 = 1.5;

/// Returns true if the axis moves with velocity feedforward, false if without; none if the motion does not show it.
///
/// With feedforward the position is PSEC delayed by a constant lag. Without, it follows PSEC with the first-order lag of
/// the position loop, `dx/dt = Kp (PSEC(t − α) − x)`, which differs in each acceleration.
pub fn infer_velocity_feedforward(signals: &Signals) -> Option<bool> {
    let (lag, delayed) = constant_lag(signals)?;
    let first_order = GAINS.iter().filter_map(|gain| {
        let gain = gain * POSITION_GAIN;
        first_order_residual(signals, gain, (lag - 1.0 / gain).max(0.0))
    });
    let first_order = first_order.reduce(f64::min)?;
    match delayed / first_order {
        ratio if ratio > CLEAR => Some(false),
        ratio if ratio < 1.0 / CLEAR => Some(true),
        _ => None,
    }
}

/// Returns the RMS difference of the position from PSEC behind a delay, s, and a first-order lag of `gain`, 1/s.
fn first_order_residual(signals: &Signals, gain: f64, delay: f64) -> Option<f64> {
    let period = signals.period;
    let decay = (-gain * period).exp();
    let differences = signals.spans.iter().filter_map(|span| Some((span.psec.as_ref()?, &span.position)));
    let differences = differences.flat_map(|(psec, position)| {
        let spline = CubicSpline::new(psec, period);
        let mut state = position.first().copied().unwrap_or(0.0);
        let mut before = spline.at(-delay)[0];
        // Exact for setpoints that are straight between two samples.
        let step = move |(i, position): (usize, &f64)| {
            let now = spline.at(i as f64 * period - delay)[0];
            let slope = (now - before) / period;
            if i > 0 {
                state = now - slope / gain + (state - before + slope / gain) * decay;
            }
            before = now;
            state - position
        };
        position.iter().enumerate().map(step).collect::<Vec<f64>>()
    });
    rms(differences)
}
