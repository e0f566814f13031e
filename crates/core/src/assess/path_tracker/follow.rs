//! A stretch of poses at once, where the path has a closed form.
//!
//! Along a line or a circle the nearest point need not be sought for every pose: once it is known that the feet
//! of all of them lie in the block, inside of what would be searched, the distance follows from the pose alone.
//! What is computed then is what the search computes, so that the distances are the same bits.

use std::f64::consts::TAU;

use nalgebra::Vector3;

use super::{BACK, Candidate, Nearest, PathTracker};
use crate::assess::path_shape::Shape;
use crate::kinematics::{Poses, ToolPose};

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
    center: Vector3<f64>,
    plane: &[Vector3<f64>; 3],
) -> ([f64; 3], f64) {
    let out = tip - center;
    let [x, y, z] = plane.map(|vector| vector.dot(&out));
    ([x, y, z], (x * x + y * y).sqrt())
}

/// Distance from a circle of what lies `off` its axis and `z` off its plane.
#[inline(always)]
pub(super) fn from_circle(off: f64, z: f64, radius: f64) -> f64 {
    let outside = off - radius;
    (outside * outside + z * z).sqrt()
}

/// The tips, one after the other.
fn tips(poses: &Poses) -> impl Iterator<Item = Vector3<f64>> {
    let [xs, ys, zs] = poses.tips();
    xs.iter().zip(ys).zip(zs).map(|((x, y), z)| Vector3::new(*x, *y, *z))
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
        // The call before found the tracker as it left it, and so would all of these.
        if self.last.is_some() && poses.stand_still() && until(last) == begin {
            (0..last).for_each(|_| found.push(&first));
            return Some(Followed { first, closed_form: false });
        }
        if poses.only_axis().is_some() && begin >= self.path.length() && self.all_beyond(poses, &first) {
            for place in 1..=last {
                found.push(&self.at_end(&poses.get(place), &first));
            }
            return Some(Followed { first, closed_form: true });
        }
        let reach = if last > 1 { self.reach(before, [begin, until(last)]) } else { None };
        let closed_form = poses.only_axis().and(reach).is_some_and(|reach| {
            self.follow_line(poses, reach, &mut found.distance)
                || self.follow_circle(poses, reach, &mut found.distance)
        });
        if closed_form {
            self.nearest(&poses.get(last), until(last));
            found.within_ends.extend_from_slice(&found.distance[1..]);
            // The tool axis stands still, and so does that of the path.
            found.orientation.resize(poses.len(), first.orientation);
        } else {
            found.clear();
            found.push(&first);
            for place in 1..=last {
                let nearest = self.nearest(&poses.get(place), until(place));
                found.push(&nearest);
            }
        }
        Some(Followed { first, closed_form })
    }

    /// Whether all of `poses` lie beyond the path's last point, to which the first of them is nearest, and all of
    /// the path has been commanded.
    fn all_beyond(&self, poses: &Poses, first: &Nearest) -> bool {
        let (block, length) = (self.block, self.path.blocks()[self.block].length());
        let is_last = block + 1 == self.path.blocks().len();
        let at_end = is_last && first.progress >= self.path.length() && self.s >= length;
        let low = self.furthest - BACK;
        if !at_end || self.path.locate(low.max(0.0)).0 != block || self.furthest < self.path.length() {
            return false;
        }
        // Written so that what is no number is not beyond.
        match &self.shapes[block] {
            Shape::Segment { from, slope, .. } => {
                tips(poses).all(|tip| from_line(tip, *from, *slope) > length + CLEAR)
            }
            // The begin of what is searched is further off than the end, less than a quarter of a turn before.
            Shape::Circle { center, plane, radius, turn, .. } if BACK * turn.abs() < 1.0 && length > BACK => {
                let (least, direction) = (FORWARDS * radius * radius, turn.signum());
                let ([x0, y0, _], _) = from_axis(first.point, *center, plane);
                tips(poses).all(|tip| {
                    let ([x, y, _], _) = from_axis(tip, *center, plane);
                    (x0 * y - y0 * x) * direction > least && x0 * x + y0 * y > 0.0
                })
            }
            _ => false,
        }
    }

    /// What is nearest to a pose beyond the path's last point, which `first` is nearest to.
    fn at_end(&self, pose: &ToolPose, first: &Nearest) -> Nearest {
        let distance = (pose.tip - first.point).norm();
        let end = Candidate {
            block: self.block,
            s: self.s,
            progress: first.progress,
            point: first.point,
            distance,
        };
        Nearest { distance, within_ends: self.within_ends(&end, pose), ..*first }
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

    /// Distances of all poses from a line, as long as all feet lie inside of what is searched. The feet of all
    /// but the last are taken into account.
    fn follow_line(&mut self, poses: &Poses, reach: Reach, distances: &mut Vec<f64>) -> bool {
        let Shape::Segment { from, slope, .. } = &self.shapes[reach.block] else { return false };
        let (from, slope) = (*from, *slope);
        let [feet, _] = &mut self.feet;
        feet.resize(poses.len(), 0.0);
        distances.resize(poses.len(), 0.0);
        for ((foot, distance), tip) in feet.iter_mut().zip(&mut *distances).zip(tips(poses)) {
            let s = from_line(tip, from, slope);
            *foot = s;
            *distance = (tip - (from + slope * s)).norm();
        }
        // Written so that what is no number is not inside.
        let inside = feet.iter().fold(true, |inside, s| inside & (*s > CLEAR && *s < reach.high[0] - CLEAR));
        let least = feet.iter().fold(f64::INFINITY, |least, s| if *s < least { *s } else { least });
        let most = |feet: &[f64]| feet.iter().fold(0.0, |most, s| if *s > most { *s } else { most });
        let (furthest, before) = (most(feet), most(&feet[..poses.len() - 1]));
        let low = (self.furthest.max(reach.start + furthest) - BACK - reach.start).max(reach.low);
        let inside = inside && least > low + CLEAR && self.is_within_ends(reach, least, furthest);
        if inside {
            let progress = (reach.start + before).min(self.path.start_of(reach.block + 1));
            self.furthest = self.furthest.max(progress);
            self.last = None;
        }
        inside
    }

    /// Distances of all poses from a circle, as long as each foot lies clearly ahead of the one before, and all
    /// inside of what is searched.
    ///
    /// The first one has been found between both ends. What is searched begins some way behind the furthest foot
    /// so far, and ends further ahead at each pose: feet that lie ahead of each other are never before its begin,
    /// and none is behind its end if the last one is not behind the end that the first one had. As less than a
    /// turn is searched there is one passage only for each.
    fn follow_circle(&mut self, poses: &Poses, reach: Reach, distances: &mut Vec<f64>) -> bool {
        let Shape::Circle { center, plane, radius, turn, .. } = &self.shapes[reach.block] else {
            return false;
        };
        let (center, plane, radius, turn) = (*center, *plane, *radius, *turn);
        let first = self.s;
        let one_turn = reach.high[1] - reach.low < TAU / turn.abs() - CLEAR;
        if !(one_turn && first > reach.low + CLEAR && first < reach.high[0] - CLEAR) {
            return false;
        }
        let [xs, ys] = &mut self.feet;
        xs.resize(poses.len(), 0.0);
        ys.resize(poses.len(), 0.0);
        distances.resize(poses.len(), 0.0);
        let places = xs.iter_mut().zip(ys.iter_mut()).zip(&mut *distances);
        for (((x_out, y_out), distance), tip) in places.zip(tips(poses)) {
            let ([x, y, z], off) = from_axis(tip, center, &plane);
            (*x_out, *y_out) = (x, y);
            *distance = from_circle(off, z, radius);
        }
        let (least, direction) = (FORWARDS * radius * radius, turn.signum());
        let (x0, y0) = (xs[0], ys[0]);
        let steps = xs.iter().zip(ys.iter()).zip(xs[1..].iter().zip(&ys[1..]));
        // Written so that what is no number is not ahead.
        let ahead = steps.fold(true, |ahead, ((x_before, y_before), (x, y))| {
            let forwards = (x_before * y - y_before * x) * direction > least;
            ahead & forwards & (x0 * x + y0 * y > 0.0)
        });
        if !ahead {
            return false;
        }
        let (x, y) = (xs[poses.len() - 1], ys[poses.len() - 1]);
        let swept = ((x0 * y - y0 * x) * direction).atan2(x0 * x + y0 * y);
        let end = first + swept / turn.abs();
        end < reach.high[0] - CLEAR && self.is_within_ends(reach, first, end)
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
