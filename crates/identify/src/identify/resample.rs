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

/// Degree of [`BandLimitedSpline`].
const DEGREE: usize = 7;
/// Roots within the unit circle of the B-spline of that degree, sampled at the integers: Σ β(k) zᵏ = 0.
const ROOTS: [f64; 3] = [-0.535_280_430_796_438_2, -0.122_554_615_192_326_7, -0.009_148_694_809_608_277];
/// Samples by which the signal is continued at both ends, point-symmetrically; the effect of the largest root decays to
/// 10⁻⁸.
const MARGIN: usize = 30;

/// Spline of degree 7 through samples at equal distances.
///
/// A band-limited signal of frequency f, sampled at F, is met to about (f / (F − f))⁸ of its amplitude: at a fifth of F
/// to 10⁻⁵, where a cubic spline has 4·10⁻³.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct BandLimitedSpline {
    period: f64,
    count: usize,
    /// Coefficients of the B-splines, from `MARGIN` samples before the first one on.
    coefficients: Vec<f64>,
}

impl BandLimitedSpline {
    /// Creates the spline; `period` is the distance of the samples, s. Without samples its value is NaN.
    pub fn new(values: &[f64], period: f64) -> Self {
        let (count, margin) = (values.len(), MARGIN as isize);
        let last = count.saturating_sub(1) as isize;
        let at = |i: isize| values.get(i.clamp(0, last) as usize).copied().unwrap_or(f64::NAN);
        // Signals shorter than the margin continue along their chord.
        let chord = (at(last) - at(0)) / last.max(1) as f64;
        let at = |i: isize| chord.mul_add((i - i.clamp(0, last)) as f64, at(i));
        let continued = |i: isize| match i {
            i if i < 0 => 2.0 * at(0) - at(-i),
            i if i > last => 2.0 * at(last) - at(2 * last - i),
            _ => at(i),
        };
        let mut coefficients: Vec<f64> = (-margin..=last + margin).map(continued).collect();
        for root in ROOTS {
            let gain = (1.0 - root) * (1.0 - 1.0 / root);
            let mut before = coefficients[0] / (1.0 - root);
            for c in &mut coefficients {
                before = gain.mul_add(*c, root * before);
                *c = before;
            }
            let mut after = -root / (1.0 - root) * before;
            for c in coefficients.iter_mut().rev() {
                after = root * (after - *c);
                *c = after;
            }
        }
        BandLimitedSpline { period, count, coefficients }
    }

    /// Returns value and first derivative at time `t` after the first sample, s; beyond the ends the spline is continued by
    /// straight lines.
    pub fn at(&self, t: f64) -> [f64; 2] {
        let end = self.count.saturating_sub(1) as f64;
        let inside = (t / self.period).clamp(0.0, end);
        let i = (inside as usize).min(self.count.saturating_sub(2));
        let (u, from) = (inside - i as f64, MARGIN + i - DEGREE / 2);
        let near = &self.coefficients[from..=from + DEGREE];
        let value: f64 = near.iter().zip(basis(DEGREE, u)).map(|(c, b)| c * b).sum();
        let steps = near.windows(2).map(|pair| pair[1] - pair[0]);
        let slope: f64 = steps.zip(basis(DEGREE - 1, u)).map(|(c, b)| c * b).sum::<f64>() / self.period;
        [(t - inside * self.period).mul_add(slope, value), slope]
    }
}

/// Returns the values of the `degree` + 1 uniform B-splines between two knots, at `u` from 0 to 1 (Cox and de Boor).
fn basis(degree: usize, u: f64) -> [f64; DEGREE + 1] {
    let mut values = [0.0; DEGREE + 1];
    values[0] = 1.0;
    for p in 1..=degree {
        let mut saved = 0.0;
        for (r, value) in values.iter_mut().enumerate().take(p) {
            let part = *value / p as f64;
            *value = saved + ((r + 1) as f64 - u) * part;
            saved = (u + (p - r - 1) as f64) * part;
        }
        values[p] = saved;
    }
    values
}

/// Returns an upper estimate of the RMS error of the interpolation: that of a cubic spline. It is the error of the samples
/// left out if every second one is interpolated, divided by 2⁴ since it falls with the fourth power of the distance.
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
    fn a_band_limited_spline_is_met_to_the_stated_order() {
        let h = 0.02;
        for f in [5.0, 10.0, 15.0] {
            let values: Vec<f64> = (0..201).map(|i| (TAU * f * f64::from(i) * h).sin()).collect();
            let spline = BandLimitedSpline::new(&values, h);
            let order = (f / (1.0 / h - f)).powi(8);
            let times = (1000..3000).map(|k| f64::from(k) * 1e-3);
            let worst = times.map(|t| (spline.at(t)[0] - (TAU * f * t).sin()).abs()).fold(0.0, f64::max);
            assert!(worst < 3.0 * order + 1e-8 && worst > 0.3 * order, "{f} Hz: {worst} {order}");
            let slope = spline.at(2.0)[1] / (TAU * f * (TAU * f * 2.0).cos());
            assert!((slope - 1.0).abs() < 40.0 * order + 1e-6, "{f} Hz: {slope}");
        }
    }

    #[test]
    fn a_band_limited_spline_meets_samples_and_continues_straight_lines() {
        let values: Vec<f64> = (0..40).map(|i| f64::from(i * i % 7)).collect();
        let spline = BandLimitedSpline::new(&values, 0.5);
        for (i, value) in values.iter().enumerate() {
            assert!((spline.at(0.5 * i as f64)[0] - value).abs() < 1e-6, "{i}");
        }
        for count in 1..5 {
            let line: Vec<f64> = (0..count).map(|i| 1.0 + 2.0 * f64::from(i)).collect();
            let spline = BandLimitedSpline::new(&line, 0.5);
            for t in [-1.0, 0.2, 1.1, 3.0] {
                let wanted = if count == 1 { 1.0 } else { 1.0 + 4.0 * t };
                assert!((spline.at(t)[0] - wanted).abs() < 1e-6, "{count} samples, {t} s");
            }
        }
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
