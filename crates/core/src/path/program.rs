//! A path with its feed profiles: position setpoints over time.

use std::ops::Range;
use std::sync::Arc;

use super::block::Block;
use super::geometry::Path;
use super::profile::SpeedProfile;
use crate::config::AxisKind;

/// Limits along s for one move, in addition to the axis limits; ∞ means no limit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathLimits {
    /// Largest acceleration along s, m/s² or rad/s².
    pub acceleration: f64,
    /// Largest jerk along s, m/s³ or rad/s³.
    pub jerk: f64,
}

impl Default for PathLimits {
    /// Returns infinite limits.
    fn default() -> Self {
        Self { acceleration: f64::INFINITY, jerk: f64::INFINITY }
    }
}

/// Feed profile of a move: feed over time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum FeedProfile {
    /// Jerk-limited profile within the acceleration and jerk limits of path and axes.
    JerkLimited,
    /// Cosine ramps from rest to rest: rising as v/2 (1 − cos(π t/ramp)), constant, falling symmetrically.
    /// Each ramp takes v·ramp/2 of the block's length. The profile is not adapted; only Vmax of the axes is
    /// checked.
    Cosine {
        /// Duration of a ramp, s.
        ramp: f64,
    },
}

/// A block with its feed, limits, feed profile and dwell.
#[derive(Debug, Clone, PartialEq)]
pub struct Move {
    /// Geometry of the move.
    pub block: Block,
    /// Programmed feed: largest speed along s, m/s or rad/s.
    pub feed: f64,
    /// Speed along s permitted at the end of this move if the direction changes there; `None` is an exact
    /// stop. The setpoint velocity is discontinuous there, and no limit holds at that instant.
    pub corner: Option<f64>,
    /// Additional limits along the path.
    pub limits: PathLimits,
    /// Feed profile.
    pub profile: FeedProfile,
    /// Dwell after the move, s.
    pub dwell: f64,
}

impl Move {
    /// Creates a jerk-limited move at `feed` with an exact stop at its end, no additional limits and no
    /// dwell.
    pub fn new(block: Block, feed: f64) -> Self {
        let limits = PathLimits::default();
        Self { block, feed, corner: None, limits, profile: FeedProfile::JerkLimited, dwell: 0.0 }
    }
}

/// Part of a block with one feed profile.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct TimedSpan {
    pub block: usize,
    pub s_from: f64,
    pub s_to: f64,
    /// Start time, s.
    pub start: f64,
    pub end: f64,
    pub profile: SpeedProfile,
}

/// A path with its feed profiles: position along the path over time.
///
/// The feed is the largest for which no joint exceeds its speed, acceleration and jerk limits and the move
/// does not exceed its feed and its own limits. Jerk and acceleration are piecewise constant. On a straight
/// line in joint space the motion is time-optimal; on curves the limits are constant over spans of the path
/// and the motion is close to the optimum.
///
/// Tangent-continuous junctions are passed at speed, at most that of the slower move, without acceleration
/// along the path, and slowly enough that the curvature jump causes an acceleration jump of at most
/// Jmax·Tsp. At corners the path stops without a dwell unless [`Move::corner`] permits a speed.
///
/// The controllers receive setpoints sampled once per position cycle. The first, second and third
/// differences of these samples over the cycle, its square and its cube keep the limits to 10⁻⁶ relative.
/// Moves with a cosine profile and corners passed at speed are exempt.
#[derive(Debug, Clone, PartialEq)]
pub struct Program {
    pub(super) path: Arc<Path>,
    pub(super) spans: Vec<TimedSpan>,
    pub(super) duration: f64,
    /// Highest programmed feed of the linear moves, m/s, and of the rotary moves, rad/s; 0 without such moves.
    pub(super) programmed_feeds: [f64; 2],
}

impl Program {
    /// Returns the path.
    pub fn path(&self) -> &Arc<Path> {
        &self.path
    }

    /// Returns the total time including rests and dwells, s.
    pub fn duration(&self) -> f64 {
        self.duration
    }

    /// Returns the highest programmed feed of the moves of one kind, m/s or rad/s; 0 without such moves.
    pub fn programmed_feed(&self, kind: AxisKind) -> f64 {
        self.programmed_feeds[kind as usize]
    }

    /// Returns the highest feed that moves of one kind reach, m/s or rad/s, and a time at which it is reached, s.
    pub fn highest_feed(&self, kind: AxisKind) -> (f64, f64) {
        let spans = self.spans.iter().filter(|span| self.path.blocks()[span.block].kind() == kind);
        let feeds = spans
            .map(|span| (span.profile.highest_speed(), span.start + span.profile.time_of_highest_speed()));
        feeds.max_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or_default()
    }

    /// Returns the progress along the path at time `t`, s, clamped; monotonic in time.
    pub fn progress(&self, t: f64) -> f64 {
        let (block, s) = self.locate(t);
        (self.path.start_of(block) + s).min(self.path.start_of(block + 1))
    }

    /// Writes the position setpoints (PSEC) at time `t`, s, clamped, m or rad, into `out`: one value per
    /// joint.
    pub fn psec(&self, t: f64, out: &mut [f64]) {
        let (block, s) = self.locate(t);
        self.path.joints_in(block, s, out);
    }

    /// Returns the time range of `block`, counted from 0, s, without the dwell after it; empty beyond the
    /// last block.
    pub fn time_range(&self, block: usize) -> Range<f64> {
        let spans = self.spans_of(block);
        match (spans.first(), spans.last()) {
            (Some(first), Some(last)) => first.start..last.end,
            _ => self.duration..self.duration,
        }
    }

    /// Returns the highest feed that is reached in `block`, counted from 0, m/s or rad/s; 0 beyond the last block.
    pub fn highest_feed_of(&self, block: usize) -> f64 {
        self.spans_of(block).iter().map(|span| span.profile.highest_speed()).fold(0.0, f64::max)
    }

    fn spans_of(&self, block: usize) -> &[TimedSpan] {
        let from = self.spans.partition_point(|span| span.block < block);
        &self.spans[from..self.spans.partition_point(|span| span.block <= block)]
    }

    /// Returns the index of the last span that starts at or before `t`, or 0.
    pub(super) fn span_index_at(&self, t: f64) -> usize {
        self.spans.partition_point(|span| span.start <= t).saturating_sub(1)
    }

    /// Returns the block and the arc length in it at time `t`.
    fn locate(&self, t: f64) -> (usize, f64) {
        let span = &self.spans[self.span_index_at(t)];
        let s = if t >= span.end {
            span.s_to
        } else {
            (span.s_from + span.profile.at(t - span.start)).min(span.s_to)
        };
        (span.block, s)
    }
}
