//! Distance from a geometric path.

mod follow;

use std::f64::consts::TAU;
use std::sync::Arc;

use nalgebra::Vector3;

use super::path_shape::{Room, Shape, pose};
use crate::kinematics::ToolPose;
use crate::path::Path;

pub use follow::{Deviations, Followed};
use follow::{from_axis, from_circle, from_line};

/// How far behind the furthest nearest point the next one may lie, m or rad: an axis that swings back.
const BACK: f64 = 5e-3;
/// How far behind it a point still counts as ahead, m or rad, when two are as near.
const SLACK: f64 = 1e-5;
/// Distances that differ by less, m, are the same: two passages of one place.
const SAME: f64 = 1e-12;
/// Blocks looked at in one call; of more, some around the last nearest point and some spread out.
const MAX_BLOCKS: usize = 16;
/// Of these, those around the last nearest point, on either side.
const NEIGHBORS: usize = 3;
/// Steps from block to block towards a nearer one, in one call.
const MAX_WALK: usize = 64;
/// Samples of a curve looked at in one call.
const MAX_SAMPLES: usize = 64;
/// Newton's steps in one call; two or three suffice.
const MAX_NEWTON: usize = 16;
/// Newton's steps smaller than that, m or rad, are rounding.
const NEWTON_TOLERANCE: f64 = 1e-13;
/// How far a curve is taken for a quadratic, as a part of its block.
const QUADRATIC_REACH: f64 = 3e-4;
/// Least part of the tangent's square that Newton's denominator keeps: further from the curve than its
/// radius there is no nearest point to find.
const MIN_DENOMINATOR: f64 = 0.2;
/// Arm that makes an angle comparable with a distance, m: where the tip stands still while the axis
/// turns, the orientation must tell that place from its neighbors.
const ARM: f64 = 0.1;

/// The point of a path that is nearest to a pose of the tool.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Nearest {
    /// Its progress along the path ([`Path::length`]).
    pub progress: f64,
    /// The point, workpiece frame, m.
    pub point: Vector3<f64>,
    /// The path's tool axis there.
    pub axis: Vector3<f64>,
    /// Distance of the tips, m: the contour error.
    pub distance: f64,
    /// The distance without what overshoots the path's two ends, m: that to the path continued
    /// straight beyond its first and last point.
    pub within_ends: f64,
    /// Angle between the tool axes, rad: the orientation error.
    pub orientation: f64,
}

/// A place on the path and how far it is.
#[derive(Debug, Clone, Copy)]
struct Candidate {
    block: usize,
    s: f64,
    progress: f64,
    point: Vector3<f64>,
    distance: f64,
}

/// Follows a pose along a path: the nearest point on the continuous curve, not on samples of it.
///
/// It is sought from a little behind the furthest one found so far up to what has been commanded, so
/// that a path that passes a place twice is followed in its order. Lines and circles along which the
/// tables stand still are closed forms, other curves are sampled once and refined by Newton's method.
/// Where the tip stands still, the nearest point is that of the nearest tool axis. A call allocates
/// nothing, and costs the same however long the path is.
#[derive(Debug, Clone)]
pub struct PathTracker {
    path: Arc<Path>,
    /// Shared by clones.
    shapes: Arc<[Shape]>,
    /// Directions of the path at both ends, where the tip moves there.
    ends: [Option<Vector3<f64>>; 2],
    /// Largest progress of a nearest point so far.
    furthest: f64,
    /// The last nearest one.
    block: usize,
    s: f64,
    /// The last call, if it found the tracker as it left it: the same one would find the same.
    last: Option<Call>,
    /// Room for where the feet of poses are.
    feet: [Vec<f64>; 2],
    room: Room,
}

/// What was asked for, and what was found.
#[derive(Debug, Clone, Copy)]
struct Call {
    pose: ToolPose,
    until: f64,
    nearest: Nearest,
}

impl Call {
    fn is_for(&self, pose: &ToolPose, until: f64) -> bool {
        let bits = |vector: &Vector3<f64>| [vector.x, vector.y, vector.z].map(f64::to_bits);
        self.until == until
            && bits(&self.pose.tip) == bits(&pose.tip)
            && bits(&self.pose.axis) == bits(&pose.axis)
    }
}

impl PathTracker {
    /// A tracker at the start of `path`.
    pub fn new(path: Arc<Path>) -> Self {
        let mut room = Room::new(path.joint_count());
        let shapes: Arc<[Shape]> =
            (0..path.blocks().len()).map(|block| Shape::new(&path, block, &mut room)).collect();
        let last = shapes.len() - 1;
        let end = path.blocks()[last].length();
        let ends =
            [(0, 0.0), (last, end)].map(|(block, s)| shapes[block].direction(&path, block, s, &mut room));
        Self {
            path,
            shapes,
            ends,
            furthest: 0.0,
            block: 0,
            s: 0.0,
            last: None,
            feet: [Vec::new(), Vec::new()],
            room,
        }
    }

    /// The path.
    pub fn path(&self) -> &Arc<Path> {
        &self.path
    }

    /// The nearest point of what has been commanded so far, progress ≤ `until`, sought from the last
    /// nearest one.
    pub fn nearest(&mut self, pose: &ToolPose, until: f64) -> Nearest {
        let until = until.clamp(0.0, self.path.length()).max(self.furthest);
        if let Some(last) = self.last.filter(|last| last.is_for(pose, until)) {
            return last.nearest;
        }
        let before = (self.furthest, self.block, self.s);
        let from = (self.furthest - BACK).max(0.0);
        let window = (self.path.locate(from), self.path.locate(until));
        let best = self.search(pose, window);
        if best.s.is_finite() {
            self.furthest = self.furthest.max(best.progress);
            (self.block, self.s) = (best.block, best.s);
        }
        let axis = self.shapes[best.block].axis(&self.path, best.block, best.s, &mut self.room);
        let nearest = Nearest {
            progress: best.progress,
            point: best.point,
            axis,
            distance: best.distance,
            within_ends: self.within_ends(&best, pose),
            orientation: angle(&axis, &pose.axis),
        };
        let stays = before == (self.furthest, self.block, self.s);
        self.last = stays.then_some(Call { pose: *pose, until, nearest });
        nearest
    }

    /// See [`Nearest::within_ends`].
    fn within_ends(&self, best: &Candidate, pose: &ToolPose) -> f64 {
        let direction = if best.progress >= self.path.length() {
            self.ends[1]
        } else if best.progress <= 0.0 {
            self.ends[0].map(|direction| -direction)
        } else {
            None
        };
        let Some(outwards) = direction else { return best.distance };
        let error = pose.tip - best.point;
        let along = error.dot(&outwards);
        if along > 0.0 { (error - outwards * along).norm() } else { best.distance }
    }

    fn search(&mut self, pose: &ToolPose, window: ((usize, f64), (usize, f64))) -> Candidate {
        let (first, last) = (window.0.0, window.1.0);
        let mut best = None;
        let count = last - first + 1;
        if count <= MAX_BLOCKS {
            for block in first..=last {
                self.try_block(pose, window, block, &mut best);
            }
        } else {
            let here = self.block.clamp(first, last);
            for block in here.saturating_sub(NEIGHBORS).max(first)..=(here + NEIGHBORS).min(last) {
                self.try_block(pose, window, block, &mut best);
            }
            let spread = MAX_BLOCKS - 2 * NEIGHBORS - 1;
            for i in 0..spread {
                self.try_block(pose, window, first + (count - 1) * i / (spread - 1), &mut best);
            }
            self.walk(pose, window, &mut best);
        }
        // The window has a block, and a block has a candidate.
        best.unwrap_or_else(|| self.still(pose, self.block, self.s))
    }

    /// From block to block as long as that comes nearer.
    fn walk(&mut self, pose: &ToolPose, window: ((usize, f64), (usize, f64)), best: &mut Option<Candidate>) {
        let (first, last) = (window.0.0, window.1.0);
        for _ in 0..MAX_WALK {
            let Some(at) = best.map(|best| best.block) else { return };
            for block in [at.saturating_sub(1).max(first), (at + 1).min(last)] {
                self.try_block(pose, window, block, best);
            }
            if best.is_none_or(|best| best.block == at) {
                return;
            }
        }
    }

    fn try_block(
        &mut self,
        pose: &ToolPose,
        window: ((usize, f64), (usize, f64)),
        block: usize,
        best: &mut Option<Candidate>,
    ) {
        let low = if block == window.0.0 { window.0.1 } else { 0.0 };
        let high = if block == window.1.0 { window.1.1 } else { self.path.blocks()[block].length() };
        let candidate = self.in_block(pose, block, low, high.max(low));
        let better = best.is_none_or(|best| self.is_better(pose, &candidate, &best));
        if better {
            *best = Some(candidate);
        }
    }

    /// Whether `a` is nearer than `b`, or as near and the next one in order.
    fn is_better(&mut self, pose: &ToolPose, a: &Candidate, b: &Candidate) -> bool {
        let both_move = self.shapes[a.block].moves_tip() && self.shapes[b.block].moves_tip();
        let (a_cost, b_cost) =
            if both_move { (a.distance, b.distance) } else { (self.cost(pose, a), self.cost(pose, b)) };
        if (a_cost - b_cost).abs() > SAME {
            return a_cost < b_cost;
        }
        let ahead = |candidate: &Candidate| candidate.progress >= self.furthest - SLACK;
        match (ahead(a), ahead(b)) {
            (true, true) => a.progress < b.progress,
            (false, false) => a.progress > b.progress,
            (a_ahead, _) => a_ahead,
        }
    }

    /// Distance with the angle between the axes, m.
    fn cost(&mut self, pose: &ToolPose, candidate: &Candidate) -> f64 {
        let Candidate { block, s, distance, .. } = *candidate;
        let axis = self.shapes[block].axis(&self.path, block, s, &mut self.room);
        distance.hypot(ARM * angle(&axis, &pose.axis))
    }

    fn candidate(&self, block: usize, s: f64, point: Vector3<f64>, distance: f64) -> Candidate {
        let progress = (self.path.start_of(block) + s).min(self.path.start_of(block + 1));
        Candidate { block, s, progress, point, distance }
    }

    /// The candidate at a given place.
    fn still(&mut self, pose: &ToolPose, block: usize, s: f64) -> Candidate {
        let point = self::pose(&self.path, block, s, &mut self.room).tip;
        self.candidate(block, s, point, (pose.tip - point).norm())
    }

    /// The nearest point of a block between `low` and `high`.
    fn in_block(&mut self, pose: &ToolPose, block: usize, low: f64, high: f64) -> Candidate {
        match &self.shapes[block] {
            Shape::Segment { from, slope, .. } => {
                let (from, slope) = (*from, *slope);
                let s = from_line(pose.tip, from, slope).clamp(low, high);
                let length = self.path.blocks()[block].length();
                if s <= 0.0 || s >= length {
                    return self.still(pose, block, s);
                }
                let point = from + slope * s;
                self.candidate(block, s, point, (pose.tip - point).norm())
            }
            Shape::Circle { center, plane, radius, start, turn, .. } => {
                let (center, plane, radius, turn) = (*center, *plane, *radius, *turn);
                let ([x, y, z], off) = from_axis(pose.tip, center, &plane);
                let angle = ((y.atan2(x) - start) * turn.signum()).rem_euclid(TAU);
                let ahead = self.furthest - SLACK - self.path.start_of(block);
                match passage(angle / turn.abs(), TAU / turn.abs(), low, high, ahead) {
                    Some(s) if off > 0.0 => {
                        let point = center + (plane[0] * x + plane[1] * y) * (radius / off);
                        self.candidate(block, s, point, from_circle(off, z, radius))
                    }
                    _ => self.nearer_end(pose, block, low, high),
                }
            }
            Shape::Curve { .. } | Shape::Turn { .. } => self.in_curve(pose, block, low, high),
            // Nothing tells where on it the pose is.
            Shape::Still => self.still(pose, block, high),
        }
    }

    fn nearer_end(&mut self, pose: &ToolPose, block: usize, low: f64, high: f64) -> Candidate {
        let (a, b) = (self.still(pose, block, low), self.still(pose, block, high));
        if self.is_better(pose, &b, &a) { b } else { a }
    }

    /// The nearest point of a curve without a closed form: from the last one and from the best sample.
    fn in_curve(&mut self, pose: &ToolPose, block: usize, low: f64, high: f64) -> Candidate {
        let shape = &self.shapes[block];
        let (Shape::Curve { samples, .. } | Shape::Turn { samples }) = shape else {
            return self.nearer_end(pose, block, low, high);
        };
        let target = if shape.moves_tip() { pose.tip } else { pose.axis };
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

    /// Newton's method for (target − q(s))·q'(s) = 0 from `s`, by a quadratic of the curve there.
    fn refine(&mut self, pose: &ToolPose, block: usize, s: f64, low: f64, high: f64) -> Candidate {
        let shape = &self.shapes[block];
        let target = if shape.moves_tip() { pose.tip } else { pose.axis };
        let reach = QUADRATIC_REACH * self.path.blocks()[block].length();
        let mut s = s.clamp(low, high);
        let mut local = (s, shape.local(&self.path, block, s, &mut self.room));
        let mut point = local.1.0;
        for _ in 0..MAX_NEWTON {
            if (s - local.0).abs() > reach {
                local = (s, shape.local(&self.path, block, s, &mut self.room));
                point = local.1.0;
            }
            let (from, (_, slope, bend)) = local;
            let tangent = slope + bend * (s - from);
            let error = target - point;
            let square = tangent.norm_squared();
            let denominator = (square - error.dot(&bend)).max(MIN_DENOMINATOR * square);
            let next = (s + error.dot(&tangent) / denominator).clamp(low, high);
            // Written so that NaN ends it too: nothing moves there.
            let moves = (next - s).abs() > NEWTON_TOLERANCE;
            if !moves {
                break;
            }
            s = next;
            point = shape.point(&self.path, block, s, &mut self.room);
        }
        let point =
            if shape.moves_tip() { point } else { self::pose(&self.path, block, s, &mut self.room).tip };
        self.candidate(block, s, point, (pose.tip - point).norm())
    }
}

/// Of the places s, s + period, …, the first between `low` and `high` that is not before `ahead`, or
/// else the last of them.
fn passage(s: f64, period: f64, low: f64, high: f64, ahead: f64) -> Option<f64> {
    let first_from = |bound: f64| s + ((bound - s) / period).ceil().max(0.0) * period;
    let next = first_from(low.max(ahead));
    let place = if next <= high { next } else { s + ((high - s) / period).floor() * period };
    (low..=high).contains(&place).then_some(place)
}

/// Angle between two unit vectors, rad; exact for small ones.
fn angle(a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
    // As it is on all paths along which the tables stand still.
    if a == b { 0.0 } else { a.cross(b).norm().atan2(a.dot(b)) }
}
