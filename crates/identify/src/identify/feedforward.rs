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

fn fit_weight<'a>(
    recordings: &[&'a Signals],
    tsp: f64,
    channel: impl Fn(&'a SignalSpan) -> Option<&'a Vec<f64>>,
    derivative: impl Fn(&[f64]) -> f64,
) -> Option<FeedforwardRegression> {
    // Zero-order-held derivative at each sample, recorded signal, sampling period.
    let mut parts: Vec<(Vec<f64>, &'a [f64], f64)> = Vec::new();
    for signals in recordings {
        for span in &signals.spans {
            let Some(recorded) = channel(span).filter(|c| c.iter().any(|value| *value != 0.0)) else {
                continue;
            };
            let Some(setpoints) = SetpointGrid::of(span, signals.period, tsp) else { continue };
            let derivatives: Vec<f64> = setpoints.values.windows(3).map(&derivative).collect();
            let at = |i: usize| {
                let instant = ((i as f64 * signals.period - setpoints.first) / tsp + 1e-9).floor();
                // The first derivative belongs to the third setpoint.
                let index = instant - 2.0;
                if index < 0.0 { 0.0 } else { derivatives.get(index as usize).copied().unwrap_or(0.0) }
            };
            parts.push(((0..recorded.len()).map(at).collect(), recorded, signals.period));
        }
    }
    let period = parts.first()?.2;
    let shifts = (LONGEST_DELAY / period).floor() as usize;
    let fits = (0..=shifts).filter_map(|shift| {
        let pairs = || {
            parts
                .iter()
                .flat_map(move |(d, recorded, _)| d.iter().copied().zip(recorded.iter().copied().skip(shift)))
        };
        let fit = fit_linear(pairs().map(|(x, y)| (vec![x], y, 1.0)))?;
        let value = *fit.values.first()?;
        let determination = r_squared(pairs().map(|(x, y)| (y, value * x)));
        determination.is_finite().then(|| (shift, value, fit.error(0), determination))
    });
    let (shift, value, error, determination) = fits.max_by(|a, b| a.3.total_cmp(&b.3))?;
    let all =
        parts.iter().flat_map(|(d, recorded, _)| d.iter().copied().zip(recorded.iter().copied().skip(shift)));
    let largest = all.clone().map(|(x, _)| x.abs()).fold(0.0, f64::max);
    let points = all.filter(|(x, _)| x.abs() > SHOWN * largest).collect();
    let delay = ((shift as f64 - 1.0).max(0.0) * period, shift as f64 * period);
    Some(FeedforwardRegression { value, error, r_squared: determination, delay, points })
}
