//! Why setpoints from CSV cannot be used.

use super::psec_csv::{LONGEST, TIME};
use virtual_axes_core::text::nearest_hint;
use virtual_axes_core::trajectory::Rejection;
use virtual_axes_core::units::Rounded;

/// Why a file of setpoints cannot be used; each names file and line.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PsecError {
    /// The file cannot be read, or is not text.
    #[error("{at}: {reason}")]
    Unreadable {
        /// File, and line where there is one.
        at: String,
        /// What the reader says.
        reason: String,
    },
    /// The first line is not a header that begins with `time` and names joints.
    #[error("{at}: the header is \"{found}\"; it begins with \"{TIME}\", then a joint for each column")]
    Header {
        /// File and line.
        at: String,
        /// What stands there.
        found: String,
    },
    /// A column is headed by what is not a joint.
    #[error("{at}: there is no joint \"{found}\"; there are {known}{}", nearest_hint(.nearest))]
    UnknownJoint {
        /// File and line.
        at: String,
        /// What stands there.
        found: String,
        /// The joints, with commas.
        known: String,
        /// The joint that looks most like it.
        nearest: Option<String>,
    },
    /// A joint has two columns.
    #[error("{at}: joint {joint} has two columns")]
    DuplicateJoint {
        /// File and line.
        at: String,
        /// Its name.
        joint: String,
    },
    /// A line has too many or too few values.
    #[error("{at}: {found} values, the header names {wanted} columns")]
    Columns {
        /// File and line.
        at: String,
        /// Values there are.
        found: usize,
        /// Columns there are.
        wanted: usize,
    },
    /// A field is not a number.
    #[error("{at}: {column} is \"{found}\", must be a finite number")]
    Number {
        /// File and line.
        at: String,
        /// Header of the column.
        column: String,
        /// What stands there.
        found: String,
    },
    /// A time is out of range.
    #[error("{at}: {TIME} is {} s, must lie in 0 … {LONGEST} s", Rounded(*found))]
    Time {
        /// File and line.
        at: String,
        /// What stands there.
        found: f64,
    },
    /// A time is not after the one before it.
    #[error("{at}: {TIME} is {found} s, must be later than {before} s of the line before it")]
    NotIncreasing {
        /// File and line.
        at: String,
        /// What stands there.
        found: f64,
        /// The time before it, s.
        before: f64,
    },
    /// The axes cannot do it.
    #[error("{at}: {rejection}")]
    Point {
        /// File and line.
        at: String,
        /// Why.
        rejection: Rejection,
    },
    /// There is no point.
    #[error("{at}: there is no setpoint below the header")]
    Empty {
        /// The file.
        at: String,
    },
}
