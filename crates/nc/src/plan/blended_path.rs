//! Blended part of the path: a cubic spline within the tolerances of the programmed curves.
//!
//! The spline is Schoenberg's: its control points lie on the programmed curve p(u) at the averages of three consecutive
//! knots. It reproduces straight lines exactly, has a continuous second derivative, and needs a few neighboring curves
//! only. With knots of distance h it deviates by h |ΔT| / 6 at a corner with the tangent change ΔT at a knot, by 13 h |ΔT|
//! / 48 at a corner between two knots, and by h² κ / 6 on an arc of curvature κ. A corner between long lines is a knot
//! with two equal distances on either side, h = 6 P / |ΔT|, so that it is passed at the tolerance P. Elsewhere distances
//! are divided until the deviation is within the tolerance, less a reserve for the unequal distances of adjacent knots,
//! which differ by a factor of two at most.

use std::collections::VecDeque;

use super::motion_curve::{BlendTolerance, CurveEnd, MotionCurve};
use super::piece::{CapSpan, FeedChange, Piece, PieceCurve};
use super::vector::{Jet, JointKinds, JointVector, MAX_JOINTS, difference, norm};

/// Deviation on arcs and splines, m: the tolerance is for corners.
pub(super) const ARC_DEVIATION: f64 = 0.5e-6;
/// Fraction of the tolerance used for knots of equal distance.
const USED: f64 = 0.9;
/// Number of equal parts of an interval at whose ends the deviation is computed.
const SAMPLES: usize = 4;
/// Rounds of halving of a block, and knot distance that is not halved further, m.
const MAX_SETTLING: usize = 40;
const MIN_DISTANCE: f64 = 1e-9;
/// Smallest knot distance as a fraction of the largest one.
const MAX_HALVINGS: u32 = 14;
/// Knot distance at the ends of a blended path, as a fraction of the largest one.
const END_FRACTION: f64 = 1.0 / 256.0;
/// Number of vertices inside an interval at which the deviation is computed.
const MAX_VERTICES: usize = 16;
/// Number of changes of the feed in a piece up to which each part of the piece has its own.
const MAX_CHANGES: usize = 8;
/// Largest knot distance of a wide tolerance as a multiple of it, and in all, m.
const TOLERANCE_DISTANCE: f64 = 4.5;
const WIDEST_DISTANCE: f64 = 0.1;
/// Largest knot distance at a corner as a fraction of the shorter line: two on either side, and half of the line for the
/// next corner.
const CORNER_FRACTION: f64 = 0.25;
/// Fraction of the tolerance used at a corner: the rest is for rounding.
const CORNER_USED: f64 = 1.0 - 1e-6;
/// Distance from a change of the feed in which the intervals are graded, as a multiple of the largest knot distance.
const GRADED_DISTANCE: f64 = 4.0;

struct Member {
    start: f64,
    curve: MotionCurve,
    tolerance: BlendTolerance,
    /// Knot distance at the corner between the curve before and this one, if both are long lines.
    corner: Option<f64>,
}

/// Blended curves between two stops.
pub(super) struct BlendedPath {
    members: VecDeque<Member>,
    /// Places where the feed changes.
    changes: VecDeque<FeedChange>,
    /// Path parameter at the start of the blended path, from the start of the program.
    origin: f64,
    /// Length of the curves added.
    length: f64,
    /// True if the motion stops at the end of the last curve.
    is_closed: bool,
    knots: VecDeque<f64>,
    /// Intervals between knots that may still be halved.
    block: Vec<f64>,
    planned: f64,
    /// Largest knot distance, and that of tolerances that are not wide.
    largest: f64,
    usual: f64,
}

/// Returns the weights of four control points at the fraction `x` between the second and the third, for knots of equal
/// distance.
fn uniform_weights(x: f64) -> [f64; 4] {
    let y = 1.0 - x;
    let (cube, other) = (x * x * x, y * y * y);
    [other / 6.0, 2.0 / 3.0 - x * x * (1.0 - 0.5 * x), 2.0 / 3.0 - y * y * (1.0 - 0.5 * y), cube / 6.0]
}

/// Returns the distance at which a corner of two lines is passed, m, if the `shorter` one bounds it and not the tolerance.
/// `turn` is the norm of the difference of the directions.
pub(crate) fn bounded_corner(tolerance: f64, turn: f64, shorter: f64) -> Option<f64> {
    let wanted = (6.0 * tolerance / turn).min(TOLERANCE_DISTANCE * tolerance).min(WIDEST_DISTANCE);
    let bound = CORNER_FRACTION * shorter;
    (bound < wanted).then_some(turn * bound / 6.0)
}

impl BlendedPath {
    /// Creates a blended path that starts at `origin`, with a largest knot distance.
    pub fn new(origin: f64, largest: f64) -> Self {
        let knots = VecDeque::from([0.0; 3]);
        let (members, changes, block) = (VecDeque::new(), VecDeque::new(), vec![]);
        Self {
            members,
            changes,
            origin,
            length: 0.0,
            is_closed: false,
            knots,
            block,
            planned: 0.0,
            largest,
            usual: largest,
        }
    }

    /// Appends a curve.
    pub fn push(&mut self, curve: MotionCurve, kinds: &JointKinds) {
        let tolerance = match curve.at_end {
            CurveEnd::Blend(tolerance) => tolerance,
            _ => self.members.back().map_or([f64::INFINITY; 2], |member| member.tolerance),
        };
        let start = self.length;
        if let Some(last) = self.members.back().map(|member| member.curve.cap).filter(|cap| *cap != curve.cap)
        {
            self.changes.push_back(FeedChange { at: start, caps: [last, curve.cap] });
        }
        if tolerance[0].is_finite() {
            self.largest = self.largest.max((TOLERANCE_DISTANCE * tolerance[0]).min(WIDEST_DISTANCE));
        }
        let corner = self.members.back().and_then(|before| {
            let length = before.curve.length.min(curve.length);
            let turn = difference(&curve.jet(0.0)[1], &before.curve.jet(before.curve.length)[1]);
            let of = |i: usize, joints: &[usize]| {
                6.0 * CORNER_USED * tolerance[i].min(before.tolerance[i]) / norm(&turn, joints)
            };
            let distance = of(0, &kinds.linear).min(of(1, &kinds.rotary));
            let bound = WIDEST_DISTANCE.min(CORNER_FRACTION * length);
            let is_long = distance <= bound || bound >= self.usual;
            let is_straight = before.curve.is_line() && curve.is_line();
            (is_straight && is_long && distance > MIN_DISTANCE).then_some(distance.min(bound))
        });
        // Corners of small angles need long distances.
        self.largest = self.largest.max(corner.unwrap_or(0.0));
        self.length += curve.length;
        self.members.push_back(Member { start, curve, tolerance, corner });
    }

    /// Ends the path with a standstill.
    pub fn close(&mut self) {
        self.is_closed = true;
    }

    /// Returns the tool length of tool center point control.
    pub fn tcp_length(&self) -> Option<f64> {
        self.members.back().and_then(|member| member.curve.tcp_length)
    }

    /// Returns true if the next piece can be computed.
    pub fn is_ready(&self) -> bool {
        // A corner at the end of a line takes up to half of it.
        let last =
            self.members.back().filter(|last| last.curve.is_line()).map_or(0.0, |last| last.curve.length);
        self.is_closed || self.length - 2.0 * CORNER_FRACTION * last >= self.planned + 4.0 * self.largest
    }

    /// Returns the next piece; `None` after the last one. The path must be ready.
    pub fn next(&mut self, kinds: &JointKinds) -> Option<Piece> {
        while self.knots.len() < 6 {
            if self.planned >= self.length {
                self.settle_block(&[], kinds);
                let end = self.length;
                // The last knot is already there once.
                self.knots.extend([end; 2]);
                self.planned = f64::INFINITY;
                break;
            }
            let block = self.plan_block(kinds);
            self.settle_block(&block, kinds);
            self.block = block;
        }
        let (from, to) = (*self.knots.get(2)?, *self.knots.get(3)?);
        if to <= from || self.knots.len() < 6 {
            return None;
        }
        let piece = self.piece(from, to);
        self.knots.pop_front();
        let keep = self.knots[0] - 2.0 * self.largest;
        while self.members.len() > 1 && self.members[1].start < keep {
            self.members.pop_front();
        }
        let keep = self.knots[0] - GRADED_DISTANCE * self.largest;
        while self.changes.front().is_some_and(|change| change.at < keep) {
            self.changes.pop_front();
        }
        Some(piece)
    }

    fn index_at(&self, u: f64) -> usize {
        self.members.partition_point(|member| member.start <= u).saturating_sub(1)
    }

    /// Returns the programmed point at `u`, continued beyond both ends by point reflection.
    fn point(&self, u: f64) -> JointVector {
        let reflected = |end: f64| {
            let (center, mirror) = (self.point(end), self.point((2.0 * end - u).clamp(0.0, self.length)));
            std::array::from_fn(|i| 2.0 * center[i] - mirror[i])
        };
        if u < 0.0 {
            return reflected(0.0);
        }
        if u > self.length {
            return reflected(self.length);
        }
        if let Some(last) = self.members.back()
            && u == self.length
        {
            return last.curve.to;
        }
        let member = &self.members[self.index_at(u)];
        member.curve.point((u - member.start).min(member.curve.length))
    }

    /// Returns true if knots of distance `h` keep the tolerance between `from` and `from + h`.
    fn is_within_tolerance(&self, from: f64, h: f64, kinds: &JointKinds) -> bool {
        let to_end = if self.is_closed { self.length - from } else { f64::INFINITY };
        let nearest = to_end.min(from + h);
        if h > (self.largest * END_FRACTION).max(0.6 * nearest) {
            return false;
        }
        let control: [JointVector; 4] = std::array::from_fn(|i| self.point(from + (i as f64 - 1.0) * h));
        let ends = [from - h, from + 2.0 * h].map(|u| self.index_at(u.clamp(0.0, self.length)));
        let mut allowed = self.tolerance(from - h, from + 2.0 * h).map(|tolerance| USED * tolerance);
        if ends[0] == ends[1] && !self.members[ends[0]].curve.is_line() {
            allowed[0] = allowed[0].min(ARC_DEVIATION);
        }
        self.samples(from, h).all(|u| {
            let weights = uniform_weights((u - from) / h);
            let here = self.point(u);
            let deviation: JointVector = std::array::from_fn(|i| {
                control.iter().zip(weights).map(|(point, weight)| weight * (point[i] - here[i])).sum()
            });
            norm(&deviation, &kinds.linear) <= allowed[0] && norm(&deviation, &kinds.rotary) <= allowed[1]
        })
    }

    /// Returns the knot distances of the next block.
    fn plan_block(&mut self, kinds: &JointKinds) -> Vec<f64> {
        let ahead = self.members.range(self.index_at(self.planned)..);
        let corner = ahead
            .filter_map(|member| Some((member.start, member.corner?)))
            .find(|(at, _)| *at >= self.planned);
        let (end, is_end) = match corner {
            Some((at, h)) if at == self.planned => {
                self.planned += 2.0 * h;
                return vec![h; 2];
            }
            Some((at, h)) if at - 2.0 * h <= self.planned + MIN_DISTANCE => {
                let h = 0.5 * (at - self.planned);
                self.planned = at;
                return vec![h; 2];
            }
            Some((at, h)) => (at - 2.0 * h, true),
            None => (self.length, self.is_closed),
        };
        let left = end - self.planned;
        let size = if is_end { left.min(self.largest) } else { self.largest };
        // A short rest is not left over.
        let size = if is_end && left - size < 1e-3 * self.largest { left } else { size };
        let mut block = Vec::new();
        let mut stack = vec![(self.planned, size, 0)];
        while let Some((from, h, depth)) = stack.pop() {
            if depth >= MAX_HALVINGS || self.is_within_tolerance(from, h, kinds) {
                block.push(h);
                continue;
            }
            // Thirds where halves do not suffice: less of the tolerance remains unused.
            let fits = |parts: i32| {
                let part = h / f64::from(parts);
                (0..parts).all(|i| self.is_within_tolerance(from + f64::from(i) * part, part, kinds))
            };
            let parts = if !fits(2) && fits(3) { 3 } else { 2 };
            let part = h / f64::from(parts);
            stack.extend((0..parts).rev().map(|i| (from + f64::from(i) * part, part, depth + 1)));
        }
        self.planned = if size == left { end } else { self.planned + size };
        block
    }

    /// Halves the pending intervals until adjacent ones differ by a factor of two at most and the spline is within the
    /// tolerance, and appends their knots.
    fn settle_block(&mut self, after: &[f64], kinds: &JointKinds) {
        let mut block = std::mem::take(&mut self.block);
        if block.is_empty() {
            return;
        }
        let before = match (self.knots.get(self.knots.len() - 2), self.knots.back()) {
            (Some(a), Some(b)) if b > a => b - a,
            _ => f64::INFINITY,
        };
        let next = after.first().copied().unwrap_or(f64::INFINITY);
        for _ in 0..MAX_SETTLING {
            let mut balanced = Vec::with_capacity(block.len());
            for (i, &h) in block.iter().enumerate() {
                let left = if i > 0 { block[i - 1] } else { before };
                let right = block.get(i + 1).copied().unwrap_or(next);
                if h > 2.01 * left.min(right) {
                    balanced.extend([0.5 * h; 2]);
                } else {
                    balanced.push(h);
                }
            }
            let mut is_settled = balanced.len() == block.len();
            block = balanced;
            if is_settled {
                let deviating = self.deviating(&block, after, kinds);
                is_settled = deviating.is_empty();
                for i in deviating.into_iter().rev() {
                    let half = 0.5 * block[i];
                    block.splice(i..=i, [half; 2]);
                }
            }
            if is_settled {
                break;
            }
        }
        let mut at = self.knots.back().copied().unwrap_or(0.0);
        for h in &block {
            at += h;
            self.knots.push_back(at);
        }
        if after.is_empty()
            && let Some(last) = self.knots.back_mut()
        {
            *last = self.length;
        }
    }

    /// Returns value and derivatives of the spline at the third of six consecutive knots.
    fn cubic(&self, knots: &[f64; 6]) -> Jet {
        let [a, b, c, d, e, f] = *knots;
        let control = [[a, b, c], [b, c, d], [c, d, e], [d, e, f]].map(|k| {
            let u = (k[0] + k[1] + k[2]) / 3.0;
            // Exact at both ends of the path.
            if k[0] == k[2] { self.point(k[0]) } else { self.point(u) }
        });
        let slope = |i: usize, width: f64| -> JointVector {
            std::array::from_fn(|j| 3.0 * (control[i + 1][j] - control[i][j]) / width)
        };
        let (e0, e1, e2) = (slope(0, d - a), slope(1, e - b), slope(2, f - c));
        let (w0, w2) = ((d - c) * (d - c) / ((d - a) * (d - b)), (c - b) * (c - b) / ((e - b) * (d - b)));
        let first = (d - c) / (d - b);
        let mut jet = [[0.0; MAX_JOINTS]; 4];
        for j in 0..jet[0].len() {
            let [p0, p1, p2, _] = control.map(|point| point[j]);
            jet[0][j] = p1 + w0 * (p0 - p1) + w2 * (p2 - p1);
            jet[1][j] = e0[j] * first + e1[j] * (1.0 - first);
            let (f0, f1) = (2.0 * (e1[j] - e0[j]) / (d - b), 2.0 * (e2[j] - e1[j]) / (e - c));
            jet[2][j] = f0;
            jet[3][j] = (f1 - f0) / (d - c);
        }
        jet
    }

    /// Returns the intervals of `block` in which the spline exceeds the tolerance.
    fn deviating(&self, block: &[f64], after: &[f64], kinds: &JointKinds) -> Vec<usize> {
        let mut knots: Vec<f64> = self.knots.iter().skip(self.knots.len() - 3).copied().collect();
        for h in block.iter().chain(after.iter().take(2)) {
            knots.push(knots[knots.len() - 1] + h);
        }
        while knots.len() < block.len() + 5 {
            let last = knots[knots.len() - 1];
            let h = after.last().copied().unwrap_or(0.0);
            knots.push(last + h);
        }
        let exceeds = |i: &usize| {
            let window: [f64; 6] = std::array::from_fn(|k| knots[i + k].min(self.length));
            let (from, h) = (window[2], window[3] - window[2]);
            let jet = self.cubic(&window);
            let allowed = self.tolerance(window[0], window[5]);
            !self.samples(from, h).all(|u| {
                let (here, x) = (self.point(u), u - from);
                let deviation: JointVector = std::array::from_fn(|j| {
                    jet[0][j] - here[j] + x * (jet[1][j] + x * (0.5 * jet[2][j] + x * jet[3][j] / 6.0))
                });
                norm(&deviation, &kinds.linear) <= allowed[0] && norm(&deviation, &kinds.rotary) <= allowed[1]
            })
        };
        (0..block.len()).filter(|i| block[*i] > MIN_DISTANCE && exceeds(i)).collect()
    }

    /// Returns places between two knots where the deviation is computed: equal parts and the corners.
    fn samples(&self, from: f64, h: f64) -> impl Iterator<Item = f64> + '_ {
        let (first, last) = (self.index_at(from), self.index_at(from + h));
        let stride = (last - first).div_ceil(MAX_VERTICES).max(1);
        let vertices = (first + 1..=last).step_by(stride).map(|i| self.members[i].start);
        let parts = (0..=SAMPLES).map(move |i| from + h * (i as f64 / SAMPLES as f64));
        parts.chain(vertices)
    }

    /// Returns the tolerance between two places.
    fn tolerance(&self, from: f64, to: f64) -> BlendTolerance {
        let [first, last] = [from, to].map(|u| self.index_at(u.clamp(0.0, self.length)));
        let (low, high) = (&self.members[first], &self.members[last]);
        std::array::from_fn(|i| low.tolerance[i].min(high.tolerance[i]))
    }

    /// Returns the bounds on the feed between two knots, and the changes of the feed there and nearby. Of a piece with
    /// many changes, the least feed applies to all of it.
    fn feeds(&self, from: f64, to: f64) -> (Vec<CapSpan>, Vec<FeedChange>) {
        let place = |at: f64| self.changes.partition_point(|change| change.at <= at);
        let (first, last) = (place(from), self.changes.partition_point(|change| change.at < to));
        let mut spans = Vec::with_capacity(2);
        let mut start =
            CapSpan { from: 0.0, to: to - from, cap: self.members[self.index_at(from)].curve.cap };
        for change in self.changes.range(first..last.max(first)) {
            spans.push(CapSpan { to: change.at - from, ..start });
            start = CapSpan { from: change.at - from, to: to - from, cap: change.caps[1] };
        }
        spans.push(start);
        if spans.len() > MAX_CHANGES + 1 {
            spans.iter_mut().for_each(|span| (span.from, span.to) = (0.0, to - from));
            return (spans, Vec::new());
        }
        let distance = GRADED_DISTANCE * self.largest;
        let begin = place(from - distance).max(first.saturating_sub(MAX_CHANGES));
        let end = place(to + distance).min(last + MAX_CHANGES);
        let near = self.changes.range(begin..end.max(begin));
        (spans, near.map(|change| FeedChange { at: change.at - from, ..*change }).collect())
    }

    /// Returns the piece between two knots, from the knots around it.
    fn piece(&self, from: f64, to: f64) -> Piece {
        let jet = self.cubic(&std::array::from_fn(|i| self.knots[i]));
        let member = &self.members[self.index_at(from)];
        let (caps, changes) = self.feeds(from, to);
        let is_last = self.is_closed && to >= self.length;
        Piece {
            curve: PieceCurve::Cubic(jet),
            length: to - from,
            start: self.origin + from,
            caps,
            changes,
            line: member.curve.line,
            is_graded: (0..5)
                .any(|i| (self.knots[i + 1] - self.knots[i] - (to - from)).abs() > 0.01 * (to - from)),
            tcp_length: member.curve.tcp_length,
            to_stop: self.is_closed.then(|| (self.length - to).max(0.0)),
            end: is_last.then(|| self.point(self.length)),
            is_stop: is_last,
            feed_factor: 1.0,
        }
    }
}
