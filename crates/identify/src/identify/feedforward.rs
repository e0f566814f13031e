//! Identification of the feedforward weights by regression on the derivatives of PSEC (Prévost section 3.5,
//! eqs. 6–8).

use serde::{Serialize, Serializer};

use super::fit::{fit_linear, r_squared};
use super::setpoints::SetpointGrid;
use crate::recording::{Finding, SignalSpan, Signals};
use virtual_axes_core::units::MILLISECOND;

/// Longest delay of the feedforward, s.
const LONGEST_DELAY: f64 = 0.1;
/// R² below which the ratio is not constant.
const LEAST_DETERMINATION: f64 = 0.99;
/// Tolerance of a whole number of samples or position cycles.
const WHOLE: f64 = 1e-9;
/// Smallest derivative shown in plots, relative to the largest.
const SHOWN: f64 = 0.02;

/// Regression of a feedforward weight.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FeedforwardRegression {
    /// VFFW (dimensionless), or TFFW (kg·m² at the motor, kg for a linear motor).
    pub value: f64,
    /// Standard error of the weight.
    pub error: f64,
    /// Coefficient of determination R².
    pub r_squared: f64,
    /// Delay of the recorded setpoint behind the derivative, s: above the first and up to the second value.
    #[serde(rename = "delay_ms", serialize_with = "serialize_milliseconds")]
    pub delay: (f64, f64),
    /// Pairs of the derivative of PSEC at the motor (rad/s, rad/s²) and the recorded setpoint.
    #[serde(skip)]
    pub points: Vec<(f64, f64)>,
}

fn serialize_milliseconds<S: Serializer>(delay: &(f64, f64), serializer: S) -> Result<S::Ok, S::Error> {
    (delay.0 / MILLISECOND, delay.1 / MILLISECOND).serialize(serializer)
}

/// Regressions of VFFW and TFFW.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct FeedforwardFit {
    /// Regression of VFFW.
    pub velocity: Option<FeedforwardRegression>,
    /// Regression of TFFW.
    pub torque: Option<FeedforwardRegression>,
    /// True if a recording with torque feedforward shows that TFFW is 0.
    #[serde(skip)]
    pub is_torque_zero: bool,
}

/// Fits VFFW and TFFW as ratios of the recorded VFFWS and TFFWS to the derivatives of PSEC (Prévost eqs. 6,
/// 7).
///
/// `tsp` is the position cycle, s; `ratio` is r, m or rad of the axis per rad of the motor.
pub fn fit_feedforward(
    recordings: &[&Signals],
    tsp: f64,
    ratio: f64,
    findings: &mut Vec<Finding>,
) -> FeedforwardFit {
    let velocity = fit_weight(
        recordings,
        tsp,
        |span| span.velocity_feedforward.as_ref(),
        |p| (p[2] - p[1]) / tsp / ratio,
    );
    let torque = fit_weight(
        recordings,
        tsp,
        |span| span.torque_feedforward.as_ref(),
        |p| ((p[2] - p[1]) - (p[1] - p[0])) / (tsp * tsp) / ratio,
    );
    for (name, key, found) in [("VFFW", "velocity", &velocity), ("TFFW", "torque", &torque)] {
        if let Some(r) = found.as_ref().filter(|r| r.r_squared < LEAST_DETERMINATION) {
            findings.push(Finding::warning(
                "feedforward-not-constant",
                format!("{name} is not constant: R² of its regression is {:.4}", r.r_squared),
                format!("check column and unit of {key}_feedforward"),
            ));
        }
    }
    FeedforwardFit { velocity, torque, is_torque_zero: false }
}

/// Derivative of PSEC of a span, and the recorded feedforward signal.
struct WeightPart<'a> {
    /// Zero-order-held derivative of each position cycle, from the third one on.
    derivatives: Vec<f64>,
    /// Time of the first position cycle in the span, s.
    first: f64,
    recorded: &'a [f64],
    /// Sampling period of the recording, s.
    period: f64,
}

impl WeightPart<'_> {
    /// Returns the pairs of the derivative `delay` s before each sample and the recorded signal; `tsp` is the position
    /// cycle, s.
    fn pairs(&self, delay: f64, tsp: f64) -> impl Iterator<Item = (f64, f64)> + Clone + '_ {
        let skipped = (delay / self.period - WHOLE).ceil().max(0.0) as usize;
        self.recorded.iter().enumerate().skip(skipped).map(move |(i, recorded)| {
            let instant = ((i as f64 * self.period - delay - self.first) / tsp + WHOLE).floor();
            // The first derivative belongs to the third setpoint.
            let index = instant - 2.0;
            let derivative = if index < 0.0 { None } else { self.derivatives.get(index as usize) };
            (derivative.copied().unwrap_or(0.0), *recorded)
        })
    }
}

fn fit_weight<'a>(
    recordings: &[&'a Signals],
    tsp: f64,
    channel: impl Fn(&'a SignalSpan) -> Option<&'a Vec<f64>>,
    derivative: impl Fn(&[f64]) -> f64,
) -> Option<FeedforwardRegression> {
    let mut parts: Vec<WeightPart<'a>> = Vec::new();
    for signals in recordings {
        for span in &signals.spans {
            let Some(recorded) = channel(span).filter(|c| c.iter().any(|value| *value != 0.0)) else {
                continue;
            };
            let Some(setpoints) = SetpointGrid::of(span, signals.period, tsp) else { continue };
            let derivatives = setpoints.values.windows(3).map(&derivative).collect();
            parts.push(WeightPart { derivatives, first: setpoints.first, recorded, period: signals.period });
        }
    }
    // The recording with the shortest sampling period resolves the delay best.
    let step = parts.iter().map(|part| part.period).reduce(f64::min)?;
    let steps = (LONGEST_DELAY / step).floor() as usize;
    let pairs = |count: usize| parts.iter().flat_map(move |part| part.pairs(count as f64 * step, tsp));
    let fits = (0..=steps).filter_map(|count| {
        let fit = fit_linear(pairs(count).map(|(x, y)| (vec![x], y, 1.0)))?;
        let value = *fit.values.first()?;
        let determination = r_squared(pairs(count).map(|(x, y)| (y, value * x)));
        determination.is_finite().then(|| (count, value, fit.error(0), determination))
    });
    let (count, value, error, determination) = fits.max_by(|a, b| a.3.total_cmp(&b.3))?;
    let largest = pairs(count).map(|(x, _)| x.abs()).fold(0.0, f64::max);
    let points = pairs(count).filter(|(x, _)| x.abs() > SHOWN * largest).collect();
    let delay = ((count as f64 - 1.0).max(0.0) * step, count as f64 * step);
    Some(FeedforwardRegression { value, error, r_squared: determination, delay, points })
}

#[cfg(test)]
mod tests {
    use super::*;

    const TSP: f64 = 6e-3;
    /// Delay of the feedforward, s.
    const DELAY: f64 = 9e-3;

    /// Returns a recording of VFFWS with a weight of 0.8, sampled with `period`.
    fn recorded(period: f64) -> Signals {
        let psec = |cycle: f64| (0.05 * (cycle - 10.0).max(0.0)).sin();
        let cycle = |time: f64| (time / TSP + 1e-9).floor();
        let times = (0..(6.0 / period) as usize).map(|i| i as f64 * period);
        let feedforward = |time: f64| {
            let cycle = cycle(time - DELAY);
            0.8 * (psec(cycle) - psec(cycle - 1.0)) / TSP
        };
        let span = SignalSpan {
            psec: Some(times.clone().map(|time| psec(cycle(time))).collect()),
            velocity_feedforward: Some(times.map(feedforward).collect()),
            ..SignalSpan::default()
        };
        Signals {
            name: String::new(),
            period,
            renewal: None,
            cutoff: 100.0,
            trace_filter: None,
            torque_constant: None,
            current_lag: 0.0,
            spans: vec![span],
        }
    }

    #[test]
    fn the_delay_is_independent_of_the_order_of_recordings() {
        let (fine, coarse) = (recorded(1e-3), recorded(TSP));
        for recordings in [[&fine, &coarse], [&coarse, &fine]] {
            let found = fit_feedforward(&recordings, TSP, 1.0, &mut Vec::new()).velocity.expect("a weight");
            assert!((found.value - 0.8).abs() < 1e-6 && found.r_squared > 1.0 - 1e-9, "{found:?}");
            assert!((found.delay.0 - 8e-3).abs() < 1e-9 && (found.delay.1 - DELAY).abs() < 1e-9);
        }
    }
}
