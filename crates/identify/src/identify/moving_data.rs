//! Samples in motion of recordings with current, and the current that Prévost eqs. 1 to 3 model there.
//!
//! The friction law is parametrized such that a + c ≥ 0 and d < b always hold.

use super::friction::friction_current;
use super::resample::CubicSpline;
use crate::recording::{GaussianFilter, SignalSpan, Signals};
use virtual_axes_core::config::{AxisConfig, AxisKind, FrictionConfig};
use virtual_axes_core::drive::Gravity;
use virtual_axes_core::statistics::mean;
use virtual_axes_core::units::MILLIMETER;

/// Longest step of the friction current before it is filtered like the current, s.
const FINE: f64 = 2e-3;
/// Speed below which the direction of the friction is uncertain, m/s or rad/s.
const SLOWEST: f64 = 2.0 * MILLIMETER;
/// Speed at standstill relative to that: less than the steps of an encoder.
const STANDING: f64 = 0.1;
/// Fewest samples at standstill.
pub(super) const FEWEST_STILL: usize = 10;
/// Standard deviations of the filter within which the axis must be faster than that.
const REACH: f64 = 3.0;
/// Fewest samples in motion; the prior determines what they do not.
const FEWEST_SAMPLES: usize = 6;
/// Highest cut-off frequency, Hz: faster currents are those of elastic parts and of the sampling.
const CUTOFF: f64 = 25.0;
/// Index of the factor of the ripple, and that of its prior.
pub(super) const RIPPLE: usize = 6;

/// Ripple of the current at each sample of each span of each recording, A; NaN where it is unknown.
pub(super) type CurrentRipple = Vec<Vec<Vec<f64>>>;

/// One sample in motion.
pub(super) struct Sample {
    pub acceleration: f64,
    pub current: f64,
    /// Derivative of the filtered current, A/s.
    pub slope: f64,
    /// Filtered ripple of the acceleration, m/s² or rad/s².
    pub ripple: f64,
    /// First of the fine speeds around the sample.
    pub from: usize,
    pub recording: usize,
    /// Number of the move.
    pub cluster: usize,
    pub span: usize,
    /// Number of the span in the recording.
    pub number: usize,
    /// Index in the span.
    pub index: usize,
}

/// Samples in motion of all recordings.
pub(super) struct MovingData {
    pub samples: Vec<Sample>,
    /// Fine velocities of each span, m/min or rev/min.
    pub speeds: Vec<Vec<f64>>,
    /// Weights of the filter window of each recording, from its first fine sample on.
    pub weights: Vec<Vec<f64>>,
    pub moves: usize,
    /// Filtered currents at standstill, A, and the mean of each standstill.
    pub still: Vec<f64>,
    pub standstills: Vec<f64>,
}

impl MovingData {
    /// Selects the samples in motion, at most one per `distance` s, where `known` is finite.
    pub fn new(
        recordings: &[&Signals],
        axis: &AxisConfig,
        distance: f64,
        known: Option<&CurrentRipple>,
    ) -> Option<Self> {
        let mut data = MovingData {
            samples: Vec::new(),
            speeds: Vec::new(),
            weights: Vec::new(),
            moves: 0,
            still: Vec::new(),
            standstills: Vec::new(),
        };
        for (recording, signals) in recordings.iter().enumerate() {
            let steps = (signals.period / FINE).ceil().max(1.0) as usize;
            let fine = signals.period / steps as f64;
            let sigma = crate::recording::deviation(signals.cutoff) / fine;
            let radius = (REACH * sigma).ceil() as usize;
            let gauss = |k: usize| (-0.5 * ((k as f64 - radius as f64) / sigma).powi(2)).exp();
            let sum: f64 = (0..=2 * radius).map(gauss).sum();
            data.weights.push((0..=2 * radius).map(|k| gauss(k) / sum).collect());
            for (number, span) in signals.spans.iter().enumerate() {
                let known = known.and_then(|all| all.get(recording)?.get(number)).map(Vec::as_slice);
                let thinning = ((distance / signals.period + 1e-9) as usize).max(1);
                data.add((span, number, known), (signals.period, steps, thinning), axis);
            }
        }
        (data.samples.len() >= FEWEST_SAMPLES).then_some(data)
    }

    fn add(
        &mut self,
        (span, number, known): (&SignalSpan, usize, Option<&[f64]>),
        (period, steps, thinning): (f64, usize, usize),
        axis: &AxisConfig,
    ) {
        let (Some(current), Some(raw)) = (&span.smooth_current, &span.current) else { return };
        let unit = axis.units().speed;
        let spline = CubicSpline::new(&span.position, period);
        let fine = period / steps as f64;
        let count = (span.position.len().saturating_sub(1)) * steps + 1;
        let speeds: Vec<f64> = (0..count).map(|k| spline.at(k as f64 * fine)[1] / unit).collect();
        let recording = self.weights.len() - 1;
        let (radius, slowest) = (self.weights[recording].len() / 2, SLOWEST / unit);
        let limit = super::inertia::SATURATED * axis.motor.max_current;
        let mut moving = 0.0;
        let mut standing: Vec<f64> = Vec::new();
        for i in 0..span.position.len() {
            let window = (i * steps)
                .checked_sub(radius)
                .and_then(|from| Some((from, speeds.get(from..=from + 2 * radius)?)));
            let direction = window.map_or(0.0, |(_, speeds)| {
                let sign = speeds[radius].signum();
                if speeds.iter().all(|v| v * sign > slowest) { sign } else { 0.0 }
            });
            if direction != 0.0 && direction != moving {
                self.moves += 1;
            }
            moving = direction;
            let stands =
                window.is_some_and(|(_, speeds)| speeds.iter().all(|v| v.abs() < STANDING * slowest));
            if stands && current[i].is_finite() {
                standing.push(current[i]);
            } else {
                self.add_standstill(&mut standing);
            }
            let is_simulated = known.is_none_or(|known| known.get(i).is_some_and(|value| value.is_finite()));
            let is_known =
                is_simulated && current[i].is_finite() && raw[i].is_finite() && raw[i].abs() < limit;
            let last = current.len().saturating_sub(1);
            let (before, after) = (i.saturating_sub(1), (i + 1).min(last));
            let slope = (current[after] - current[before]) / ((after - before).max(1) as f64 * period);
            if let (Some((from, _)), true) =
                (window.filter(|_| direction != 0.0), is_known && slope.is_finite() && i % thinning == 0)
            {
                self.samples.push(Sample {
                    acceleration: span.acceleration[i],
                    current: current[i],
                    slope,
                    ripple: 0.0,
                    from,
                    recording,
                    cluster: self.moves,
                    span: self.speeds.len(),
                    number,
                    index: i,
                });
            }
        }
        self.add_standstill(&mut standing);
        self.speeds.push(speeds);
    }

    /// Adds the currents of a standstill that ends.
    fn add_standstill(&mut self, standing: &mut Vec<f64>) {
        if standing.len() >= FEWEST_STILL {
            self.standstills.extend(mean(standing));
        }
        self.still.append(standing);
    }

    /// Returns the filtered current of each sample, without that of the gravity of a rotary axis, A.
    pub fn measured(&self, recordings: &[&Signals], axis: &AxisConfig) -> Vec<f64> {
        let gravity = Gravity::new(&axis.gravity, axis.transmission_ratio);
        let spans = recordings.iter().flat_map(|signals| &signals.spans);
        let spans: Vec<&SignalSpan> = spans.filter(|span| span.smooth_current.is_some()).collect();
        let held = |sample: &Sample| match (axis.kind(), spans.get(sample.span)) {
            (AxisKind::Rotary, Some(span)) => {
                gravity.torque(span.position[sample.index]) / axis.motor.torque_constant
            }
            _ => 0.0,
        };
        self.samples.iter().map(|sample| sample.current - held(sample)).collect()
    }

    /// Returns the filtered friction current of each sample, A.
    pub fn friction(&self, law: &FrictionConfig) -> Vec<f64> {
        let friction: Vec<Vec<f64>> = self
            .speeds
            .iter()
            .map(|speeds| speeds.iter().map(|v| friction_current(law, *v)).collect())
            .collect();
        let of = |sample: &Sample| {
            let window = friction.get(sample.span).and_then(|all| all.get(sample.from..)).unwrap_or_default();
            self.weights[sample.recording].iter().zip(window).map(|(w, f)| w * f).sum()
        };
        self.samples.iter().map(of).collect()
    }

    /// Returns the modeled current of each sample for the parameters of [`NAMES`] in fitted form.
    pub fn modeled(&self, x: &[f64]) -> Vec<f64> {
        let friction = self.friction(&law_of(x));
        self.samples
            .iter()
            .zip(friction)
            .map(|(sample, friction)| {
                let acceleration = sample.acceleration + x[RIPPLE] * sample.ripple;
                x[0] * acceleration + x[1] + friction - x[7] * sample.slope
            })
            .collect()
    }

    /// Returns by how much the mean current of each standstill is outside of ±i0 around the gravity, A.
    pub fn excesses(&self, x: &[f64]) -> impl Iterator<Item = f64> {
        // Difference quotients can leave the range of a.
        let i0 = law_of(x).i0.max(0.0);
        self.standstills.iter().map(move |current| {
            let held = current - x[1];
            held - held.clamp(-i0, i0)
        })
    }
}

/// Filtered current of a sample in motion: recorded, and modeled by Prévost eqs. 1 to 3.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct MovingCurrent {
    /// Index of the span.
    pub span: usize,
    /// Index in the span.
    pub index: usize,
    /// Recorded and filtered current, A.
    pub recorded: f64,
    /// Modeled and filtered current, A.
    pub modeled: f64,
}

/// Computes the filtered current of a linear or rotary axis at the samples in motion.
pub(super) fn moving_current(signals: &Signals, axis: &AxisConfig) -> Vec<MovingCurrent> {
    let signals = &smoothed(signals);
    let Some(data) = MovingData::new(&[signals], axis, 0.0, None) else { return Vec::new() };
    let gravity = Gravity::new(&axis.gravity, axis.transmission_ratio);
    let (kt, r) = (axis.motor.torque_constant, axis.transmission_ratio);
    let spans: Vec<&SignalSpan> = signals.spans.iter().filter(|span| span.smooth_current.is_some()).collect();
    let numbers: Vec<usize> =
        (0..signals.spans.len()).filter(|k| signals.spans[*k].smooth_current.is_some()).collect();
    let friction = data.friction(&axis.friction);
    let of = |(sample, friction): (&Sample, f64)| {
        let position = spans.get(sample.span)?.position.get(sample.index)?;
        let modeled =
            axis.motor.inertia * sample.acceleration / (r * kt) + friction + gravity.torque(*position) / kt;
        Some(MovingCurrent {
            span: numbers[sample.span],
            index: sample.index,
            recorded: sample.current,
            modeled,
        })
    };
    data.samples.iter().zip(friction).filter_map(of).collect()
}

/// Returns the friction law of the fitted parameters: factor of the acceleration, gravity, a, −c / a, b, ln(−d).
pub(super) fn law_of(x: &[f64]) -> FrictionConfig {
    let (a, ratio, b, d) = (x[2], x[3], x[4], -x[5].exp());
    FrictionConfig { a, b, c: -ratio * a, d, i0: (1.0 - ratio) * a }
}

/// Returns the recording with signals filtered at most at [`CUTOFF`].
pub(super) fn smoothed(signals: &Signals) -> Signals {
    if signals.cutoff <= CUTOFF {
        return signals.clone();
    }
    let filter = GaussianFilter::new(CUTOFF, signals.period);
    let of = |span: &SignalSpan| {
        let motion = filter.apply(&span.position);
        SignalSpan {
            velocity: motion.first,
            acceleration: motion.second,
            smooth_current: span.current.as_ref().map(|current| filter.apply(current).value),
            ..span.clone()
        }
    };
    Signals { cutoff: CUTOFF, spans: signals.spans.iter().map(of).collect(), ..signals.clone() }
}
