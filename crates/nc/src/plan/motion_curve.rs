//! Exact curves of single motions: lines, arcs and helices in the coordinates of the machine's joints.

use super::nurbs::SplineTable;
use super::vector::{Jet, JointKinds, JointVector, MAX_JOINTS, difference, mix};

/// Bound on the rate of the path parameter that follows from the programmed feed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum FeedCap {
    /// No bound: rapid traverse.
    Rapid,
    /// Speed of the given joints, m/s or rad/s.
    Speed { value: f64, joints: FeedJoints },
    /// Rate of the path parameter, 1/s.
    Rate(f64),
}

impl FeedCap {
    /// Returns the largest rate of the path parameter where the coordinates have the derivative `first`.
    pub fn rate(&self, first: &JointVector) -> f64 {
        match self {
            FeedCap::Rapid => f64::INFINITY,
            FeedCap::Speed { value, joints } => value / joints.norm(first),
            FeedCap::Rate(rate) => *rate,
        }
    }
}

/// Up to three joints.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct FeedJoints {
    pub indices: [Option<usize>; 3],
}

impl FeedJoints {
    pub fn norm(&self, vector: &JointVector) -> f64 {
        // Not `sum`, which is -0 without indices.
        let squares = self.indices.iter().flatten().map(|&i| vector[i] * vector[i]);
        squares.fold(0.0, |sum, square| sum + square).sqrt()
    }
}

/// Curve of an curve.
#[derive(Debug, Clone)]
pub(super) enum Shape {
    Line,
    Arc(Arc),
    Spline(SplineTable),
}

/// Circle with a linearly changing radius, which corrects a rounded center.
#[derive(Debug, Clone)]
pub(super) struct Arc {
    /// Joints of the plane.
    pub plane: [usize; 2],
    pub center: [f64; 2],
    pub radii: [f64; 2],
    /// Angle of the start, rad.
    pub phase: f64,
    pub sweep: f64,
}

/// Behavior at the end of a curve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum CurveEnd {
    Stop,
    /// Stop unless tangent and curvature continue.
    ExactPath,
    Blend(BlendTolerance),
}

/// Tolerances of blending at the end of a curve: linear axes (m) and rotary axes (rad).
pub(super) type BlendTolerance = [f64; 2];

/// Exact curve of a motion over the path parameter, which is its length in the metric of [`JointKinds::length`].
#[derive(Debug, Clone)]
pub(super) struct MotionCurve {
    pub shape: Shape,
    pub from: JointVector,
    pub to: JointVector,
    pub length: f64,
    pub line: usize,
    pub tool: Option<u32>,
    pub feed: f64,
    pub cap: FeedCap,
    pub tcp_length: Option<f64>,
    pub at_end: CurveEnd,
    /// Distance of points from a line within which lines become one, m.
    pub merge_tolerance: f64,
}

impl MotionCurve {
    /// Returns the length of the curve in the metric of the path parameter.
    pub fn measure(shape: &Shape, from: &JointVector, to: &JointVector, kinds: &JointKinds) -> f64 {
        let mut step = difference(to, from);
        if let Shape::Arc(arc) = shape {
            let [r0, r1] = arc.radii;
            step[arc.plane[0]] = 0.5 * (r0 + r1) * arc.sweep;
            step[arc.plane[1]] = r1 - r0;
        }
        match shape {
            Shape::Spline(table) => table.length(),
            _ => kinds.length(&step),
        }
    }

    /// Returns the coordinates at path parameter `u`, exact at both ends.
    pub fn point(&self, u: f64) -> JointVector {
        let t = u / self.length;
        if let Shape::Spline(table) = &self.shape {
            return table.point(&self.from, &self.to, u);
        }
        let mut point = mix(&self.from, &self.to, t);
        if let Shape::Arc(arc) = &self.shape
            && t > 0.0
            && t < 1.0
        {
            let (sine, cosine) = (arc.phase + arc.sweep * t).sin_cos();
            let radius = arc.radii[0] + (arc.radii[1] - arc.radii[0]) * t;
            point[arc.plane[0]] = arc.center[0] + radius * cosine;
            point[arc.plane[1]] = arc.center[1] + radius * sine;
        }
        point
    }

    /// Returns coordinates and derivatives at path parameter `u`.
    pub fn jet(&self, u: f64) -> Jet {
        let mut jet = [[0.0; MAX_JOINTS]; 4];
        jet[0] = self.point(u);
        let l = self.length;
        jet[1] = difference(&self.to, &self.from).map(|step| step / l);
        if let Shape::Arc(arc) = &self.shape {
            let (s, c) = (arc.phase + arc.sweep * u / l).sin_cos();
            let (w, dr) = (arc.sweep / l, (arc.radii[1] - arc.radii[0]) / l);
            let r = arc.radii[0] + dr * u;
            let [x, y] = arc.plane;
            (jet[1][x], jet[1][y]) = (dr * c - r * w * s, dr * s + r * w * c);
            (jet[2][x], jet[2][y]) = (w * (-2.0 * dr * s - r * w * c), w * (2.0 * dr * c - r * w * s));
            let w2 = w * w;
            (jet[3][x], jet[3][y]) = (w2 * (-3.0 * dr * c + r * w * s), w2 * (-3.0 * dr * s - r * w * c));
        }
        if let Shape::Spline(table) = &self.shape {
            jet[1] = table.slope(&self.from, &self.to, u);
        }
        jet
    }

    /// Returns the duration at the programmed feed, s; 0 at rapid traverse.
    pub fn programmed_time(&self) -> f64 {
        self.length / self.cap.rate(&self.jet(0.0)[1])
    }

    /// Returns true if the coordinates are linear in the path parameter.
    pub fn is_line(&self) -> bool {
        matches!(self.shape, Shape::Line)
    }
}
