//! Why there is no campaign.

use virtual_axes_core::path::{PathError, PlanError};

use super::room::SPEED_RESERVE;

/// A campaign that cannot be. Values are in the units of the axis: mm and m/min, or ° and rev/min.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CampaignError {
    /// The machine has no such axis.
    #[error("axis {place}: the machine has {count}")]
    NoAxis {
        /// From 1.
        place: usize,
        /// Axes of the machine.
        count: usize,
    },
    /// A range that is none, or not within the stroke.
    #[error("range {min},{max} {unit}: must rise and lie within the stroke of {axis}, {stroke}")]
    Range {
        /// Lower end.
        min: f64,
        /// Upper end.
        max: f64,
        /// mm or deg.
        unit: &'static str,
        /// Name of the axis.
        axis: String,
        /// The stroke, with its unit.
        stroke: String,
    },
    /// A speed that the axis cannot have.
    #[error("feed {found} {unit}: must be above 0 and at most {allowed}, {SPEED_RESERVE} of what {axis} can")]
    Feed {
        /// What was asked for.
        found: f64,
        /// Largest one.
        allowed: f64,
        /// m/min or rpm.
        unit: &'static str,
        /// Name of the axis.
        axis: String,
    },
    /// No room to reach the speed and to hold it.
    #[error(
        "{axis}: a range of {found} {unit} is too short for {feed} {feed_unit}: it needs {needed} {unit}, or a feed \
         of {possible} {feed_unit} at most"
    )]
    TooShort {
        /// Name of the axis.
        axis: String,
        /// Length of the range.
        found: f64,
        /// Length that the speed needs.
        needed: f64,
        /// mm or deg.
        unit: &'static str,
        /// Highest speed of the campaign.
        feed: f64,
        /// Highest speed that the range has room for.
        possible: f64,
        /// m/min or rpm.
        feed_unit: &'static str,
    },
    /// More than an hour.
    #[error(
        "{axis}: part {part} would last {duration:.0} s, {limit} s at most are allowed: a shorter range or \
             a higher feed is needed"
    )]
    TooLong {
        /// Name of the axis.
        axis: String,
        /// Which part.
        part: &'static str,
        /// s.
        duration: f64,
        /// s.
        limit: f64,
    },
    /// A leg that is no geometry: too short for the numbers that describe it.
    #[error("{axis}: {error}")]
    Path {
        /// Name of the axis.
        axis: String,
        /// What is wrong.
        error: PathError,
    },
    /// Legs that cannot be planned.
    #[error("{axis}: {error}")]
    Plan {
        /// Name of the axis.
        axis: String,
        /// Why.
        error: PlanError,
    },
}
