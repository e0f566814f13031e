//! Unit conversion factors, integer time in nanoseconds, and rounding of numbers in messages.
//!
//! The library computes in SI units; machine files use the units of CNC documentation (Prévost Appendix 2). All
//! conversions use the factors of this module.

use std::f64::consts::{PI, TAU};
use std::fmt;

/// Meters in a millimeter.
pub const MILLIMETER: f64 = 1e-3;
/// Meters in an inch.
pub const INCH: f64 = 25.4 * MILLIMETER;
/// Meters in a micrometer.
pub const MICROMETER: f64 = 1e-6;
/// Seconds in a millisecond.
pub const MILLISECOND: f64 = 1e-3;
/// Henries in a millihenry.
pub const MILLIHENRY: f64 = 1e-3;
/// Seconds in a minute.
pub const MINUTE: f64 = 60.0;
/// Radians per second in a revolution per minute.
pub const RPM: f64 = TAU / MINUTE;
/// Radians in a revolution.
pub const REVOLUTION: f64 = TAU;
/// Radians in a degree.
pub const DEGREE: f64 = PI / 180.0;
/// Radians in a millidegree.
pub const MILLIDEGREE: f64 = 1e-3 * DEGREE;
/// Newtons per meter in a newton per micrometer.
pub const NEWTON_PER_MICROMETER: f64 = 1e6;
/// Meters per second in a meter per minute.
pub const METER_PER_MINUTE: f64 = 1.0 / MINUTE;
/// Position-loop gain of one (m/min)/mm or one (1000 °/min)/°, s⁻¹: both are 1000/60 s⁻¹.
pub const POSITION_GAIN: f64 = 1000.0 / MINUTE;

/// Time or duration as an integer number of nanoseconds: ROS stamps, trajectory times and periods.
pub type Nanoseconds = i64;
/// Nanoseconds in a second.
pub const SECOND_NS: Nanoseconds = 1_000_000_000;
/// Nanoseconds in a millisecond.
pub const MILLISECOND_NS: Nanoseconds = 1_000_000;
/// Nanoseconds in a microsecond.
pub const MICROSECOND_NS: Nanoseconds = 1_000;

/// Number in a message: displays at most six significant digits, in scientific notation if very large or small.
///
/// ```
/// use virtual_axes_core::units::Rounded;
///
/// assert_eq!(Rounded(0.1 + 0.2).to_string(), "0.3");
/// assert_eq!(Rounded(2.0e-7 / 3.0).to_string(), "6.66667e-8");
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rounded(pub f64);

impl fmt::Display for Rounded {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Rounded(value) = *self;
        let size = value.abs();
        let rounded: f64 = format!("{value:.5e}").parse().unwrap_or(value);
        match size == 0.0 || !size.is_finite() || (1e-5..1e12).contains(&size) {
            true => write!(f, "{rounded}"),
            false => write!(f, "{rounded:e}"),
        }
    }
}

/// Returns a position for messages, in SI units and in those of a machine file: `0.36 m (360 mm)`, `1 rad (57.2958°)`.
/// `unit` is m or rad.
pub fn position_text(value: f64, unit: &str) -> String {
    match unit {
        "m" => format!("{} m ({} mm)", Rounded(value), Rounded(value / MILLIMETER)),
        _ => format!("{} {unit} ({}°)", Rounded(value), Rounded(value / DEGREE)),
    }
}

/// Returns a speed for messages, in SI units and in those of a machine file: `0.5 m/s (30 m/min)`. `unit` is m or rad.
pub fn speed_text(value: f64, unit: &str) -> String {
    match unit {
        "m" => format!("{} m/s ({} m/min)", Rounded(value), Rounded(value / METER_PER_MINUTE)),
        _ => format!("{} {unit}/s ({} rpm)", Rounded(value), Rounded(value / RPM)),
    }
}

/// Returns the key of the velocity limit of an axis with positions in `unit`, m or rad.
pub fn velocity_limit_key(unit: &str) -> &'static str {
    if unit == "m" { "limits.velocity_m_min" } else { "limits.velocity_rpm" }
}

/// Converts nanoseconds to seconds.
pub fn seconds(ns: Nanoseconds) -> f64 {
    ns as f64 / SECOND_NS as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounded_displays_at_most_six_significant_digits() {
        for (value, text) in [
            (1000.0000000000001, "1000"),
            (0.1 + 0.2, "0.3"),
            (-0.355_000_000_1, "-0.355"),
            (1_234.567_8, "1234.57"),
            (2e-7, "2e-7"),
            (1e300, "1e300"),
            (0.0, "0"),
            (f64::NAN, "NaN"),
            (f64::INFINITY, "inf"),
        ] {
            assert_eq!(Rounded(value).to_string(), text);
        }
    }
}
