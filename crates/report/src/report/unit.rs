//! Units in which pictures are labeled.

use virtual_axes_core::config::AxisKind;
use virtual_axes_core::units::{DEGREE, METER_PER_MINUTE, MILLIMETER, RPM};

use super::text;

/// Sizes and least ranges lie between this and its inverse, so that no scale overflows.
const SMALLEST: f64 = 1e-18;

/// A unit in which an axis of a picture is labeled; the values that are drawn are in SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unit {
    /// As written.
    pub(super) symbol: &'static str,
    /// SI units in one of it.
    pub(super) size: f64,
    /// A range smaller than this, in the unit, is drawn as large: noise must not look like a signal.
    pub(super) least_range: f64,
}

impl Unit {
    /// Seconds.
    pub const SECOND: Unit = Unit::new("s", 1.0, 1e-3);
    /// Milliseconds.
    pub const MILLISECOND: Unit = Unit::new("ms", 1e-3, 1e-3);
    /// Millimeters.
    pub const MILLIMETER: Unit = Unit::new("mm", MILLIMETER, 1e-3);
    /// Micrometers.
    pub const MICROMETER: Unit = Unit::new("µm", MILLIMETER * 1e-3, 0.1);
    /// Degrees.
    pub const DEGREE: Unit = Unit::new("°", DEGREE, 1e-3);
    /// Thousandths of a degree.
    pub const MILLIDEGREE: Unit = Unit::new("mdeg", DEGREE * 1e-3, 0.1);
    /// Meters per minute.
    pub const METER_PER_MINUTE: Unit = Unit::new("m/min", METER_PER_MINUTE, 0.01);
    /// Revolutions per minute.
    pub const RPM: Unit = Unit::new("rpm", RPM, 0.01);
    /// Amperes.
    pub const AMPERE: Unit = Unit::new("A", 1.0, 0.1);
    /// Of a pure number.
    pub const NONE: Unit = Unit::new("", 1.0, 1e-3);

    /// A unit that is `size` SI units large; a range below `least_range`, in the unit, is drawn as
    /// large as that. With a size of 1 values are drawn as given.
    ///
    /// Both are positive; what is not, or beyond 1e-18…1e18, is taken for the nearest that is.
    pub const fn new(symbol: &'static str, size: f64, least_range: f64) -> Unit {
        let largest = 1.0 / SMALLEST;
        Unit {
            symbol,
            size: size.max(SMALLEST).min(largest),
            least_range: least_range.max(SMALLEST).min(largest),
        }
    }

    /// Of positions.
    pub fn position(kind: AxisKind) -> Unit {
        match kind {
            AxisKind::Linear => Unit::MILLIMETER,
            AxisKind::Rotary => Unit::DEGREE,
        }
    }

    /// Of errors.
    pub fn error(kind: AxisKind) -> Unit {
        match kind {
            AxisKind::Linear => Unit::MICROMETER,
            AxisKind::Rotary => Unit::MILLIDEGREE,
        }
    }

    /// Of velocities.
    pub fn velocity(kind: AxisKind) -> Unit {
        match kind {
            AxisKind::Linear => Unit::METER_PER_MINUTE,
            AxisKind::Rotary => Unit::RPM,
        }
    }

    /// A value in SI, rounded, with the unit.
    pub(super) fn show(&self, value: f64) -> String {
        let gap = if self.symbol.is_empty() { "" } else { "\u{a0}" };
        format!("{}{gap}{}", text::rounded(value / self.size), self.symbol)
    }

    /// A quantity with the unit behind it, as it stands along an axis.
    pub(super) fn label(&self, quantity: &str) -> String {
        if self.symbol.is_empty() { quantity.to_owned() } else { format!("{quantity} ({})", self.symbol) }
    }
}
