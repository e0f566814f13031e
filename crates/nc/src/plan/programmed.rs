//! Programmed path before blending, as curves of the tool tip in the workpiece frame.

use std::collections::VecDeque;

use nalgebra::Vector3;
use virtual_axes_core::kinematics::Kinematics;

use super::machine_model::MachineModel;
use super::motion_curve::MotionCurve;
use super::planner::PartProgramPlanner;
use super::vector::MAX_JOINTS;

/// Largest deviation of a span from the programmed curve, m.
const DEVIATION: f64 = 2e-9;
/// Most halvings of a curve.
const MAX_HALVINGS: u32 = 14;
/// Smallest change of direction at a corner, rad, and shortest span with a direction, m.
const CORNER_TURN: f64 = 0.05;
const LEAST_LENGTH: f64 = 1e-9;
/// Steps of Newton's method for a foot point.
const NEWTON_STEPS: usize = 6;
/// Search range around a place on the path, as a multiple of the distance from it, and its least value, m.
const SEARCH_FACTOR: f64 = 3.0;
const LEAST_SEARCH: f64 = 1e-6;

/// Part of the programmed path: a parabola of the tool tip over the path position.
#[derive(Debug, Clone, Copy)]
pub struct ProgrammedSpan {
    /// Path positions of both ends, m.
    ends: [f64; 2],
    /// Tool tip at the start and the two coefficients over 0 to 1, m.
    coefficients: [Vector3<f64>; 3],
}

impl ProgrammedSpan {
    fn new(ends: [f64; 2], [start, middle, end]: [Vector3<f64>; 3]) -> Self {
        let bend = 2.0 * (start - 2.0 * middle + end);
        Self { ends, coefficients: [start, end - start - bend, bend] }
    }

    fn at(&self, t: f64) -> Vector3<f64> {
        let [start, slope, bend] = &self.coefficients;
        start + t * (slope + t * bend)
    }

    /// Returns the point nearest to `tip` and its path position, m.
    fn nearest(&self, tip: &Vector3<f64>) -> (Vector3<f64>, f64) {
        let [start, slope, bend] = &self.coefficients;
        let chord = slope + bend;
        let square = chord.norm_squared();
        let mut t = if square > 0.0 { ((tip - start).dot(&chord) / square).clamp(0.0, 1.0) } else { 0.0 };
        if *bend != Vector3::zeros() {
            for _ in 0..NEWTON_STEPS {
                let (error, first) = (self.at(t) - tip, slope + 2.0 * t * bend);
                let curvature = first.norm_squared() + 2.0 * error.dot(bend);
                if curvature <= 0.0 {
                    break;
                }
                t = (t - error.dot(&first) / curvature).clamp(0.0, 1.0);
            }
        }
        let [from, to] = self.ends;
        (self.at(t), from + (to - from) * t)
    }
}

/// Corner of the programmed path.
#[derive(Debug, Clone, Copy)]
pub struct ProgrammedCorner {
    /// Path position, m.
    pub path_position: f64,
    /// Tool tip in the workpiece frame, m.
    pub tip: Vector3<f64>,
}

/// Programmed path ahead of and around the tool, in order.
#[derive(Debug, Clone, Default)]
pub struct ProgrammedPath {
    spans: VecDeque<ProgrammedSpan>,
    corners: VecDeque<ProgrammedCorner>,
    /// Direction at the end of the path.
    direction: Option<Vector3<f64>>,
}

impl ProgrammedPath {
    /// Moves the spans of `path` to the end.
    pub fn append(&mut self, path: &mut ProgrammedPath) {
        self.spans.append(&mut path.spans);
        self.corners.append(&mut path.corners);
    }

    /// Returns the next corner up to a path position, m, and removes it.
    pub fn next_corner(&mut self, path_position: f64) -> Option<ProgrammedCorner> {
        self.corners.front().filter(|corner| corner.path_position <= path_position)?;
        self.corners.pop_front()
    }

    /// Appends a span, and a corner before it where the direction changes.
    fn push_span(&mut self, span: ProgrammedSpan) {
        let [tip, slope, bend] = span.coefficients;
        if slope.norm() > LEAST_LENGTH {
            let turn = self.direction.map_or(0.0, |before| before.angle(&slope));
            if turn > CORNER_TURN {
                self.corners.push_back(ProgrammedCorner { path_position: span.ends[0], tip });
            }
            self.direction = Some(slope + 2.0 * bend);
        }
        self.spans.push_back(span);
    }

    /// Drops the path before a path position, m.
    pub fn drop_before(&mut self, path_position: f64) {
        while self.spans.front().is_some_and(|span| span.ends[1] < path_position) {
            self.spans.pop_front();
        }
    }

    /// Returns the point of the programmed path nearest to a tool tip, m, near a path position, m, and its own path position;
    /// `None` for an empty path.
    pub fn nearest(&self, tip: &Vector3<f64>, path_position: f64) -> Option<(Vector3<f64>, f64)> {
        let index = |position: f64| self.spans.partition_point(|span| span.ends[1] < position);
        let last = self.spans.len().checked_sub(1)?;
        let here = &self.spans[index(path_position).min(last)];
        let [from, to] = here.ends;
        let place = here.at(((path_position - from) / (to - from)).clamp(0.0, 1.0));
        let reach = SEARCH_FACTOR * (tip - place).norm() + LEAST_SEARCH;
        let near = self.spans.range(index(path_position - reach).min(last)..);
        near.take_while(|span| span.ends[0] <= path_position + reach)
            .map(|span| span.nearest(tip))
            .min_by(|(a, _), (b, _)| (a - tip).norm_squared().total_cmp(&(b - tip).norm_squared()))
            .or(Some((place, path_position)))
    }

    /// Appends a curve that starts at a path position.
    fn push(&mut self, curve: &MotionCurve, start: f64, model: &MachineModel, kinematics: &Kinematics) {
        let tip = |u: f64| {
            let mut jet = [[0.0; MAX_JOINTS]; 4];
            jet[0] = curve.point(u);
            model.apply_tip(&mut jet, curve.tcp_length);
            kinematics.forward(&jet[0][..model.joints.len()]).tip
        };
        let turns = model.kinds.rotary.iter().any(|&joint| curve.from[joint] != curve.to[joint]);
        let mut parts = vec![([0.0, curve.length], MAX_HALVINGS)];
        while let Some(([from, to], halvings)) = parts.pop() {
            let place = |part: f64| from + (to - from) * part;
            let [first, last] = [0.0, 1.0].map(|part| tip(place(part)));
            if curve.is_line() && !turns {
                let span = ProgrammedSpan::new([start, start + to], [first, 0.5 * (first + last), last]);
                self.push_span(span);
                return;
            }
            let span = ProgrammedSpan::new([start + from, start + to], [first, tip(place(0.5)), last]);
            let is_close = |part: f64| (span.at(part) - tip(place(part))).norm() <= DEVIATION;
            if halvings == 0 || [0.25, 0.75].into_iter().all(is_close) {
                self.push_span(span);
            } else {
                let middle = place(0.5);
                parts.extend([([middle, to], halvings - 1), ([from, middle], halvings - 1)]);
            }
        }
    }
}

impl PartProgramPlanner<'_> {
    /// Keeps the programmed path from the start, for [`take_programmed_path`](Self::take_programmed_path).
    pub fn keep_programmed_path(&mut self) {
        self.ahead.source.programmed.get_or_insert_default();
    }

    /// Appends the programmed path that was read since the last call to `path`.
    pub fn take_programmed_path(&mut self, kinematics: &Kinematics, path: &mut ProgrammedPath) {
        for (start, curve) in self.ahead.source.programmed.iter_mut().flat_map(|curves| curves.drain(..)) {
            path.push(&curve, start, &self.ahead.model, kinematics);
        }
    }
}
