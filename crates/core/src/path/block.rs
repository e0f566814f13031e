//! One geometric element of a path.

use super::arc::{Arc, Circle, turned};
use super::error::PathError;
use super::line::Line;
use super::spline::Spline;
use crate::config::AxisKind;
use crate::units::REVOLUTION;

/// Derivatives of the coordinates with respect to the length, one value per coordinate.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Derivatives {
    /// Of first order.
    pub first: Vec<f64>,
    /// Of second order.
    pub second: Vec<f64>,
    /// Of third order.
    pub third: Vec<f64>,
}

impl Derivatives {
    /// Room for `joints` coordinates, all 0.
    pub fn new(joints: usize) -> Self {
        Self { first: vec![0.0; joints], second: vec![0.0; joints], third: vec![0.0; joints] }
    }
}

/// One geometric element in programmed coordinates, one per joint of the machine, m or rad.
///
/// Its parameter s is the arc length of the linear coordinates, m; where these stand still, that of
/// the rotary ones, rad. When both move, the rotary ones follow s. Both ends are returned bit for bit
/// as they were given.
#[derive(Debug, Clone, PartialEq)]
pub struct Block {
    shape: Shape,
    start: Vec<f64>,
    end: Vec<f64>,
    length: f64,
    kind: AxisKind,
}

#[derive(Debug, Clone, PartialEq)]
enum Shape {
    Line(Line),
    Arc(Arc),
    Spline(Spline),
}

impl Block {
    /// A straight line.
    ///
    /// # Errors
    /// [`PathError`]: another number of coordinates than `kinds`, a value that is not finite, two
    /// equal points, a length that no f64 holds.
    pub fn line(from: &[f64], to: &[f64], kinds: &[AxisKind]) -> Result<Self, PathError> {
        check_point("the start", from, kinds)?;
        check_point("the end", to, kinds)?;
        let steps: Vec<f64> = from.iter().zip(to).map(|(from, to)| to - from).collect();
        let (length, kind) = measure(&steps, kinds).ok_or(PathError::StandsStill)?;
        let slopes = slopes(&steps, length)?;
        let shape = Shape::Line(Line { slopes });
        Ok(Self { shape, start: from.to_vec(), end: to.to_vec(), length, kind })
    }

    /// An arc of a circle in the plane of the two linear coordinates `plane`, with its center in these,
    /// m; `sweep` in rad, positive from the first towards the second, of any number of turns. `to`
    /// gives the other coordinates at the end, which are linear in s (a helix); its entries of the
    /// plane are ignored.
    ///
    /// # Errors
    /// [`PathError`]: as for a line; a plane that is not two linear coordinates; a start at the center;
    /// a sweep of 0.
    pub fn arc(
        from: &[f64],
        plane: [usize; 2],
        center: [f64; 2],
        sweep: f64,
        to: &[f64],
        kinds: &[AxisKind],
    ) -> Result<Self, PathError> {
        check_point("the start", from, kinds)?;
        let linear = |place: usize| kinds.get(place) == Some(&AxisKind::Linear);
        let [p, q] = plane;
        if p == q || !linear(p) || !linear(q) {
            return Err(PathError::Plane {
                first: p.saturating_add(1),
                second: q.saturating_add(1),
                joints: kinds.len(),
            });
        }
        check_finite("the center", &center)?;
        if !sweep.is_finite() || sweep == 0.0 {
            return Err(PathError::Sweep { sweep });
        }
        check_size("the end", to, kinds)?;
        let spoke = [from[p] - center[0], from[q] - center[1]];
        let radius = spoke[0].hypot(spoke[1]);
        if radius == 0.0 {
            return Err(PathError::Radius { center });
        }
        let mut end = to.to_vec();
        (end[p], end[q]) = if (sweep / REVOLUTION).fract() == 0.0 {
            (from[p], from[q])
        } else {
            let spoke = turned(spoke, sweep);
            (center[0] + spoke[0], center[1] + spoke[1])
        };
        check_point("the end", &end, kinds)?;
        let mut steps: Vec<f64> = from.iter().zip(&end).map(|(from, to)| to - from).collect();
        (steps[p], steps[q]) = (radius * sweep, 0.0);
        let (length, kind) = measure(&steps, kinds).ok_or(PathError::StandsStill)?;
        let mut slopes = slopes(&steps, length)?;
        slopes[p] = 0.0;
        let turn = sweep / length;
        if !(turn * turn * turn * radius).is_finite() || turn == 0.0 {
            return Err(PathError::Unmeasurable { length });
        }
        let circle = Circle { plane, center, radius, sweep };
        let shape = Shape::Arc(Arc { circle, spoke, turn, slopes });
        Ok(Self { shape, start: from.to_vec(), end, length, kind })
    }

    /// A clamped uniform cubic B-spline (C²); `points` are its control points after `from`, at least
    /// three. It starts at `from` towards the first of them and ends at the last, coming from the last
    /// but one; it does not pass through the others. Its arc length is exact to 10⁻¹⁰ relative.
    ///
    /// # Errors
    /// [`PathError`]: as for a line; fewer than three points; a spline that stands still on its way,
    /// for instance where the first two or last two points coincide.
    pub fn spline(from: &[f64], points: &[Vec<f64>], kinds: &[AxisKind]) -> Result<Self, PathError> {
        check_point("the start", from, kinds)?;
        for point in points {
            check_point("a control point", point, kinds)?;
        }
        let (spline, kind) = Spline::new(from, points, kinds)?;
        let end = points.last().cloned().unwrap_or_default();
        Ok(Self { length: spline.length(), shape: Shape::Spline(spline), start: from.to_vec(), end, kind })
    }

    /// Largest s: m or rad, after [`kind`](Self::kind).
    pub fn length(&self) -> f64 {
        self.length
    }

    /// What the length counts in: linear, m, or rotary, rad.
    pub fn kind(&self) -> AxisKind {
        self.kind
    }

    /// Number of coordinates.
    pub fn joints(&self) -> usize {
        self.start.len()
    }

    /// First point, m or rad.
    pub fn start(&self) -> &[f64] {
        &self.start
    }

    /// Last point, m or rad.
    pub fn end(&self) -> &[f64] {
        &self.end
    }

    /// The point at `s`, clamped to [0, length], into `out`, one value per coordinate.
    pub fn point(&self, s: f64, out: &mut [f64]) {
        debug_assert_eq!(out.len(), self.joints(), "one value per coordinate");
        if s <= 0.0 {
            return copy(&self.start, out);
        }
        if s >= self.length {
            return copy(&self.end, out);
        }
        match &self.shape {
            Shape::Line(line) => line.point(&self.start, s, out),
            Shape::Arc(arc) => arc.point(&self.start, s, out),
            Shape::Spline(spline) => spline.point(s, out),
        }
    }

    /// Derivatives at `s`, clamped to [0, length], with respect to it.
    pub fn derivatives(&self, s: f64) -> Derivatives {
        let mut out = Derivatives::new(self.joints());
        self.derivatives_into(s, &mut out);
        out
    }

    /// Like [`derivatives`](Self::derivatives), into room that is used again.
    pub fn derivatives_into(&self, s: f64, out: &mut Derivatives) {
        for order in [&mut out.first, &mut out.second, &mut out.third] {
            order.resize(self.joints(), 0.0);
        }
        let s = s.clamp(0.0, self.length);
        match &self.shape {
            Shape::Line(line) => line.derivatives(out),
            Shape::Arc(arc) => arc.derivatives(s, out),
            Shape::Spline(spline) => spline.derivatives(s, out),
        }
    }

    /// The circle, if it is an arc.
    pub fn circle(&self) -> Option<Circle> {
        match &self.shape {
            Shape::Arc(arc) => Some(arc.circle),
            _ => None,
        }
    }

    /// Whether it is a straight line in its coordinates.
    pub fn is_line(&self) -> bool {
        matches!(self.shape, Shape::Line(_))
    }

    /// Places s, from 0 to the length, between which all derivatives are continuous.
    pub(super) fn knots(&self) -> Vec<f64> {
        match &self.shape {
            Shape::Spline(spline) => spline.knots(),
            _ => vec![0.0, self.length],
        }
    }

    /// Whether none of the coordinates at `places` ever changes.
    pub fn keeps(&self, places: impl IntoIterator<Item = usize>) -> bool {
        places.into_iter().filter(|place| *place < self.joints()).all(|place| match &self.shape {
            Shape::Line(line) => line.slopes[place] == 0.0,
            Shape::Arc(arc) => !arc.circle.plane.contains(&place) && arc.slopes[place] == 0.0,
            Shape::Spline(spline) => spline.keeps(place),
        })
    }
}

fn copy(from: &[f64], to: &mut [f64]) {
    for (to, from) in to.iter_mut().zip(from) {
        *to = *from;
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

/// The coordinates of `kind` in `steps`, put together; hypot neither overflows nor underflows on the way.
fn norm(steps: &[f64], kinds: &[AxisKind], kind: AxisKind) -> f64 {
    let of_kind = steps.iter().zip(kinds).filter(|(_, found)| **found == kind);
    of_kind.fold(0.0, |sum: f64, (step, _)| sum.hypot(*step))
}

/// Length of the linear steps, or of the rotary ones where the linear are 0, or nothing.
fn measure(steps: &[f64], kinds: &[AxisKind]) -> Option<(f64, AxisKind)> {
    let of = |kind| Some((norm(steps, kinds, kind), kind)).filter(|(length, _)| *length > 0.0);
    of(AxisKind::Linear).or_else(|| of(AxisKind::Rotary))
}

fn slopes(steps: &[f64], length: f64) -> Result<Vec<f64>, PathError> {
    let slopes: Vec<f64> = steps.iter().map(|step| step / length).collect();
    if length.is_finite() && slopes.iter().all(|slope| slope.is_finite()) {
        Ok(slopes)
    } else {
        Err(PathError::Unmeasurable { length })
    }
}
