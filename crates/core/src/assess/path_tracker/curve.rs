//! Contour and orientation errors of a series of poses along a curve without a closed form.
//!
//! The foot points of all poses are found side by side by Newton's method on the polynomials of the curve. They are the
//! nearest points if the curve is flat around them and the rest of the search range is farther from all poses than they
//! are; otherwise each pose is searched.

use std::sync::Arc;

use super::{FootBuffers, NearestPoint, PathDeviations, PathTracker, SEARCH_BACK};
use crate::assess::curve_cells::{CurveCell, CurveCells, Polynomials, derivatives, value};
use crate::assess::path_shape::TipCurve;
use crate::assess::tool_angle::{ToolAngles, tool_angle};
use crate::kinematics::Poses;
use crate::simd::{SliceOperation, vectorize};

/// Distance that foot points keep from the ends of the search range, and other parts of the path from the poses, m.
const CLEARANCE: f64 = 1e-9;
/// Largest distance of the last iterate from the foot point, m. The error of the distance is its square times the
/// curvature.
const CONVERGENCE: f64 = 1e-9;
/// Largest |x| of a foot point in a cell: foot points at a common end belong to both cells.
const CELL_END: f64 = 1.0 + 1e-9;
/// Largest |x| of an estimate in a cell.
const CELL_REACH: f64 = 1.5;
/// Largest number of blocks in the search range.
const MAX_BLOCKS: usize = 8;

/// Foot points of all poses on a block: their range, m, and the largest distance from a pose, m.
#[derive(Debug, Clone, Copy)]
struct FeetRange {
    first: f64,
    last: f64,
    distance: f64,
}

impl PathTracker {
    /// Computes the deviations of all poses; returns the nearest point to the first one, or `None`, without a change
    /// of the tracker, if each pose must be searched.
    ///
    /// `until` contains the progress commanded at the first and at the last pose.
    pub(super) fn follow_curve(
        &mut self,
        poses: &Poses,
        until: [f64; 2],
        found: &mut PathDeviations,
    ) -> Option<NearestPoint> {
        let shapes = Arc::clone(&self.shapes);
        let TipCurve::Sampled { cells: Some(cells), .. } = &shapes[self.block] else { return None };
        self.find_feet(cells, poses, found)?;
        let feet = &self.feet.along;
        let extreme =
            |pick: fn(f64, f64) -> f64, start: f64, values: &[f64]| values.iter().copied().fold(start, pick);
        let range = FeetRange {
            first: extreme(f64::min, f64::INFINITY, feet),
            last: extreme(f64::max, f64::NEG_INFINITY, feet),
            distance: extreme(f64::max, 0.0, &found.distance),
        };
        if !self.is_within_window(range, until) || !self.is_nearest(&shapes, cells, poses, range, until) {
            return None;
        }
        found.within_ends.copy_from_slice(&found.distance);
        self.angles.write_angles(&mut found.orientation);
        let start = self.path.start_of(self.block);
        let (s, pose) = (self.feet.along[0], poses.get(0));
        let axis = shapes[self.block].axis(&self.path, self.block, s, &mut self.scratch);
        self.furthest = self.furthest.max(start + range.last);
        self.s = self.feet.along[poses.len() - 1];
        self.last = None;
        Some(NearestPoint {
            progress: start + s,
            point: cells.tip(s),
            axis,
            distance: found.distance[0],
            within_ends: found.distance[0],
            orientation: tool_angle(&axis, &pose.axis),
        })
    }

    /// Finds the foot points near the last one; `None` if one is not found.
    fn find_feet(&mut self, cells: &CurveCells, poses: &Poses, found: &mut PathDeviations) -> Option<()> {
        let count = poses.len();
        found.resize(count);
        self.angles.resize(count);
        let (point, tangent, _) = cells.tip_derivatives(self.s);
        let slope = tangent / tangent.norm_squared();
        let FootBuffers { along: feet, guesses, .. } = &mut self.feet;
        feet.resize(count);
        guesses.resize(count);
        feet.fill(f64::NAN);
        let [xs, ys, zs] = poses.tips();
        for (guess, ((x, y), z)) in guesses.iter_mut().zip(xs.iter().zip(ys).zip(zs)) {
            *guess = self.s + (x - point.x) * slope.x + (y - point.y) * slope.y + (z - point.z) * slope.z;
        }
        let ends = [guesses[0], guesses[count - 1]].map(|s| cells.index_at(s));
        for cell in &cells.cells()[ends[0].min(ends[1])..=ends[0].max(ends[1])] {
            let (distances, angles) = (&mut found.distance, &mut self.angles);
            vectorize(CellFeet { cell, poses, guesses, feet, distances, angles });
        }
        feet.iter().all(|s| s.is_finite()).then_some(())
    }

    /// Returns true if all foot points lie clearly within the search range of each pose and between the ends of block
    /// and path.
    fn is_within_window(&self, range: FeetRange, until: [f64; 2]) -> bool {
        let (start, length) = (self.path.start_of(self.block), self.path.blocks()[self.block].length());
        let furthest = self.furthest.max(start + range.last);
        let high = until[0].clamp(0.0, self.path.length()).max(self.furthest);
        range.first > CLEARANCE
            && range.last < length - CLEARANCE
            && start + range.first > furthest - SEARCH_BACK + CLEARANCE
            && start + range.last < high - CLEARANCE
    }

    /// Returns true if no other point of the search range can be nearer to a pose than its foot point.
    fn is_nearest(
        &self,
        shapes: &[TipCurve],
        cells: &CurveCells,
        poses: &Poses,
        range: FeetRange,
        until: [f64; 2],
    ) -> bool {
        let block = self.block;
        let around = 2.0 * range.distance + 3.0 * spacing(&shapes[block], self.path.blocks()[block].length());
        let near = [range.first - around, range.last + around];
        // Around the feet, the derivative of the distance along the curve changes its sign once.
        let [from, to] = near.map(|s| cells.index_at(s));
        let reach = near[1] - near[0];
        let is_flat = cells.cells()[from..=to].iter().all(|cell| {
            (range.distance + reach * cell.most_speed) * cell.most_bend < cell.least_square_speed
        });
        if !is_flat {
            return false;
        }
        let center = poses.tip(poses.len() / 2);
        let [xs, ys, zs] = poses.tips();
        let square = |((x, y), z): ((&f64, &f64), &f64)| {
            (x - center.x).powi(2) + (y - center.y).powi(2) + (z - center.z).powi(2)
        };
        let radius = xs.iter().zip(ys).zip(zs).map(square).fold(0.0, f64::max).sqrt();
        let bound = radius + range.distance + CLEARANCE;
        let low = (self.furthest - SEARCH_BACK).max(0.0);
        let high = until[1].clamp(0.0, self.path.length()).max(self.furthest);
        let (from, to) = (self.path.locate(low), self.path.locate(high));
        to.0 - from.0 < MAX_BLOCKS
            && (from.0..=to.0).all(|index| {
                let length = self.path.blocks()[index].length();
                let window =
                    [if index == from.0 { from.1 } else { 0.0 }, if index == to.0 { to.1 } else { length }];
                let excluded = (index == block).then_some(near);
                is_farther(&shapes[index], length, window, excluded, center, bound)
            })
    }
}

/// Returns the distance between two samples of a curve along it, ∞ without samples.
fn spacing(shape: &TipCurve, length: f64) -> f64 {
    match shape {
        TipCurve::Sampled { samples, .. } => length / (samples.len() - 1) as f64,
        _ => f64::INFINITY,
    }
}

/// Returns true if all points of a curve within `window`, except between `excluded`, are farther than `bound` from
/// `center`.
fn is_farther(
    shape: &TipCurve,
    length: f64,
    window: [f64; 2],
    excluded: Option<[f64; 2]>,
    center: nalgebra::Vector3<f64>,
    bound: f64,
) -> bool {
    let TipCurve::Sampled { samples, cells: Some(cells), .. } = shape else { return false };
    let spacing = spacing(shape, length);
    // A point between two samples is at most half of their distance from the nearer one.
    let bound = bound + 0.5 * spacing * cells.most_speed();
    let from = (window[0] / spacing).floor().max(0.0) as usize;
    let to = ((window[1] / spacing).ceil() as usize).min(samples.len() - 1);
    (from..=to).all(|index| {
        let s = index as f64 * spacing;
        let is_excluded = excluded.is_some_and(|[first, last]| s > first && s < last);
        is_excluded || (samples[index] - center).norm_squared() > bound * bound
    })
}

/// Search of the foot points of all poses on a cell.
struct CellFeet<'a> {
    cell: &'a CurveCell,
    poses: &'a Poses,
    /// Estimates of the foot points, arc length.
    guesses: &'a [f64],
    /// Foot points found, arc length; NaN for poses without one.
    feet: &'a mut [f64],
    distances: &'a mut [f64],
    angles: &'a mut ToolAngles,
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
