//! A stretch of poses at once, where the path has a closed form.
//!
//! Along a line or a circle the nearest point need not be sought for every pose: once it is known that the feet
//! of all of them lie in the block, inside of what would be searched, the distance follows from the pose alone.
//! What is computed then is what the search computes, so that the distances are the same bits.

use nalgebra::Vector3;

use super::{BACK, Nearest, PathTracker};
use crate::assess::path_shape::Shape;
use crate::kinematics::Poses;

/// How far from the ends of what is searched all feet must lie, m: more than rounding moves them.
const CLEAR: f64 = 1e-9;
/// Least angle from one foot on a circle to the next, rad, that surely is one forwards.
const FORWARDS: f64 = 1e-9;

/// How far poses that follow each other are from a path.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Deviations {
    /// [`Nearest::distance`] of each, m.
    pub distance: Vec<f64>,
    /// [`Nearest::within_ends`] of each, m.
    pub within_ends: Vec<f64>,
    /// [`Nearest::orientation`] of each, rad.
    pub orientation: Vec<f64>,
}

impl Deviations {
    /// Forgets all of them.
    pub fn clear(&mut self) {
        self.distance.clear();
        self.within_ends.clear();
        self.orientation.clear();
    }

    /// Adds those of one pose.
    pub fn push(&mut self, nearest: &Nearest) {
        self.distance.push(nearest.distance);
        self.within_ends.push(nearest.within_ends);
        self.orientation.push(nearest.orientation);
    }
}

/// A stretch of poses that was followed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Followed {
    /// What is nearest to the first of them.
    pub first: Nearest,
    /// Whether it took a closed form of the path, and not a search for each of them.
    pub closed_form: bool,
}

/// What is searched, as lengths in the one block that holds all of it.
#[derive(Debug, Clone, Copy)]
struct Reach {
    block: usize,
    /// Progress at the start of the block.
    start: f64,
    /// From where on at the first pose.
    low: f64,
    /// Up to where at the first pose, and at the last one.
    high: [f64; 2],
}

/// Distance from a line through `from`, and how far along it the foot lies.
#[inline(always)]
pub(super) fn from_line(tip: Vector3<f64>, from: Vector3<f64>, slope: Vector3<f64>) -> f64 {
    slope.dot(&(tip - from)) / slope.norm_squared()
}

/// Coordinates of a tip in the frame of a circle, and its distance from the circle's axis.
#[inline(always)]
pub(super) fn from_axis(
    tip: Vector3<f64>,
    centre: Vector3<f64>,
    plane: &[Vector3<f64>; 3],
) -> ([f64; 3], f64) {
    let out = tip - centre;
    let [x, y, z] = plane.map(|vector| vector.dot(&out));
    ([x, y, z], (x * x + y * y).sqrt())
}

/// Distance from a circle of what lies `off` its axis and `z` off its plane.
#[inline(always)]
pub(super) fn from_circle(off: f64, z: f64, radius: f64) -> f64 {
    let outside = off - radius;
    (outside * outside + z * z).sqrt()
}

impl PathTracker {
    /// As [`nearest`](Self::nearest) for each of `poses`, one after the other: what they deviate by goes to
    /// `found`, in the place of what was there. `until` tells by the place of a pose what has been commanded by
    /// then; it never decreases. None without a pose.
    pub fn follow(
        &mut self,
        poses: &Poses,
        mut until: impl FnMut(usize) -> f64,
        found: &mut Deviations,
    ) -> Option<Followed> {
        found.clear();
        let last = poses.len().checked_sub(1)?;
        let before = self.furthest;
        let begin = until(0);
        let first = self.nearest(&poses.get(0), begin);
        found.push(&first);
        let reach = if last > 1 { self.reach(before, [begin, until(last)]) } else { None };
        let closed_form = poses.only_axis().and(reach).is_some_and(|reach| {
            let inside = self.follow_line(poses, reach, found) || self.follow_circle(poses, reach, found);
            if !inside {
                found.distance.truncate(1);
            }
            inside
        });
        if closed_form {
            // The tool axis stands still, and so does that of the path.
            found.orientation.resize(last, first.orientation);
            found.within_ends.extend_from_slice(&found.distance[1..]);
            found.push(&self.nearest(&poses.get(last), until(last)));
        } else {
            for place in 1..=last {
                let nearest = self.nearest(&poses.get(place), until(place));
                found.push(&nearest);
            }
        }
        Some(Followed { first, closed_form })
    }

    /// What is searched for poses, the first of which has been sought already, if it lies in one block.
    /// `before` is the furthest nearest point before that.
    fn reach(&self, before: f64, until: [f64; 2]) -> Option<Reach> {
        let block = self.block;
        let holds = |progress: f64| self.path.locate(progress).0 == block;
        let (start, length) = (self.path.start_of(block), self.path.blocks()[block].length());
        let low = (before - BACK).max(0.0);
        let [first, last] = until.map(|until| until.clamp(0.0, self.path.length()));
        let (first, last) = (first.max(before), last.max(self.furthest));
        (holds(low) && holds(last)).then(|| Reach {
            block,
            start,
            low: low - start,
            high: [first, last].map(|high| (high - start).min(length)),
        })
    }

    /// Distances of all poses but the first and the last from a line, as long as all feet, those of the two
    /// included, lie inside of what is searched.
    fn follow_line(&mut self, poses: &Poses, reach: Reach, found: &mut Deviations) -> bool {
        let Shape::Segment { from, slope, .. } = &self.shapes[reach.block] else { return false };
        let (from, slope) = (*from, *slope);
        let last = poses.len() - 1;
        let [xs, ys, zs] = poses.tips();
        let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
        let mut before_last = f64::NEG_INFINITY;
        // Written so that what is no number is not inside.
        let mut inside = true;
        let mut see = |place: usize| {
            let tip = Vector3::new(xs[place], ys[place], zs[place]);
            let s = from_line(tip, from, slope);
            inside &= s > CLEAR && s < reach.high[0] - CLEAR;
            least = if s < least { s } else { least };
            most = if s > most { s } else { most };
            let point = from + slope * s;
            (tip - point).norm()
        };
        see(0);
        for place in 1..last {
            let distance = see(place);
            found.distance.push(distance);
        }
        see(last);
        for place in 1..last {
            let s = from_line(poses.tip(place), from, slope);
            before_last = if s > before_last { s } else { before_last };
        }
        let furthest = self.furthest.max(self.path.start_of(reach.block) + most);
        let low = (furthest - BACK - reach.start).max(reach.low);
        let inside = inside && least > low + CLEAR && self.is_within_ends(reach, least, most);
        if inside {
            let progress = (reach.start + before_last).min(self.path.start_of(reach.block + 1));
            self.furthest = self.furthest.max(progress);
        }
        inside
    }

    /// Distances of all poses but the first and the last from a circle, as long as each foot lies clearly ahead
    /// of the one before, and all inside of what is searched.
    ///
    /// The first one has been found between both ends. What is searched ends further ahead at each pose, and
    /// begins behind the furthest foot so far: those that lie ahead of each other lie behind that begin never, and
    /// before that end if the last one lies before the end that the first one had. There is one passage only
    /// to choose for each if less than a turn is searched.
    fn follow_circle(&mut self, poses: &Poses, reach: Reach, found: &mut Deviations) -> bool {
        let Shape::Circle { centre, plane, radius, turn, .. } = &self.shapes[reach.block] else {
            return false;
        };
        let (centre, plane, radius, turn) = (*centre, *plane, *radius, *turn);
        let first = self.s;
        let turn_length = std::f64::consts::TAU / turn.abs();
        let one_turn = reach.high[1] - first.min(reach.low) < turn_length - CLEAR;
        if !(one_turn && first > reach.low + CLEAR && first < reach.high[0] - CLEAR) {
            return false;
        }
        let last = poses.len() - 1;
        let [xs, ys, zs] = poses.tips();
        let least = FORWARDS * radius * radius;
        let at = |place: usize| from_axis(Vector3::new(xs[place], ys[place], zs[place]), centre, &plane);
        let ([x0, y0, _], _) = at(0);
        let direction = turn.signum();
        let (mut x_before, mut y_before) = (x0, y0);
        // Written so that what is no number is not ahead.
        let mut ahead = true;
        let mut see = |place: usize| {
            let ([x, y, z], off) = at(place);
            ahead &= (x_before * y - y_before * x) * direction > least && x0 * x + y0 * y > 0.0;
            (x_before, y_before) = (x, y);
            from_circle(off, z, radius)
        };
        for place in 1..last {
            let distance = see(place);
            found.distance.push(distance);
        }
        see(last);
        let (x, y) = (x_before, y_before);
        let swept = ((x0 * y - y0 * x) * direction).atan2(x0 * x + y0 * y);
        let end = first + swept / turn.abs();
        ahead && end < reach.high[0] - CLEAR && self.is_within_ends(reach, first, end)
    }

    /// Whether what lies between two lengths in a block lies between the ends of the block and of the path.
    fn is_within_ends(&self, reach: Reach, least: f64, most: f64) -> bool {
        let length = self.path.blocks()[reach.block].length();
        least > CLEAR
            && most < length - CLEAR
            && reach.start + least > 0.0
            && reach.start + most + CLEAR < self.path.length()
    }
}
