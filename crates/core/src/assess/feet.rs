//! Foot points of all poses of a position cycle on a line, a circle or a smooth curve, in vectors of poses.

use nalgebra::Vector3;

use super::curve_cells::{CurveCell, CurveCells, Polynomials, derivatives, value};
use super::tool_angle::ToolAngles;
use crate::kinematics::Poses;
use crate::simd::{LANES, SliceOperation};

/// Largest distance of the last iterate from the foot point, m. The error of the distance is its square times the
/// curvature.
const CONVERGENCE: f64 = 1e-9;
/// Largest |x| of a foot point in a cell: foot points at a common end belong to both cells.
const CELL_END: f64 = 1.0 + 1e-9;
/// Largest |x| of an estimate in a cell.
const CELL_REACH: f64 = 1.5;
/// Distance by which other parts of a curve are farther from all poses, m.
const CLEARANCE: f64 = 1e-9;

/// Returns the parameter of the foot point of `tip` on the line through `from`.
#[inline(always)]
pub(super) fn line_parameter(tip: Vector3<f64>, from: Vector3<f64>, slope: Vector3<f64>) -> f64 {
    slope.dot(&(tip - from)) / slope.norm_squared()
}

/// Returns the value clamped to a range; NaN stays NaN.
#[inline(always)]
fn clamped(value: f64, [low, high]: [f64; 2]) -> f64 {
    let value = if value < low { low } else { value };
    if value > high { high } else { value }
}

/// Returns the largest value, −∞ if all are NaN.
pub(super) fn largest(values: &[f64]) -> f64 {
    let (groups, rest) = values.as_chunks::<LANES>();
    let mut largest = [f64::NEG_INFINITY; LANES];
    for group in groups {
        for k in 0..LANES {
            largest[k] = if group[k] > largest[k] { group[k] } else { largest[k] };
        }
    }
    largest.iter().chain(rest).copied().fold(f64::NEG_INFINITY, f64::max)
}

/// Computation of the foot points of poses on a line.
pub(super) struct LineFeet<'a> {
    pub poses: &'a Poses,
    pub from: Vector3<f64>,
    pub slope: Vector3<f64>,
    /// Range of arc length.
    pub window: [f64; 2],
    /// Arc lengths.
    pub feet: &'a mut [f64],
    pub distances: &'a mut [f64],
}

impl SliceOperation for LineFeet<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let LineFeet { poses, from, slope, window, feet, distances } = self;
        let count = feet.len();
        let [xs, ys, zs] = poses.tips().map(|values| &values[..count]);
        let distances = &mut distances[..count];
        for index in 0..count {
            let tip = Vector3::new(xs[index], ys[index], zs[index]);
            let s = clamped(line_parameter(tip, from, slope), window);
            feet[index] = s;
            distances[index] = (tip - (from + slope * s)).norm();
        }
    }
}

/// Computation of the foot points of poses on an arc of less than half a turn.
pub(super) struct ArcFeet<'a> {
    pub poses: &'a Poses,
    pub center: Vector3<f64>,
    /// Directions of the arc's middle from the center, of its motion there, and of its axis.
    pub frame: [Vector3<f64>; 3],
    pub radius: f64,
    /// Tangent of half the angle of the arc.
    pub bound: f64,
    /// Tangents of the angles from the middle.
    pub feet: &'a mut [f64],
    pub distances: &'a mut [f64],
}

impl SliceOperation for ArcFeet<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let ArcFeet { poses, center, frame, radius, bound, feet, distances } = self;
        let count = feet.len();
        let [xs, ys, zs] = poses.tips().map(|values| &values[..count]);
        let distances = &mut distances[..count];
        for index in 0..count {
            let out = Vector3::new(xs[index], ys[index], zs[index]) - center;
            let [u, v, off_plane] = [frame[0].dot(&out), frame[1].dot(&out), frame[2].dot(&out)];
            // Behind the center, the nearer end is nearest.
            let end = if v < 0.0 { -bound } else { bound };
            let tangent = if u <= 0.0 { end } else { clamped(v / u, [-bound, bound]) };
            let cosine = radius / (1.0 + tangent * tangent).sqrt();
            let (x, y) = (u - cosine, v - cosine * tangent);
            feet[index] = tangent;
            distances[index] = (x * x + y * y + off_plane * off_plane).sqrt();
        }
    }
}

/// Search of the foot points of all poses on a cell of a curve by Newton's method.
pub(super) struct CellFeet<'a> {
    pub cell: &'a CurveCell,
    pub poses: &'a Poses,
    /// Estimates of the foot points, arc length.
    pub guesses: &'a [f64],
    /// Foot points found, arc length; NaN for poses without one.
    pub feet: &'a mut [f64],
    pub distances: &'a mut [f64],
    pub angles: &'a mut ToolAngles,
}

impl SliceOperation for CellFeet<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let CellFeet { cell, poses, guesses, feet, distances, angles } = self;
        let count = guesses.len();
        let [xs, ys, zs] = poses.tips().map(|values| &values[..count]);
        let [us, vs, ws] = poses.axes().map(|values| &values[..count]);
        let (feet, distances) = (&mut feet[..count], &mut distances[..count]);
        let [square_sines, cosines] = angles.columns(count);
        let scale = 1.0 / cell.half;
        let (middle, half) = (cell.middle, cell.half);
        let (tip, axis) = (cell.tip, cell.axis);
        for index in 0..count {
            let position = [xs[index], ys[index], zs[index]];
            let x = (guesses[index] - middle) * scale;
            let x = if x < -CELL_REACH { -CELL_REACH } else { x };
            let x = if x > CELL_REACH { CELL_REACH } else { x };
            let x = newton_step(&tip, position, newton_step(&tip, position, x));
            let [error, slope, bend] = local(&tip, position, x);
            let (product, square) = (dot(error, slope), dot(slope, slope));
            let step = product / (square - dot(error, bend));
            let along = product / square;
            let across =
                [error[0] - along * slope[0], error[1] - along * slope[1], error[2] - along * slope[2]];
            let x = x + step;
            let is_free = feet[index].is_nan();
            let is_found =
                (x.abs() <= CELL_END) & (step * step * square <= CONVERGENCE * CONVERGENCE) & is_free;
            let nominal = [value(&axis[0], x), value(&axis[1], x), value(&axis[2], x)];
            let [square_sine, cosine] =
                ToolAngles::square_sine_and_cosine([us[index], vs[index], ws[index]], nominal);
            feet[index] = if is_found { middle + half * x } else { feet[index] };
            distances[index] = if is_found { dot(across, across).sqrt() } else { distances[index] };
            square_sines[index] = if is_found { square_sine } else { square_sines[index] };
            cosines[index] = if is_found { cosine } else { cosines[index] };
        }
    }
}

/// Returns the next iterate of Newton's method for the foot point of `position`.
#[inline(always)]
fn newton_step(tip: &Polynomials, position: [f64; 3], x: f64) -> f64 {
    let [error, slope, bend] = local(tip, position, x);
    x + dot(error, slope) / (dot(slope, slope) - dot(error, bend))
}

/// Returns the vector from the curve to `tip` at `x`, and the first and second derivative of the curve.
#[inline(always)]
fn local(tip: &Polynomials, position: [f64; 3], x: f64) -> [[f64; 3]; 3] {
    let [a, b, c] = [derivatives(&tip[0], x), derivatives(&tip[1], x), derivatives(&tip[2], x)];
    [[position[0] - a[0], position[1] - b[0], position[2] - c[0]], [a[1], b[1], c[1]], [a[2], b[2], c[2]]]
}

#[inline(always)]
fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Samples of a curve at equal distances, and its polynomials.
#[derive(Debug, Clone, Copy)]
pub(super) struct SampledCurve<'a> {
    pub samples: &'a [Vector3<f64>],
    /// Arc length between two samples.
    pub spacing: f64,
    pub cells: &'a CurveCells,
}

impl SampledCurve<'_> {
    /// Returns true if no other point in a window of arc length can be nearer to a pose than its foot point; the foot
    /// points are in `range`, the poses at most `distance` from them.
    pub fn are_nearest(&self, poses: &Poses, range: [f64; 2], distance: f64, window: [f64; 2]) -> bool {
        let cells = self.cells;
        let around = 2.0 * distance + 3.0 * self.spacing;
        let near = [range[0] - around, range[1] + around];
        // Around the feet, the derivative of the distance along the curve changes its sign once.
        let [from, to] = near.map(|s| cells.index_at(s));
        let reach = near[1] - near[0];
        let is_flat = cells.cells()[from..=to]
            .iter()
            .all(|cell| (distance + reach * cell.most_speed) * cell.most_bend < cell.least_square_speed);
        if !is_flat {
            return false;
        }
        let center = poses.tip(poses.len() / 2);
        let [xs, ys, zs] = poses.tips();
        let square = |((x, y), z): ((&f64, &f64), &f64)| {
            (x - center.x).powi(2) + (y - center.y).powi(2) + (z - center.z).powi(2)
        };
        let radius = xs.iter().zip(ys).zip(zs).map(square).fold(0.0, f64::max).sqrt();
        // A point between two samples is at most half of their distance from the nearer one.
        let bound = radius + distance + CLEARANCE + 0.5 * self.spacing * cells.most_speed();
        let from = (window[0] / self.spacing).floor().max(0.0) as usize;
        let to = ((window[1] / self.spacing).ceil() as usize).min(self.samples.len() - 1);
        (from..=to).all(|index| {
            let s = index as f64 * self.spacing;
            (s > near[0] && s < near[1]) || (self.samples[index] - center).norm_squared() > bound * bound
        })
    }
}
