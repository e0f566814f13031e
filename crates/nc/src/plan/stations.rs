//! Division of pieces into intervals with the derivatives of the joints at their ends.

use std::sync::Arc;

use super::element::JointKinds;
use super::piece::{FeedChange, Piece, PieceCurve};
use super::vector::{Jet, TipToJoints};
use super::window::{Interval, JointBounds, Node};

/// Growth of the intervals with the distance from a stop.
const GROWTH: f64 = 0.17;
/// Time of the first interval from a standstill, as a fraction of the jerk phase.
const REST_FRACTION: f64 = 1.0 / 6.0;
/// Largest interval as a fraction of the distance covered during a jerk phase.
const PHASE_FRACTION: f64 = 1.0 / 8.0;
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

/// Interval of the path with its piece.
#[derive(Debug, Clone)]
pub(super) struct Station {
    pub interval: Interval,
    pub piece: Arc<Piece>,
    /// Start of the interval from the start of the piece.
    pub from: f64,
}

/// Machine as the planner sees it.
#[derive(Debug, Clone)]
pub(super) struct MachineModel {
    pub joints: Vec<JointBounds>,
    pub kinds: JointKinds,
    pub tip: Option<TipToJoints>,
    /// Largest centripetal acceleration of the tool path, m/s².
    pub centripetal: f64,
}

impl MachineModel {
    /// Returns the joints with their derivatives at `u` from the start of `piece`.
    pub fn joints(&self, piece: &Piece, u: f64) -> Jet {
        let mut jet = piece.jet(u);
        if let (Some(length), Some(tip)) = (piece.tcp_length, &self.tip) {
            tip.apply(&mut jet, length);
        }
        jet
    }

    /// Returns the joint derivatives and the largest rate of the path parameter at `u`.
    pub fn node(&self, piece: &Piece, u: f64) -> (Node, f64) {
        let mut jet = piece.jet(u);
        let mut cap = piece.cap([u; 2], &jet[1]);
        if self.centripetal.is_finite() {
            let bend = super::vector::norm(&jet[2], &self.kinds.linear);
            cap = cap.min((self.centripetal / bend).sqrt());
        }
        if let (Some(length), Some(tip)) = (piece.tcp_length, &self.tip) {
            tip.apply(&mut jet, length);
        }
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

    /// Divides `piece`, which starts `from_stop` after a stop, into intervals.
    pub fn stations(&self, piece: &Arc<Piece>, from_stop: f64, out: &mut Vec<Station>) {
        let (node, cap) = self.node(piece, 0.0);
        let [acceleration, jerk] = self.tangential(&node);
        let phase = (acceleration / jerk).min((cap / jerk).sqrt());
        let most = 0.05 * piece.length;
        let rest = (jerk * (REST_FRACTION * phase).powi(3) / 6.0).clamp(LEAST_REST.min(most), most);
        let largest = match &piece.curve {
            PieceCurve::Cubic(_) => {
                let parts = if piece.is_graded { GRADED_PARTS } else { PARTS };
                (piece.length / parts as f64).min(PHASE_FRACTION * cap * acceleration / jerk)
            }
            PieceCurve::Exact(element) => {
                let middle = self.node(piece, 0.5 * piece.length).1.min(cap);
                let turn = piece.jet(0.0)[1];
                let mut rate = super::vector::norm(&turn, &self.kinds.rotary);
                if let super::element::Shape::Arc(arc) = &element.shape {
                    rate = rate.max((arc.sweep / element.length).abs());
                }
                (TURN / rate).min(PHASE_FRACTION * middle * acceleration / jerk).min(piece.length / 8.0)
            }
        };
        let largest = largest.max(piece.length / MAX_PARTS as f64);
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
            graded.fold(largest.min(after).min(before), f64::min)
        };
        let mut ends = self.node(piece, 0.0);
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
            };
            out.push(Station { interval, piece: Arc::clone(piece), from: u });
            (ends, u) = (next, to);
        }
    }
}
