//! Feedforward signals of recordings at any sampling period: weights, and the active feedforward.

use super::feedforward::{FeedforwardFit, FeedforwardRegression};
use super::feedforward_mode::FeedforwardMode;
use super::fit::{fit_linear, r_squared};
use super::options::IdentificationInput;
use super::resample::BandLimitedSpline;
use crate::recording::{FilteredSignal, GaussianFilter, SignalSpan, Signals, deviation};

/// Range of the delay of a feedforward signal behind the derivative of PSEC, s, and steps of the search.
const DELAYS: (f64, f64) = (-0.02, 0.06);
const STEPS: [f64; 3] = [2e-3, 4e-4, 8e-5];
/// Highest cut-off frequency of the filter of both, Hz.
const CUTOFF: f64 = 25.0;
/// Standard deviations of the filter from which on it does not change a sample.
const REACH: f64 = 5.0;
/// R² from which on a signal is a derivative of PSEC.
const DETERMINATION: f64 = 0.9;
/// Largest number of compared samples of a span.
const SAMPLES: usize = 5000;
/// Smallest derivative shown in plots, relative to the largest.
const SHOWN: f64 = 0.02;

/// Returns the active feedforward by the recorded signals; none without them.
pub(super) fn recorded_feedforward(signals: &Signals) -> Option<FeedforwardMode> {
    let acts = |channel: fn(&SignalSpan) -> Option<&Vec<f64>>| {
        let recorded: Option<Vec<&Vec<f64>>> = signals.spans.iter().map(channel).collect();
        recorded.map(|all| all.iter().any(|channel| channel.iter().any(|value| *value != 0.0)))
    };
    let velocity = acts(|span| span.velocity_feedforward.as_ref())?;
    match (velocity, acts(|span| span.torque_feedforward.as_ref())) {
        (false, None | Some(false)) => Some(FeedforwardMode::Off),
        (true, Some(false)) => Some(FeedforwardMode::Velocity),
        (_, Some(true)) => Some(FeedforwardMode::Both),
        (true, None) => None,
    }
}

/// Fits VFFW and TFFW as ratios of the recorded signals to the derivatives of PSEC; `ratio` is r, m or rad of the axis per
/// rad of the motor. A signal that is always 0 is a weight of 0, and one that is no derivative of PSEC has no weight.
pub(super) fn fit_recorded_feedforward(inputs: &[IdentificationInput<'_>], ratio: f64) -> FeedforwardFit {
    let signals: Vec<&Signals> = inputs.iter().map(|input| input.signals).collect();
    let velocity = fit_weight(
        &signals,
        |span| span.velocity_feedforward.as_ref(),
        |psec| psec.first.iter().map(|v| v / ratio).collect(),
    );
    let torque = fit_weight(
        &signals,
        |span| span.torque_feedforward.as_ref(),
        |psec| psec.second.iter().map(|a| a / ratio).collect(),
    );
    let mut all = signals.iter().flat_map(|signals| &signals.spans);
    let is_torque_zero = velocity.is_some()
        && all.all(|span| {
            span.torque_feedforward.as_ref().is_some_and(|c| c.iter().all(|value| *value == 0.0))
        });
    FeedforwardFit { velocity, torque, is_torque_zero }
}

/// Derivative of PSEC and a feedforward signal of a span, both filtered.
struct WeightPart {
    derivative: Vec<f64>,
    recorded: BandLimitedSpline,
    period: f64,
    /// Time at both ends that the filter does not reach, s.
    margin: f64,
}

impl WeightPart {
    /// Returns pairs of the derivative and the signal `delay` s later.
    fn pairs(&self, delay: f64) -> impl Iterator<Item = (f64, f64)> + Clone + '_ {
        let count = self.derivative.len();
        let (step, margin) = (count.div_ceil(SAMPLES).max(1), (self.margin / self.period).ceil() as usize);
        let kept = (margin..count.saturating_sub(margin)).step_by(step);
        kept.map(move |i| (self.derivative[i], self.recorded.at(i as f64 * self.period + delay)[0]))
    }
}

fn fit_weight<'a>(
    recordings: &[&'a Signals],
    channel: impl Fn(&'a SignalSpan) -> Option<&'a Vec<f64>>,
    derivative: impl Fn(&FilteredSignal) -> Vec<f64>,
) -> Option<FeedforwardRegression> {
    let mut parts: Vec<WeightPart> = Vec::new();
    for signals in recordings {
        // The filter passes setpoints that are held between position cycles as their mean.
        let (period, cutoff) = (signals.period, signals.cutoff.min(CUTOFF));
        let filter = GaussianFilter::new(cutoff, period);
        let margin = DELAYS.1 + REACH * deviation(cutoff);
        for span in &signals.spans {
            let recorded = channel(span).filter(|c| c.iter().any(|value| *value != 0.0));
            let (Some(recorded), Some(psec)) = (recorded, &span.psec) else { continue };
            let recorded = BandLimitedSpline::new(&filter.apply(recorded).value, period);
            parts.push(WeightPart { derivative: derivative(&filter.apply(psec)), recorded, period, margin });
        }
    }
    let pairs = |delay: f64| parts.iter().flat_map(move |part| part.pairs(delay));
    // The noise is that of the derivative, so that it is the dependent variable.
    let fit = |delay: f64| {
        let fit = fit_linear(pairs(delay).map(|(x, y)| (vec![y], x, 1.0)))?;
        let inverse = *fit.values.first()?;
        let determination = r_squared(pairs(delay).map(|(x, y)| (x, inverse * y)));
        let error = fit.error(0) / (inverse * inverse);
        determination.is_finite().then(|| (delay, 1.0 / inverse, error, determination))
    };
    let mut best: Option<(f64, f64, f64, f64)> = None;
    let (mut low, mut high) = DELAYS;
    for step in STEPS {
        let count = ((high - low) / step).round() as usize;
        let found =
            (0..=count).filter_map(|k| fit(low + k as f64 * step)).max_by(|a, b| a.3.total_cmp(&b.3))?;
        (low, high) = (found.0 - step, found.0 + step);
        best = Some(found);
    }
    let (delay, value, error, determination) = best.filter(|best| best.3 >= DETERMINATION)?;
    let largest = pairs(delay).map(|(x, _)| x.abs()).fold(0.0, f64::max);
    let points = pairs(delay).filter(|(x, _)| x.abs() > SHOWN * largest).collect();
    Some(FeedforwardRegression { value, error, r_squared: determination, delay: (low, high), points })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a recording of a sine with VFFWS of weight 0.8 and a delay of 3 ms, sampled with `period`.
    fn recorded(period: f64, torque: f64) -> Signals {
        let (omega, delay) = (6.0, 3e-3);
        let times: Vec<f64> = (0..(4.0 / period) as usize).map(|i| i as f64 * period).collect();
        let of = |f: &dyn Fn(f64) -> f64| Some(times.iter().map(|t| f(*t)).collect::<Vec<f64>>());
        let span = SignalSpan {
            psec: of(&|t| (omega * t).sin()),
            velocity_feedforward: of(&|t| 0.8 * omega * (omega * (t - delay)).cos()),
            torque_feedforward: of(&|t| -torque * omega * omega * (omega * (t - delay)).sin()),
            ..SignalSpan::default()
        };
        let name = String::new();
        Signals {
            name,
            period,
            renewal: None,
            cutoff: (0.16 / period).min(100.0),
            trace_filter: None,
            torque_constant: None,
            current_lag: 0.0,
            spans: vec![span],
        }
    }

    #[test]
    fn weight_and_delay_are_found_at_any_rate() {
        for period in [1e-3, 2e-3, 0.01, 0.02] {
            let signals = recorded(period, 0.03);
            let input = IdentificationInput { signals: &signals, feedforward: None };
            let found = fit_recorded_feedforward(&[input], 1.0);
            let (velocity, torque) = (found.velocity.expect("VFFW"), found.torque.expect("TFFW"));
            assert!((velocity.value - 0.8).abs() < 1e-4, "{period}: {}", velocity.value);
            assert!((torque.value - 0.03).abs() < 1e-4, "{period}: {}", torque.value);
            assert!(velocity.delay.0 < 3e-3 && 3e-3 < velocity.delay.1, "{:?}", velocity.delay);
            assert_eq!(recorded_feedforward(&signals), Some(FeedforwardMode::Both));
        }
    }

    #[test]
    fn a_torque_that_is_always_zero_is_a_weight_of_zero() {
        let signals = recorded(2e-3, 0.0);
        let input = IdentificationInput { signals: &signals, feedforward: None };
        let found = fit_recorded_feedforward(&[input], 1.0);
        assert!(found.is_torque_zero && found.torque.is_none());
        assert_eq!(recorded_feedforward(&signals), Some(FeedforwardMode::Velocity));
    }
}
