//! Cutter radius compensation: the path of the tool center beside the contour.
//!
//! Outside of a corner the tool center follows an arc about it, inside it turns at the intersection of both parallels. As
//! in LinuxCNC the first motion ends perpendicular to itself at the contour; as on other controls perpendicular to the
//! motion that follows. The motion after the end of compensation leaves from the last point of the parallel.

use virtual_axes_core::units::{DEGREE, MILLIMETER, Rounded};

use super::corner::{normal, turn_to};
use super::piece::{ContourPiece, Point, SAME, angle};
use crate::interpret::error::Outcome;
use crate::motion::{Feed, MotionKind, PlanarArc, Plane, ProgramMotion, ProgramStep};

/// Sine of the angle between two motions below which they are tangent.
const TANGENT: f64 = 1e-6;

/// Turn from which G451 passes an outside corner on an arc: default of the machine data 20210, rad.
const POINTED: f64 = 100.0 * DEGREE;

/// Cutter radius compensation in effect.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::interpret) struct Compensation {
    /// True if the tool is left of the path (G41).
    pub is_left: bool,
    /// Tool radius, m; a negative one is on the other side.
    pub radius: f64,
}

/// Compensation with the motion that the next one completes.
#[derive(Debug)]
pub(in crate::interpret) struct Compensator {
    is_left: bool,
    radius: f64,
    plane: Plane,
    /// True if the first motion ends perpendicular to itself, as in LinuxCNC.
    ends_perpendicular: bool,
    /// True if outside corners are intersections of the parallels (G451).
    pub has_intersections: bool,
    /// True if the tool goes around the start of the contour (KONT).
    pub goes_around: bool,
    last: Option<Last>,
}

/// Last motion in the plane.
#[derive(Debug)]
struct Last {
    /// Contour as programmed.
    contour: ContourPiece,
    /// Path of the tool center; its end is moved by an inside corner.
    path: ContourPiece,
    motion: ProgramMotion,
    /// True for the first motion of the compensation.
    is_first: bool,
    /// True for a motion with an error, whose path is the contour: its end is no corner.
    has_failed: bool,
    /// Events and motions normal to the plane that follow.
    after: Vec<ProgramStep>,
}

impl Last {
    /// Returns a motion with an error.
    fn failed(contour: ContourPiece, motion: ProgramMotion) -> Self {
        Self { contour, path: contour, motion, is_first: false, has_failed: true, after: Vec::new() }
    }
}

impl Compensator {
    pub(in crate::interpret) fn new(
        compensation: Compensation,
        plane: Plane,
        ends_perpendicular: bool,
    ) -> Self {
        let Compensation { is_left, radius } = compensation;
        let is_left = is_left == (radius >= 0.0);
        Self {
            is_left,
            radius: radius.abs(),
            plane,
            ends_perpendicular,
            has_intersections: false,
            goes_around: false,
            last: None,
        }
    }

    /// Returns true if steps wait for the next motion.
    pub(in crate::interpret) fn is_waiting(&self) -> bool {
        self.last.is_some()
    }

    /// Adds an event after the last motion.
    pub(in crate::interpret) fn push_event(&mut self, step: ProgramStep) {
        if let Some(last) = &mut self.last {
            last.after.push(step);
        }
    }

    /// Adds a motion; steps that are complete are appended to `out`.
    ///
    /// # Errors
    ///
    /// A contour that the tool cannot follow, or a curve that is no line or arc in the plane. The motions after it continue
    /// without consequences of the error.
    pub(in crate::interpret) fn push(
        &mut self,
        motion: ProgramMotion,
        out: &mut Vec<ProgramStep>,
    ) -> Outcome<()> {
        let contour = ContourPiece::new(&motion, self.plane)
            .ok_or("cutter compensation allows lines and arcs in the active plane only: program G40 first")?;
        let Some(last) = &mut self.last else { return self.enter(contour, motion, out) };
        if contour.is_still() {
            last.after.push(ProgramStep::Motion(motion));
            return Ok(());
        }
        let parallel = self.parallel(&contour);
        let Some(mut last) = self.last.take() else { return Ok(()) };
        let mut path = match parallel {
            Ok(path) => path,
            Err(reason) => {
                self.finish(last, out);
                self.last = Some(Last::failed(contour, motion));
                return Err(reason);
            }
        };
        let mut result = Ok(());
        let corner = contour.start;
        let (leave, enter) = (last.contour.tangent(true), contour.tangent(false));
        let turn = turn_to(leave, enter, self.is_left);
        if last.has_failed {
            self.finish(last, out);
        } else if last.is_first && !self.ends_perpendicular {
            // The lead-in ends perpendicular to the contour.
            if self.goes_around {
                result = require_in_front((last.contour.end - last.contour.start).dot(&enter));
            }
            last.path.end = path.start;
            self.finish(last, out);
        } else if turn.abs() < TANGENT && leave.dot(&enter) > 0.0 {
            path.start = last.path.end;
            self.finish(last, out);
        } else if turn < 0.0 && !self.meets(&mut last, &mut path, corner) {
            let (from, to) = (last.path.end, path.start);
            self.finish(last, out);
            out.push(ProgramStep::Motion(self.around(&motion, out, [from, to, corner])));
        } else {
            if turn > 0.0 {
                result = self.inside(&mut last, &mut path, corner, motion.line);
            }
            self.finish(last, out);
        }
        let (is_first, has_failed, after) = (false, false, Vec::new());
        self.last = Some(Last { contour, path, motion, is_first, has_failed, after });
        result
    }

    /// Ends the compensation: appends the steps that wait. Returns the tool center, where the next motion begins, and the
    /// direction of the contour there.
    pub(in crate::interpret) fn end(&mut self, out: &mut Vec<ProgramStep>) -> Option<(Point, Point)> {
        let last = self.last.take()?;
        let (center, direction) = (last.path.end, last.contour.tangent(true));
        self.finish(last, out);
        Some((center, direction))
    }

    fn enter(
        &mut self,
        contour: ContourPiece,
        motion: ProgramMotion,
        out: &mut Vec<ProgramStep>,
    ) -> Outcome<()> {
        if contour.is_still() {
            out.push(ProgramStep::Motion(motion));
            return Ok(());
        }
        let (is_first, has_failed, after) = (contour.arc.is_none(), false, Vec::new());
        match self.entry(&contour) {
            Ok(path) => self.last = Some(Last { contour, path, motion, is_first, has_failed, after }),
            Err(reason) => {
                self.last = Some(Last::failed(contour, motion));
                return Err(reason);
            }
        }
        Ok(())
    }

    /// Returns the path of the first motion.
    fn entry(&self, contour: &ContourPiece) -> Outcome<ContourPiece> {
        if contour.arc.is_some() {
            self.require_longer((contour.end - contour.start).norm(), "arc")?;
            return self.entry_arc(contour);
        }
        if self.ends_perpendicular {
            self.require_longer((contour.end - contour.start).norm(), "motion")?;
        }
        let end = contour.end + normal(contour.tangent(true), self.is_left) * self.radius;
        Ok(ContourPiece { end, ..*contour })
    }

    fn require_longer(&self, length: f64, what: &str) -> Outcome<()> {
        if length > self.radius {
            return Ok(());
        }
        let [length, radius] = [length, self.radius].map(|length| Rounded(length / MILLIMETER));
        Err(format!(
            "the first {what} with cutter compensation is {length} mm long, it must be longer than the tool radius of \
             {radius} mm"
        ))
    }

    /// Returns the arc from the start of an arc to the end of its parallel, tangent to the parallel there.
    fn entry_arc(&self, contour: &ContourPiece) -> Outcome<ContourPiece> {
        let Some((center, sweep)) = contour.arc else { return Ok(*contour) };
        let end = self.parallel(contour)?.end;
        let (inward, chord) = ((center - end).normalize(), contour.start - end);
        let along = inward.dot(&chord);
        if along.abs() < SAME {
            return Err(
                "the first arc with cutter compensation cannot be reached: begin with a line".to_owned()
            );
        }
        let center = end + inward * (0.5 * chord.norm_squared() / along);
        let change = angle(contour.start - center, end - center);
        let sweep =
            if change * sweep > 0.0 { change } else { change + std::f64::consts::TAU * sweep.signum() };
        Ok(ContourPiece { start: contour.start, end, arc: Some((center, sweep)) })
    }

    fn parallel(&self, contour: &ContourPiece) -> Outcome<ContourPiece> {
        let distance = if self.is_left { self.radius } else { -self.radius };
        contour.parallel(distance).ok_or_else(|| {
            let [arc, tool] = [contour.radius().unwrap_or_default(), self.radius]
                .map(|length| Rounded(length / MILLIMETER));
            format!("the tool radius of {tool} mm does not fit into the arc of radius {arc} mm")
        })
    }

    /// Ends and begins two parallels at their intersection outside of a corner (G451). Returns false without an intersection
    /// and at a pointed corner, which the tool passes on an arc.
    fn meets(&self, last: &mut Last, path: &mut ContourPiece, corner: Point) -> bool {
        let turn = angle(last.contour.tangent(true), path.tangent(false));
        if !self.has_intersections || turn.abs() > POINTED {
            return false;
        }
        let (mut before, mut after) = (last.path, *path);
        let Some(point) = before.intersection(&after, corner) else { return false };
        let is_found = before.move_to(point, true) && after.move_to(point, false);
        if is_found {
            (last.path, *path) = (before, after);
        }
        is_found
    }

    /// Returns the motion around an outside corner.
    fn around(
        &self,
        next: &ProgramMotion,
        out: &[ProgramStep],
        [from, to, corner]: [Point; 3],
    ) -> ProgramMotion {
        let mut motion = next.clone();
        // Other axes remain where the motion before has ended.
        if let Some(ProgramStep::Motion(before)) =
            out.iter().rev().find(|step| matches!(step, ProgramStep::Motion(_)))
        {
            motion.start = before.end;
        }
        motion.end = motion.start;
        let change = angle(from - corner, to - corner);
        // Around the corner the tool turns against its side.
        let sign = if self.is_left { -1.0 } else { 1.0 };
        let sweep = if change * sign > 0.0 { change } else { change + sign * std::f64::consts::TAU };
        let arc = (next.kind != MotionKind::Rapid).then_some((corner, sweep));
        if let Some((center, sweep)) = arc {
            motion.kind = MotionKind::Arc(PlanarArc { plane: self.plane, center: center.into(), sweep });
            if let Feed::Duration(time) = next.feed {
                let length = (next.end[0] - next.start[0])
                    .hypot(next.end[1] - next.start[1])
                    .hypot(next.end[2] - next.start[2]);
                motion.feed = Feed::Linear((length / time).max(SAME));
            }
        }
        ContourPiece { start: from, end: to, arc }.write(&mut motion, self.plane);
        motion
    }

    /// Ends and begins two parallels at their intersection inside of a corner.
    fn inside(&self, last: &mut Last, path: &mut ContourPiece, corner: Point, line: usize) -> Outcome<()> {
        let last_line = last.motion.line;
        let gouges = || {
            format!(
                "the tool radius of {} mm does not fit into the corner between lines {last_line} and {line}",
                Rounded(self.radius / MILLIMETER)
            )
        };
        // The lead-in turns at its parallel, then begins at its programmed start.
        let mut lead = last.path;
        if last.is_first {
            lead = self.parallel(&last.contour)?;
        }
        let point = lead.intersection(path, corner).ok_or_else(gouges)?;
        let mut moved = *path;
        if !(lead.move_to(point, true) & moved.move_to(point, false)) {
            return Err(gouges());
        }
        *path = moved;
        last.path = match last.is_first {
            true => ContourPiece { end: point, ..last.path },
            false => lead,
        };
        Ok(())
    }

    /// Appends a motion with the path of the tool center, and the steps after it.
    fn finish(&self, last: Last, out: &mut Vec<ProgramStep>) {
        let Last { path, mut motion, after, .. } = last;
        path.write(&mut motion, self.plane);
        if let MotionKind::Arc(_) = motion.kind
            && path.arc.is_none()
        {
            motion.kind = MotionKind::Line;
        }
        out.push(ProgramStep::Motion(motion));
        let still = ContourPiece { start: path.end, end: path.end, arc: None };
        out.extend(after.into_iter().map(|step| match step {
            ProgramStep::Motion(mut motion) => {
                still.write(&mut motion, self.plane);
                ProgramStep::Motion(motion)
            }
            event => event,
        }));
    }
}

/// Rejects a start or end of compensation with KONT behind the contour, by the way along the direction of the contour, m.
pub(in crate::interpret) fn require_in_front(way: f64) -> Outcome<()> {
    if way > -SAME {
        return Ok(());
    }
    Err("KONT with a start or end behind the contour is not supported: program NORM, or a start or end in front of it"
        .to_owned())
}
