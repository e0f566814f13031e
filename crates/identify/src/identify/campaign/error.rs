//! Errors of planning a campaign.

use virtual_axes_core::path::{PathError, PlanError};
use virtual_axes_core::units::Rounded;

use super::options::SPEED_RESERVE;

/// Error of [`Campaign::plan`](super::Campaign::plan). Values are in mm and m/min, or ° and rev/min.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CampaignError {
    /// Axis that does not exist.
    #[error("axis {number} does not exist: the machine has {count} axes")]
    NoAxis {
        /// Axis number, starting at 1.
        number: usize,
        /// Number of axes of the machine.
        count: usize,
    },
    /// Empty range, or range outside the travel limits.
    #[error("range {min},{max} {unit} of {axis}: must be rising and within the travel limits {limits}")]
    Range {
        /// Lower end.
        min: f64,
        /// Upper end.
        max: f64,
        /// Unit: mm or deg.
        unit: &'static str,
        /// Name of the axis.
        axis: String,
        /// Travel limits with unit.
        limits: String,
    },
    /// Feed that the axis cannot reach.
    #[error(
        "feed {} {unit} of {axis}: must be above 0 and at most {allowed} {unit}, {SPEED_RESERVE} of the axis limit",
        Rounded(*found)
    )]
    Feed {
        /// Given feed.
        found: f64,
        /// Highest permitted feed.
        allowed: f64,
        /// Unit: m/min or rpm.
        unit: &'static str,
        /// Name of the axis.
        axis: String,
    },
    /// Range too short to reach the feed and hold it.
    #[error(
        "{axis}: a range of {found} {unit} is too short for a feed of {feed} {feed_unit}; give a range of at least \
         {needed} {unit} or a feed of at most {possible} {feed_unit}"
    )]
    TooShort {
        /// Name of the axis.
        axis: String,
        /// Length of the range.
        found: f64,
        /// Length required for the feed.
        needed: f64,
        /// Unit: mm or deg.
        unit: &'static str,
        /// Highest feed of the campaign.
        feed: f64,
        /// Highest feed that is possible within the range.
        possible: f64,
        /// Unit: m/min or rpm.
        feed_unit: &'static str,
    },
    /// Part that takes too long.
    #[error(
        "{axis}: part {part} takes {duration:.0} s, at most {limit} s are allowed; give a shorter range or a \
         higher feed"
    )]
    TooLong {
        /// Name of the axis.
        axis: String,
        /// Name of the part.
        part: &'static str,
        /// Planned duration, s.
        duration: f64,
        /// Longest permitted duration, s.
        limit: f64,
    },
    /// Leg with invalid geometry, such as a length below the numeric resolution.
    #[error("{axis}: {error}")]
    Path {
        /// Name of the axis.
        axis: String,
        /// Error of the geometry.
        error: PathError,
    },
    /// Legs that cannot be planned.
    #[error("{axis}: {error}")]
    Plan {
        /// Name of the axis.
        axis: String,
        /// Error of the planner.
        error: PlanError,
    },
}
