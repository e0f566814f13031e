//! Parameters of the fit of a production trace: their effect on an axis, and their prior.

use virtual_axes_core::config::{AxisConfig, Periods};
use virtual_axes_core::units::{MICROSECOND_NS, Nanoseconds, seconds};

/// Largest residual of one standard deviation of the prior, m or rad: a few encoder increments.
pub(super) const PRIOR: f64 = 5e-6;
/// Usual ratio of velocity-loop gain to inertia, s⁻¹.
const BANDWIDTH: f64 = 240.0;

/// Parameter of the fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum LoopParameter {
    /// Lag of the position at constant velocity, s: α, and the time by which the control logs actual values late.
    Lag,
    /// β, s.
    Beta,
    /// γ, s.
    Gamma,
    /// Position-loop gain, s⁻¹.
    Gain,
    /// Velocity-loop gain divided by Jeq, s⁻¹.
    Bandwidth,
    /// Integral time of the velocity loop, s.
    IntegralTime,
    /// TFFW divided by Jeq.
    TorqueRatio,
}

/// Returns the axis with `values`, and the time by which actual values are logged late, s: the lag without whole cycles.
pub(super) fn apply(
    axis: &AxisConfig,
    periods: &Periods,
    parameters: &[LoopParameter],
    values: &[f64],
) -> (AxisConfig, f64) {
    let mut axis = axis.clone();
    let inertia = axis.motor.inertia;
    let mut shift = 0.0;
    let lag = parameters.iter().zip(values).find(|(p, _)| **p == LoopParameter::Lag);
    if let Some((_, lag)) = lag {
        let tsp = seconds(periods.position);
        let cycles = (lag / tsp).round().max(0.0);
        axis.delays.alpha = nanoseconds(((cycles - 0.5) * tsp).max(0.0));
        shift = lag - cycles * tsp;
    }
    for (parameter, &value) in parameters.iter().zip(values) {
        match parameter {
            LoopParameter::Lag => {}
            // Actual values that are logged late show the feedforward late too.
            LoopParameter::Beta => axis.delays.beta = nanoseconds((value - shift).max(0.0)),
            LoopParameter::Gamma => axis.delays.gamma = nanoseconds((value - shift).max(0.0)),
            LoopParameter::Gain => axis.position_loop.gain = value,
            LoopParameter::Bandwidth => axis.velocity_loop.gain = value * inertia,
            LoopParameter::IntegralTime => axis.velocity_loop.integral_time = value,
            LoopParameter::TorqueRatio => axis.feedforward.torque = value * inertia,
        }
    }
    (axis, shift)
}

/// Returns the distances from a weak prior, in its standard deviations. Production traces do not determine all parameters of the velocity loop
/// and of the torque feedforward; the prior keeps them at usual values.
pub(super) fn prior(parameters: &[LoopParameter], values: &[f64], given_gain: f64) -> Vec<f64> {
    let of = |parameter: LoopParameter| {
        parameters.iter().position(|p| *p == parameter).and_then(|k| values.get(k)).copied()
    };
    let bandwidth = of(LoopParameter::Bandwidth).unwrap_or(BANDWIDTH);
    let distance = |(parameter, &value): (&LoopParameter, &f64)| match parameter {
        LoopParameter::Lag | LoopParameter::Beta => 0.0,
        LoopParameter::Gamma => (value - of(LoopParameter::Beta).unwrap_or(value)) / 5e-3,
        LoopParameter::Gain => (value / given_gain).ln() / 0.4,
        LoopParameter::Bandwidth => (value / BANDWIDTH).ln() / 0.4,
        LoopParameter::IntegralTime => (value * bandwidth / 1.5).ln() / 0.4,
        LoopParameter::TorqueRatio => (value - 1.0) / 0.1,
    };
    parameters.iter().zip(values).map(distance).collect()
}

fn nanoseconds(time: f64) -> Nanoseconds {
    // A microsecond is less than the uncertainty of any delay.
    (time * 1e6).round() as Nanoseconds * MICROSECOND_NS
}
