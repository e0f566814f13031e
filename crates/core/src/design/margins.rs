//! Stability margins of control loops: modulus, phase, gain and delay margin.

use std::f64::consts::PI;

use nalgebra::Complex;

use super::poles::{STABILITY_MARGIN, characteristic_polynomial, check_stable};
use super::polynomial::{has_roots_within, roots, value, without_integrators};
use super::{DesignError, PredictionModel};
use crate::control::{INTEGRATOR_TOLERANCE, Rst};

/// Lowest frequency of the grid, rad per sample; slower poles count as unstable.
const FIRST_ANGLE: f64 = 1e-7;
/// Frequencies per decade in the logarithmic part of the grid.
const POINTS_PER_DECADE: f64 = 16.0;
/// Frequencies in the linear part of the grid, up to the Nyquist frequency.
const LINEAR_POINTS: usize = 192;
/// Step of the linear part, rad per sample.
const LINEAR_STEP: f64 = PI / LINEAR_POINTS as f64;
/// Distance of poles of L from the unit circle, in steps of the linear part, below which the grid is refined near them.
const REFINEMENT_DISTANCE: f64 = 4.0;
/// Ratio of the distances of successive refined frequencies from the pole.
const REFINEMENT_RATIO: f64 = 3.0;
/// Smallest distance of a refined frequency from the pole, rad per sample.
const MIN_REFINEMENT: f64 = 1e-8;
/// Distance of an extremum of ln|L| or of the phase from a crossover, nepers or rad, below which it is refined.
const EXTREMUM_TOLERANCE: f64 = 0.5;
/// Steps of the golden-section search: the bracket shrinks by 10⁸, the resolution of a minimum in f64.
const GOLDEN_STEPS: usize = 38;
/// Steps of the bisection: the bracket shrinks by 10¹⁵.
const BISECTION_STEPS: usize = 50;
/// |L| beyond which a point counts as a pole of L, not as a crossover.
const POLE_MAGNITUDE: f64 = 1e9;

/// Stability margins of a stable sampled loop L; that of the position loop is B R / (A S).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Margins {
    /// Modulus margin min |1 + L|, the distance of L from −1.
    pub modulus: f64,
    /// Phase margin: smallest rotation of L, in either direction, that reaches −1, rad; infinite if |L| is never 1.
    pub phase: f64,
    /// Gain margin upwards: smallest factor above 1 that makes the loop unstable; infinite if there is none.
    pub gain: f64,
    /// Gain margin downwards: largest factor below 1 that makes the loop unstable; 0 if there is none.
    pub gain_reduction: f64,
    /// Delay margin: smallest additional delay that makes the loop unstable, s; infinite if |L| is never 1. The
    /// minimum over all frequencies with |L| = 1, not necessarily that of the phase margin.
    pub delay: f64,
}

/// Stability margins of a loop with the frequencies at which they are found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LoopMargins {
    /// Stability margins.
    pub margins: Margins,
    /// Frequency of the phase margin, at which |L| = 1, Hz; `None` if |L| is never 1.
    pub gain_crossover: Option<f64>,
    /// Frequency of the gain margin upwards, at which L is real and negative, Hz; `None` without this margin.
    pub phase_crossover: Option<f64>,
}

/// Computes the stability margins of `model` controlled by `rst`.
///
/// # Errors
/// [`DesignError::Unstable`] with the pole of largest modulus, since an unstable loop has no margins;
/// [`DesignError::NoPoles`] if the poles cannot be computed.
pub fn margins(model: &PredictionModel, rst: &Rst) -> Result<Margins, DesignError> {
    Ok(position_loop_margins(model, rst)?.margins)
}

/// Computes the stability margins of `model` controlled by `rst`, with their frequencies.
///
/// # Errors
/// Those of [`margins`].
pub(super) fn position_loop_margins(model: &PredictionModel, rst: &Rst) -> Result<LoopMargins, DesignError> {
    if !has_roots_within(&characteristic_polynomial(model, rst), 1.0 - STABILITY_MARGIN) {
        check_stable(model, rst)?;
    }
    Ok(loop_margins(&OpenLoop { model, rst }))
}

/// Computes the margins of a stable loop.
pub(super) fn loop_margins(l: &impl LoopTransfer) -> LoopMargins {
    let sample = |angle| Sample { angle, l: l.at(angle) };
    let samples: Vec<Sample> = grid(&l.poles_near_circle()).into_iter().map(sample).collect();
    let mut found = Margins {
        modulus: f64::INFINITY,
        phase: f64::INFINITY,
        gain: f64::INFINITY,
        gain_reduction: 0.0,
        delay: f64::INFINITY,
    };
    let hertz = |angle: f64| angle / (2.0 * PI * l.period());
    let (mut gain_crossover, mut phase_crossover) = (None, None);
    found.modulus = minimum(&samples, |angle| (l.at(angle) + 1.0).norm(), |s| (s.l + 1.0).norm()).1;
    let magnitude = |angle| l.at(angle).norm().ln();
    for angle in crossings(&samples, magnitude, |s| s.l.norm().ln(), f64::INFINITY) {
        // Angle from −1 to L, against the rotation by a delay.
        let ahead = (-l.at(angle)).arg().rem_euclid(2.0 * PI);
        let rotation = ahead.min(2.0 * PI - ahead);
        if rotation < found.phase {
            (found.phase, gain_crossover) = (rotation, Some(hertz(angle)));
        }
        found.delay = found.delay.min(ahead / angle * l.period());
    }
    let mut add_crossing = |angle: f64, l: f64| {
        let factor = -1.0 / l;
        if factor > 1.0 && factor < found.gain {
            (found.gain, phase_crossover) = (factor, Some(hertz(angle)));
        } else if factor <= 1.0 && factor > 1.0 / POLE_MAGNITUDE {
            found.gain_reduction = found.gain_reduction.max(factor);
        }
    };
    for angle in crossings(&samples, |angle| (-l.at(angle)).arg(), |s| (-s.l).arg(), PI) {
        add_crossing(angle, l.at(angle).re);
    }
    // L is real at both ends, without a change of sign.
    add_crossing(PI, l.at(PI).re);
    if let Some(static_gain) = l.static_gain() {
        found.modulus = found.modulus.min((1.0 + static_gain).abs());
        add_crossing(0.0, static_gain);
    }
    LoopMargins { margins: found, gain_crossover, phase_crossover }
}

/// Returns frequency (rad per sample) and value of the largest magnitude of `f`, on the grid for the poles `near_circle`.
pub(super) fn largest_magnitude(near_circle: &[Complex<f64>], f: impl Fn(f64) -> Complex<f64>) -> (f64, f64) {
    let sample = |angle| Sample { angle, l: f(angle) };
    let samples: Vec<Sample> = grid(near_circle).into_iter().map(sample).collect();
    let (angle, negative) = minimum(&samples, |angle| -f(angle).norm(), |s| -s.l.norm());
    (angle, -negative)
}

/// Transfer function L of an open loop, sampled every period.
pub(super) trait LoopTransfer {
    /// Returns L at a frequency, rad per sample.
    fn at(&self, angle: f64) -> Complex<f64>;

    /// Returns L at frequency 0; `None` if L contains an integrator.
    fn static_gain(&self) -> Option<f64>;

    /// Returns the sampling period, s.
    fn period(&self) -> f64;

    /// Returns poles of L, at least those close to the unit circle other than at 1.
    fn poles_near_circle(&self) -> Vec<Complex<f64>>;
}

/// Open loop L of a position controller in RST form.
pub(super) struct OpenLoop<'a> {
    pub model: &'a PredictionModel,
    pub rst: &'a Rst,
}

/// L at one frequency.
struct Sample {
    angle: f64,
    l: Complex<f64>,
}

impl LoopTransfer for OpenLoop<'_> {
    fn at(&self, angle: f64) -> Complex<f64> {
        let delay = delay(angle);
        let l = value(self.model.b(), delay) * value(self.rst.r(), delay)
            / (value(self.model.a(), delay) * value(self.rst.s(), delay));
        if l.is_finite() { l } else { f64::MAX.sqrt().into() }
    }

    fn static_gain(&self) -> Option<f64> {
        let sum = |p: &[f64]| p.iter().sum::<f64>();
        let size = |p: &[f64]| p.iter().map(|c| c.abs()).sum::<f64>();
        let (a, s) = (self.model.a(), self.rst.s());
        let denominator = sum(a) * sum(s);
        let is_finite = denominator.abs() > INTEGRATOR_TOLERANCE * size(a) * size(s);
        is_finite.then(|| sum(self.model.b()) * sum(self.rst.r()) / denominator)
    }
    fn period(&self) -> f64 {
        self.model.period()
    }

    fn poles_near_circle(&self) -> Vec<Complex<f64>> {
        let mut poles = Vec::new();
        for polynomial in [self.model.a(), self.rst.s()] {
            // The logarithmic part of the grid covers poles at angle 0.
            let others = without_integrators(polynomial);
            if !has_roots_within(&others, 1.0 - REFINEMENT_DISTANCE * LINEAR_STEP) {
                poles.extend(roots(&others).into_iter().flatten());
            }
        }
        poles
    }
}

/// Returns q⁻¹ at a frequency, rad per sample.
pub(super) fn delay(angle: f64) -> Complex<f64> {
    // At π rounding of the sine would leave an imaginary part.
    if angle == PI { (-1.0).into() } else { Complex::from_polar(1.0, -angle) }
}

/// Creates the frequency grid up to π, rad per sample, refined near poles of L close to the unit circle.
fn grid(poles: &[Complex<f64>]) -> Vec<f64> {
    let mut grid: Vec<f64> = (1..=LINEAR_POINTS).map(|i| PI * i as f64 / LINEAR_POINTS as f64).collect();
    let mut angle = FIRST_ANGLE;
    while angle < LINEAR_STEP {
        grid.push(angle);
        angle *= 10_f64.powf(1.0 / POINTS_PER_DECADE);
    }
    for pole in poles {
        let depth = (1.0 - pole.norm()).abs();
        if depth > REFINEMENT_DISTANCE * LINEAR_STEP || pole.im < 0.0 || (pole.im == 0.0 && pole.re > 0.0) {
            continue;
        }
        let center = pole.arg();
        let mut offset = depth.max(MIN_REFINEMENT);
        grid.push(center);
        while offset < LINEAR_STEP {
            grid.extend([center - offset, center + offset]);
            offset *= REFINEMENT_RATIO;
        }
    }
    grid.retain(|angle| (FIRST_ANGLE..=PI).contains(angle));
    grid.sort_by(f64::total_cmp);
    grid.dedup();
    grid
}

/// Returns argument and value of the minimum of `f`, whose values at the samples are `sampled`.
fn minimum(samples: &[Sample], f: impl Fn(f64) -> f64, sampled: impl Fn(&Sample) -> f64) -> (f64, f64) {
    let smaller = |a: (f64, f64), b: (f64, f64)| if b.1 < a.1 { b } else { a };
    let mut minimum = samples.iter().map(|s| (s.angle, sampled(s))).fold((0.0, f64::INFINITY), smaller);
    for triple in samples.windows(3) {
        if sampled(&triple[1]) <= sampled(&triple[0]).min(sampled(&triple[2])) {
            let angle = golden_section(&f, triple[0].angle, triple[2].angle);
            minimum = smaller(minimum, (angle, f(angle)));
        }
    }
    minimum
}

/// Returns the frequencies at which `f` changes its sign, except for jumps by more than `jump` between samples: a phase
/// jumps by 2π where L crosses the positive real axis.
fn crossings(
    samples: &[Sample],
    f: impl Fn(f64) -> f64,
    sampled: impl Fn(&Sample) -> f64,
    jump: f64,
) -> Vec<f64> {
    let values: Vec<f64> = samples.iter().map(sampled).collect();
    let mut found = Vec::new();
    let mut between = |a: (f64, f64), b: (f64, f64)| {
        if (a.1 > 0.0) != (b.1 > 0.0) && (a.1 - b.1).abs() <= jump {
            found.push(bisection(&f, a, b));
        }
    };
    for i in 1..samples.len() {
        between((samples[i - 1].angle, values[i - 1]), (samples[i].angle, values[i]));
    }
    for i in 1..samples.len().saturating_sub(1) {
        // Two crossings lie between samples where an extremum of f is close to 0.
        let [before, here, after] = [values[i - 1], values[i], values[i + 1]];
        let side = if here > 0.0 { 1.0 } else { -1.0 };
        let is_extremum = side * here <= (side * before).min(side * after);
        let is_same_sign = (before > 0.0) == (here > 0.0) && (after > 0.0) == (here > 0.0);
        if !(is_extremum && is_same_sign && here.abs() < EXTREMUM_TOLERANCE) {
            continue;
        }
        let (first, last) = (samples[i - 1].angle, samples[i + 1].angle);
        let angle = golden_section(|x| side * f(x), first, last);
        let turn = f(angle);
        between((first, before), (angle, turn));
        between((angle, turn), (last, after));
    }
    found
}

/// Returns the argument of the minimum between `low` and `high`.
fn golden_section(f: impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
    let ratio = (5.0_f64.sqrt() - 1.0) / 2.0;
    let (mut left, mut right) = (high - ratio * (high - low), low + ratio * (high - low));
    let (mut f_left, mut f_right) = (f(left), f(right));
    for _ in 0..GOLDEN_STEPS {
        if f_left < f_right {
            (high, right, f_right) = (right, left, f_left);
            left = high - ratio * (high - low);
            f_left = f(left);
        } else {
            (low, left, f_left) = (left, right, f_right);
            right = low + ratio * (high - low);
            f_right = f(right);
        }
    }
    if f_left < f_right { left } else { right }
}

/// Returns the argument of the change of sign between two points of a function.
fn bisection(f: impl Fn(f64) -> f64, (mut low, at_low): (f64, f64), (mut high, _): (f64, f64)) -> f64 {
    for _ in 0..BISECTION_STEPS {
        let middle = (low + high) / 2.0;
        if (f(middle) > 0.0) == (at_low > 0.0) {
            low = middle;
        } else {
            high = middle;
        }
    }
    (low + high) / 2.0
}
