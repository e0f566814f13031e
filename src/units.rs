//! Units of CNC documentation, and time as an integer.
//!
//! Everything inside the library is SI; machine files use the units of CNC documentation
//! (Prévost Appendix 2). The factors below are the only place where the two meet.

use std::f64::consts::{PI, TAU};

/// Metres in a millimetre.
pub const MILLIMETRE: f64 = 1e-3;
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
/// Metres per second in a metre per minute.
pub const METRE_PER_MINUTE: f64 = 1.0 / MINUTE;
/// Position-loop gain, s⁻¹, in one (m/min)/mm, and in one (1000 °/min)/°: both are 1000/60 s⁻¹.
pub const POSITION_GAIN: f64 = 1000.0 / MINUTE;

/// Nanoseconds: the integer in which ROS stamps, trajectory times and periods are counted.
pub type Nanoseconds = i64;
/// Nanoseconds in a second.
pub const SECOND_NS: Nanoseconds = 1_000_000_000;
/// Nanoseconds in a millisecond.
pub const MILLISECOND_NS: Nanoseconds = 1_000_000;
/// Nanoseconds in a microsecond.
pub const MICROSECOND_NS: Nanoseconds = 1_000;

/// Seconds in `ns` nanoseconds.
pub fn seconds(ns: Nanoseconds) -> f64 {
    ns as f64 / SECOND_NS as f64
}
