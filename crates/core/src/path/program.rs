//! A path with its law of time.

use std::ops::Range;
use std::sync::Arc;

use super::block::Block;
use super::cosine::Cosine;
use super::error::PlanError;
use super::planner;
use super::profile::Profile;
use super::route::{Frame, Path};
use crate::kinematics::Kinematics;
use crate::trajectory::JointLimits;
use crate::units::Nanoseconds;

/// What a move may ask of the path besides the limits of the axes; along s, ∞ where there is none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathLimits {
    /// m/s² or rad/s².
    pub acceleration: f64,
    /// m/s³ or rad/s³.
    pub jerk: f64,
}

impl Default for PathLimits {
    /// None.
    fn default() -> Self {
        Self { acceleration: f64::INFINITY, jerk: f64::INFINITY }
    }
}

/// How the feed changes along a move.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Law {
    /// Within the limits of acceleration and jerk of path and axes.
    JerkLimited,
    /// From rest to rest, rising as v/2 (1 − cos(π t/ramp)), constant, falling likewise. The ramps,
    /// v·ramp/2 each, are part of the block's length. As prescribed: only Vmax is checked.
    Cosine {
        /// s.
        ramp: f64,
    },
}

/// A block and how it is to be passed.
#[derive(Debug, Clone, PartialEq)]
pub struct Move {
    /// What is passed.
    pub block: Block,
    /// Largest speed along s, m/s or rad/s.
    pub feed: f64,
    /// Speed along s permitted at the end of this move if the direction turns there; none: exact stop.
    /// Setpoints jump in their velocity there, and at that instant no limit holds.
    pub corner: Option<f64>,
    /// Further limits.
    pub limits: PathLimits,
    /// How the feed changes.
    pub law: Law,
    /// Time at rest after the move, s.
    pub dwell: f64,
}

impl Move {
    /// A move at `feed` with an exact stop at its end, no further limits and no dwell.
    pub fn new(block: Block, feed: f64) -> Self {
        let limits = PathLimits::default();
        Self { block, feed, corner: None, limits, law: Law::JerkLimited, dwell: 0.0 }
    }
}

/// The law of time of a span.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum SpanLaw {
    Jerk(Profile),
    Cosine(Cosine),
}

impl SpanLaw {
    pub fn duration(&self) -> f64 {
        match self {
            Self::Jerk(profile) => profile.duration(),
            Self::Cosine(cosine) => cosine.duration(),
        }
    }

    fn at(&self, t: f64) -> f64 {
        match self {
            Self::Jerk(profile) => profile.at(t),
            Self::Cosine(cosine) => cosine.at(t),
        }
    }
}

/// Part of a block passed by one law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Span {
    pub block: usize,
    pub s_from: f64,
    pub s_to: f64,
    /// s.
    pub start: f64,
    pub end: f64,
    pub law: SpanLaw,
}

/// A path with its law of time: where it is when.
///
/// The feed is the largest such that no joint exceeds its speed, acceleration and jerk, nor the move
/// its feed and its own limits; jerk and acceleration are constant within the phases of a move. On a
/// straight line of the joints that is the fastest motion there is; on curves, limits are constant
/// over spans of the path (see below) and the result is near the fastest.
///
/// Junctions that are tangent continuous are passed at speed, at most at that of the slower move,
/// without acceleration along the path, and slowly enough that the jump of curvature makes
/// accelerations jump by Jmax·Tsp at most. Where the direction turns the path is left at rest, without
/// a pause, unless [`Move::corner`] permits a speed.
///
/// The setpoints that a controller gets are samples, one per position period: it is their first,
/// second and third differences over the period, its square and its cube that keep the limits, to
/// 10⁻⁶ relative; moves by a cosine law and corners passed at speed are excepted.
#[derive(Debug, Clone, PartialEq)]
pub struct Program {
    pub(super) path: Arc<Path>,
    pub(super) spans: Vec<Span>,
    /// Place of the first span of each block; then the number of spans.
    pub(super) first: Vec<usize>,
    pub(super) duration: f64,
}

impl Program {
    /// Plans the time law of `moves`, which begin after `rest` seconds, for joints with `limits` whose
    /// setpoints come every `period` nanoseconds.
    ///
    /// Strokes are not looked at: that is the business of whoever moves the machine.
    ///
    /// # Errors
    /// [`PlanError`], which names the move, from 1, the value and what is allowed.
    pub fn plan(
        kinematics: Kinematics,
        frame: Frame,
        limits: &[JointLimits],
        period: Nanoseconds,
        rest: f64,
        moves: Vec<Move>,
    ) -> Result<Self, PlanError> {
        planner::plan(kinematics, frame, limits, period, rest, moves)
    }

    /// The path.
    pub fn path(&self) -> &Arc<Path> {
        &self.path
    }

    /// Time of everything, rests and dwells included, s.
    pub fn duration(&self) -> f64 {
        self.duration
    }

    /// Progress along the path at time `t`, s, clamped; it never decreases with time.
    pub fn progress(&self, t: f64) -> f64 {
        let (block, s) = self.place(t);
        (self.path.start_of(block) + s).min(self.path.start_of(block + 1))
    }

    /// The joints at time `t`, s, clamped, m or rad, into `out`: one value per joint.
    pub fn psec(&self, t: f64, out: &mut [f64]) {
        let (block, s) = self.place(t);
        self.path.joints_in(block, s, out);
    }

    /// When `block`, from 0, is executed, s, without the dwell after it; empty beyond the last.
    pub fn span(&self, block: usize) -> Range<f64> {
        let place = |i: usize| self.first.get(i).copied().unwrap_or(self.spans.len());
        let spans = &self.spans[place(block)..place(block.saturating_add(1))];
        match (spans.first(), spans.last()) {
            (Some(first), Some(last)) => first.start..last.end,
            _ => self.duration..self.duration,
        }
    }

    /// The place of the last span that starts not later than `t`; the first one before that.
    pub(super) fn span_at(&self, t: f64) -> usize {
        self.spans.partition_point(|span| span.start <= t).saturating_sub(1)
    }

    /// Block and length in it at time `t`.
    fn place(&self, t: f64) -> (usize, f64) {
        let span = &self.spans[self.span_at(t)];
        let s = if t >= span.end {
            span.s_to
        } else {
            (span.s_from + span.law.at(t - span.start)).min(span.s_to)
        };
        (span.block, s)
    }
}
