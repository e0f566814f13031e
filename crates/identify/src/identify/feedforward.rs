//! Weights of the feedforward by regression on the derivatives of PSEC (Prévost section 3.5, eqs. 6 to 8).

use super::fit::{determination, linear};
use super::setpoints::Setpoints;
use crate::recording::{Finding, Signals, Span};

/// Longest delay of a feedforward that is looked for, s.
const LONGEST_DELAY: f64 = 0.1;
/// R² below which the ratio is not constant.
const LEAST_DETERMINATION: f64 = 0.99;
/// Part of the largest derivative below which an instant is left out of the picture.
const SHOWN: f64 = 0.02;

/// A weight of the feedforward.
#[derive(Debug, Clone, PartialEq)]
pub struct Regression {
    /// VFFW (1), or TFFW (kg·m² at the motor, kg for a linear motor).
    pub value: f64,
    /// Its standard error.
    pub error: f64,
    /// R².
    pub determination: f64,
    /// Delay of the recorded setpoint behind the derivative: above the first, up to the second, s.
    pub delay: (f64, f64),
    /// Derivative of PSEC at the motor (rad/s, rad/s²) and the recorded setpoint, pairs.
    pub points: Vec<(f64, f64)>,
}

/// VFFW and TFFW.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FeedforwardFit {
    /// VFFW.
    pub velocity: Option<Regression>,
    /// TFFW.
    pub torque: Option<Regression>,
    /// Whether a recording with torque feedforward shows that TFFW is 0.
    pub no_torque: bool,
}

/// (Prévost eqs. 6, 7) ratios of the recorded VFFWS and TFFWS to the derivatives of PSEC.
///
/// `tsp` is the position period, s; `ratio` r, m or rad of the axis per rad of the motor.
pub fn feedforward(
    recordings: &[&Signals],
    tsp: f64,
    ratio: f64,
    findings: &mut Vec<Finding>,
) -> FeedforwardFit {
    let velocity = regression(
        recordings,
        tsp,
        |span| span.velocity_feedforward.as_ref(),
        |p| (p[2] - p[1]) / tsp / ratio,
    );
    let torque = regression(
        recordings,
        tsp,
        |span| span.torque_feedforward.as_ref(),
        |p| ((p[2] - p[1]) - (p[1] - p[0])) / (tsp * tsp) / ratio,
    );
    for (name, key, found) in [("VFFW", "velocity", &velocity), ("TFFW", "torque", &torque)] {
        if let Some(r) = found.as_ref().filter(|r| r.determination < LEAST_DETERMINATION) {
            findings.push(Finding::warning(
                "feedforward-not-constant",
                format!("{name} is not constant: R² of its regression is {:.4}", r.determination),
                format!("check the column and the unit of {key}_feedforward"),
            ));
        }
    }
    FeedforwardFit { velocity, torque, no_torque: false }
}

fn regression<'a>(
    recordings: &[&'a Signals],
    tsp: f64,
    channel: impl Fn(&'a Span) -> Option<&'a Vec<f64>>,
    derivative: impl Fn(&[f64]) -> f64,
) -> Option<Regression> {
    // The staircase of the derivative under each sample, with what was recorded there.
    let mut parts: Vec<(Vec<f64>, &'a [f64], f64)> = Vec::new();
    for signals in recordings {
        for span in &signals.spans {
            let Some(recorded) = channel(span).filter(|c| c.iter().any(|value| *value != 0.0)) else {
                continue;
            };
            let Some(setpoints) = Setpoints::of(span, signals.period, tsp) else { continue };
            let derivatives: Vec<f64> = setpoints.values.windows(3).map(&derivative).collect();
            let at = |i: usize| {
                let instant = ((i as f64 * signals.period - setpoints.first) / tsp + 1e-9).floor();
                // The first derivative is that of the third setpoint.
                let place = instant - 2.0;
                if place < 0.0 { 0.0 } else { derivatives.get(place as usize).copied().unwrap_or(0.0) }
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
        let fit = linear(pairs().map(|(x, y)| (vec![x], y, 1.0)))?;
        let value = *fit.values.first()?;
        let determination = determination(pairs().map(|(x, y)| (y, value * x)));
        determination.is_finite().then(|| (shift, value, fit.error(0), determination))
    });
    let (shift, value, error, determination) = fits.max_by(|a, b| a.3.total_cmp(&b.3))?;
    let all =
        parts.iter().flat_map(|(d, recorded, _)| d.iter().copied().zip(recorded.iter().copied().skip(shift)));
    let largest = all.clone().map(|(x, _)| x.abs()).fold(0.0, f64::max);
    let points = all.filter(|(x, _)| x.abs() > SHOWN * largest).collect();
    let delay = ((shift as f64 - 1.0).max(0.0) * period, shift as f64 * period);
    Some(Regression { value, error, determination, delay, points })
}
