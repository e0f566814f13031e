//! Hints of errors of position setpoints from CSV.

use crate::messages::trajectory_msgs::msg::JointTrajectory;
use virtual_axes_core::trajectory::{Rejection, RejectionCode};
use virtual_axes_core::units::Rounded;

/// Header of the time column.
pub(super) const TIME: &str = "time";
/// Maximum time, s: 100 h, as of part programs.
pub(super) const MAX_TIME: f64 = 360_000.0;
/// Largest magnitude of a value of a point, in SI units: beyond that of any axis.
pub(super) const MAX_VALUE: f64 = 1e9;

/// Returns the index of the first point after [`MAX_TIME`] or with a value beyond [`MAX_VALUE`], with the reason of its
/// rejection.
pub(super) fn extreme_point(message: &JointTrajectory) -> Option<(usize, String)> {
    message.points.iter().enumerate().find_map(|(index, point)| {
        let time = point.time_from_start.sec;
        if f64::from(time) > MAX_TIME {
            let reason = format!("time_from_start is {time} s, must be at most {MAX_TIME} s (100 h)");
            return Some((index, format!("point {index}: {reason}")));
        }
        let fields = [
            ("positions", &point.positions),
            ("velocities", &point.velocities),
            ("accelerations", &point.accelerations),
            ("effort", &point.effort),
        ];
        fields.into_iter().find_map(|(field, values)| {
            let value = values.iter().find(|value| value.is_finite() && value.abs() > MAX_VALUE)?;
            let reason = format!("{} in {field}, must lie in ±{MAX_VALUE:e}", Rounded(*value));
            Some((index, format!("point {index}: {reason} (m or rad, and s)")))
        })
    })
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
