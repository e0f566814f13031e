//! Contour between interpretation and steps: corners (`,R` `,C`, RND, CHF) and cutter radius compensation, which need the
//! next motion before one is complete.

mod compensation;
mod corner;
mod piece;

pub(super) use compensation::{Compensation, Compensator, require_in_front};
pub(super) use corner::Corner;
pub(super) use piece::{ContourPiece, Point, SAME};

use crate::motion::{Plane, ProgramMotion, ProgramStep};

/// Steps that wait for the next motion.
#[derive(Debug, Default)]
pub(super) struct Contour {
    /// Motion whose corner the next motion completes, and the events after it.
    pub(super) corner: Option<(ProgramMotion, Corner, Plane, Vec<ProgramStep>)>,
    pub(super) compensator: Option<Compensator>,
    /// Compensation with its plane, for a restart after an interruption.
    pub(super) compensation: Option<(Compensation, Plane)>,
    /// Tool center at the end of compensation, where the next motion begins.
    pub(super) leave: Option<(Point, Plane)>,
    /// Direction of the contour at the end of compensation, from which KONT must lead away.
    pub(super) leave_direction: Option<Point>,
    /// True if outside corners are intersections of the parallels (G451).
    pub(super) has_intersections: bool,
    /// True if the tool goes around the ends of the contour (KONT).
    pub(super) goes_around: bool,
    pub(super) out: Vec<ProgramStep>,
}
