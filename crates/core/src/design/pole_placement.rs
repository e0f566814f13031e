//! Position controllers by pole placement.

use nalgebra::{Complex, DMatrix, DVector};

use super::pid::{check_feedforward, with_feedforward};
use super::poles::is_stable_pole;
use super::polynomial::{product, roots, sum};
use super::{DesignError, PredictionModel};
use crate::control::Rst;

/// Largest distance between a desired pole and the conjugate of another that count as a pair.
const SAME_POLE: f64 = 1e-9;
/// Smallest ratio of the pivots of a regular Sylvester matrix: below it, the coefficients have fewer than three correct
/// digits.
const MIN_PIVOT_RATIO: f64 = 1e-13;
/// Largest residual of A S + B R, relative to Σ |cᵢ|.
const MAX_RESIDUAL: f64 = 1e-9;

/// Specification of a closed loop for pole placement.
#[derive(Debug, Clone, PartialEq)]
pub struct PolePlacement {
    /// Desired poles in z, complex ones with their conjugates; the remaining poles are at 0.
    pub poles: Vec<Complex<f64>>,
    /// True if S contains the factor 1 − q⁻¹, so that a constant torque causes no position error.
    pub integrator: bool,
    /// Weight of the velocity feedforward; 0 disables it.
    pub velocity_feedforward: f64,
}

/// Designs the controller of lowest degree with A S + B R = Π (1 − pᵢ q⁻¹) for the desired poles pᵢ.
///
/// T is R(1), so that setpoints are not filtered by the zeros of R, plus the feedforward.
///
/// # Errors
/// [`DesignError::OutOfRange`] for more poles than the closed loop has, [`DesignError::PoleOutside`] for an unstable
/// one, [`DesignError::NoConjugate`] for a complex one without its conjugate, [`DesignError::SharedRoot`] if A and B
/// have a common root.
pub fn pole_placement(model: &PredictionModel, wanted: &PolePlacement) -> Result<Rst, DesignError> {
    check_feedforward(wanted.velocity_feedforward)?;
    let factor: &[f64] = if wanted.integrator { &[1.0, -1.0] } else { &[1.0] };
    let mut a = product(trimmed(model.a()), factor);
    // A of degree 0 would leave R empty; a trailing 0 leaves one coefficient.
    a.resize(a.len().max(2), 0.0);
    let b = trimmed(model.b());
    let (order_a, order_b) = (a.len() - 1, b.len() - 1);
    let unknowns = order_a + order_b - 1;
    if wanted.poles.len() > unknowns {
        return Err(DesignError::OutOfRange {
            name: "poles",
            value: wanted.poles.len() as f64,
            allowed: format!("be at most {unknowns} in number, the order of this loop"),
        });
    }
    let mut target = polynomial_from_poles(&wanted.poles)?;
    target.resize(unknowns + 1, 0.0);
    // Unknowns: s₁ … of degree order_b − 1, then r₀ … of degree order_a − 1; rows: q⁻¹ … q^−unknowns.
    let shifted = |p: &[f64], row: usize, shift: usize| {
        row.checked_sub(shift).and_then(|i| p.get(i)).copied().unwrap_or(0.0)
    };
    let mut sylvester =
        DMatrix::from_fn(unknowns, unknowns, |row, column| match (column + 1).checked_sub(order_b) {
            None => shifted(&a, row + 1, column + 1),
            Some(lag) => shifted(b, row + 1, lag),
        });
    let right = DVector::from_fn(unknowns, |row, _| target[row + 1] - shifted(&a, row + 1, 0));
    // B is much smaller than A: columns of equal length, so that small pivots indicate common roots only.
    let lengths: Vec<f64> = sylvester.column_iter().map(|column| column.norm()).collect();
    for (mut column, length) in sylvester.column_iter_mut().zip(&lengths) {
        column /= *length;
    }
    let solution = solve(sylvester, &right).ok_or_else(|| shared_root(&a, b))?;
    let coefficient = |i: usize| solution[i] / lengths[i];
    let s: Vec<f64> = std::iter::once(1.0).chain((0..order_b - 1).map(coefficient)).collect();
    let r: Vec<f64> = (order_b - 1..unknowns).map(coefficient).collect();
    let found = sum(&product(&a, &s), &product(b, &r));
    let scale: f64 = found.iter().chain(&target).map(|c| c.abs()).sum();
    if !found.iter().zip(&target).all(|(f, t)| (f - t).abs() <= MAX_RESIDUAL * scale) {
        return Err(shared_root(&a, b));
    }
    let gain: f64 = r.iter().sum();
    with_feedforward(&r, &product(&s, factor), &[gain], wanted.velocity_feedforward, model.period())
}

/// Largest damping ratio of a pole pair. The slow pole of larger values exceeds 1 − 10⁻⁶ at any bandwidth.
const MAX_DAMPING: f64 = 1e9;

/// Computes the pole pair exp(s Tsp) in z for a bandwidth (natural frequency, rad/s) and a damping ratio, sampled every
/// `period` s. Both poles are real for a damping ratio of at least 1.
///
/// # Errors
/// [`DesignError::OutOfRange`] unless 0 < bandwidth ≤ π/period and 0 < damping ≤ 1e9.
pub fn pole_pair(bandwidth: f64, damping: f64, period: f64) -> Result<[Complex<f64>; 2], DesignError> {
    let nyquist = std::f64::consts::PI / period;
    if !(bandwidth > 0.0 && bandwidth <= nyquist) {
        let allowed = format!("be above 0 and at most {nyquist:.3}, half the sampling rate in rad/s");
        return Err(DesignError::OutOfRange { name: "bandwidth", value: bandwidth, allowed });
    }
    if !(damping > 0.0 && damping <= MAX_DAMPING) {
        let allowed = format!("be above 0 and at most {MAX_DAMPING:e}");
        return Err(DesignError::OutOfRange { name: "damping", value: damping, allowed });
    }
    let turn = Complex::new(damping * damping - 1.0, 0.0).sqrt();
    // The product of both is ω²: the slow one is computed without cancellation.
    let fast = -(turn + damping) * bandwidth;
    let slow = Complex::new(bandwidth * bandwidth, 0.0) / fast;
    let exact = |s: Complex<f64>| if damping < 1.0 { s } else { s.re.into() };
    Ok([exact(slow), exact(fast)].map(|s| (s * period).exp()))
}

/// Expands Π (1 − pᵢ q⁻¹).
fn polynomial_from_poles(poles: &[Complex<f64>]) -> Result<Vec<f64>, DesignError> {
    let mut polynomial = vec![1.0];
    let mut left = poles.to_vec();
    while let Some(pole) = left.pop() {
        if !is_stable_pole(pole) {
            return Err(DesignError::PoleOutside { re: pole.re, im: pole.im, modulus: pole.norm() });
        }
        if pole.im == 0.0 {
            polynomial = product(&polynomial, &[1.0, -pole.re]);
            continue;
        }
        match left.iter().position(|other| (other - pole.conj()).norm() <= SAME_POLE) {
            Some(conjugate) => left.swap_remove(conjugate),
            None => return Err(DesignError::NoConjugate { re: pole.re, im: pole.im }),
        };
        polynomial = product(&polynomial, &[1.0, -2.0 * pole.re, pole.norm_sqr()]);
    }
    Ok(polynomial)
}

/// Returns the polynomial without trailing zeros.
fn trimmed(polynomial: &[f64]) -> &[f64] {
    let end = polynomial.iter().rposition(|c| *c != 0.0).map_or(0, |last| last + 1);
    &polynomial[..end]
}

/// Solves a square system; `None` if its matrix is singular.
fn solve(matrix: DMatrix<f64>, right: &DVector<f64>) -> Option<DVector<f64>> {
    let decomposition = matrix.full_piv_lu();
    let pivots = decomposition.u().diagonal().abs();
    // False for NaN.
    let is_regular = pivots.min() > MIN_PIVOT_RATIO * pivots.max();
    if is_regular { decomposition.solve(right) } else { None }
}

/// Returns the error with the root of A that is nearest to a root of B.
fn shared_root(a: &[f64], b: &[f64]) -> DesignError {
    // B without its delay, so that its first coefficient is not 0.
    let leading = b.iter().position(|c| *c != 0.0).unwrap_or(0);
    let (Some(of_a), Some(of_b)) = (roots(a), roots(&b[leading..])) else {
        return DesignError::NoPoles;
    };
    let distance = |root: &Complex<f64>| of_b.iter().map(|z| (z - root).norm()).fold(f64::INFINITY, f64::min);
    match of_a.iter().min_by(|x, y| distance(x).total_cmp(&distance(y))) {
        Some(root) => DesignError::SharedRoot { re: root.re, im: root.im.abs() },
        None => DesignError::NoPoles,
    }
}
