//! Hints of errors of position setpoints from CSV.

use virtual_axes_core::trajectory::{Rejection, RejectionCode, TrajectoryRequest};
use virtual_axes_core::units::seconds;

/// Header of the time column.
pub(super) const TIME: &str = "time";
/// Maximum time, s: 100 h, as of part programs.
pub(super) const MAX_TIME: f64 = 360_000.0;

/// Returns the index of the first point after [`MAX_TIME`], with the reason of its rejection.
pub(super) fn late_point(request: &TrajectoryRequest) -> Option<(usize, String)> {
    let mut times = (0..request.points()).filter_map(|index| Some((index, seconds(request.point(index)?.0))));
    let (index, time) = times.find(|&(_, time)| time > MAX_TIME)?;
    Some((index, format!("point {index}: time_from_start is {time} s, must be at most {MAX_TIME} s (100 h)")))
}

/// Returns the probable cause of a setpoint far beyond a limit: another unit. Else an empty text.
pub(super) fn unit_hint(rejection: &Rejection) -> &'static str {
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
pub(super) fn separator_hint(found: usize, wanted: usize, has_semicolon: bool) -> &'static str {
    if has_semicolon {
        "; columns must be separated by commas, not by semicolons, and decimals by a point"
    } else if 2 * found >= 3 * wanted {
        "; decimals must be separated by a point, not by a comma"
    } else {
        ""
    }
}
