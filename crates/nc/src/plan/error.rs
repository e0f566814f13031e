//! Errors of look-ahead and feed planning.

use thiserror::Error;
use virtual_axes_core::trajectory::InvalidFeedOverride;
use virtual_axes_core::units::Rounded;

/// Error of a program's source, such as a syntax error.
pub type StepError = Box<dyn std::error::Error + Send + Sync>;

/// Error of look-ahead and feed planning. Lines are lines of the part program, counted from 1.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum FeedPlanError {
    /// Error of the iterator of program steps.
    #[error(transparent)]
    Step(StepError),
    /// Number of joints beyond the programmable axes.
    #[error("the machine has {found} axes, at most {allowed} are supported")]
    TooManyAxes {
        /// Number of axes found.
        found: usize,
        /// Largest number of axes.
        allowed: usize,
    },
    /// Option outside its range.
    #[error("{name} is {value}, must be {allowed}")]
    InvalidOption {
        /// Name of the option.
        name: &'static str,
        /// Value found.
        value: f64,
        /// Allowed values.
        allowed: &'static str,
    },
    /// Motion with a coordinate, feed or arc that is not finite.
    #[error("line {line}: {what} {value} is not a finite number")]
    NotFinite {
        /// Source line.
        line: usize,
        /// Quantity.
        what: &'static str,
        /// Value found.
        value: f64,
    },
    /// Feed of zero or less.
    #[error("line {line}: feed {value} must be positive")]
    InvalidFeed {
        /// Source line.
        line: usize,
        /// Feed found, m/s, rad/s or s.
        value: f64,
    },
    /// Blending tolerance that is too small.
    #[error("line {line}: blending tolerance {} µm must be at least {} µm", Rounded(*.value * 1e6), Rounded(*.least * 1e6))]
    ToleranceTooSmall {
        /// Source line.
        line: usize,
        /// Tolerance found, m.
        value: f64,
        /// Smallest tolerance, m.
        least: f64,
    },
    /// Motion of an axis that the machine does not have.
    #[error("line {line}: axis {axis} moves, but the machine has no such axis")]
    MissingAxis {
        /// Source line.
        line: usize,
        /// Letter of the axis.
        axis: char,
    },
    /// Motion that does not start at the end of the motion before.
    #[error("line {line}: starts {} m or rad away from the end of the motion before", Rounded(*.gap))]
    Gap {
        /// Source line.
        line: usize,
        /// Largest difference of a coordinate, m or rad.
        gap: f64,
    },
    /// Spline that needs too many points within its tolerance.
    #[error(
        "line {line}: the spline needs more than {allowed} points; it is too long or its control points are too far apart"
    )]
    SplineTooLong {
        /// Source line.
        line: usize,
        /// Largest number of points.
        allowed: usize,
    },
    /// Spline on a control that has no splines.
    #[error("line {line}: the control has no splines: program lines, or set control.profile to own")]
    SplineUnsupported {
        /// Source line.
        line: usize,
    },
    /// Tool center point control without X, Y and Z.
    #[error("line {line}: tool center point control needs a machine with the axes X, Y and Z")]
    NoToolCenterPoint {
        /// Source line.
        line: usize,
    },
    /// Setpoint outside the travel limits.
    #[error(
        "line {line}: {axis} is at {} {unit}, outside the travel limits, {} to {}",
        Rounded(*.position), Rounded(*.min), Rounded(*.max)
    )]
    OutsideTravelLimits {
        /// Source line.
        line: usize,
        /// Name of the axis.
        axis: String,
        /// Unit of positions.
        unit: &'static str,
        /// Position, m or rad.
        position: f64,
        /// Lower limit, m or rad.
        min: f64,
        /// Upper limit, m or rad.
        max: f64,
    },
    /// Path along which no feed within the limits was found.
    #[error(
        "line {line}: no feed within the axis limits found; a corner or arc is too sharp for the numerical method \
         (smallest interval {} m), a larger blending tolerance may help",
        Rounded(*.interval)
    )]
    NoFeed {
        /// Source line.
        line: usize,
        /// Shortest interval of the path near the line, m.
        interval: f64,
    },
    /// Feed override outside 0 to 200 %.
    #[error(transparent)]
    InvalidOverride(#[from] InvalidFeedOverride),
}
