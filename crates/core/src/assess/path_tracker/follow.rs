//! Contour errors of a series of poses in closed form on lines and circles.
//!
//! Along a line or a circle, no search is needed for each pose: if the foot points of all poses lie in the
//! block, within the search range, the distance follows directly from the pose. The computation is the same
//! as in the search, so the distances are bit-identical. On a circle, the furthest of poses that differ by rounding can be
//! another one than in the search: the start of the search range then differs in the last digit.

use std::f64::consts::TAU;

use nalgebra::Vector3;

use super::{NearestPoint, PathTracker, SEARCH_BACK};
use crate::assess::path_shape::{TipCurve, circle_coordinates, distance_to_circle, line_parameter};
use crate::kinematics::Poses;
use crate::simd::{AlignedBuffer, LANES, SliceOperation, vectorize};

/// Arc length by which a search range is shorter than a turn, m: more than rounding.
const CLEARANCE: f64 = 1e-9;
/// Bound of rounding in an arc length or an angle, relative to the largest value in its computation.
const ROUNDING: f64 = 64.0 * f64::EPSILON;

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
        let furthest = poses.constant_axis().and(range).and_then(|range| {
            self.follow_line(poses, range, &mut found.distance)
                .or_else(|| self.follow_circle(poses, range, &mut found.distance))
        });
        if let Some(furthest) = furthest {
            if furthest != 0 && furthest != last {
                self.find(&poses.get(furthest), until(furthest));
            }
            self.find(&poses.get(last), until(last));
            self.last = None;
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
        Some(FollowResult { first, closed_form: furthest.is_some() })
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

    /// Computes the distances of all poses from a line; returns the index of the furthest foot point if all of them lie
    /// within the search range.
    fn follow_line(&mut self, poses: &Poses, range: SearchRange, distances: &mut Vec<f64>) -> Option<usize> {
        let TipCurve::Segment { from, slope, .. } = &self.shapes[range.block] else { return None };
        let (from, slope) = (*from, *slope);
        vectorize(LineFeet { poses, from, slope, buffers: &mut self.feet });
        let feet = FootRange::of(&self.feet.along[..poses.len()])?;
        self.closed_form(range, feet, from.amax(), distances)
    }

    /// Computes the distances of all poses from a circle; returns the index of the furthest foot point if all of them lie
    /// within the search range.
    ///
    /// The range is less than one turn, so each pose has a single foot point in it.
    fn follow_circle(
        &mut self,
        poses: &Poses,
        range: SearchRange,
        distances: &mut Vec<f64>,
    ) -> Option<usize> {
        let TipCurve::Circle { center, plane, radius, turn, .. } = &self.shapes[range.block] else {
            return None;
        };
        let (center, plane, radius, turn) = (*center, *plane, *radius, *turn);
        if range.high[1] - range.low >= TAU / turn.abs() - CLEARANCE {
            return None;
        }
        let direction = turn.signum();
        vectorize(CircleFeet { poses, center, plane, radius, direction, buffers: &mut self.feet });
        let tangents = FootRange::of(&self.feet.along[..poses.len()])?;
        // An angle below a quarter turn is not larger than its tangent.
        let feet = FootRange {
            first: self.s + tangents.first / turn.abs(),
            last: self.s + tangents.last / turn.abs(),
            ..tangents
        };
        self.closed_form(range, feet, (TAU + center.amax() / radius) / turn.abs(), distances)
    }

    /// Writes the distances of all poses if their foot points `feet` lie clearly within the search range of each pose and
    /// between the ends of block and path; returns the index of the furthest one.
    ///
    /// `scale` is the largest value in the computation of an arc length.
    fn closed_form(
        &self,
        range: SearchRange,
        feet: FootRange,
        scale: f64,
        distances: &mut Vec<f64>,
    ) -> Option<usize> {
        let margin = ROUNDING * (self.path.length() + scale);
        let length = self.path.blocks()[range.block].length();
        let low = (self.furthest.max(range.start + feet.last) - SEARCH_BACK - range.start).max(range.low);
        let is_inside = feet.first > low.max(0.0) + margin
            && feet.last < range.high[0].min(length) - margin
            && range.start + feet.first > 0.0
            && range.start + feet.last + margin < self.path.length();
        if is_inside {
            distances.clear();
            distances.extend_from_slice(&self.feet.distances);
        }
        is_inside.then_some(feet.furthest)
    }
}

/// Foot points of poses that are first and last along the path, arc length or tangent of the angle on a circle, and the
/// index of the last one.
#[derive(Debug, Clone, Copy)]
struct FootRange {
    first: f64,
    last: f64,
    furthest: usize,
}

impl FootRange {
    /// Returns the range of foot points; `None` if one is NaN.
    fn of(feet: &[f64]) -> Option<Self> {
        let [first, last] = vectorize(Extremes(feet))?;
        // Mostly the axes move forward.
        let furthest = feet.iter().rposition(|s| *s == last)?;
        Some(FootRange { first, last, furthest })
    }
}

/// Search of the least and the largest of values, none of which is NaN.
struct Extremes<'a>(&'a [f64]);

impl SliceOperation for Extremes<'_> {
    type Output = Option<[f64; 2]>;

    #[inline(always)]
    fn run(self) -> Option<[f64; 2]> {
        let [mut least, mut largest, mut is_nan] = [f64::INFINITY, f64::NEG_INFINITY, 0.0];
        for &value in self.0 {
            least = if value < least { value } else { least };
            largest = if value > largest { value } else { largest };
            is_nan = if value.is_nan() { 1.0 } else { is_nan };
        }
        (is_nan == 0.0).then_some([least, largest])
    }
}

/// Buffers for the foot points of consecutive poses.
#[derive(Debug, Clone, Default)]
pub(super) struct FootBuffers {
    /// Arc length of the foot point, or tangent of its angle from the first one on a circle.
    pub along: AlignedBuffer,
    /// Estimate of the arc length of the foot point.
    pub guesses: AlignedBuffer,
    /// Distance from the curve, m.
    distances: AlignedBuffer,
}

impl FootBuffers {
    /// Sets the number of poses; returns the places of foot points and distances in vectors.
    #[inline(always)]
    fn lanes(&mut self, count: usize) -> [&mut [[f64; LANES]]; 2] {
        [&mut self.along, &mut self.distances].map(|buffer| {
            buffer.resize(count);
            &mut buffer.lanes_mut()[..count.div_ceil(LANES)]
        })
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
        let [feet, distances] = buffers.lanes(poses.len());
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

/// Computation of the foot points of poses on a circle.
struct CircleFeet<'a> {
    poses: &'a Poses,
    center: Vector3<f64>,
    plane: [Vector3<f64>; 3],
    radius: f64,
    /// Sign of the direction of rotation.
    direction: f64,
    buffers: &'a mut FootBuffers,
}

impl SliceOperation for CircleFeet<'_> {
    type Output = ();

    /// Writes the tangents of the angles from the first foot point, NaN beyond a quarter turn, and the distances.
    #[inline(always)]
    fn run(self) {
        let CircleFeet { poses, center, plane, radius, direction, buffers } = self;
        let [tangents, distances] = buffers.lanes(poses.len());
        let ([u0, v0, _], _) = circle_coordinates(poses.tip(0), center, &plane);
        let [xs, ys, zs] = poses.tip_lanes();
        let tips = xs.iter().zip(ys).zip(zs);
        for ((tangent, distance), ((x, y), z)) in tangents.iter_mut().zip(distances).zip(tips) {
            let (x, y, z, mut ratio, mut length) = (*x, *y, *z, [0.0; LANES], [0.0; LANES]);
            for k in 0..LANES {
                let tip = Vector3::new(x[k], y[k], z[k]);
                let ([u, v, off_plane], off) = circle_coordinates(tip, center, &plane);
                let (sine, cosine) = ((u0 * v - v0 * u) * direction, u0 * u + v0 * v);
                ratio[k] = if cosine > 0.0 { sine / cosine } else { f64::NAN };
                length[k] = distance_to_circle(off, off_plane, radius);
            }
            (*tangent, *distance) = (ratio, length);
        }
    }
}
