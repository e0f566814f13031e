//! Rational B-splines over their length.

use std::sync::Arc;

use super::error::FeedPlanError;
use super::vector::{JointKinds, JointVector, difference, mix};
use crate::motion::Nurbs;

/// Largest distance of the chords of a table from their curve: m, and as a fraction of the blending tolerance.
const CHORD_ERROR: f64 = 1e-8;
const CHORD_FRACTION: f64 = 0.02;
/// Smallest and largest number of halvings of a knot interval.
const HALVINGS: [u32; 2] = [3, 24];
/// Largest number of points of a table.
const MAX_POINTS: usize = 1_000_000;

/// Point of a spline.
#[derive(Debug, Clone, Copy)]
struct SplinePoint {
    /// Path parameter from the start of the spline.
    u: f64,
    /// Parameter of the B-spline, from 0 to 1. The joints outside the plane are linear in it.
    t: f64,
    /// Coordinates in the plane, m.
    position: [f64; 2],
}

/// Points of a B-spline by the path parameter, so close that chords replace the curve between them.
#[derive(Debug, Clone)]
pub(super) struct SplineTable {
    /// Joints of the plane.
    plane: [usize; 2],
    points: Arc<[SplinePoint]>,
}

impl SplineTable {
    /// Creates the table of the curve of source line `line` between two points, and returns it with the largest distance
    /// of the chords from the curve, m. `plane` are the joints of the plane.
    ///
    /// # Errors
    /// Returns an error for a point that is not finite, and for too many points.
    pub fn new(
        nurbs: &Nurbs,
        plane: [usize; 2],
        ends: [&JointVector; 2],
        kinds: &JointKinds,
        tolerance: f64,
        line: usize,
    ) -> Result<(Self, f64), FeedPlanError> {
        let chord_error = CHORD_ERROR.min(CHORD_FRACTION * tolerance);
        let joints = |point: &SplinePoint| joints(plane, ends, point);
        let intervals = intervals(nurbs);
        let knot = |i: usize| i as f64 / intervals as f64;
        let mut before = SplinePoint { u: 0.0, t: 0.0, position: plane.map(|joint| ends[0][joint]) };
        let mut points = vec![before];
        // Parts of the curve without chords, the next one last.
        let mut parts: Vec<_> = (0..intervals).rev().map(|i| (knot(i), knot(i + 1), 0)).collect();
        while let Some((from, to, halvings)) = parts.pop() {
            let position = if to < 1.0 { nurbs.point(to) } else { plane.map(|joint| ends[1][joint]) };
            let distance = |share: f64| {
                let curve = nurbs.point(from + share * (to - from));
                let chord = [0, 1].map(|k| before.position[k] + share * (position[k] - before.position[k]));
                (curve[0] - chord[0]).hypot(curve[1] - chord[1])
            };
            let distance = [0.25, 0.5, 0.75].map(distance).into_iter().fold(0.0, f64::max);
            if let Some(&value) = position.iter().chain([&distance]).find(|value| !value.is_finite()) {
                return Err(FeedPlanError::NotFinite { line, what: "point of a spline", value });
            }
            if halvings < HALVINGS[0] || (halvings < HALVINGS[1] && distance > chord_error) {
                let middle = 0.5 * (from + to);
                parts.extend([(middle, to, halvings + 1), (from, middle, halvings + 1)]);
                continue;
            }
            let mut here = SplinePoint { u: 0.0, t: to, position };
            here.u = before.u + kinds.length(&difference(&joints(&here), &joints(&before)));
            if here.u > before.u {
                points.push(here);
            } else if let Some(last) = points.last_mut() {
                *last = here;
            }
            if points.len() > MAX_POINTS {
                return Err(FeedPlanError::SplineTooLong { line, allowed: MAX_POINTS });
            }
            before = here;
        }
        Ok((Self { plane, points: points.into() }, chord_error))
    }

    /// Returns the length of the chords in the metric of the path parameter.
    pub fn length(&self) -> f64 {
        self.points.last().map_or(0.0, |last| last.u)
    }

    /// Returns the chord at path parameter `u`.
    fn chord(&self, u: f64) -> [&SplinePoint; 2] {
        let next = self.points.partition_point(|point| point.u <= u).clamp(1, self.points.len() - 1);
        [&self.points[next - 1], &self.points[next]]
    }

    /// Returns the joints at path parameter `u` of a spline between `from` and `to`, exact at both ends.
    pub fn point(&self, from: &JointVector, to: &JointVector, u: f64) -> JointVector {
        if u >= self.length() {
            return *to;
        }
        let [start, end] = self.chord(u);
        let share = (u - start.u) / (end.u - start.u);
        let between = |a: f64, b: f64| a + share * (b - a);
        let position = [0, 1].map(|k| between(start.position[k], end.position[k]));
        joints(self.plane, [from, to], &SplinePoint { u, t: between(start.t, end.t), position })
    }

    /// Returns the derivatives of the joints at path parameter `u`.
    pub fn slope(&self, from: &JointVector, to: &JointVector, u: f64) -> JointVector {
        let [start, end] = self.chord(u);
        let [first, second] = [start, end].map(|point| joints(self.plane, [from, to], point));
        difference(&second, &first).map(|step| step / (end.u - start.u))
    }
}

/// Returns the joints at a point of a spline between two ends.
fn joints(plane: [usize; 2], [from, to]: [&JointVector; 2], point: &SplinePoint) -> JointVector {
    let mut joints = mix(from, to, point.t);
    for (joint, value) in plane.into_iter().zip(point.position) {
        joints[joint] = value;
    }
    joints
}

/// Returns the degree of a spline.
fn degree(nurbs: &Nurbs) -> usize {
    let count = nurbs.control.len();
    nurbs.order.clamp(2, count.max(2)).saturating_sub(1).min(count.saturating_sub(1))
}

/// Returns the number of knot intervals of a spline.
fn intervals(nurbs: &Nurbs) -> usize {
    nurbs.control.len().saturating_sub(degree(nurbs)).max(1)
}

impl Nurbs {
    /// Returns the point (m) at parameter `t` from 0 to 1, by de Boor's algorithm in homogeneous coordinates. Inner knots
    /// are uniform; both ends are clamped. NaN without control points.
    pub fn point(&self, t: f64) -> [f64; 2] {
        let count = self.control.len();
        if count == 0 {
            return [f64::NAN; 2];
        }
        let (degree, spans) = (degree(self), intervals(self));
        let u = (t * spans as f64).clamp(0.0, spans as f64);
        let span = (u as usize).min(spans - 1);
        let knot = |i: usize| (i as f64 - degree as f64).clamp(0.0, spans as f64);
        let mut points: Vec<[f64; 3]> = (span..=span + degree)
            .map(|i| {
                let ([x, y], w) = self.control[i];
                [x * w, y * w, w]
            })
            .collect();
        for r in 1..=degree {
            for j in (r..=degree).rev() {
                let (low, high) = (knot(span + j), knot(span + j + degree + 1 - r));
                let alpha = if high > low { (u - low) / (high - low) } else { 0.0 };
                let (before, here) = (points[j - 1], points[j]);
                points[j] = std::array::from_fn(|k| before[k] + (here[k] - before[k]) * alpha);
            }
        }
        let [x, y, w] = points[degree];
        [x / w, y / w]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::Plane;

    #[test]
    fn a_quarter_circle_is_exact() {
        let w = 0.5_f64.sqrt();
        let control = vec![([1.0, 0.0], 1.0), ([1.0, 1.0], w), ([0.0, 1.0], 1.0)];
        let nurbs = Nurbs { plane: Plane::Xy, order: 3, control };
        for i in 0..=10 {
            let [x, y] = nurbs.point(f64::from(i) / 10.0);
            assert!((x.hypot(y) - 1.0).abs() < 1e-15);
        }
    }
}
