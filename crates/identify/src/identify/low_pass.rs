//! Low-pass filter of the trace function of a control.

use std::f64::consts::{PI, SQRT_2};

/// Second-order Butterworth filter, discretized with the bilinear transform, half power at its cut-off frequency.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct LowPassFilter {
    gain: f64,
    feedback: [f64; 2],
    inputs: [f64; 2],
    outputs: [f64; 2],
}

impl LowPassFilter {
    /// Creates a filter of `cutoff` Hz for samples `period` s apart, settled at `start`.
    pub fn new(cutoff: f64, period: f64, start: f64) -> Self {
        // The tangent places the half power at the cut-off frequency of the sampled filter.
        let w = (PI * (cutoff * period).min(0.49)).tan();
        let scale = 1.0 / (1.0 + SQRT_2 * w + w * w);
        LowPassFilter {
            gain: w * w * scale,
            feedback: [2.0 * (w * w - 1.0) * scale, (1.0 - SQRT_2 * w + w * w) * scale],
            inputs: [start; 2],
            outputs: [start; 2],
        }
    }

    /// Filters the next sample.
    pub fn next(&mut self, input: f64) -> f64 {
        let [x1, x2] = self.inputs;
        let [y1, y2] = self.outputs;
        let output = self.gain * (input + 2.0 * x1 + x2) - self.feedback[0] * y1 - self.feedback[1] * y2;
        self.inputs = [input, x1];
        self.outputs = [output, y1];
        output
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn the_cut_off_has_half_the_power_and_a_constant_passes() {
        let (cutoff, period) = (24.0, 1e-3);
        let mut filter = LowPassFilter::new(cutoff, period, 0.0);
        let count = 100_000;
        let power: f64 = (0..count)
            .map(|k| filter.next((TAU * cutoff * f64::from(k) * period).sin()).powi(2))
            .skip(1000)
            .sum::<f64>()
            / f64::from(count - 1000);
        // A sine of amplitude 1 has the power 1/2.
        assert!((power - 0.25).abs() < 1e-3, "{power}");
        let mut settled = LowPassFilter::new(cutoff, period, 2.0);
        assert!((settled.next(2.0) - 2.0).abs() < 1e-12);
    }
}
