//! Clamped uniform cubic B-spline by its arc length.

use super::block::Derivatives;
use super::error::PathError;
use super::quadrature::integrate;
use crate::config::AxisKind;

/// Degree of the polynomials.
const DEGREE: usize = 3;
/// Coefficients of one.
const COEFFICIENTS: usize = DEGREE + 1;
/// Largest relative difference between the length of a stretch and that of its halves.
const LENGTH_TOLERANCE: f64 = 1e-13;
/// Halvings of a piece after which it must have a cusp: where there is none, a few suffice.
const MAX_HALVINGS: u32 = 40;
/// Smallest speed over the largest one; a spline slower than that stands still.
const MIN_SPEED: f64 = 1e-9;
/// Newton's steps for the parameter of a length; two or three suffice.
const MAX_NEWTON: usize = 12;

/// A stretch of a piece short enough for one quadrature.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Stretch {
    piece: usize,
    /// Parameter at both ends, 0 to 1 in the piece.
    from: f64,
    to: f64,
    /// Length at both ends.
    s_from: f64,
    s_to: f64,
    /// du/ds at both ends.
    slope_from: f64,
    slope_to: f64,
}

/// Polynomial pieces, and the table of lengths along them.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Spline {
    joints: usize,
    /// Coefficients c0 to c3 of each coordinate of each piece, by its parameter from 0 to 1.
    coefficients: Vec<[f64; COEFFICIENTS]>,
    /// Coordinates that the length counts.
    measured: Vec<usize>,
    stretches: Vec<Stretch>,
}

impl Spline {
    /// The spline and what its length counts.
    pub fn new(from: &[f64], points: &[Vec<f64>], kinds: &[AxisKind]) -> Result<(Self, AxisKind), PathError> {
        if points.len() < DEGREE {
            return Err(PathError::TooFewPoints { found: points.len(), needed: DEGREE });
        }
        let moves = |place: &usize| points.iter().any(|point| point[*place] != from[*place]);
        let moving = |kind| -> Vec<usize> {
            (0..kinds.len()).filter(|place| kinds[*place] == kind).filter(moves).collect()
        };
        let (mut measured, mut kind) = (moving(AxisKind::Linear), AxisKind::Linear);
        if measured.is_empty() {
            (measured, kind) = (moving(AxisKind::Rotary), AxisKind::Rotary);
        }
        if measured.is_empty() {
            return Err(PathError::StandsStill);
        }
        let joints = kinds.len();
        let mut spline = Self { joints, coefficients: pieces(from, points), measured, stretches: Vec::new() };
        spline.measure()?;
        Ok((spline, kind))
    }

    fn pieces(&self) -> usize {
        self.coefficients.len() / self.joints
    }

    fn piece(&self, piece: usize) -> &[[f64; COEFFICIENTS]] {
        &self.coefficients[piece * self.joints..(piece + 1) * self.joints]
    }

    /// ds/du.
    fn speed(&self, piece: usize, u: f64) -> f64 {
        let coefficients = self.piece(piece);
        let square = |place: &usize| {
            let c = &coefficients[*place];
            let d = c[1] + u * (2.0 * c[2] + u * 3.0 * c[3]);
            d * d
        };
        self.measured.iter().map(square).sum::<f64>().sqrt()
    }

    fn stretch_length(&self, piece: usize, from: f64, to: f64) -> f64 {
        integrate(from, to, |u| self.speed(piece, u))
    }

    /// Makes the table of lengths.
    fn measure(&mut self) -> Result<(), PathError> {
        let pieces = self.pieces();
        let mut s = 0.0;
        for piece in 0..pieces {
            let cusp = PathError::Cusp { piece: piece + 1, pieces };
            // Depth-first, left half on top, so that stretches come out in order.
            let mut stack = vec![(0.0, 1.0, self.stretch_length(piece, 0.0, 1.0), 0)];
            while let Some((from, to, whole, depth)) = stack.pop() {
                let middle = 0.5 * (from + to);
                let halves =
                    [self.stretch_length(piece, from, middle), self.stretch_length(piece, middle, to)];
                let length = halves[0] + halves[1];
                if !length.is_finite() {
                    return Err(PathError::Unmeasurable { length });
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
                self.stretches.push(Stretch { piece, from, to, s_from, s_to, slope_from, slope_to });
                s = s_to;
            }
        }
        let fastest = self.stretches.iter().map(|stretch| stretch.slope_from.min(stretch.slope_to));
        let bound = fastest.fold(f64::INFINITY, f64::min) / MIN_SPEED;
        // Written so that NaN is a cusp too.
        let stands = |stretch: &&Stretch| {
            let slow = stretch.slope_from.max(stretch.slope_to);
            !slow.is_finite() || slow > bound
        };
        match self.stretches.iter().find(stands) {
            Some(stretch) => Err(PathError::Cusp { piece: stretch.piece + 1, pieces }),
            None if s > 0.0 => Ok(()),
            None => Err(PathError::StandsStill),
        }
    }

    pub fn length(&self) -> f64 {
        self.stretches.last().map_or(0.0, |stretch| stretch.s_to)
    }

    pub fn keeps(&self, place: usize) -> bool {
        (0..self.pieces()).all(|piece| {
            let c = &self.piece(piece)[place];
            c[1] == 0.0 && c[2] == 0.0 && c[3] == 0.0
        })
    }

    /// Lengths at the borders of the pieces, both ends of the spline among them.
    pub fn knots(&self) -> Vec<f64> {
        let starts = self.stretches.iter().filter(|stretch| stretch.from == 0.0);
        starts.map(|stretch| stretch.s_from).chain([self.length()]).collect()
    }

    /// Piece and parameter at the length `s`.
    fn locate(&self, s: f64) -> (usize, f64) {
        let place = self.stretches.partition_point(|stretch| stretch.s_to <= s);
        let stretch = &self.stretches[place.min(self.stretches.len() - 1)];
        let (length, target) = (stretch.s_to - stretch.s_from, s - stretch.s_from);
        let width = stretch.to - stretch.from;
        // Hermite's cubic through both ends of u(s).
        let x = (target / length).clamp(0.0, 1.0);
        let (m0, m1) = (stretch.slope_from * length, stretch.slope_to * length);
        let cubic = x * (m0 + x * (3.0 * width - 2.0 * m0 - m1 + x * (m0 + m1 - 2.0 * width)));
        let mut u = (stretch.from + cubic).clamp(stretch.from, stretch.to);
        for _ in 0..MAX_NEWTON {
            let missing = target - self.stretch_length(stretch.piece, stretch.from, u);
            let step = missing / self.speed(stretch.piece, u);
            let next = (u + step).clamp(stretch.from, stretch.to);
            let small = (next - u).abs() <= NEWTON_TOLERANCE * width;
            u = next;
            if small {
                break;
            }
        }
        (stretch.piece, u)
    }

    pub fn point(&self, s: f64, out: &mut [f64]) {
        let (piece, u) = self.locate(s);
        for (value, c) in out.iter_mut().zip(self.piece(piece)) {
            *value = c[0] + u * (c[1] + u * (c[2] + u * c[3]));
        }
    }

    /// By the chain rule through u(s), with σ = ds/du:
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
        for &place in &self.measured {
            let (first, second, third) = by_u(&coefficients[place]);
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

/// Newton's steps smaller than that, relative to the stretch, are rounding.
const NEWTON_TOLERANCE: f64 = 1e-9;

/// The polynomials of each piece: control points → Bézier points by blossoming → powers.
fn pieces(from: &[f64], points: &[Vec<f64>]) -> Vec<[f64; COEFFICIENTS]> {
    let count = points.len() + 1 - DEGREE;
    let control = |i: usize, place: usize| if i == 0 { from[place] } else { points[i - 1][place] };
    // Uniform knots 0, 1, …, count, the outer ones repeated.
    let knot = |i: usize| i.saturating_sub(DEGREE).min(count) as f64;
    let mut coefficients = Vec::with_capacity(count * from.len());
    let still: Vec<bool> =
        (0..from.len()).map(|place| points.iter().all(|point| point[place] == from[place])).collect();
    for piece in 0..count {
        for place in 0..from.len() {
            if still[place] {
                coefficients.push([from[place], 0.0, 0.0, 0.0]);
                continue;
            }
            let blossom = |arguments: [f64; DEGREE]| {
                let mut d: [f64; COEFFICIENTS] = std::array::from_fn(|i| control(piece + i, place));
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
