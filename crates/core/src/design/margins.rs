//! Stability margins of the position loop.

use std::f64::consts::PI;

use nalgebra::Complex;

use super::poles::{STABILITY_MARGIN, characteristic, check_stable};
use super::polynomial::{roots, roots_within, value, without_integrators};
use super::{DesignError, PredictionModel};
use crate::control::{INTEGRATOR_TOLERANCE, Rst};

/// First frequency looked at, rad per period: poles slower than it count as unstable.
const FIRST_ANGLE: f64 = 1e-7;
/// Frequencies per decade below those at equal distances.
const PER_DECADE: f64 = 16.0;
/// Frequencies at equal distances up to Nyquist.
const LINEAR: usize = 192;
/// Poles of L nearer to the unit circle than so many of those distances have frequencies of their own.
const NEAR: f64 = 4.0;
/// Ratio of the distances of these frequencies from the pole.
const SPREAD: f64 = 3.0;
/// Nearest of them to the pole, rad per period.
const CLOSEST: f64 = 1e-8;
/// An extremum of ln|L| or of the phase this near to a crossover, in nepers or rad, is looked at closely.
const SUSPECT: f64 = 0.5;
/// Steps of a golden section: the bracket shrinks by 10⁸, as far as a minimum can be told.
const GOLDEN_STEPS: usize = 38;
/// Steps of a bisection: the bracket shrinks by 10¹⁵.
const BISECTIONS: usize = 50;
/// |L| beyond which a point is a pole of L and no crossover.
const INFINITE: f64 = 1e9;

/// How far a stable loop is from instability: margins of L = B R / (A S), sampled every Tsp.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Margins {
    /// Modulus margin min |1 + L|, the distance of L from −1.
    pub modulus: f64,
    /// Phase margin: the least angle by which L, turned in either direction, meets −1, rad; infinite
    /// where |L| is never 1.
    pub phase: f64,
    /// Gain margin upwards: the least factor above 1 that makes the loop unstable; infinite without one.
    pub gain: f64,
    /// Gain margin downwards: the largest factor below 1 that makes the loop unstable; 0 without one.
    pub gain_reduction: f64,
    /// Delay margin: the least further delay in the loop that makes it unstable, s; infinite where |L| is
    /// never 1. Over all frequencies with |L| = 1, since the least phase need not give it.
    pub delay: f64,
}

/// The margins of `model` controlled by `rst`.
///
/// # Errors
/// [`DesignError::Unstable`] with the pole: a loop that is not stable has no margins;
/// [`DesignError::NoPoles`].
pub fn margins(model: &PredictionModel, rst: &Rst) -> Result<Margins, DesignError> {
    if !roots_within(&characteristic(model, rst), 1.0 - STABILITY_MARGIN) {
        check_stable(model, rst)?;
    }
    let l = OpenLoop { model, rst };
    let samples: Vec<Sample> = grid(model, rst).into_iter().map(|angle| l.sample(angle)).collect();
    let mut found = Margins {
        modulus: f64::INFINITY,
        phase: f64::INFINITY,
        gain: f64::INFINITY,
        gain_reduction: 0.0,
        delay: f64::INFINITY,
    };
    found.modulus = least(&samples, |angle| (l.at(angle) + 1.0).norm(), |s| (s.l + 1.0).norm());
    let magnitude = |angle| l.at(angle).norm().ln();
    for angle in crossings(&samples, magnitude, |s| s.l.norm().ln(), f64::INFINITY) {
        // From −1 on, against the direction in which a delay turns L.
        let ahead = (-l.at(angle)).arg().rem_euclid(2.0 * PI);
        found.phase = found.phase.min(ahead).min(2.0 * PI - ahead);
        found.delay = found.delay.min(ahead / angle * model.period());
    }
    let mut take = |l: f64| {
        let factor = -1.0 / l;
        if factor > 1.0 {
            found.gain = found.gain.min(factor);
        } else if factor > 1.0 / INFINITE {
            found.gain_reduction = found.gain_reduction.max(factor);
        }
    };
    for angle in crossings(&samples, |angle| (-l.at(angle)).arg(), |s| (-s.l).arg(), PI) {
        take(l.at(angle).re);
    }
    // L is real at both ends, which no change of sign shows.
    take(l.at(PI).re);
    if let Some(standing) = l.standing() {
        found.modulus = found.modulus.min((1.0 + standing).abs());
        take(standing);
    }
    Ok(found)
}

/// L as a function of the frequency, rad per period.
struct OpenLoop<'a> {
    model: &'a PredictionModel,
    rst: &'a Rst,
}

/// L at one frequency.
struct Sample {
    angle: f64,
    l: Complex<f64>,
}

impl OpenLoop<'_> {
    fn at(&self, angle: f64) -> Complex<f64> {
        // At π the sine would leave an imaginary part.
        let delay = if angle == PI { (-1.0).into() } else { Complex::from_polar(1.0, -angle) };
        let l = value(self.model.b(), delay) * value(self.rst.r(), delay)
            / (value(self.model.a(), delay) * value(self.rst.s(), delay));
        if l.is_finite() { l } else { f64::MAX.sqrt().into() }
    }

    fn sample(&self, angle: f64) -> Sample {
        Sample { angle, l: self.at(angle) }
    }

    /// L at frequency 0; none if it has an integrator.
    fn standing(&self) -> Option<f64> {
        let sum = |p: &[f64]| p.iter().sum::<f64>();
        let size = |p: &[f64]| p.iter().map(|c| c.abs()).sum::<f64>();
        let (a, s) = (self.model.a(), self.rst.s());
        let below = sum(a) * sum(s);
        let regular = below.abs() > INTEGRATOR_TOLERANCE * size(a) * size(s);
        regular.then(|| sum(self.model.b()) * sum(self.rst.r()) / below)
    }
}

/// Frequencies to look at, rad per period, rising to π: close to each other where L can change quickly.
fn grid(model: &PredictionModel, rst: &Rst) -> Vec<f64> {
    let distance = PI / LINEAR as f64;
    let mut grid: Vec<f64> = (1..=LINEAR).map(|i| PI * i as f64 / LINEAR as f64).collect();
    let mut angle = FIRST_ANGLE;
    while angle < distance {
        grid.push(angle);
        angle *= 10_f64.powf(1.0 / PER_DECADE);
    }
    for polynomial in [model.a(), rst.s()] {
        // Poles at angle 0 are served by the logarithmic part.
        let others = without_integrators(polynomial);
        if roots_within(&others, 1.0 - NEAR * distance) {
            continue;
        }
        for pole in roots(&others).into_iter().flatten() {
            let depth = (1.0 - pole.norm()).abs();
            if depth > NEAR * distance || pole.im < 0.0 || (pole.im == 0.0 && pole.re > 0.0) {
                continue;
            }
            let center = pole.arg();
            let mut offset = depth.max(CLOSEST);
            grid.push(center);
            while offset < distance {
                grid.extend([center - offset, center + offset]);
                offset *= SPREAD;
            }
        }
    }
    grid.retain(|angle| (FIRST_ANGLE..=PI).contains(angle));
    grid.sort_by(f64::total_cmp);
    grid.dedup();
    grid
}

/// The least value of a function that is `seen` in the samples.
fn least(samples: &[Sample], f: impl Fn(f64) -> f64, seen: impl Fn(&Sample) -> f64) -> f64 {
    let mut least = samples.iter().map(&seen).fold(f64::INFINITY, f64::min);
    for triple in samples.windows(3) {
        if seen(&triple[1]) <= seen(&triple[0]).min(seen(&triple[2])) {
            let angle = golden_section(&f, triple[0].angle, triple[2].angle);
            least = least.min(f(angle));
        }
    }
    least
}

/// The frequencies at which a function changes its sign by less than `jump` from sample to sample: a phase
/// jumps by 2π where L crosses the positive real axis.
fn crossings(
    samples: &[Sample],
    f: impl Fn(f64) -> f64,
    seen: impl Fn(&Sample) -> f64,
    jump: f64,
) -> Vec<f64> {
    let values: Vec<f64> = samples.iter().map(seen).collect();
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
        // Two crossings hide between samples where the function turns round just before 0.
        let [before, here, after] = [values[i - 1], values[i], values[i + 1]];
        let side = if here > 0.0 { 1.0 } else { -1.0 };
        let turns = side * here <= (side * before).min(side * after);
        let same = (before > 0.0) == (here > 0.0) && (after > 0.0) == (here > 0.0);
        if !(turns && same && here.abs() < SUSPECT) {
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

/// The place of the minimum between `low` and `high`.
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

/// The place of the change of sign between two points of a function.
fn bisection(f: impl Fn(f64) -> f64, (mut low, at_low): (f64, f64), (mut high, _): (f64, f64)) -> f64 {
    for _ in 0..BISECTIONS {
        let middle = (low + high) / 2.0;
        if (f(middle) > 0.0) == (at_low > 0.0) {
            low = middle;
        } else {
            high = middle;
        }
    }
    (low + high) / 2.0
}
