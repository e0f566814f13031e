//! Errors of position setpoints from CSV.

use virtual_axes_core::text::nearest_hint;
use virtual_axes_core::trajectory::{Rejection, RejectionCode};
use virtual_axes_core::units::Rounded;

/// Header of the time column.
pub(super) const TIME: &str = "time";
/// Maximum time, s: 100 h, as of part programs.
pub(super) const MAX_TIME: f64 = 360_000.0;

/// Error of reading position setpoints from CSV, with file and line.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PsecError {
    /// The file cannot be read, or is not text.
    #[error("{at}: {reason}")]
    Unreadable {
        /// File, and line if known.
        at: String,
        /// Error message of the reader.
        reason: String,
    },
    /// The first line is not a header of `time` and joint names.
    #[error("{at}: the header is \"{found}\", must be \"{TIME}\", then one joint name per column")]
    Header {
        /// File and line.
        at: String,
        /// Line found.
        found: String,
    },
    /// A column header is not a joint name.
    #[error("{at}: there is no joint \"{found}\"; there are {known}{}{}", nearest_hint(.nearest), header_unit_hint(.found))]
    UnknownJoint {
        /// File and line.
        at: String,
        /// Header found.
        found: String,
        /// Joint names, separated by commas.
        known: String,
        /// Most similar joint name.
        nearest: Option<String>,
    },
    /// A joint has two columns.
    #[error("{at}: joint {joint} has two columns")]
    DuplicateJoint {
        /// File and line.
        at: String,
        /// Name of the joint.
        joint: String,
    },
    /// A line has too many or too few values.
    #[error("{at}: {found} values, the header names {wanted} columns{}", separator_hint(*.found, *.wanted, *.has_semicolon))]
    Columns {
        /// File and line.
        at: String,
        /// Number of values found.
        found: usize,
        /// Number of columns in the header.
        wanted: usize,
        /// True if the line contains a semicolon.
        has_semicolon: bool,
    },
    /// A field is not a number.
    #[error("{at}: {column} is \"{found}\", must be a finite number")]
    Number {
        /// File and line.
        at: String,
        /// Header of the column.
        column: String,
        /// Field found.
        found: String,
    },
    /// A time is out of range.
    #[error("{at}: {TIME} is {} s, must lie in 0 … {MAX_TIME} s (100 h); is the column in s?", Rounded(*found))]
    Time {
        /// File and line.
        at: String,
        /// Time found, s.
        found: f64,
    },
    /// Times do not increase strictly.
    #[error("{at}: {TIME} is {found} s, must be later than {before} s of the previous row")]
    NotIncreasing {
        /// File and line.
        at: String,
        /// Time found, s.
        found: f64,
        /// Time of the previous row, s.
        before: f64,
    },
    /// A setpoint exceeds the limits of a joint.
    #[error("{at}: {rejection}{}", unit_hint(.rejection))]
    Point {
        /// File and line.
        at: String,
        /// Violated limit.
        rejection: Rejection,
    },
    /// The file has no row below the header.
    #[error("{at}: there is no setpoint below the header")]
    Empty {
        /// Name of the file.
        at: String,
    },
}

/// Returns the probable cause of a setpoint far beyond a limit: another unit. Else an empty text.
fn unit_hint(rejection: &Rejection) -> &'static str {
    /// Ratio to the limit from which the unit is doubted; a degree in place of a radian is a factor of 57.
    const DOUBTFUL_RATIO: f64 = 20.0;
    let is_limit = matches!(
        rejection.code,
        RejectionCode::OutsideTravelLimits | RejectionCode::Jump | RejectionCode::Speed
    );
    if is_limit && rejection.value.abs() > DOUBTFUL_RATIO * rejection.limit.abs() {
        "; positions are in m or rad: are these in mm or degrees?"
    } else {
        ""
    }
}

/// Returns the remedy for a unit in the header of a column.
pub(super) fn header_unit_hint(header: &str) -> &'static str {
    if header.contains(['[', '(']) {
        "; the header has no units: the time is in s, positions are in m or rad"
    } else {
        ""
    }
}

/// Returns the probable cause of a wrong number of values: another separator, or decimal commas.
fn separator_hint(found: usize, wanted: usize, has_semicolon: bool) -> &'static str {
    if has_semicolon {
        "; columns must be separated by commas, not by semicolons, and decimals by a point"
    } else if 2 * found >= 3 * wanted {
        "; decimals must be separated by a point, not by a comma"
    } else {
        ""
    }
}
