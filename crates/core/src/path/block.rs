//! Geometric elements of a path: lines, arcs and splines.

use super::arc::{Circle, CircularArc, rotated};
use super::derivatives::Derivatives;
use super::error::PathError;
use super::spline::Spline;
use crate::config::AxisKind;
use crate::units::REVOLUTION;

/// A geometric element in programmed coordinates, one per joint of the machine, m or rad.
///
/// Its parameter s is the arc length of the linear coordinates, m, or, if these are constant, that of the
/// rotary coordinates, rad. If both move, the rotary coordinates follow s. Both ends are returned
/// bit-identical to the input.
#[derive(Debug, Clone, PartialEq)]
pub struct Block {
    shape: Shape,
    start: Vec<f64>,
    end: Vec<f64>,
    /// Change of each coordinate per unit of length, of those outside the plane of an arc; empty for a spline.
    slopes: Vec<f64>,
    length: f64,
    kind: AxisKind,
}

#[derive(Debug, Clone, PartialEq)]
enum Shape {
    Line,
    Arc(CircularArc),
    Spline(Spline),
}

impl Block {
    /// Creates a straight line.
    ///
    /// # Errors
    /// Returns [`PathError`] if the number of coordinates differs from `kinds`, a value is not finite, both
    /// points are equal, or the length overflows.
    pub fn line(from: &[f64], to: &[f64], kinds: &[AxisKind]) -> Result<Self, PathError> {
        check_point("the start", from, kinds)?;
        check_point("the end", to, kinds)?;
        let steps: Vec<f64> = from.iter().zip(to).map(|(from, to)| to - from).collect();
        let (length, kind) = measure(&steps, kinds).ok_or(PathError::ZeroLength)?;
        let slopes = slopes(&steps, length)?;
        Ok(Self { shape: Shape::Line, start: from.to_vec(), end: to.to_vec(), slopes, length, kind })
    }

    /// Creates a circular arc or helix in the plane of the two linear coordinates `plane`, with its center
    /// in these, m.
    ///
    /// `sweep` in rad is positive from the first coordinate towards the second and may exceed one turn.
    /// `to` contains the end values of the other coordinates, which are linear in s; its entries for the
    /// plane are ignored.
    ///
    /// # Errors
    /// Returns [`PathError`] for the reasons given at [`line`](Self::line), if the plane is not two
    /// different linear coordinates, if the start is the center, or if the sweep is 0.
    pub fn arc(
        from: &[f64],
        plane: [usize; 2],
        center: [f64; 2],
        sweep: f64,
        to: &[f64],
        kinds: &[AxisKind],
    ) -> Result<Self, PathError> {
        check_point("the start", from, kinds)?;
        let linear = |index: usize| kinds.get(index) == Some(&AxisKind::Linear);
        let [p, q] = plane;
        if p == q || !linear(p) || !linear(q) {
            return Err(PathError::InvalidPlane {
                first: p.saturating_add(1),
                second: q.saturating_add(1),
                joints: kinds.len(),
            });
        }
        check_finite("the center", &center)?;
        if !sweep.is_finite() || sweep == 0.0 {
            return Err(PathError::InvalidSweep { sweep });
        }
        check_size("the end", to, kinds)?;
        let radius_vector = [from[p] - center[0], from[q] - center[1]];
        let radius = radius_vector[0].hypot(radius_vector[1]);
        if radius == 0.0 {
            return Err(PathError::ZeroRadius { center });
        }
        let mut end = to.to_vec();
        (end[p], end[q]) = if (sweep / REVOLUTION).fract() == 0.0 {
            (from[p], from[q])
        } else {
            let radius_vector = rotated(radius_vector, sweep);
            (center[0] + radius_vector[0], center[1] + radius_vector[1])
        };
        check_point("the end", &end, kinds)?;
        let mut steps: Vec<f64> = from.iter().zip(&end).map(|(from, to)| to - from).collect();
        (steps[p], steps[q]) = (radius * sweep, 0.0);
        let (length, kind) = measure(&steps, kinds).ok_or(PathError::ZeroLength)?;
        let mut slopes = slopes(&steps, length)?;
        slopes[p] = 0.0;
        let angle_per_length = sweep / length;
        if !(angle_per_length * angle_per_length * angle_per_length * radius).is_finite()
            || angle_per_length == 0.0
        {
            return Err(PathError::NotComputable { length });
        }
        let circle = Circle { plane, center, radius, sweep };
        let shape = Shape::Arc(CircularArc { circle, start_radius: radius_vector, angle_per_length });
        Ok(Self { shape, start: from.to_vec(), end, slopes, length, kind })
    }

    /// Creates a clamped uniform cubic B-spline (C²); `points` are its control points after `from`, at
    /// least three.
    ///
    /// The spline starts at `from` towards the first control point and ends at the last one, coming from
    /// the last but one; it does not pass through the others. Its arc length is exact to 10⁻¹⁰ relative.
    ///
    /// # Errors
    /// Returns [`PathError`] for the reasons given at [`line`](Self::line), if there are fewer than three
    /// points, or if the tangent vanishes, for instance because the first two or last two points coincide.
    pub fn spline(from: &[f64], points: &[Vec<f64>], kinds: &[AxisKind]) -> Result<Self, PathError> {
        check_point("the start", from, kinds)?;
        for point in points {
            check_point("a control point", point, kinds)?;
        }
        let (spline, kind) = Spline::new(from, points, kinds)?;
        let end = points.last().cloned().unwrap_or_default();
        let (length, start) = (spline.length(), from.to_vec());
        Ok(Self { shape: Shape::Spline(spline), start, end, slopes: Vec::new(), length, kind })
    }

    /// Returns the arc length, m or rad depending on [`kind`](Self::kind).
    pub fn length(&self) -> f64 {
        self.length
    }

    /// Returns the kind of the arc length: linear, m, or rotary, rad.
    pub fn kind(&self) -> AxisKind {
        self.kind
    }

    /// Returns the number of coordinates.
    pub fn joints(&self) -> usize {
        self.start.len()
    }

    /// Returns the first point, m or rad.
    pub fn start(&self) -> &[f64] {
        &self.start
    }

    /// Returns the last point, m or rad.
    pub fn end(&self) -> &[f64] {
        &self.end
    }

    /// Writes the point at `s`, clamped to [0, length], into `out`, one value per coordinate.
    pub fn point(&self, s: f64, out: &mut [f64]) {
        debug_assert_eq!(out.len(), self.joints(), "one value per coordinate");
        if s <= 0.0 {
            return out.copy_from_slice(&self.start);
        }
        if s >= self.length {
            return out.copy_from_slice(&self.end);
        }
        if let Shape::Spline(spline) = &self.shape {
            return spline.point(s, out);
        }
        for ((value, start), slope) in out.iter_mut().zip(&self.start).zip(&self.slopes) {
            *value = start + slope * s;
        }
        if let Shape::Arc(arc) = &self.shape {
            arc.point(s, out);
        }
    }

    /// Returns the derivatives with respect to s at `s`, clamped to [0, length].
    pub fn derivatives(&self, s: f64) -> Derivatives {
        let mut out = Derivatives::new(self.joints());
        self.derivatives_into(s, &mut out);
        out
    }

    /// Writes the derivatives into `out`, as [`derivatives`](Self::derivatives) does, without allocation.
    pub fn derivatives_into(&self, s: f64, out: &mut Derivatives) {
        for order in [&mut out.first, &mut out.second, &mut out.third] {
            order.resize(self.joints(), 0.0);
        }
        let s = s.clamp(0.0, self.length);
        if let Shape::Spline(spline) = &self.shape {
            return spline.derivatives(s, out);
        }
        out.first.copy_from_slice(&self.slopes);
        out.second.fill(0.0);
        out.third.fill(0.0);
        if let Shape::Arc(arc) = &self.shape {
            arc.derivatives(s, out);
        }
    }

    /// Returns the circle of an arc, `None` for other shapes.
    pub fn circle(&self) -> Option<Circle> {
        match &self.shape {
            Shape::Arc(arc) => Some(arc.circle),
            _ => None,
        }
    }

    /// Returns true for a straight line in programmed coordinates.
    pub fn is_line(&self) -> bool {
        matches!(self.shape, Shape::Line)
    }

    /// Returns the arc lengths, from 0 to the length, between which all derivatives are continuous.
    pub(crate) fn knots(&self) -> Vec<f64> {
        match &self.shape {
            Shape::Spline(spline) => spline.knots(),
            _ => vec![0.0, self.length],
        }
    }

    /// Returns true if the coordinates at `indices` are constant along the block.
    pub fn is_constant(&self, indices: impl IntoIterator<Item = usize>) -> bool {
        indices.into_iter().filter(|index| *index < self.joints()).all(|index| match &self.shape {
            Shape::Line => self.slopes[index] == 0.0,
            Shape::Arc(arc) => !arc.circle.plane.contains(&index) && self.slopes[index] == 0.0,
            Shape::Spline(spline) => spline.is_constant(index),
        })
    }
}

fn check_size(what: &'static str, point: &[f64], kinds: &[AxisKind]) -> Result<(), PathError> {
    if point.len() == kinds.len() {
        return Ok(());
    }
    Err(PathError::WrongSize { what, found: point.len(), wanted: kinds.len() })
}

fn check_finite(what: &'static str, point: &[f64]) -> Result<(), PathError> {
    match point.iter().position(|value| !value.is_finite()) {
        None => Ok(()),
        Some(i) => Err(PathError::NotFinite { what, coordinate: i + 1, value: point[i] }),
    }
}

fn check_point(what: &'static str, point: &[f64], kinds: &[AxisKind]) -> Result<(), PathError> {
    check_size(what, point, kinds)?;
    check_finite(what, point)
}

/// Returns the Euclidean norm of the coordinates of `kind` in `steps`; hypot avoids overflow and underflow.
fn norm(steps: &[f64], kinds: &[AxisKind], kind: AxisKind) -> f64 {
    let of_kind = steps.iter().zip(kinds).filter(|(_, found)| **found == kind);
    of_kind.fold(0.0, |sum: f64, (step, _)| sum.hypot(*step))
}

/// Returns the length of the linear steps, or of the rotary steps if the linear steps are 0, or `None`.
fn measure(steps: &[f64], kinds: &[AxisKind]) -> Option<(f64, AxisKind)> {
    let of = |kind| Some((norm(steps, kinds, kind), kind)).filter(|(length, _)| *length > 0.0);
    of(AxisKind::Linear).or_else(|| of(AxisKind::Rotary))
}

fn slopes(steps: &[f64], length: f64) -> Result<Vec<f64>, PathError> {
    let slopes: Vec<f64> = steps.iter().map(|step| step / length).collect();
    if length.is_finite() && slopes.iter().all(|slope| slope.is_finite()) {
        Ok(slopes)
    } else {
        Err(PathError::NotComputable { length })
    }
}
