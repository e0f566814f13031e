//! Lines and arcs in the plane of the contour: tangents, parallels, intersections.

use nalgebra::Vector2;

use crate::motion::{MotionKind, PlanarArc, Plane, ProgramMotion};

/// Point or direction in the plane, m.
pub(in crate::interpret) type Point = Vector2<f64>;

/// Distance below which two points are the same, m.
pub(in crate::interpret) const SAME: f64 = 1e-9;

/// Line or arc in the plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::interpret) struct ContourPiece {
    pub start: Point,
    pub end: Point,
    /// Center and swept angle of an arc, rad, positive counterclockwise.
    pub arc: Option<(Point, f64)>,
}

impl ContourPiece {
    /// Returns the piece of a motion, or `None` for a curve that is neither a line nor an arc in the plane.
    pub(in crate::interpret) fn new(motion: &ProgramMotion, plane: Plane) -> Option<Self> {
        let [first, second, _] = plane.axes();
        let [start, end] = [&motion.start, &motion.end].map(|point| Point::new(point[first], point[second]));
        let arc = match &motion.kind {
            MotionKind::Rapid | MotionKind::Line => None,
            MotionKind::Arc(arc) if arc.plane == plane => Some((Point::from(arc.center), arc.sweep)),
            MotionKind::Arc(_) | MotionKind::Nurbs(_) => return None,
        };
        Some(Self { start, end, arc })
    }

    /// Writes the piece into a motion of the plane.
    pub(super) fn write(&self, motion: &mut ProgramMotion, plane: Plane) {
        let [first, second, _] = plane.axes();
        for (coordinates, point) in [(&mut motion.start, self.start), (&mut motion.end, self.end)] {
            [coordinates[first], coordinates[second]] = point.into();
        }
        if let (Some((center, sweep)), MotionKind::Arc(arc)) = (self.arc, &mut motion.kind) {
            *arc = PlanarArc { plane, center: center.into(), sweep };
        }
    }

    /// Returns true if start and end of a line are the same.
    pub(in crate::interpret) fn is_still(&self) -> bool {
        self.arc.is_none() && (self.end - self.start).norm() < SAME
    }

    /// Returns the unit tangent at the start, or at the end.
    pub(super) fn tangent(&self, at_end: bool) -> Point {
        let Some((center, sweep)) = self.arc else { return (self.end - self.start).normalize() };
        let radius = if at_end { self.end - center } else { self.start - center };
        left(radius).normalize() * sweep.signum()
    }

    /// Returns the radius of an arc at its start.
    pub(super) fn radius(&self) -> Option<f64> {
        self.arc.map(|(center, _)| (self.start - center).norm())
    }

    /// Returns the parallel at a distance to the left, or `None` if an arc has no radius left.
    pub(super) fn parallel(&self, distance: f64) -> Option<Self> {
        if let Some((center, sweep)) = self.arc {
            let least = (self.start - center).norm().min((self.end - center).norm());
            if least - sweep.signum() * distance < SAME {
                return None;
            }
        }
        let shifted = |point: Point, at_end| point + left(self.tangent(at_end)) * distance;
        Some(Self { start: shifted(self.start, false), end: shifted(self.end, true), arc: self.arc })
    }

    /// Returns the intersection with another piece, both continued, that is nearest to a point.
    pub(super) fn intersection(&self, other: &Self, near: Point) -> Option<Point> {
        let points = match (self.arc, other.arc) {
            (None, None) => line_line(self, other),
            (None, Some((center, _))) => line_circle(self, center, other.radius()?),
            (Some((center, _)), None) => line_circle(other, center, self.radius()?),
            (Some((a, _)), Some((b, _))) => circle_circle(a, self.radius()?, b, other.radius()?),
        };
        let distance = |point: &Point| (point - near).norm();
        points.into_iter().flatten().min_by(|a, b| distance(a).total_cmp(&distance(b)))
    }

    /// Moves the end, or the start, to a point of the continued piece; returns false if nothing of the piece remains.
    #[must_use]
    pub(super) fn move_to(&mut self, point: Point, at_end: bool) -> bool {
        let before = if at_end { self.end } else { self.start };
        let direction = self.tangent(false);
        *(if at_end { &mut self.end } else { &mut self.start }) = point;
        let Some((center, sweep)) = &mut self.arc else {
            return (self.end - self.start).dot(&direction) > -SAME;
        };
        let sign = sweep.signum();
        let change = angle(before - *center, point - *center);
        *sweep += if at_end { change } else { -change };
        let radius = (point - *center).norm();
        *sweep * sign * radius > -SAME
    }

    /// Returns the point at a distance from the end, or the start, along a line or as a chord of an arc.
    pub(super) fn point_at(&self, distance: f64, from_end: bool) -> Point {
        let (from, inward) = if from_end { (self.end, -1.0) } else { (self.start, 1.0) };
        match self.arc {
            None => from + self.tangent(from_end) * distance * inward,
            Some((center, sweep)) => {
                let radius = from - center;
                let half = (0.5 * distance / radius.norm()).min(1.0).asin();
                center + rotated(radius, 2.0 * half * sweep.signum() * inward)
            }
        }
    }

    /// Returns the point nearest to `point` on the continued piece.
    pub(super) fn foot(&self, point: Point) -> Point {
        match self.arc {
            None => {
                let direction = self.tangent(false);
                self.start + direction * (point - self.start).dot(&direction)
            }
            Some((center, _)) => center + (point - center).normalize() * (self.start - center).norm(),
        }
    }

    /// Returns the share of the piece up to a point of it, 0 to 1.
    pub(super) fn share(&self, point: Point) -> f64 {
        match self.arc {
            None => {
                let step = self.end - self.start;
                (point - self.start).dot(&step) / step.norm_squared()
            }
            Some((center, sweep)) => angle(self.start - center, point - center) / sweep,
        }
    }
}

/// Returns a direction turned by 90° to the left.
pub(super) fn left(direction: Point) -> Point {
    Point::new(-direction.y, direction.x)
}

/// Returns the cross product.
pub(super) fn cross(a: Point, b: Point) -> f64 {
    a.x * b.y - a.y * b.x
}

/// Returns the angle from one direction to another, −π to π.
pub(super) fn angle(from: Point, to: Point) -> f64 {
    cross(from, to).atan2(from.dot(&to))
}

fn rotated(point: Point, angle: f64) -> Point {
    let (sin, cos) = angle.sin_cos();
    Point::new(point.x * cos - point.y * sin, point.x * sin + point.y * cos)
}

fn line_line(one: &ContourPiece, other: &ContourPiece) -> [Option<Point>; 2] {
    let (a, b) = (one.tangent(true), other.tangent(false));
    let sine = cross(a, b);
    if sine.abs() < 1e-12 {
        return [None, None];
    }
    [Some(one.end + a * (cross(other.start - one.end, b) / sine)), None]
}

fn line_circle(line: &ContourPiece, center: Point, radius: f64) -> [Option<Point>; 2] {
    let direction = line.tangent(false);
    let foot = line.start + direction * (center - line.start).dot(&direction);
    half_chord(radius, (foot - center).norm())
        .map_or([None, None], |half| [Some(foot + direction * half), Some(foot - direction * half)])
}

fn circle_circle(a: Point, radius_a: f64, b: Point, radius_b: f64) -> [Option<Point>; 2] {
    let axis = b - a;
    let distance = axis.norm();
    if distance < SAME {
        return [None, None];
    }
    let along = 0.5 * (distance + (radius_a - radius_b) * (radius_a + radius_b) / distance);
    let foot = a + axis * (along / distance);
    half_chord(radius_a, along.abs()).map_or([None, None], |half| {
        let across = left(axis / distance) * half;
        [Some(foot + across), Some(foot - across)]
    })
}

/// Returns half of the chord at a distance from the center; a line that misses the circle by rounding touches it.
fn half_chord(radius: f64, distance: f64) -> Option<f64> {
    let square = (radius - distance) * (radius + distance);
    (square > -2.0 * radius * SAME).then(|| square.max(0.0).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(start: [f64; 2], end: [f64; 2]) -> ContourPiece {
        ContourPiece { start: start.into(), end: end.into(), arc: None }
    }

    #[test]
    fn parallels_and_intersections_have_closed_forms() {
        let (along, up) = (line([0.0, 0.0], [4.0, 0.0]), line([4.0, 0.0], [4.0, 3.0]));
        let corner = Point::new(4.0, 0.0);
        let [one, other] = [along, up].map(|piece| piece.parallel(1.0).unwrap());
        assert!((one.intersection(&other, corner).unwrap() - Point::new(3.0, 1.0)).norm() < 1e-15);
        // Quarter circle about (0, 0) from (5, 0): its parallel 1 to the left has radius 4.
        let arc = ContourPiece {
            start: Point::new(5.0, 0.0),
            end: Point::new(0.0, 5.0),
            arc: Some((Point::zeros(), std::f64::consts::FRAC_PI_2)),
        };
        let inner = arc.parallel(1.0).unwrap();
        assert!((inner.radius().unwrap() - 4.0).abs() < 1e-15);
        assert!(arc.parallel(5.0).is_none(), "no radius left");
        let crossing = inner.intersection(&line([3.0, -9.0], [3.0, 9.0]), corner).unwrap();
        assert!((crossing - Point::new(3.0, 7.0_f64.sqrt())).norm() < 1e-14);
        let mut cut = inner;
        assert!(cut.move_to(crossing, true));
        assert!((cut.arc.unwrap().1 - (7.0_f64.sqrt() / 3.0).atan()).abs() < 1e-15);
        assert!(!line([0.0, 0.0], [1.0, 0.0]).move_to(Point::new(-0.5, 0.0), true), "reversed");
        assert!(line([0.0, 0.0], [1.0, 0.0]).intersection(&line([0.0, 1.0], [1.0, 1.0]), corner).is_none());
    }
}
