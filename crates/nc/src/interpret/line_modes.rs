//! Modes of a line by which the words of its motion are written again.

use super::codes::{FeedMode, Motion};
use super::dialect::Dialect;
use super::state::State;
use crate::motion::{Coordinates, Plane};

/// Modes after a line, and the programmed coordinates that it has reached.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LineModes {
    /// Programmed coordinates of the end of the last motion, m and rad.
    pub programmed: Coordinates,
    /// Length unit of the words, m.
    pub unit: f64,
    /// True if axis words are increments (G91).
    pub is_incremental: bool,
    /// True if the center of an arc is absolute (G90.1).
    pub has_absolute_centers: bool,
    /// Plane of arcs.
    pub plane: Plane,
    /// Feed word in effect.
    pub feed_word: f64,
    /// True if the words of a line, or arc at feed per minute are its coordinates shifted by an offset: no cycle, probing,
    /// compensation, rotation, scaling, polar coordinate, tilted plane or modal macro.
    pub is_plain: bool,
}

impl State {
    /// Returns the modes after the last line.
    pub(super) fn line_modes(&self) -> LineModes {
        let modal = &self.modal;
        let is_line_or_arc =
            matches!(modal.motion, Some(Motion::Line | Motion::ClockwiseArc | Motion::CounterclockwiseArc));
        let is_plain = is_line_or_arc
            && !matches!(self.dialect, Dialect::Sinumerik | Dialect::Okuma)
            && modal.feed_mode == FeedMode::PerMinute
            && modal.polar.is_none()
            && modal.surface.is_none()
            && !modal.has_tool_vectors
            && !modal.is_machine
            && !self.moves_in_machine_coordinates
            && self.frame.is_identity()
            && self.tilt.is_none()
            && self.offsets.rotations.get(&self.offsets.active).is_none_or(|angle| *angle == 0.0)
            && self.spline.is_none()
            && self.contour.compensation.is_none()
            && self.corner.is_none()
            && self.modal_macro.is_none();
        LineModes {
            programmed: self.programmed(),
            unit: modal.length,
            is_incremental: modal.is_incremental,
            has_absolute_centers: modal.has_absolute_centers,
            plane: modal.plane,
            feed_word: modal.feed_word,
            is_plain,
        }
    }
}
