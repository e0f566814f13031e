//! Smooth pieces of the path that the feed is planned along.

use std::sync::Arc;

use super::corner::CornerArc;
use super::interval_motion::PathState;
use super::motion_curve::{FeedCap, MotionCurve};
use super::vector::{Jet, JointVector, MAX_JOINTS};

/// Curve of a piece.
#[derive(Debug, Clone)]
pub(super) enum PieceCurve {
    /// Cubic polynomials: value and derivatives at the start.
    Cubic(Jet),
    /// Exact curve of a motion.
    Exact(MotionCurve),
    /// Arc in a corner.
    Corner(CornerArc),
    /// Two motions that overlap in time.
    Overlap(Box<Overlap>),
}

/// Bound on the feed along a part of a piece; places from the start of the piece.
#[derive(Debug, Clone, Copy)]
pub(super) struct CapSpan {
    pub from: f64,
    pub to: f64,
    pub cap: FeedCap,
}

/// Place where the programmed feed changes.
#[derive(Debug, Clone, Copy)]
pub(super) struct FeedChange {
    pub at: f64,
    /// Bounds before and after it.
    pub caps: [FeedCap; 2],
}

/// Smooth piece of the path.
#[derive(Debug, Clone)]
pub(super) struct Piece {
    pub curve: PieceCurve,
    pub length: f64,
    /// Path parameter at the start, from the start of the program.
    pub start: f64,
    pub caps: Vec<CapSpan>,
    /// Changes of the feed inside and near the piece in order, from its start.
    pub changes: Vec<FeedChange>,
    pub line: usize,
    /// True if adjacent pieces differ in length.
    pub is_graded: bool,
    pub tcp_length: Option<f64>,
    /// Distance to the next stop, if it is known.
    pub to_stop: Option<f64>,
    /// Exact coordinates at a stop at the end.
    pub end: Option<JointVector>,
    /// True if the motion stops at the end.
    pub is_stop: bool,
    /// Factor on the programmed feeds.
    pub feed_factor: f64,
}

impl Piece {
    /// Returns the coordinates at `u` from the start of the piece.
    pub fn point(&self, u: f64) -> JointVector {
        if let Some(end) = self.end
            && u >= self.length
        {
            return end;
        }
        match &self.curve {
            PieceCurve::Exact(curve) => curve.point(u),
            PieceCurve::Corner(arc) => arc.jet(u)[0],
            PieceCurve::Overlap(overlap) => overlap.jet(u)[0],
            PieceCurve::Cubic([p, d1, d2, d3]) => {
                std::array::from_fn(|i| p[i] + u * (d1[i] + u * (0.5 * d2[i] + u * d3[i] / 6.0)))
            }
        }
    }

    /// Returns the coordinates and their derivatives at `u` from the start of the piece.
    pub fn jet(&self, u: f64) -> Jet {
        match &self.curve {
            PieceCurve::Exact(curve) => curve.jet(u),
            PieceCurve::Corner(arc) => arc.jet(u),
            PieceCurve::Overlap(overlap) => overlap.jet(u),
            PieceCurve::Cubic([p, d1, d2, d3]) => {
                let mut jet = [*p, [0.0; MAX_JOINTS], [0.0; MAX_JOINTS], *d3];
                for i in 0..MAX_JOINTS {
                    jet[0][i] += u * (d1[i] + u * (0.5 * d2[i] + u * d3[i] / 6.0));
                    jet[1][i] = d1[i] + u * (d2[i] + 0.5 * u * d3[i]);
                    jet[2][i] = d2[i] + u * d3[i];
                }
                if let Some(end) = self.end
                    && u >= self.length
                {
                    jet[0] = end;
                }
                jet
            }
        }
    }

    /// Returns a curve of `length` from the path parameter `start` on, beside this piece.
    pub fn part(&self, curve: PieceCurve, length: f64, start: f64) -> Piece {
        let (caps, changes) = (Vec::new(), Vec::new());
        Piece { curve, length, start, caps, changes, end: None, ..*self }
    }

    /// Multiplies the programmed feeds by `factor`.
    pub fn scale_feed(&mut self, factor: f64) {
        self.feed_factor = factor;
        let spans = self.caps.iter_mut().map(|span| &mut span.cap);
        for cap in spans.chain(self.changes.iter_mut().flat_map(|change| &mut change.caps)) {
            match cap {
                FeedCap::Rapid => {}
                FeedCap::Speed { value, .. } | FeedCap::Rate(value) => *value *= factor,
            }
        }
    }

    /// Returns the largest rate of the path parameter between two places, where it has the first derivative `first`.
    pub fn cap(&self, [from, to]: [f64; 2], first: &JointVector) -> f64 {
        let spans = self.caps.iter().filter(|span| span.from <= to && from <= span.to);
        spans.map(|span| span.cap.rate(first)).fold(f64::INFINITY, f64::min)
    }
}

/// Motion with constant acceleration along a curve.
#[derive(Debug, Clone)]
pub(super) struct TimedCurve {
    pub piece: Arc<Piece>,
    /// State at the start.
    pub state: PathState,
}

impl TimedCurve {
    /// Returns the coordinates and their derivatives with respect to time.
    fn jet(&self, time: f64) -> Jet {
        let PathState { u, rate, acceleration: a } = self.state;
        let place = (u + time * (rate + 0.5 * time * a)).clamp(0.0, self.piece.length);
        let [q, q1, q2, q3] = self.piece.jet(place);
        let v = rate + time * a;
        let each = |of: &dyn Fn(usize) -> f64| -> JointVector { std::array::from_fn(of) };
        [
            q,
            each(&|i| q1[i] * v),
            each(&|i| q1[i] * a + q2[i] * v * v),
            each(&|i| 3.0 * q2[i] * v * a + q3[i] * v.powi(3)),
        ]
    }
}

/// End of one motion and start of the next at the same time: the sum of both from their common point.
#[derive(Debug, Clone)]
pub(super) struct Overlap {
    pub motions: [TimedCurve; 2],
    /// Time per unit of the path parameter.
    pub pace: f64,
}

impl Overlap {
    /// Returns the coordinates and their derivatives at path parameter `u`.
    pub fn jet(&self, u: f64) -> Jet {
        let [ending, starting] = self.motions.each_ref().map(|motion| motion.jet(u * self.pace));
        let corner = self.motions[1].piece.point(0.0);
        let mut jet = [[0.0; MAX_JOINTS]; 4];
        jet[0] = std::array::from_fn(|i| ending[0][i] + (starting[0][i] - corner[i]));
        for order in 1..jet.len() {
            let scale = self.pace.powi(order as i32);
            jet[order] = std::array::from_fn(|i| scale * (ending[order][i] + starting[order][i]));
        }
        jet
    }
}
