//! Units in which pictures are labeled.

use virtual_axes_core::config::AxisKind;
use virtual_axes_core::units::{DEGREE, METER_PER_MINUTE, MILLIMETER, RPM};

use super::text;

/// Sizes and least ranges lie between this and its inverse, so that no scale overflows.
const SMALLEST: f64 = 1e-18;

/// A unit in which an axis of a picture is labeled; the values that are drawn are in SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DisplayUnit {
    /// As written.
    pub(super) symbol: &'static str,
    /// SI units in one of it.
    pub(super) size: f64,
    /// A range smaller than this, in the unit, is drawn as large: noise must not look like a signal.
    pub(super) least_range: f64,
}

impl DisplayUnit {
    /// Seconds.
    pub const SECOND: DisplayUnit = DisplayUnit::new("s", 1.0, 1e-3);
    /// Milliseconds.
    pub const MILLISECOND: DisplayUnit = DisplayUnit::new("ms", 1e-3, 1e-3);
    /// Millimeters.
    pub const MILLIMETER: DisplayUnit = DisplayUnit::new("mm", MILLIMETER, 1e-3);
    /// Micrometers.
    pub const MICROMETER: DisplayUnit = DisplayUnit::new("µm", MILLIMETER * 1e-3, 0.1);
    /// Degrees.
    pub const DEGREE: DisplayUnit = DisplayUnit::new("°", DEGREE, 1e-3);
    /// Thousandths of a degree.
    pub const MILLIDEGREE: DisplayUnit = DisplayUnit::new("mdeg", DEGREE * 1e-3, 0.1);
    /// Meters per minute.
    pub const METER_PER_MINUTE: DisplayUnit = DisplayUnit::new("m/min", METER_PER_MINUTE, 0.01);
    /// Revolutions per minute.
    pub const RPM: DisplayUnit = DisplayUnit::new("rpm", RPM, 0.01);
    /// Amperes.
    pub const AMPERE: DisplayUnit = DisplayUnit::new("A", 1.0, 0.1);
    /// Of a pure number.
    pub const NONE: DisplayUnit = DisplayUnit::new("", 1.0, 1e-3);

    /// A unit that is `size` SI units large; a range below `least_range`, in the unit, is drawn as
    /// large as that. With a size of 1 values are drawn as given.
    ///
    /// Both are positive; what is not, or beyond 1e-18…1e18, is taken for the nearest that is.
    pub const fn new(symbol: &'static str, size: f64, least_range: f64) -> DisplayUnit {
        let largest = 1.0 / SMALLEST;
        DisplayUnit {
            symbol,
            size: size.max(SMALLEST).min(largest),
            least_range: least_range.max(SMALLEST).min(largest),
        }
    }

    /// Of positions.
    pub fn position(kind: AxisKind) -> DisplayUnit {
        match kind {
            AxisKind::Linear => DisplayUnit::MILLIMETER,
            AxisKind::Rotary => DisplayUnit::DEGREE,
        }
    }

    /// Of errors.
    pub fn error(kind: AxisKind) -> DisplayUnit {
        match kind {
            AxisKind::Linear => DisplayUnit::MICROMETER,
            AxisKind::Rotary => DisplayUnit::MILLIDEGREE,
        }
    }

    /// Of velocities.
    pub fn velocity(kind: AxisKind) -> DisplayUnit {
        match kind {
            AxisKind::Linear => DisplayUnit::METER_PER_MINUTE,
            AxisKind::Rotary => DisplayUnit::RPM,
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
