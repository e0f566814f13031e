//! Division of pieces into intervals with the derivatives of the joints at their ends.

use virtual_axes_core::config::LimitsConfig;

use super::interval_motion::peak_rate;
use super::motion_curve::Shape;
use super::piece::{FeedChange, Piece, PieceCurve};
use super::vector::{Jet, JointKinds, TipToJoints, norm};
use super::window::{Interval, Node};

/// Growth of the intervals with the distance from a stop.
const GROWTH: f64 = 0.17;
/// Time of the first interval from a standstill, as a fraction of the jerk phase.
const REST_FRACTION: f64 = 1.0 / 6.0;
/// Largest interval in a ramp of the feed as a fraction of the distance covered during a jerk phase, and smallest as a
/// and largest fraction of the distance of the ramp: a jerk phase that is shorter takes one or two intervals, and a ramp
/// without constant acceleration at least four.
const PHASE_FRACTION: f64 = 1.0 / 8.0;
const RAMP_FRACTION: f64 = 1.0 / 64.0;
const RAMP_PART: f64 = 1.0 / 4.0;
/// Fraction of the acceleration and jerk limits up to which the feed of a steady piece needs no ramp, and largest
/// relative change of its bound.
const STEADY_LOAD: f64 = 0.9;
const STEADY_CHANGE: f64 = 0.003;
/// Intervals per spline piece, and where adjacent pieces differ in length: near corners.
const PARTS: usize = 3;
const GRADED_PARTS: usize = 4;
/// Ratio of two programmed feeds below which the intervals between them are graded.
const FEED_CHANGE: f64 = 0.9;
/// Smallest interval at a change of the feed, m.
const MIN_INTERVAL: f64 = 1e-8;
/// Smallest interval at a stop, m; less in shorter pieces.
const LEAST_REST: f64 = 1e-9;
/// Largest turn of an arc or of a rotary axis per interval of an exact curve, rad.
const TURN: f64 = 0.1;
/// Largest number of intervals of one piece.
const MAX_PARTS: usize = 20_000;
/// Usable fraction of the acceleration and jerk limits: the rest covers the values between the stations.
pub(super) const SHARE: f64 = 0.995;

/// Surroundings of a piece that its division into intervals depends on.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Surroundings {
    /// Distance of the start of the piece from the last stop.
    pub from_stop: f64,
    /// True if the piece is steady, and distances before and after it in which its rate continues.
    pub is_steady: bool,
    pub constant: [f64; 2],
}

/// Returns true if a steady piece continues with the rate of its neighbor.
pub(super) fn is_continued(rate: Option<f64>, neighbor: Option<f64>) -> bool {
    matches!((rate, neighbor), (Some(a), Some(b)) if (a - b).abs() <= STEADY_CHANGE * a.max(b))
}

/// Returns the time of a jerk phase of the fastest ramp from standstill to `rate`.
fn phase_time(rate: f64, acceleration: f64, jerk: f64) -> f64 {
    (acceleration / jerk).min((rate / jerk).sqrt())
}

/// Returns the distance of the fastest ramp from standstill to `rate`.
fn ramp_distance(rate: f64, acceleration: f64, jerk: f64) -> f64 {
    let phase = phase_time(rate, acceleration, jerk);
    0.5 * rate * (rate / (jerk * phase) + phase)
}

/// Machine as the planner sees it.
#[derive(Debug, Clone)]
pub(super) struct MachineModel {
    pub joints: Vec<LimitsConfig>,
    /// Inverse limits of acceleration and jerk of each joint.
    pub inverses: Vec<[f64; 2]>,
    pub kinds: JointKinds,
    pub tip: Option<TipToJoints>,
    /// Largest centripetal acceleration of the tool path, m/s².
    pub centripetal: f64,
}

impl MachineModel {
    /// Returns the joints with their derivatives at `u` from the start of `piece`.
    pub fn joints(&self, piece: &Piece, u: f64) -> Jet {
        let mut jet = piece.jet(u);
        self.apply_tip(&mut jet, piece.tcp_length);
        jet
    }

    /// Converts the tip of tool center point control with a tool length into joints.
    pub fn apply_tip(&self, coordinates: &mut Jet, tcp_length: Option<f64>) {
        if let (Some(length), Some(tip)) = (tcp_length, &self.tip) {
            tip.apply(coordinates, length);
        }
    }

    /// Returns the joint derivatives and the largest rate of the path parameter at `u`.
    pub fn node(&self, piece: &Piece, u: f64) -> (Node, f64) {
        let mut jet = piece.jet(u);
        let mut cap = piece.cap([u; 2], &jet[1]);
        if self.centripetal.is_finite() {
            let bend = norm(&jet[2], &self.kinds.linear);
            cap = cap.min((self.centripetal / bend).sqrt());
        }
        self.apply_tip(&mut jet, piece.tcp_length);
        for (bounds, first) in self.joints.iter().zip(&jet[1]) {
            cap = cap.min(bounds.velocity / first.abs());
        }
        ([jet[1], jet[2], jet[3]], cap)
    }

    /// Returns the largest acceleration and jerk along the path where the joints have the first derivative in `node`.
    pub fn tangential(&self, node: &Node) -> [f64; 2] {
        let mut limits = [f64::INFINITY; 2];
        for (bounds, first) in self.joints.iter().zip(&node[0]) {
            limits[0] = limits[0].min(bounds.acceleration / first.abs());
            limits[1] = limits[1].min(bounds.jerk / first.abs());
        }
        limits
    }

    /// Returns the largest acceleration and jerk along the path near the start of a piece, whose `node` is singular where a
    /// blend of opposite motions turns back.
    fn tangential_near_start(&self, piece: &Piece, node: &Node) -> [f64; 2] {
        let limits = self.tangential(node);
        if limits[1].is_finite() { limits } else { self.tangential(&self.node(piece, 0.5 * piece.length).0) }
    }

    /// Returns the places near `piece` where the feed changes by more than a little, with the length of the intervals
    /// there, which last `time` at the lower feed. `node` is that of the start of the piece.
    fn feed_changes(&self, piece: &Piece, node: &Node, time: f64) -> Vec<(f64, f64)> {
        let first = piece.jet(0.0)[1];
        let bounds = self.joints.iter().zip(&node[0]).map(|(bounds, first)| bounds.velocity / first.abs());
        let fastest = bounds.fold(f64::INFINITY, f64::min);
        let change = |change: &FeedChange| {
            let [before, after] = change.caps.map(|cap| cap.rate(&first).min(fastest));
            let low = before.min(after);
            let is_large = low < FEED_CHANGE * before.max(after);
            is_large.then(|| (change.at, (time * low).max(MIN_INTERVAL)))
        };
        piece.changes.iter().filter_map(change).collect()
    }

    /// Returns the rate of the path parameter that is constant along a steady piece, far within the limits of the joints;
    /// `None` for any other piece.
    pub fn steady_rate(&self, piece: &Piece) -> Option<f64> {
        if piece.caps.len() != 1 {
            return None;
        }
        let nodes = [0.0, 0.5, 1.0].map(|part| self.node(piece, part * piece.length));
        let caps = nodes.map(|(_, cap)| cap);
        let (low, high) = (caps[0].min(caps[1]).min(caps[2]), caps[0].max(caps[1]).max(caps[2]));
        let is_within = |node: &Node| {
            self.joints.iter().enumerate().all(|(j, bounds)| {
                node[1][j].abs() * high.powi(2) <= STEADY_LOAD * bounds.acceleration
                    && node[2][j].abs() * high.powi(3) <= STEADY_LOAD * bounds.jerk
            })
        };
        (high - low <= STEADY_CHANGE * high && nodes.iter().all(|(node, _)| is_within(node))).then_some(low)
    }

    /// Returns the distance behind a steady piece up to which its division depends on the path.
    pub fn reach(&self, piece: &Piece) -> f64 {
        let (node, cap) = self.node(piece, 0.0);
        let [acceleration, jerk] = self.tangential_near_start(piece, &node);
        ramp_distance(cap, acceleration, jerk) + (1.0 + GROWTH) / GROWTH * piece.length
    }

    /// Divides a piece into intervals. `push` receives the start of each, from the start of the piece, and the interval.
    pub fn divide(&self, piece: &Piece, around: &Surroundings, mut push: impl FnMut(f64, Interval)) {
        let (node, cap) = self.node(piece, 0.0);
        let [acceleration, jerk] = self.tangential_near_start(piece, &node);
        let from_stop = around.from_stop;
        // The distance between two stops, if it is known, limits the rate.
        let between = piece.to_stop.map_or(f64::INFINITY, |to_stop| from_stop + piece.length + to_stop);
        let peak = peak_rate(between, acceleration, jerk);
        let phase = phase_time(cap.min(peak), acceleration, jerk);
        let most = 0.05 * piece.length;
        let rest = (jerk * (REST_FRACTION * phase).powi(3) / 6.0).clamp(LEAST_REST.min(most), most);
        let middle = self.node(piece, 0.5 * piece.length).1.min(cap);
        let largest = match &piece.curve {
            PieceCurve::Cubic(_) | PieceCurve::Corner(_) | PieceCurve::Overlap(_) => {
                let parts = if piece.is_graded { GRADED_PARTS } else { PARTS };
                piece.length / parts as f64
            }
            PieceCurve::Exact(curve) => {
                let turn = piece.jet(0.0)[1];
                let mut rate = norm(&turn, &self.kinds.rotary);
                if let Shape::Arc(arc) = &curve.shape {
                    rate = rate.max((arc.sweep / curve.length).abs());
                }
                (TURN / rate).min(piece.length / 8.0)
            }
        };
        let largest = largest.max(piece.length / MAX_PARTS as f64);
        // Elsewhere in the piece other joints can bound the motion along the path.
        let places = [0.5, 1.0].map(|part| self.tangential(&self.node(piece, part * piece.length).0));
        let least = |k: usize, start: f64| places.iter().map(|limits| limits[k]).fold(start, f64::min);
        let (a_least, j_least) = (least(0, acceleration), least(1, jerk));
        let ramp = ramp_distance(middle, a_least, j_least);
        let peak_least = peak_rate(between, a_least, j_least);
        let fine = match peak_least < middle {
            true => PHASE_FRACTION * peak_least * phase_time(peak_least, a_least, j_least),
            false => {
                (PHASE_FRACTION * middle * a_least / j_least).max(RAMP_FRACTION * ramp).min(RAMP_PART * ramp)
            }
        };
        let fine = fine.max(piece.length / MAX_PARTS as f64);
        // In a steady piece, only the ramps of its surroundings are divided finely.
        let widest = if matches!(piece.curve, PieceCurve::Exact(_)) { largest } else { piece.length };
        let in_ramps = |u: f64| {
            let usual = fine.min(largest);
            if !around.is_steady {
                return usual;
            }
            let [before, after] = around.constant;
            let outside = (before + u).min(after + piece.length - u) - ramp;
            (usual + GROWTH / (1.0 + GROWTH) * outside.max(0.0)).min(widest)
        };
        let changes = self.feed_changes(piece, &node, PHASE_FRACTION * acceleration / jerk);
        let step = |u: f64| {
            let after = rest + GROWTH * (u + from_stop);
            let before = piece.to_stop.map_or(f64::INFINITY, |to_stop| {
                (rest + GROWTH * (piece.length - u + to_stop)) / (1.0 + GROWTH)
            });
            let graded = changes.iter().map(|(at, interval)| match *at > u {
                true => (interval + GROWTH * (at - u)) / (1.0 + GROWTH),
                false => interval + GROWTH * (u - at),
            });
            graded.fold(in_ramps(u).min(after).min(before), f64::min)
        };
        let mut ends = (node, cap);
        let mut u = 0.0;
        while u < piece.length {
            let h = step(u);
            // An interval ends at a change of the feed.
            let inside = u + MIN_INTERVAL..piece.length - MIN_INTERVAL;
            let end =
                changes.iter().map(|(at, _)| *at).find(|at| inside.contains(at)).unwrap_or(piece.length);
            let left = end - u;
            let h = if left < 1.2 * h {
                left
            } else if left < 2.0 * h {
                0.5 * left
            } else {
                h
            };
            let to = if h == left { end } else { u + h };
            let next = self.node(piece, to);
            let middle = self.node(piece, 0.5 * (u + to)).1;
            let feed = match piece.caps.len() {
                // The nodes have it.
                1 => f64::INFINITY,
                _ => piece.cap([u, to], &piece.jet(u)[1]),
            };
            let interval = Interval {
                length: h,
                ends: [ends.0, next.0],
                cap: ends.1.min(next.1).min(middle).min(feed),
                share: SHARE,
                guess: 0.0,
            };
            push(u, interval);
            (ends, u) = (next, to);
        }
    }
}
