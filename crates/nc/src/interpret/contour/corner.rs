//! Corners inserted between two motions: `,R` and `,C` of Fanuc, RND, CHF and CHR of Sinumerik.

use virtual_axes_core::units::{MILLIMETER, Rounded};

use super::piece::{ContourPiece, Point, angle, cross, left};
use crate::interpret::error::Outcome;
use crate::motion::{Coordinates, MotionKind, PlanarArc, Plane, ProgramMotion};

/// Angle between two motions below which they have no corner, rad.
const STRAIGHT: f64 = 1e-6;

/// Corner inserted between the motion of its line and the next one, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::interpret) enum Corner {
    /// Tangent arc with a radius (`,R`, RND).
    Round(f64),
    /// Straight line that cuts off a length of both motions (`,C`, CHR).
    Chamfer(f64),
    /// Straight line of a length (CHF).
    ChamferLength(f64),
}

impl Corner {
    /// Shortens two motions of a plane that meet, and returns the motion between them.
    ///
    /// # Errors
    ///
    /// Motions that are too short for the corner, or neither lines nor arcs of the plane.
    pub(in crate::interpret) fn insert(
        self,
        before: &mut ProgramMotion,
        after: &mut ProgramMotion,
        plane: Plane,
    ) -> Outcome<Option<ProgramMotion>> {
        let pieces = [&*before, &*after].map(|motion| ContourPiece::new(motion, plane));
        let [Some(mut one), Some(mut other)] = pieces else {
            return Err("a corner requires lines or arcs in the active plane on both sides".to_owned());
        };
        if one.is_still() || other.is_still() {
            return Err("a corner requires motions in the active plane on both sides".to_owned());
        }
        let (leave, enter) = (one.tangent(true), other.tangent(false));
        let turn = angle(leave, enter);
        if turn.abs() < STRAIGHT {
            return Ok(None);
        }
        let missing = || {
            let (Self::Round(size) | Self::Chamfer(size) | Self::ChamferLength(size)) = self;
            format!(
                "the corner of {} mm does not fit between the motions of lines {} and {}",
                Rounded(size / MILLIMETER),
                before.line,
                after.line
            )
        };
        let corner = one.end;
        let (ends, center) = match self {
            Self::Round(radius) => {
                let side = radius * turn.signum();
                let parallels = one.parallel(side).zip(other.parallel(side));
                let center = parallels.and_then(|(one, other)| one.intersection(&other, corner));
                let center = center.ok_or_else(missing)?;
                ([one.foot(center), other.foot(center)], Some(center))
            }
            Self::Chamfer(leg) => ([one.point_at(leg, true), other.point_at(leg, false)], None),
            Self::ChamferLength(length) => {
                let leg = 0.5 * length / (0.5 * turn).cos().abs().max(STRAIGHT);
                ([one.point_at(leg, true), other.point_at(leg, false)], None)
            }
        };
        let (from, to) = (one, other);
        let is_possible = one.move_to(ends[0], true) & other.move_to(ends[1], false);
        let shares = [from.share(ends[0]), to.share(ends[1])];
        if !is_possible || !shares.iter().all(|share| (-1e-9..=1.0 + 1e-9).contains(share)) {
            return Err(missing());
        }
        let [start, end] = [(&*before, shares[0]), (&*after, shares[1])].map(|(motion, share)| {
            let at: Coordinates = std::array::from_fn(|axis| {
                motion.start[axis] + share * (motion.end[axis] - motion.start[axis])
            });
            at
        });
        (before.end, after.start) = (start, end);
        one.write(before, plane);
        other.write(after, plane);
        let kind = match center {
            Some(center) => {
                let sweep = angle(ends[0] - center, ends[1] - center);
                MotionKind::Arc(PlanarArc { plane, center: center.into(), sweep })
            }
            None => match before.kind {
                MotionKind::Rapid => MotionKind::Rapid,
                _ => MotionKind::Line,
            },
        };
        let (start, end) = (before.end, after.start);
        Ok(Some(ProgramMotion { kind, start, end, ..before.clone() }))
    }
}

/// Returns the side of the tool at a corner: positive if the path turns to the side of the tool, inside a corner.
pub(super) fn turn_to(leave: Point, enter: Point, is_left: bool) -> f64 {
    let sine = cross(leave, enter);
    // A reversal is outside on both sides.
    let is_reversal = sine.abs() < STRAIGHT && leave.dot(&enter) < 0.0;
    match (is_reversal, is_left) {
        (true, _) => -1.0,
        (false, true) => sine,
        (false, false) => -sine,
    }
}

/// Returns the unit vector from the path to the tool center.
pub(super) fn normal(tangent: Point, is_left: bool) -> Point {
    if is_left { left(tangent) } else { -left(tangent) }
}
