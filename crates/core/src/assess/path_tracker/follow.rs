//! Contour errors of a series of poses in closed form on lines and circles.
//!
//! Along a line or a circle, no search is needed for each pose: if the foot points of all poses lie in the
//! block, within the search range, the distance follows directly from the pose. The computation is the same
//! as in the search, so the distances are bit-identical.

use std::f64::consts::TAU;

use nalgebra::Vector3;

use super::{NearestPoint, PathTracker, SEARCH_BACK};
use crate::assess::path_shape::{TipCurve, circle_coordinates, distance_to_circle, line_parameter};
use crate::kinematics::Poses;
use crate::simd::{AlignedBuffer, LANES, SliceOperation, vectorize};

/// Distance from the ends of the search range that all foot points keep, m: more than rounding.
const CLEARANCE: f64 = 1e-9;
/// Bound of rounding in an arc length or an angle, relative to the largest value in its computation.
const ROUNDING: f64 = 64.0 * f64::EPSILON;
/// Smallest angle between consecutive foot points on a circle that counts as forward, rad.
const MIN_ADVANCE: f64 = 1e-9;

/// Deviations of consecutive poses from a path.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PathDeviations {
    /// [`NearestPoint::distance`] of each pose, m.
    pub distance: Vec<f64>,
    /// [`NearestPoint::within_ends`] of each pose, m.
    pub within_ends: Vec<f64>,
    /// [`NearestPoint::orientation`] of each pose, rad.
    pub orientation: Vec<f64>,
}

impl PathDeviations {
    /// Removes all deviations.
    pub fn clear(&mut self) {
        self.distance.clear();
        self.within_ends.clear();
        self.orientation.clear();
    }

    /// Sets the number of poses; the values of further ones are 0.
    pub(in crate::assess) fn resize(&mut self, count: usize) {
        self.distance.resize(count, 0.0);
        self.within_ends.resize(count, 0.0);
        self.orientation.resize(count, 0.0);
    }

    /// Adds the deviations of one pose.
    pub fn push(&mut self, nearest: &NearestPoint) {
        self.distance.push(nearest.distance);
        self.within_ends.push(nearest.within_ends);
        self.orientation.push(nearest.orientation);
    }
}

/// Result for a series of poses.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FollowResult {
    /// Nearest point to the first pose.
    pub first: NearestPoint,
    /// True if the closed form was used instead of a search for each pose.
    pub closed_form: bool,
}

/// Search range, as arc lengths in the single block that contains it.
#[derive(Debug, Clone, Copy)]
struct SearchRange {
    block: usize,
    /// Progress at the start of the block.
    start: f64,
    /// Start of the range at the first pose.
    low: f64,
    /// End of the range at the first and at the last pose.
    high: [f64; 2],
}

/// Returns the tips in order.
fn tips(poses: &Poses) -> impl Iterator<Item = Vector3<f64>> {
    let [xs, ys, zs] = poses.tips();
    xs.iter().zip(ys).zip(zs).map(|((x, y), z)| Vector3::new(*x, *y, *z))
}

impl PathTracker {
    /// Computes the deviations of `poses` as [`nearest`](Self::nearest) does for each of them in order, and
    /// replaces the contents of `found` by them.
    ///
    /// `until` returns the progress commanded at the pose of an index; it never decreases. Returns `None`
    /// without a pose.
    pub fn follow(
        &mut self,
        poses: &Poses,
        mut until: impl FnMut(usize) -> f64,
        found: &mut PathDeviations,
    ) -> Option<FollowResult> {
        found.clear();
        let last = poses.len().checked_sub(1)?;
        let before = self.furthest;
        let begin = until(0);
        if self.shapes[self.block].has_cells()
            && let Some(first) = self.follow_curve(poses, [begin, until(last)], found)
        {
            return Some(FollowResult { first, closed_form: false });
        }
        found.clear();
        let first = self.nearest(&poses.get(0), begin);
        found.push(&first);
        // The query before left the state unchanged, and so would all of these.
        if self.last.is_some() && poses.is_constant() && until(last) == begin {
            (0..last).for_each(|_| found.push(&first));
            return Some(FollowResult { first, closed_form: false });
        }
        if poses.constant_axis().is_some()
            && begin >= self.path.length()
            && self.all_beyond_end(poses, &first)
        {
            for tip in tips(poses).skip(1) {
                let error = tip - first.point;
                let distance = error.norm();
                found.distance.push(distance);
                found.within_ends.push(self.within_ends(first.progress, error, distance));
            }
            found.orientation.resize(poses.len(), first.orientation);
            return Some(FollowResult { first, closed_form: true });
        }
        let range = if last > 1 { self.range(before, [begin, until(last)]) } else { None };
        let closed_form = poses.constant_axis().and(range).is_some_and(|range| {
            self.follow_line(poses, range, &mut found.distance)
                || self.follow_circle(poses, range, &mut found.distance)
        });
        if closed_form {
            self.nearest(&poses.get(last), until(last));
            found.within_ends.extend_from_slice(&found.distance[1..]);
            // The tool axis and that of the path are constant.
            found.orientation.resize(poses.len(), first.orientation);
        } else {
            found.clear();
            found.push(&first);
            for index in 1..=last {
                let nearest = self.nearest(&poses.get(index), until(index));
                found.push(&nearest);
            }
        }
        Some(FollowResult { first, closed_form })
    }

    /// Returns true if all of `poses` lie beyond the path's last point, which is nearest to the first of
    /// them, and the whole path has been commanded.
    fn all_beyond_end(&self, poses: &Poses, first: &NearestPoint) -> bool {
        let (block, length) = (self.block, self.path.blocks()[self.block].length());
        let is_last = block + 1 == self.path.blocks().len();
        let at_end = is_last && first.progress >= self.path.length() && self.s >= length;
        let low = self.furthest - SEARCH_BACK;
        if !at_end || self.path.locate(low.max(0.0)).0 != block || self.furthest < self.path.length() {
            return false;
        }
        // The comparisons treat NaN as not beyond the end.
        match &self.shapes[block] {
            TipCurve::Segment { from, slope, .. } => {
                let beyond = length + ROUNDING * (length + from.amax());
                tips(poses).all(|tip| line_parameter(tip, *from, *slope) > beyond)
            }
            // The start of the search range is less than a quarter turn before the end, and further away.
            TipCurve::Circle { center, plane, radius, turn, .. }
                if SEARCH_BACK * turn.abs() < 1.0 && length > SEARCH_BACK =>
            {
                let least = ROUNDING * (length * turn.abs() + center.amax() / radius) * radius * radius;
                let direction = turn.signum();
                let ([x0, y0, _], _) = circle_coordinates(first.point, *center, plane);
                tips(poses).all(|tip| {
                    let ([x, y, _], _) = circle_coordinates(tip, *center, plane);
                    (x0 * y - y0 * x) * direction > least && x0 * x + y0 * y > 0.0
                })
            }
            _ => false,
        }
    }

    /// Returns the search range of poses if it lies in one block; the first pose has been evaluated.
    ///
    /// `before` is the furthest nearest point before the first pose.
    fn range(&self, before: f64, until: [f64; 2]) -> Option<SearchRange> {
        let block = self.block;
        let holds = |progress: f64| self.path.locate(progress).0 == block;
        let (start, length) = (self.path.start_of(block), self.path.blocks()[block].length());
        let low = (before - SEARCH_BACK).max(0.0);
        let [first, last] = until.map(|until| until.clamp(0.0, self.path.length()));
        let (first, last) = (first.max(before), last.max(self.furthest));
        (holds(low) && holds(last)).then(|| SearchRange {
            block,
            start,
            low: low - start,
            high: [first, last].map(|high| (high - start).min(length)),
        })
    }

    /// Computes the distances of all poses from a line; returns true if all foot points lie within the
    /// search range. Updates the furthest point with all poses but the last.
    fn follow_line(&mut self, poses: &Poses, range: SearchRange, distances: &mut Vec<f64>) -> bool {
        let TipCurve::Segment { from, slope, .. } = &self.shapes[range.block] else { return false };
        let (from, slope) = (*from, *slope);
        vectorize(LineFeet { poses, from, slope, buffers: &mut self.feet });
        let feet = &self.feet.first[..poses.len()];
        // The comparison treats NaN as outside.
        let inside =
            feet.iter().fold(true, |inside, s| inside & (*s > CLEARANCE && *s < range.high[0] - CLEARANCE));
        let least = feet.iter().fold(f64::INFINITY, |least, s| if *s < least { *s } else { least });
        let most = |feet: &[f64]| feet.iter().fold(0.0, |most, s| if *s > most { *s } else { most });
        let (furthest, before) = (most(feet), most(&feet[..poses.len() - 1]));
        let low = (self.furthest.max(range.start + furthest) - SEARCH_BACK - range.start).max(range.low);
        let inside = inside && least > low + CLEARANCE && self.is_within_ends(range, least, furthest);
        if inside {
            let progress = (range.start + before).min(self.path.start_of(range.block + 1));
            self.furthest = self.furthest.max(progress);
            self.last = None;
            self.feet.write_distances(distances);
        }
        inside
    }

    /// Computes the distances of all poses from a circle; returns true if each foot point lies clearly
    /// ahead of the one before, and all lie within the search range.
    ///
    /// The first foot point lies within the range. The range starts a fixed length before the furthest foot
    /// point so far, and its end advances with each pose. Foot points in forward order are never before its
    /// start, and none is beyond its end if the last one is not beyond the end for the first pose. The
    /// range is less than one turn, so each pose has a single foot point.
    fn follow_circle(&mut self, poses: &Poses, range: SearchRange, distances: &mut Vec<f64>) -> bool {
        let TipCurve::Circle { center, plane, radius, turn, .. } = &self.shapes[range.block] else {
            return false;
        };
        let (center, plane, radius, turn) = (*center, *plane, *radius, *turn);
        let first = self.s;
        let one_turn = range.high[1] - range.low < TAU / turn.abs() - CLEARANCE;
        if !(one_turn && first > range.low + CLEARANCE && first < range.high[0] - CLEARANCE) {
            return false;
        }
        let (least, direction) = (MIN_ADVANCE * radius * radius, turn.signum());
        let buffers = &mut self.feet;
        if !vectorize(CircleFeet { poses, center, plane, radius, least, direction, buffers }) {
            return false;
        }
        self.feet.write_distances(distances);
        let (xs, ys) = (&self.feet.first, &self.feet.second);
        let (x0, y0, x, y) = (xs[0], ys[0], xs[poses.len() - 1], ys[poses.len() - 1]);
        let swept = ((x0 * y - y0 * x) * direction).atan2(x0 * x + y0 * y);
        let end = first + swept / turn.abs();
        end < range.high[0] - CLEARANCE && self.is_within_ends(range, first, end)
    }

    /// Returns true if the range between two arc lengths of a block lies between the ends of the block and
    /// of the path.
    fn is_within_ends(&self, range: SearchRange, least: f64, most: f64) -> bool {
        let length = self.path.blocks()[range.block].length();
        least > CLEARANCE
            && most < length - CLEARANCE
            && range.start + least > 0.0
            && range.start + most + CLEARANCE < self.path.length()
    }
}

/// Buffers for the foot points of consecutive poses.
#[derive(Debug, Clone, Default)]
pub(super) struct FootBuffers {
    /// Arc length of the foot point on a line or another curve, or first coordinate of the pose in the plane of a circle, m.
    pub first: AlignedBuffer,
    /// Second coordinate of the pose, m, or estimate of the arc length on another curve.
    pub second: AlignedBuffer,
    /// Distance from the curve, m.
    distances: AlignedBuffer,
}

impl FootBuffers {
    /// Sets the number of poses and returns the buffers in vectors.
    #[inline(always)]
    fn lanes(&mut self, count: usize) -> [&mut [[f64; LANES]]; 3] {
        [&mut self.first, &mut self.second, &mut self.distances].map(|buffer| {
            buffer.resize(count);
            &mut buffer.lanes_mut()[..count.div_ceil(LANES)]
        })
    }

    /// Replaces the contents of `distances` by those of the poses.
    fn write_distances(&self, distances: &mut Vec<f64>) {
        distances.clear();
        distances.extend_from_slice(&self.distances);
    }
}

/// Computation of the foot points of poses on a line.
struct LineFeet<'a> {
    poses: &'a Poses,
    from: Vector3<f64>,
    slope: Vector3<f64>,
    buffers: &'a mut FootBuffers,
}

impl SliceOperation for LineFeet<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let LineFeet { poses, from, slope, buffers } = self;
        let [feet, _, distances] = buffers.lanes(poses.len());
        let [xs, ys, zs] = poses.tip_lanes();
        let tips = xs.iter().zip(ys).zip(zs);
        for ((foot, distance), ((x, y), z)) in feet.iter_mut().zip(distances).zip(tips) {
            let (x, y, z, mut arc_length, mut length) = (*x, *y, *z, [0.0; LANES], [0.0; LANES]);
            for k in 0..LANES {
                let tip = Vector3::new(x[k], y[k], z[k]);
                let s = line_parameter(tip, from, slope);
                arc_length[k] = s;
                length[k] = (tip - (from + slope * s)).norm();
            }
            (*foot, *distance) = (arc_length, length);
        }
    }
}

/// Computation of the coordinates of poses in the plane of a circle.
struct CircleFeet<'a> {
    poses: &'a Poses,
    center: Vector3<f64>,
    plane: [Vector3<f64>; 3],
    radius: f64,
    /// Smallest product of the radii of consecutive foot points that counts as forward, m².
    least: f64,
    /// Sign of the direction of rotation.
    direction: f64,
    buffers: &'a mut FootBuffers,
}

impl SliceOperation for CircleFeet<'_> {
    type Output = bool;

    /// Returns true if each foot point lies clearly ahead of the one before, less than a quarter turn from the first.
    #[inline(always)]
    fn run(self) -> bool {
        let CircleFeet { poses, center, plane, radius, least, direction, buffers } = self;
        let [us, vs, distances] = buffers.lanes(poses.len());
        let [xs, ys, zs] = poses.tip_lanes();
        let outputs = us.iter_mut().zip(vs).zip(distances);
        for (((u, v), distance), ((x, y), z)) in outputs.zip(xs.iter().zip(ys).zip(zs)) {
            let (x, y, z) = (*x, *y, *z);
            let mut values = [[0.0; LANES]; 3];
            for k in 0..LANES {
                let tip = Vector3::new(x[k], y[k], z[k]);
                let ([first, second, off_plane], off) = circle_coordinates(tip, center, &plane);
                (values[0][k], values[1][k]) = (first, second);
                values[2][k] = distance_to_circle(off, off_plane, radius);
            }
            [*u, *v, *distance] = values;
        }
        let (us, vs) = (&buffers.first[..], &buffers.second[..]);
        let (u0, v0) = (us[0], vs[0]);
        let steps = us.iter().zip(vs).zip(us[1..].iter().zip(&vs[1..]));
        // The comparison treats NaN as not ahead.
        steps.fold(true, |ahead, ((u_before, v_before), (u, v))| {
            let forwards = (u_before * v - v_before * u) * direction > least;
            ahead & forwards & (u0 * u + v0 * v > 0.0)
        })
    }
}
