//! Interval of the path with its planned motion.

use std::sync::Arc;

use super::activity::ProgramActivity;
use super::interval_motion::IntervalMotion;
use super::piece::Piece;
use super::window::Interval;

/// Interval of the path with its planned motion.
#[derive(Debug, Clone)]
pub(super) struct PlannedInterval {
    /// Interval for the speed solver; `None` for a motion of closed form.
    pub interval: Option<Interval>,
    pub piece: Option<Arc<Piece>>,
    /// Start of the interval from the start of the piece.
    pub from: f64,
    pub motion: Option<IntervalMotion>,
    /// Activity of a standstill.
    pub standstill: Option<ProgramActivity>,
    /// True if the motion stops at the end of the interval.
    pub is_stop: bool,
}

impl PlannedInterval {
    /// Creates an interval with a motion of closed form.
    pub fn closed_form(piece: Arc<Piece>, from: f64, motion: IntervalMotion) -> Self {
        let (piece, motion) = (Some(piece), Some(motion));
        Self { interval: None, piece, from, motion, standstill: None, is_stop: true }
    }

    /// Creates a standstill at the end of a piece.
    pub fn standstill(piece: Option<Arc<Piece>>, motion: IntervalMotion, activity: ProgramActivity) -> Self {
        let from = piece.as_ref().map_or(0.0, |piece| piece.length);
        Self { interval: None, piece, from, motion: Some(motion), standstill: Some(activity), is_stop: true }
    }
}
