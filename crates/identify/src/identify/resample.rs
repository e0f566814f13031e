//! Interpolation of signals that were sampled more coarsely than the position cycle.

/// Natural cubic spline through samples at equal distances.
///
/// A band-limited signal of frequency f is met to about (2π f h)⁴ / 384 of its amplitude between samples h apart.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct CubicSpline {
    period: f64,
    values: Vec<f64>,
    /// Second derivatives at the samples.
    second: Vec<f64>,
}

impl CubicSpline {
    /// Creates the spline; `period` is the distance of the samples, s.
    pub fn new(values: &[f64], period: f64) -> Self {
        let count = values.len();
        let mut second = vec![0.0; count];
        // Elimination of the tridiagonal system m(i−1) + 4 m(i) + m(i+1) = 6 Δ²y(i) / h².
        let mut upper = vec![0.0; count];
        for i in 1..count.saturating_sub(1) {
            let right = 6.0 * (values[i - 1] - 2.0 * values[i] + values[i + 1]) / (period * period);
            let pivot = 4.0 - upper[i - 1];
            upper[i] = 1.0 / pivot;
            second[i] = (right - second[i - 1]) / pivot;
        }
        for i in (1..count.saturating_sub(1)).rev() {
            second[i] -= upper[i] * second[i + 1];
        }
        CubicSpline { period, values: values.to_vec(), second }
    }

    /// Returns value, first and second derivative at time `t` after the first sample, s; beyond the ends the spline is
    /// continued by straight lines.
    pub fn at(&self, t: f64) -> [f64; 3] {
        let h = self.period;
        let last = self.values.len().saturating_sub(1);
        if last == 0 {
            return [self.values.first().copied().unwrap_or(f64::NAN), 0.0, 0.0];
        }
        let end = last as f64 * h;
        let inside = t.clamp(0.0, end);
        let i = ((inside / h) as usize).min(last - 1);
        let b = inside / h - i as f64;
        let a = 1.0 - b;
        let (y0, y1, m0, m1) = (self.values[i], self.values[i + 1], self.second[i], self.second[i + 1]);
        let value = a * y0 + b * y1 + ((a * a * a - a) * m0 + (b * b * b - b) * m1) * h * h / 6.0;
        let first = (y1 - y0) / h + ((1.0 - 3.0 * a * a) * m0 + (3.0 * b * b - 1.0) * m1) * h / 6.0;
        let second = if t < 0.0 || t > end { 0.0 } else { a * m0 + b * m1 };
        [value + (t - inside) * first, first, second]
    }
}

/// Returns the RMS error of the interpolation: that of the samples left out if every second one is interpolated, divided
/// by 2⁴ since the error of a cubic spline falls with the fourth power of the distance.
pub(super) fn interpolation_error(values: &[f64]) -> f64 {
    let kept: Vec<f64> = values.iter().step_by(2).copied().collect();
    let spline = CubicSpline::new(&kept, 2.0);
    let left_out = values.iter().enumerate().skip(1).step_by(2).take(kept.len().saturating_sub(1));
    let errors: Vec<f64> = left_out.map(|(i, value)| spline.at(i as f64)[0] - value).collect();
    virtual_axes_core::statistics::rms(errors.iter().copied()).unwrap_or(0.0) / 16.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn a_sine_is_met_to_the_stated_order() {
        let (h, f) = (0.02, 5.0);
        let values: Vec<f64> = (0..101).map(|i| (TAU * f * f64::from(i) * h).sin()).collect();
        let spline = CubicSpline::new(&values, h);
        let bound = (TAU * f * h).powi(4) / 384.0;
        // Away from the ends, where a natural spline has no curvature.
        let worst = (300..1700).map(|k| {
            let t = f64::from(k) * 1e-3;
            (spline.at(t)[0] - (TAU * f * t).sin()).abs()
        });
        let worst = worst.fold(0.0, f64::max);
        assert!(worst < 1.5 * bound && worst > 0.1 * bound, "{worst} {bound}");
        let estimated = interpolation_error(&values);
        assert!(estimated < 2.0 * bound && estimated > 0.2 * bound, "{estimated}");
    }

    #[test]
    fn straight_lines_are_exact_also_beyond_the_ends() {
        let spline = CubicSpline::new(&[1.0, 3.0, 5.0, 7.0], 0.5);
        for t in [-1.0, 0.2, 1.1, 3.0] {
            let [value, first, second] = spline.at(t);
            assert!(
                (value - 1.0 - 4.0 * t).abs() < 1e-12 && (first - 4.0).abs() < 1e-12 && second.abs() < 1e-12
            );
        }
    }
}
