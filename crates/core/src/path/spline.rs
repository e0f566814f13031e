//! Clamped uniform cubic B-spline, parametrized by arc length.

use super::derivatives::Derivatives;
use super::error::PathError;
use super::quadrature::integrate;
use crate::config::AxisKind;

/// Degree of the polynomials.
const DEGREE: usize = 3;
/// Number of coefficients of a polynomial.
const COEFFICIENTS: usize = DEGREE + 1;
/// Largest relative difference between the length of an interval and that of its halves.
const LENGTH_TOLERANCE: f64 = 1e-13;
/// Bisections of a piece after which it is considered to have a cusp; a few suffice otherwise.
const MAX_HALVINGS: u32 = 40;
/// Ratio of smallest to largest speed below which the spline is considered to have a cusp.
const MIN_SPEED: f64 = 1e-9;
/// Newton iterations for the parameter at an arc length; two or three suffice.
const MAX_NEWTON: usize = 12;

/// Interval of a piece that is short enough for one quadrature.
#[derive(Debug, Clone, Copy, PartialEq)]
struct ArcLengthInterval {
    piece: usize,
    /// Parameter at the start of the interval, 0 to 1 in the piece.
    from: f64,
    to: f64,
    /// Arc length at the start of the interval.
    s_from: f64,
    s_to: f64,
    /// du/ds at the start of the interval.
    slope_from: f64,
    slope_to: f64,
}

/// Polynomial pieces and their arc-length table.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Spline {
    joints: usize,
    /// Coefficients c0 to c3 of each coordinate of each piece, for its parameter from 0 to 1.
    coefficients: Vec<[f64; COEFFICIENTS]>,
    /// Coordinates included in the arc length.
    measured: Vec<usize>,
    intervals: Vec<ArcLengthInterval>,
}

impl Spline {
    /// Creates a spline; also returns the kind of its arc length.
    pub fn new(from: &[f64], points: &[Vec<f64>], kinds: &[AxisKind]) -> Result<(Self, AxisKind), PathError> {
        if points.len() < DEGREE {
            return Err(PathError::TooFewPoints { found: points.len(), needed: DEGREE });
        }
        let moves = |index: &usize| points.iter().any(|point| point[*index] != from[*index]);
        let moving = |kind| -> Vec<usize> {
            (0..kinds.len()).filter(|index| kinds[*index] == kind).filter(moves).collect()
        };
        let (mut measured, mut kind) = (moving(AxisKind::Linear), AxisKind::Linear);
        if measured.is_empty() {
            (measured, kind) = (moving(AxisKind::Rotary), AxisKind::Rotary);
        }
        if measured.is_empty() {
            return Err(PathError::ZeroLength);
        }
        let joints = kinds.len();
        let mut spline = Self { joints, coefficients: pieces(from, points), measured, intervals: Vec::new() };
        spline.measure()?;
        Ok((spline, kind))
    }

    fn pieces(&self) -> usize {
        self.coefficients.len() / self.joints
    }

    fn piece(&self, piece: usize) -> &[[f64; COEFFICIENTS]] {
        &self.coefficients[piece * self.joints..(piece + 1) * self.joints]
    }

    /// Returns ds/du.
    fn speed(&self, piece: usize, u: f64) -> f64 {
        self.speeds(piece, [u])[0]
    }

    /// Returns ds/du at several parameters, which the compiler computes in vectors.
    #[inline]
    fn speeds<const N: usize>(&self, piece: usize, parameters: [f64; N]) -> [f64; N] {
        let coefficients = self.piece(piece);
        let mut squares = [0.0; N];
        for &index in &self.measured {
            let c = &coefficients[index];
            for (square, u) in squares.iter_mut().zip(parameters) {
                let d = c[1] + u * (2.0 * c[2] + u * 3.0 * c[3]);
                *square += d * d;
            }
        }
        squares.map(f64::sqrt)
    }

    fn arc_length(&self, piece: usize, from: f64, to: f64) -> f64 {
        integrate(from, to, |parameters| self.speeds(piece, parameters))
    }

    /// Computes the arc-length table.
    fn measure(&mut self) -> Result<(), PathError> {
        let pieces = self.pieces();
        let mut s = 0.0;
        for piece in 0..pieces {
            let cusp = PathError::Cusp { piece: piece + 1, pieces };
            // Depth-first, left half on top, so that intervals are produced in order.
            let mut stack = vec![(0.0, 1.0, self.arc_length(piece, 0.0, 1.0), 0)];
            while let Some((from, to, whole, depth)) = stack.pop() {
                let middle = 0.5 * (from + to);
                let halves = [self.arc_length(piece, from, middle), self.arc_length(piece, middle, to)];
                let length = halves[0] + halves[1];
                if !length.is_finite() {
                    return Err(PathError::NotComputable { length });
                }
                if (length - whole).abs() > LENGTH_TOLERANCE * length {
                    if depth == MAX_HALVINGS {
                        return Err(cusp);
                    }
                    stack.push((middle, to, halves[1], depth + 1));
                    stack.push((from, middle, halves[0], depth + 1));
                    continue;
                }
                let (slope_from, slope_to) = (1.0 / self.speed(piece, from), 1.0 / self.speed(piece, to));
                let (s_from, s_to) = (s, s + length);
                self.intervals.push(ArcLengthInterval {
                    piece,
                    from,
                    to,
                    s_from,
                    s_to,
                    slope_from,
                    slope_to,
                });
                s = s_to;
            }
        }
        let fastest = self.intervals.iter().map(|interval| interval.slope_from.min(interval.slope_to));
        let bound = fastest.fold(f64::INFINITY, f64::min) / MIN_SPEED;
        // The comparison treats NaN as a cusp.
        let has_cusp = |interval: &&ArcLengthInterval| {
            let slow = interval.slope_from.max(interval.slope_to);
            !slow.is_finite() || slow > bound
        };
        match self.intervals.iter().find(has_cusp) {
            Some(interval) => Err(PathError::Cusp { piece: interval.piece + 1, pieces }),
            None if s > 0.0 => Ok(()),
            None => Err(PathError::ZeroLength),
        }
    }

    pub fn length(&self) -> f64 {
        self.intervals.last().map_or(0.0, |interval| interval.s_to)
    }

    pub fn is_constant(&self, index: usize) -> bool {
        (0..self.pieces()).all(|piece| {
            let c = &self.piece(piece)[index];
            c[1] == 0.0 && c[2] == 0.0 && c[3] == 0.0
        })
    }

    /// Returns the arc lengths at the piece boundaries, including both ends of the spline.
    pub fn knots(&self) -> Vec<f64> {
        let starts = self.intervals.iter().filter(|interval| interval.from == 0.0);
        starts.map(|interval| interval.s_from).chain([self.length()]).collect()
    }

    /// Returns the piece and the parameter at arc length `s`.
    fn locate(&self, s: f64) -> (usize, f64) {
        let index = self.intervals.partition_point(|interval| interval.s_to <= s);
        let interval = &self.intervals[index.min(self.intervals.len() - 1)];
        let (length, target) = (interval.s_to - interval.s_from, s - interval.s_from);
        let width = interval.to - interval.from;
        // Initial value: cubic Hermite interpolation of u(s).
        let x = (target / length).clamp(0.0, 1.0);
        let (m0, m1) = (interval.slope_from * length, interval.slope_to * length);
        let cubic = x * (m0 + x * (3.0 * width - 2.0 * m0 - m1 + x * (m0 + m1 - 2.0 * width)));
        let mut u = (interval.from + cubic).clamp(interval.from, interval.to);
        for _ in 0..MAX_NEWTON {
            let missing = target - self.arc_length(interval.piece, interval.from, u);
            let step = missing / self.speed(interval.piece, u);
            let next = (u + step).clamp(interval.from, interval.to);
            let small = (next - u).abs() <= NEWTON_TOLERANCE * width;
            u = next;
            if small {
                break;
            }
        }
        (interval.piece, u)
    }

    pub fn point(&self, s: f64, out: &mut [f64]) {
        let (piece, u) = self.locate(s);
        for (value, c) in out.iter_mut().zip(self.piece(piece)) {
            *value = c[0] + u * (c[1] + u * (c[2] + u * c[3]));
        }
    }

    /// Computes the derivatives with respect to s by the chain rule through u(s), with σ = ds/du:
    ///
    /// ```text
    /// u' = 1/σ      u'' = −σ_u/σ³      u''' = (3 σ_u² − σ σ_uu)/σ⁵
    /// ```
    pub fn derivatives(&self, s: f64, out: &mut Derivatives) {
        let (piece, u) = self.locate(s);
        let coefficients = self.piece(piece);
        let by_u = |c: &[f64; COEFFICIENTS]| {
            let first = c[1] + u * (2.0 * c[2] + u * 3.0 * c[3]);
            (first, 2.0 * c[2] + u * 6.0 * c[3], 6.0 * c[3])
        };
        let (mut squares, mut mixed, mut curved) = (0.0, 0.0, 0.0);
        for &index in &self.measured {
            let (first, second, third) = by_u(&coefficients[index]);
            squares += first * first;
            mixed += first * second;
            curved += second * second + first * third;
        }
        let sigma = squares.sqrt();
        let sigma_u = mixed / sigma;
        let sigma_uu = (curved - sigma_u * sigma_u) / sigma;
        let u1 = 1.0 / sigma;
        let u2 = -sigma_u * u1 * u1 * u1;
        let u3 = (3.0 * sigma_u * sigma_u - sigma * sigma_uu) * u1.powi(5);
        for (i, c) in coefficients.iter().enumerate() {
            let (first, second, third) = by_u(c);
            out.first[i] = first * u1;
            out.second[i] = second * u1 * u1 + first * u2;
            out.third[i] = third * u1 * u1 * u1 + 3.0 * second * u1 * u2 + first * u3;
        }
    }
}

/// Relative tolerance of Newton's method.
const NEWTON_TOLERANCE: f64 = 1e-9;

/// Returns the polynomials of each piece: control points → Bézier points by blossoming → power basis.
fn pieces(from: &[f64], points: &[Vec<f64>]) -> Vec<[f64; COEFFICIENTS]> {
    let count = points.len() + 1 - DEGREE;
    let control = |i: usize, index: usize| if i == 0 { from[index] } else { points[i - 1][index] };
    // Uniform knots 0, 1, …, count, the outer ones repeated.
    let knot = |i: usize| i.saturating_sub(DEGREE).min(count) as f64;
    let mut coefficients = Vec::with_capacity(count * from.len());
    let still: Vec<bool> =
        (0..from.len()).map(|index| points.iter().all(|point| point[index] == from[index])).collect();
    for piece in 0..count {
        for index in 0..from.len() {
            if still[index] {
                coefficients.push([from[index], 0.0, 0.0, 0.0]);
                continue;
            }
            let blossom = |arguments: [f64; DEGREE]| {
                let mut d: [f64; COEFFICIENTS] = std::array::from_fn(|i| control(piece + i, index));
                for (level, t) in arguments.iter().enumerate() {
                    for i in (level + 1..COEFFICIENTS).rev() {
                        let (left, right) = (knot(piece + i), knot(piece + i + DEGREE - level));
                        let weight = (t - left) / (right - left);
                        d[i] = (1.0 - weight) * d[i - 1] + weight * d[i];
                    }
                }
                d[DEGREE]
            };
            let (left, right) = (piece as f64, (piece + 1) as f64);
            let b = [
                blossom([left, left, left]),
                blossom([left, left, right]),
                blossom([left, right, right]),
                blossom([right, right, right]),
            ];
            coefficients.push([
                b[0],
                3.0 * (b[1] - b[0]),
                3.0 * (b[2] - 2.0 * b[1] + b[0]),
                b[3] - b[0] + 3.0 * (b[1] - b[2]),
            ]);
        }
    }
    coefficients
}
