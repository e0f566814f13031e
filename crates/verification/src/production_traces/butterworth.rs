//! Low-pass filter of the control's trace function.

use std::f64::consts::{PI, SQRT_2};

/// Causal Butterworth low-pass filter of second order (bilinear transform with prewarped cutoff frequency).
///
/// The gain is 1 at rest and 1/√2 at the cutoff frequency. Well below it the filter delays every signal by
/// √2 / (2π · cutoff): 9.4 ms at 24 Hz. Signals filtered alike keep their lags relative to each other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ButterworthFilter {
    /// Coefficients of input values k, k − 1, k − 2.
    input: [f64; 3],
    /// Coefficients of output values k − 1, k − 2.
    output: [f64; 2],
}

impl ButterworthFilter {
    /// Creates a filter for samples every `period` s with the half-power frequency `cutoff` in Hz, below half of the
    /// sampling frequency.
    pub fn new(cutoff: f64, period: f64) -> Self {
        let k = (PI * cutoff * period).tan();
        let scale = 1.0 / (1.0 + SQRT_2 * k + k * k);
        let gain = k * k * scale;
        ButterworthFilter {
            input: [gain, 2.0 * gain, gain],
            output: [2.0 * (k * k - 1.0) * scale, (1.0 - SQRT_2 * k + k * k) * scale],
        }
    }

    /// Returns the filtered values, one per value of `values`, in their unit. Before the first value the signal has
    /// its first value.
    pub fn filter(&self, values: &[f64]) -> Vec<f64> {
        let first = values.first().copied().unwrap_or(0.0);
        // Values relative to the first keep the resolution of small changes.
        let (mut x1, mut x2, mut y1, mut y2) = (0.0, 0.0, 0.0, 0.0);
        let step = |value: &f64| {
            let x = value - first;
            let [b0, b1, b2] = self.input;
            let [a1, a2] = self.output;
            let y = b0 * x + b1 * x1 + b2 * x2 - a1 * y1 - a2 * y2;
            (x2, x1, y2, y1) = (x1, x, y1, y);
            first + y
        };
        values.iter().map(step).collect()
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;

    const PERIOD: f64 = 0.002;

    #[test]
    fn a_constant_passes_and_the_cutoff_has_half_power() {
        let filter = ButterworthFilter::new(24.0, PERIOD);
        assert_eq!(filter.filter(&[2.5; 100]), [2.5; 100]);
        let sine: Vec<f64> = (0..5000).map(|k| (TAU * 24.0 * PERIOD * f64::from(k)).sin()).collect();
        let power = |values: &[f64]| values.iter().map(|y| y * y).sum::<f64>() / values.len() as f64;
        // 2000 samples are 96 cycles.
        let ratio = power(&filter.filter(&sine)[1000..3000]) / power(&sine[1000..3000]);
        assert!((ratio - 0.5).abs() < 1e-3, "{ratio}");
    }

    #[test]
    fn a_ramp_is_delayed_by_the_group_delay() {
        let ramp: Vec<f64> = (0..1000).map(|k| f64::from(k) * PERIOD).collect();
        let filtered = ButterworthFilter::new(24.0, PERIOD).filter(&ramp);
        let lag = ramp[999] - filtered[999];
        assert!((lag - SQRT_2 / (TAU * 24.0)).abs() < 1e-4, "{lag}");
    }
}
