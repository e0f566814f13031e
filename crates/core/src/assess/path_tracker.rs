//! Contour error against a geometric path: nearest point on the continuous curve.

use std::f64::consts::TAU;
use std::sync::Arc;

use nalgebra::Vector3;

use super::deviations::{NearestPoint, PathDeviations};
use super::feet::{ArcFeet, CellFeet, LineFeet, SampledCurve, largest, line_parameter};
use super::path_shape::{Scratch, TipCurve, circle_coordinates, distance_to_circle, pose, select_passage};
use super::tool_angle::{ToolAngles, tool_angle};
use crate::kinematics::{Poses, ToolPose};
use crate::path::Path;
use crate::simd::vectorize;

/// Search range before the furthest nearest point, m or rad, for an axis that moves back.
const SEARCH_BACK: f64 = 5e-3;
/// Distance behind the furthest point up to which a candidate counts as ahead, m or rad, if two are equally
/// close.
const ORDER_TOLERANCE: f64 = 1e-5;
/// Tolerance within which two distances are equal, m: the path passes the same point twice.
const DISTANCE_TOLERANCE: f64 = 1e-12;
/// Largest number of blocks evaluated in one call; of more blocks, some near the last nearest point and
/// some spread evenly are evaluated.
const MAX_BLOCKS: usize = 16;
/// Blocks evaluated on either side of the last nearest point.
const NEIGHBORS: usize = 3;
/// Largest number of steps to a neighbor block with a closer point in one call.
const MAX_DESCENT: usize = 64;
/// Largest number of samples of a curve evaluated in one call.
const MAX_SAMPLES: usize = 64;
/// Largest number of Newton iterations in one call; two or three suffice.
const MAX_NEWTON: usize = 16;
/// Step size at which Newton's method ends, m or rad.
const NEWTON_TOLERANCE: f64 = 1e-13;
/// Range of the quadratic approximation of a curve, as a fraction of its block.
const QUADRATIC_REACH: f64 = 3e-4;
/// Smallest denominator of Newton's method, as a fraction of the squared tangent: beyond the radius of
/// curvature there is no nearest point.
const MIN_DENOMINATOR: f64 = 0.2;
/// Largest half angle of an arc on which all poses are evaluated together, rad.
const MAX_HALF_ANGLE: f64 = 1.5;
/// Distance that foot points on a curve keep from the ends of the search range, m.
const CLEARANCE: f64 = 1e-9;
/// Lever arm that converts an angle to a distance, m. Where the tip is fixed while the tool axis turns, the
/// orientation selects the nearest point.
const ORIENTATION_ARM: f64 = 0.1;

/// Part of the path that is searched: block and arc length of both ends.
#[derive(Debug, Clone, Copy)]
struct SearchWindow {
    from: (usize, f64),
    to: (usize, f64),
}

/// A point of the path and its distance from the tool tip.
#[derive(Debug, Clone, Copy)]
struct Candidate {
    block: usize,
    s: f64,
    progress: f64,
    point: Vector3<f64>,
    distance: f64,
}

/// Nearest-point search along a path on the continuous curve.
///
/// The nearest point is searched from a little before the furthest one so far up to the progress commanded
/// so far, so that a path that passes the same point twice is followed in order. Lines and circles with
/// fixed rotary tables are evaluated in closed form; other curves are sampled once and refined by Newton's
/// method. Where the tip is fixed, the nearest tool axis selects the point. The poses of a position cycle are evaluated
/// together where the search range lies in one smooth block, otherwise one by one. The cost of a call does not depend on
/// the length of the path.
#[derive(Debug, Clone)]
pub struct PathTracker {
    path: Arc<Path>,
    /// Tip curves of the blocks, shared by clones.
    shapes: Arc<[TipCurve]>,
    /// Directions of the path at both ends, if the tip moves there.
    ends: [Option<Vector3<f64>>; 2],
    /// Largest progress of a nearest point so far.
    furthest: f64,
    /// Block of the last nearest point.
    block: usize,
    s: f64,
    /// Foot points of poses: arc lengths, or tangents of angles on an arc.
    feet: Vec<f64>,
    /// Estimates of the arc lengths.
    guesses: Vec<f64>,
    angles: ToolAngles,
    scratch: Scratch,
}

impl PathTracker {
    /// Creates a tracker at the start of `path`.
    pub fn new(path: Arc<Path>) -> Self {
        let mut scratch = Scratch::new(path.joint_count());
        let shapes: Arc<[TipCurve]> =
            (0..path.blocks().len()).map(|block| TipCurve::new(&path, block, &mut scratch)).collect();
        let last = shapes.len() - 1;
        let end = path.blocks()[last].length();
        let ends =
            [(0, 0.0), (last, end)].map(|(block, s)| shapes[block].direction(&path, block, s, &mut scratch));
        Self {
            path,
            shapes,
            ends,
            furthest: 0.0,
            block: 0,
            s: 0.0,
            feet: Vec::new(),
            guesses: Vec::new(),
            angles: ToolAngles::default(),
            scratch,
        }
    }

    /// Returns the path.
    pub fn path(&self) -> &Arc<Path> {
        &self.path
    }

    /// Returns the largest progress of a nearest point so far.
    pub fn furthest(&self) -> f64 {
        self.furthest
    }

    /// Returns the nearest point to one pose, as [`follow`](Self::follow) does.
    pub fn nearest(&mut self, pose: &ToolPose, until: f64) -> NearestPoint {
        self.follow_all(&Poses::of(pose), |_| until, &mut PathDeviations::default())
    }

    /// Computes the deviations of consecutive `poses` and replaces the contents of `found` by them. Returns the nearest
    /// point to the first pose, `None` without a pose.
    ///
    /// `until` returns the progress commanded at the pose of an index; it never decreases. The search starts at the last
    /// nearest point.
    pub fn follow(
        &mut self,
        poses: &Poses,
        until: impl FnMut(usize) -> f64,
        found: &mut PathDeviations,
    ) -> Option<NearestPoint> {
        (!poses.is_empty()).then(|| self.follow_all(poses, until, found))
    }

    fn follow_all(
        &mut self,
        poses: &Poses,
        mut until: impl FnMut(usize) -> f64,
        found: &mut PathDeviations,
    ) -> NearestPoint {
        found.resize(poses.len());
        let window = self.window(until(poses.len() - 1));
        if let Some(first) = self.follow_block(poses, window, found) {
            return first;
        }
        let first = self.nearest_one(&poses.get(0), until(0));
        found.fill_from(0, &first);
        if !poses.is_constant() {
            for index in 1..poses.len() {
                found.fill_from(index, &self.nearest_one(&poses.get(index), until(index)));
            }
        }
        first
    }

    /// Returns the part of the path from a little before the furthest nearest point so far up to the progress `until`.
    fn window(&self, until: f64) -> SearchWindow {
        let until = until.clamp(0.0, self.path.length()).max(self.furthest);
        let from = (self.furthest - SEARCH_BACK).max(0.0);
        SearchWindow { from: self.path.locate(from), to: self.path.locate(until) }
    }

    /// Searches the nearest point to a single pose and advances to it.
    fn nearest_one(&mut self, pose: &ToolPose, until: f64) -> NearestPoint {
        let best = self.search(pose, self.window(until));
        if best.s.is_finite() {
            self.furthest = self.furthest.max(best.progress);
            (self.block, self.s) = (best.block, best.s);
        }
        let axis = self.shapes[best.block].axis(&self.path, best.block, best.s, &mut self.scratch);
        NearestPoint {
            progress: best.progress,
            point: best.point,
            axis,
            distance: best.distance,
            within_ends: self.within_ends(best.progress, pose.tip - best.point, best.distance),
            orientation: tool_angle(&axis, &pose.axis),
        }
    }

    /// Computes the deviations of all poses together if the window lies in one block, a line, an arc of less than half a
    /// turn or a smooth curve. Returns the nearest point to the first pose and advances to that of the last one; `None`,
    /// without a change of the tracker, if each pose must be searched.
    fn follow_block(
        &mut self,
        poses: &Poses,
        window: SearchWindow,
        found: &mut PathDeviations,
    ) -> Option<NearestPoint> {
        let (block, low, high) = (window.from.0, window.from.1, window.to.1.max(window.from.1));
        if block != window.to.0 {
            return None;
        }
        let shapes = Arc::clone(&self.shapes);
        self.feet.resize(poses.len(), 0.0);
        let (feet, distances) = (&mut self.feet[..], &mut found.distance[..]);
        // Foot points at both ends of the window, and the arc length of a foot point.
        let mut ends = [low, high];
        let mut middle = None;
        match &shapes[block] {
            TipCurve::Segment { from, slope, .. } => {
                vectorize(LineFeet {
                    poses,
                    from: *from,
                    slope: *slope,
                    window: [low, high],
                    feet,
                    distances,
                });
            }
            TipCurve::Circle { center, plane: [x, y, z], radius, start, turn, .. } => {
                let half = 0.5 * (high - low) * turn.abs();
                if half > MAX_HALF_ANGLE {
                    return None;
                }
                let s = 0.5 * (low + high);
                let ((sine, cosine), bound) = ((start + turn * s).sin_cos(), half.tan());
                let frame = [x * cosine + y * sine, (y * cosine - x * sine) * turn.signum(), *z];
                vectorize(ArcFeet { poses, center: *center, frame, radius: *radius, bound, feet, distances });
                ends = [-bound, bound];
                middle = Some((s, turn.abs()));
            }
            TipCurve::Sampled { samples, cells: Some(cells), .. } => {
                let spacing = self.path.blocks()[block].length() / (samples.len() - 1) as f64;
                let curve = SampledCurve { samples, spacing, cells };
                self.follow_curve(poses, block, [low, high], curve, found)?;
            }
            _ => return None,
        }
        let arc_length = |foot: f64| match middle {
            _ if foot <= ends[0] => low,
            _ if foot >= ends[1] => high,
            Some((s, turn)) => s + foot.atan() / turn,
            None => foot,
        };
        let [first, last] = [self.feet[0], self.feet[poses.len() - 1]].map(arc_length);
        let furthest = arc_length(largest(&self.feet));
        let shape = &shapes[block];
        let axis = shape.axis(&self.path, block, first, &mut self.scratch);
        if shape.cells().is_none() {
            match poses.constant_axis() {
                Some(tool) => found.orientation.fill(tool_angle(&axis, &tool)),
                None => {
                    let angles = found.orientation.iter_mut().enumerate();
                    angles.for_each(|(index, angle)| *angle = tool_angle(&axis, &poses.get(index).axis));
                }
            }
        }
        found.within_ends.copy_from_slice(&found.distance);
        let start = self.path.start_of(block);
        let of_window =
            [(start + low <= 0.0, low, 0.0), (start + high >= self.path.length(), high, start + high)];
        for (end, (is_end, s, progress)) in of_window.into_iter().enumerate() {
            if is_end {
                let point = shape.point(&self.path, block, s, &mut self.scratch);
                for index in (0..poses.len()).filter(|index| self.feet[*index] == ends[end]) {
                    found.within_ends[index] =
                        self.within_ends(progress, poses.tip(index) - point, found.distance[index]);
                }
            }
        }
        let progress = |s: f64| (start + s).min(self.path.start_of(block + 1));
        if last.is_finite() {
            self.furthest = self.furthest.max(progress(furthest));
            (self.block, self.s) = (block, last);
        }
        Some(NearestPoint {
            progress: progress(first),
            point: shape.point(&self.path, block, first, &mut self.scratch),
            axis,
            distance: found.distance[0],
            within_ends: found.within_ends[0],
            orientation: found.orientation[0],
        })
    }

    /// Finds the foot points and deviations of all poses on a curve near the last nearest point; `None` if one is not
    /// found within the window, or if another point of the window could be nearer.
    fn follow_curve(
        &mut self,
        poses: &Poses,
        block: usize,
        [low, high]: [f64; 2],
        curve: SampledCurve<'_>,
        found: &mut PathDeviations,
    ) -> Option<()> {
        let (count, cells) = (poses.len(), curve.cells);
        let begin = if self.block == block { self.s.clamp(low, high) } else { low };
        let (point, tangent, _) = cells.tip_derivatives(begin);
        let slope = tangent / tangent.norm_squared();
        self.angles.resize(count);
        self.guesses.resize(count, 0.0);
        self.feet.fill(f64::NAN);
        let [xs, ys, zs] = poses.tips();
        for (guess, ((x, y), z)) in self.guesses.iter_mut().zip(xs.iter().zip(ys).zip(zs)) {
            *guess = begin + (x - point.x) * slope.x + (y - point.y) * slope.y + (z - point.z) * slope.z;
        }
        let ends = [self.guesses[0], self.guesses[count - 1]].map(|s| cells.index_at(s));
        for cell in &cells.cells()[ends[0].min(ends[1])..=ends[0].max(ends[1])] {
            let (guesses, feet, angles) = (&self.guesses[..], &mut self.feet[..], &mut self.angles);
            vectorize(CellFeet { cell, poses, guesses, feet, distances: &mut found.distance, angles });
        }
        if self.feet.iter().any(|s| s.is_nan()) {
            return None;
        }
        let least = self.feet.iter().copied().fold(f64::INFINITY, f64::min);
        let range = [least, largest(&self.feet)];
        let is_inside = range[0] > low + CLEARANCE && range[1] < high - CLEARANCE;
        let distance = largest(&found.distance);
        if !is_inside || !curve.are_nearest(poses, range, distance, [low, high]) {
            return None;
        }
        self.angles.write_angles(&mut found.orientation);
        Some(())
    }

    /// Returns [`NearestPoint::within_ends`] for a nearest point at `progress` with the vector `error` to the tip, m, of
    /// the length `distance`.
    fn within_ends(&self, progress: f64, error: Vector3<f64>, distance: f64) -> f64 {
        let direction = if progress >= self.path.length() {
            self.ends[1]
        } else if progress <= 0.0 {
            self.ends[0].map(|direction| -direction)
        } else {
            None
        };
        let Some(outwards) = direction else { return distance };
        let along = error.dot(&outwards);
        if along > 0.0 { (error - outwards * along).norm() } else { distance }
    }

    fn search(&mut self, pose: &ToolPose, window: SearchWindow) -> Candidate {
        let (first, last) = (window.from.0, window.to.0);
        let mut best = None;
        let count = last - first + 1;
        if count <= MAX_BLOCKS {
            for block in first..=last {
                self.consider_block(pose, window, block, &mut best);
            }
        } else {
            let here = self.block.clamp(first, last);
            for block in here.saturating_sub(NEIGHBORS).max(first)..=(here + NEIGHBORS).min(last) {
                self.consider_block(pose, window, block, &mut best);
            }
            let spread = MAX_BLOCKS - 2 * NEIGHBORS - 1;
            for i in 0..spread {
                self.consider_block(pose, window, first + (count - 1) * i / (spread - 1), &mut best);
            }
            self.descend(pose, window, &mut best);
        }
        // The window contains a block, and each block has a candidate.
        best.unwrap_or_else(|| self.candidate_at(pose, self.block, self.s))
    }

    /// Evaluates neighbor blocks while they contain closer points.
    fn descend(&mut self, pose: &ToolPose, window: SearchWindow, best: &mut Option<Candidate>) {
        let (first, last) = (window.from.0, window.to.0);
        for _ in 0..MAX_DESCENT {
            let Some(at) = best.map(|best| best.block) else { return };
            for block in [at.saturating_sub(1).max(first), (at + 1).min(last)] {
                self.consider_block(pose, window, block, best);
            }
            if best.is_none_or(|best| best.block == at) {
                return;
            }
        }
    }

    fn consider_block(
        &mut self,
        pose: &ToolPose,
        window: SearchWindow,
        block: usize,
        best: &mut Option<Candidate>,
    ) {
        let low = if block == window.from.0 { window.from.1 } else { 0.0 };
        let high = if block == window.to.0 { window.to.1 } else { self.path.blocks()[block].length() };
        let candidate = self.nearest_in_block(pose, block, low, high.max(low));
        let better = best.is_none_or(|best| self.is_better(pose, &candidate, &best));
        if better {
            *best = Some(candidate);
        }
    }

    /// Returns true if `a` is closer than `b`, or equally close and earlier in order.
    fn is_better(&mut self, pose: &ToolPose, a: &Candidate, b: &Candidate) -> bool {
        let both_move = self.shapes[a.block].is_tip_moving() && self.shapes[b.block].is_tip_moving();
        let (a_cost, b_cost) =
            if both_move { (a.distance, b.distance) } else { (self.cost(pose, a), self.cost(pose, b)) };
        if (a_cost - b_cost).abs() > DISTANCE_TOLERANCE {
            return a_cost < b_cost;
        }
        let ahead = |candidate: &Candidate| candidate.progress >= self.furthest - ORDER_TOLERANCE;
        match (ahead(a), ahead(b)) {
            (true, true) => a.progress < b.progress,
            (false, false) => a.progress > b.progress,
            (a_ahead, _) => a_ahead,
        }
    }

    /// Returns the distance combined with the angle between the tool axes, m.
    fn cost(&mut self, pose: &ToolPose, candidate: &Candidate) -> f64 {
        let Candidate { block, s, distance, .. } = *candidate;
        let axis = self.shapes[block].axis(&self.path, block, s, &mut self.scratch);
        distance.hypot(ORIENTATION_ARM * tool_angle(&axis, &pose.axis))
    }

    fn candidate(&self, block: usize, s: f64, point: Vector3<f64>, distance: f64) -> Candidate {
        let progress = (self.path.start_of(block) + s).min(self.path.start_of(block + 1));
        Candidate { block, s, progress, point, distance }
    }

    /// Returns the candidate at `s` of a block.
    fn candidate_at(&mut self, pose: &ToolPose, block: usize, s: f64) -> Candidate {
        let point = self::pose(&self.path, block, s, &mut self.scratch).tip;
        self.candidate(block, s, point, (pose.tip - point).norm())
    }

    /// Returns the nearest point of a block between `low` and `high`.
    fn nearest_in_block(&mut self, pose: &ToolPose, block: usize, low: f64, high: f64) -> Candidate {
        match &self.shapes[block] {
            TipCurve::Segment { from, slope, .. } => {
                let (from, slope) = (*from, *slope);
                let s = line_parameter(pose.tip, from, slope).clamp(low, high);
                let length = self.path.blocks()[block].length();
                if s <= 0.0 || s >= length {
                    return self.candidate_at(pose, block, s);
                }
                let point = from + slope * s;
                self.candidate(block, s, point, (pose.tip - point).norm())
            }
            TipCurve::Circle { center, plane, radius, start, turn, .. } => {
                let (center, plane, radius, turn) = (*center, *plane, *radius, *turn);
                let ([x, y, z], off) = circle_coordinates(pose.tip, center, &plane);
                let angle = ((y.atan2(x) - start) * turn.signum()).rem_euclid(TAU);
                let ahead = self.furthest - ORDER_TOLERANCE - self.path.start_of(block);
                match select_passage(angle / turn.abs(), TAU / turn.abs(), low, high, ahead) {
                    Some(s) if off > 0.0 => {
                        let point = center + (plane[0] * x + plane[1] * y) * (radius / off);
                        self.candidate(block, s, point, distance_to_circle(off, z, radius))
                    }
                    _ => self.nearer_end(pose, block, low, high),
                }
            }
            TipCurve::Sampled { .. } | TipCurve::Reorientation { .. } => {
                self.nearest_in_curve(pose, block, low, high)
            }
            // The progress is undetermined within a fixed block.
            TipCurve::Fixed => self.candidate_at(pose, block, high),
        }
    }

    fn nearer_end(&mut self, pose: &ToolPose, block: usize, low: f64, high: f64) -> Candidate {
        let (a, b) = (self.candidate_at(pose, block, low), self.candidate_at(pose, block, high));
        if self.is_better(pose, &b, &a) { b } else { a }
    }

    /// Returns the nearest point of a curve without a closed form, refined from the last one and from the
    /// best sample.
    fn nearest_in_curve(&mut self, pose: &ToolPose, block: usize, low: f64, high: f64) -> Candidate {
        let shape = &self.shapes[block];
        let (TipCurve::Sampled { samples, .. } | TipCurve::Reorientation { samples }) = shape else {
            return self.nearer_end(pose, block, low, high);
        };
        let target = if shape.is_tip_moving() { pose.tip } else { pose.axis };
        let spacing = self.path.blocks()[block].length() / (samples.len() - 1) as f64;
        let (from, to) = ((low / spacing).ceil() as usize, (high / spacing).floor() as usize);
        let to = to.min(samples.len() - 1);
        let stride = (to.saturating_sub(from) / MAX_SAMPLES).max(1);
        let inner = (from..=to).step_by(stride);
        let sampled = inner.map(|i| ((samples[i] - target).norm_squared(), i as f64 * spacing));
        let sampled = sampled.min_by(|a, b| a.0.total_cmp(&b.0));
        let last = (self.block == block).then_some(self.s.clamp(low, high));
        let begin = last.or(sampled.map(|(_, s)| s)).unwrap_or(low);
        let mut best = self.refine(pose, block, begin, low, high);
        if let Some((_, s)) = sampled.filter(|(_, s)| (s - best.s).abs() > 2.0 * stride as f64 * spacing) {
            let other = self.refine(pose, block, s, low, high);
            if self.is_better(pose, &other, &best) {
                best = other;
            }
        }
        best
    }

    /// Solves (target − q(s))·q'(s) = 0 by Newton's method from `s`, with a quadratic approximation of the
    /// curve.
    fn refine(&mut self, pose: &ToolPose, block: usize, s: f64, low: f64, high: f64) -> Candidate {
        let shape = &self.shapes[block];
        let target = if shape.is_tip_moving() { pose.tip } else { pose.axis };
        // The derivatives of polynomials are cheap.
        let reach = match shape.cells() {
            Some(_) => 0.0,
            None => QUADRATIC_REACH * self.path.blocks()[block].length(),
        };
        let mut s = s.clamp(low, high);
        let mut expansion = (s, shape.local_derivatives(&self.path, block, s, &mut self.scratch));
        let mut point = expansion.1.0;
        for _ in 0..MAX_NEWTON {
            if (s - expansion.0).abs() > reach {
                expansion = (s, shape.local_derivatives(&self.path, block, s, &mut self.scratch));
                point = expansion.1.0;
            }
            let (from, (_, slope, bend)) = expansion;
            let tangent = slope + bend * (s - from);
            let error = target - point;
            let square = tangent.norm_squared();
            let denominator = (square - error.dot(&bend)).max(MIN_DENOMINATOR * square);
            let next = (s + error.dot(&tangent) / denominator).clamp(low, high);
            // The comparison ends the iteration at NaN too.
            let moves = (next - s).abs() > NEWTON_TOLERANCE;
            if !moves {
                break;
            }
            s = next;
            point = shape.point(&self.path, block, s, &mut self.scratch);
        }
        let point = if shape.is_tip_moving() {
            point
        } else {
            self::pose(&self.path, block, s, &mut self.scratch).tip
        };
        self.candidate(block, s, point, (pose.tip - point).norm())
    }
}
