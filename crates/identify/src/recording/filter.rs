//! Zero-phase Gaussian filter: smoothed value, first and second derivative with one kernel width.

use std::f64::consts::{LN_2, TAU};

/// Highest cut-off frequency times sampling period. The standard deviation is 0.83 samples there; below 0.8
/// samples, aliasing of the sampled second derivative exceeds half a per cent at the cut-off.
pub(super) const MAX_CUTOFF_PERIOD: f64 = 0.16;
/// Default cut-off frequency, Hz: above the bandwidth of the velocity loop, below the ripple of its current.
pub(super) const DEFAULT_CUTOFF: f64 = 100.0;
/// Half length of the kernel in standard deviations; the truncated part is 6e-7.
const REACH: f64 = 5.0;

/// Returns the standard deviation, s, of the Gaussian that passes half the power at `cutoff` (Hz): |H(f)|² =
/// exp(−(2π f σ)²) = 1/2.
pub(crate) fn deviation(cutoff: f64) -> f64 {
    LN_2.sqrt() / (TAU * cutoff)
}

/// Returns the default cut-off frequency, Hz, for a sampling period, s.
pub(super) fn default_cutoff(period: f64) -> f64 {
    DEFAULT_CUTOFF.min(MAX_CUTOFF_PERIOD / period)
}

/// Sampled Gaussian kernel and its derivatives, corrected by their moments.
///
/// The derivatives are exact on polynomials up to degree 2, the smoothed value on straight lines. The
/// smoothed value of a parabola is offset by σ² times its second derivative / 2, as with any Gaussian.
#[derive(Debug, Clone, PartialEq)]
pub struct GaussianFilter {
    /// Weights of x(n−k) + x(n+k) − 2 x(n), k = 1, 2 …, in the smoothed value.
    value: Vec<f64>,
    /// Weights of x(n+k) − x(n−k) in the first derivative, 1/s.
    first: Vec<f64>,
    /// Weights of x(n−k) + x(n+k) − 2 x(n) in the second derivative, 1/s².
    second: Vec<f64>,
}

/// Output of a [`GaussianFilter`]; each signal is as long as the input.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FilteredSignal {
    /// Smoothed signal.
    pub value: Vec<f64>,
    /// First derivative, 1/s.
    pub first: Vec<f64>,
    /// Second derivative, 1/s².
    pub second: Vec<f64>,
}

impl GaussianFilter {
    /// Creates a filter with cut-off frequency `cutoff` (Hz) for samples `period` (s) apart.
    pub fn new(cutoff: f64, period: f64) -> Self {
        let sigma = deviation(cutoff) / period;
        let radius = (REACH * sigma).ceil().max(1.0) as usize;
        let weights: Vec<(f64, f64)> = (1..=radius)
            .map(|k| k as f64)
            .map(|k| (k * k, (-0.5 * (k / sigma) * (k / sigma)).exp()))
            .collect();
        let moment = |power: i32| 2.0 * weights.iter().map(|(k2, g)| k2.powi(power) * g).sum::<f64>();
        let (m0, m2, m4) = (1.0 + moment(0), moment(1), moment(2));
        // Second derivative: (scale k² − scale m2/m0) g, whose moments of order 0 and 2 are 0 and 2.
        let scale = 2.0 / (m4 - m2 * m2 / m0) / (period * period);
        GaussianFilter {
            value: weights.iter().map(|(_, g)| g / m0).collect(),
            first: weights.iter().map(|(k2, g)| k2.sqrt() * g / m2 / period).collect(),
            second: weights.iter().map(|(k2, g)| scale * (k2 - m2 / m0) * g).collect(),
        }
    }

    /// Returns the half length of the kernel, samples.
    pub fn radius(&self) -> usize {
        self.value.len()
    }

    /// Returns the standard deviation of the smoothed value of white noise, relative to that of the noise.
    pub(crate) fn noise_gain(&self) -> f64 {
        let middle = 1.0 - 2.0 * self.value.iter().sum::<f64>();
        self.value.iter().map(|weight| 2.0 * weight * weight).sum::<f64>().sqrt().hypot(middle)
    }

    /// Returns smoothed value and derivatives of `signal`, which must be longer than the kernel.
    ///
    /// Beyond its ends the signal is continued by odd reflection about the end value, x(−k) = 2 x(0) − x(k).
    /// At the first and last sample the smoothed value is the input and the second derivative is zero.
    pub fn apply(&self, signal: &[f64]) -> FilteredSignal {
        let (padded, radius) = (self.extended(signal), self.radius());
        let mut out = FilteredSignal::default();
        for center in radius..radius + signal.len() {
            let middle = padded[center];
            let (mut value, mut first, mut second) = (0.0, 0.0, 0.0);
            for k in 1..=radius {
                let (before, after) = (padded[center - k], padded[center + k]);
                let bend = (before - middle) + (after - middle);
                value += self.value[k - 1] * bend;
                first += self.first[k - 1] * (after - before);
                second += self.second[k - 1] * bend;
            }
            out.value.push(middle + value);
            out.first.push(first);
            out.second.push(second);
        }
        out
    }

    /// Returns the second derivative of `signal` at `index`; none closer to an end than the half length of the kernel.
    pub(crate) fn second_at(&self, signal: &[f64], index: usize) -> Option<f64> {
        self.bend_at(&self.second, signal, index)
    }

    /// Returns the smoothed value of `signal` at `index`; none closer to an end than the half length of the kernel.
    pub(crate) fn value_at(&self, signal: &[f64], index: usize) -> Option<f64> {
        Some(signal.get(index)? + self.bend_at(&self.value, signal, index)?)
    }

    /// Returns the weighted sum of x(n−k) + x(n+k) − 2 x(n).
    fn bend_at(&self, weights: &[f64], signal: &[f64], index: usize) -> Option<f64> {
        let radius = self.radius();
        let middle = *signal.get(index)?;
        let part = signal.get(index.checked_sub(radius)?..=index + radius)?;
        let (before, after) = (part[..radius].iter().rev(), part[radius + 1..].iter());
        let bends = before.zip(after).zip(weights);
        Some(bends.map(|((a, b), weight)| weight * ((a - middle) + (b - middle))).sum::<f64>())
    }

    fn extended(&self, signal: &[f64]) -> Vec<f64> {
        let (Some(&first), Some(&last)) = (signal.first(), signal.last()) else {
            return vec![0.0; 2 * self.radius()];
        };
        let end = signal.len() - 1;
        // A signal shorter than the kernel is held beyond its mirror image; callers drop such spans.
        let mirrored = |k: usize| k.min(end);
        let before = (1..=self.radius()).rev().map(|k| 2.0 * first - signal[mirrored(k)]);
        let after = (1..=self.radius()).map(|k| 2.0 * last - signal[end - mirrored(k)]);
        before.chain(signal.iter().copied()).chain(after).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD: f64 = 1e-3;

    fn sampled(f: impl Fn(f64) -> f64) -> Vec<f64> {
        (0..400).map(|n| f(n as f64 * PERIOD)).collect()
    }

    #[test]
    fn derivatives_are_exact_on_parabolas() {
        for cutoff in [20.0, 100.0, 160.0] {
            let out = GaussianFilter::new(cutoff, PERIOD).apply(&sampled(|t| 0.3 - 2.0 * t + 5.0 * t * t));
            for n in 100..300 {
                let t = n as f64 * PERIOD;
                assert!((out.first[n] - (-2.0 + 10.0 * t)).abs() < 1e-11, "{cutoff} Hz: {}", out.first[n]);
                assert!((out.second[n] - 10.0).abs() < 1e-7, "{cutoff} Hz: {}", out.second[n]);
                let lifted = 0.3 - 2.0 * t + 5.0 * t * t + 5.0 * deviation(cutoff).powi(2);
                // Variance of the sampled kernel: 6e-5 from σ² at 0.83 samples by aliasing, 2e-5 by
                // truncation.
                assert!(
                    (out.value[n] - lifted).abs() < 1e-4 * 5.0 * deviation(cutoff).powi(2),
                    "{cutoff} Hz"
                );
            }
        }
    }

    #[test]
    fn a_sine_is_attenuated_by_the_gaussian_and_differentiated() {
        let (cutoff, frequency) = (100.0, 12.0);
        let w = TAU * frequency;
        let gain = (-0.5 * (w * deviation(cutoff)).powi(2)).exp();
        let out = GaussianFilter::new(cutoff, PERIOD).apply(&sampled(|t| (w * t).sin()));
        for n in 50..350 {
            let t = n as f64 * PERIOD;
            assert!((out.value[n] - gain * (w * t).sin()).abs() < 1e-3);
            assert!((out.first[n] - gain * w * (w * t).cos()).abs() < 1e-3 * w);
            assert!((out.second[n] + gain * w * w * (w * t).sin()).abs() < 1e-3 * w * w);
        }
    }

    #[test]
    fn half_the_power_passes_at_the_cutoff() {
        for cutoff in [25.0, 100.0, 160.0] {
            let w = TAU * cutoff;
            let filter = GaussianFilter::new(cutoff, PERIOD);
            // Two quadratures at one sample give the magnitude for any phase.
            let center = 200;
            let sine = filter.apply(&sampled(|t| (w * t).sin())).value[center];
            let cosine = filter.apply(&sampled(|t| (w * t).cos())).value[center];
            let power = sine * sine + cosine * cosine;
            assert!((power - 0.5).abs() < 2e-3, "{cutoff} Hz passes {power}");
        }
    }

    #[test]
    fn the_ends_of_a_ramp_keep_their_slope() {
        let out = GaussianFilter::new(100.0, PERIOD).apply(&sampled(|t| 1.0 + 3.0 * t));
        for n in [0, 1, 398, 399] {
            assert!((out.first[n] - 3.0).abs() < 1e-10);
            assert!(out.second[n].abs() < 1e-6);
        }
    }
}
