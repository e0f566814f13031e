//! Display units of plots.

use virtual_axes_core::config::AxisKind;
use virtual_axes_core::units::{DEGREE, METER_PER_MINUTE, MILLIMETER, RPM};

use super::text;

/// Lower limit of sizes and smallest ranges; the upper limit is its inverse. Prevents overflow of scales.
const SMALLEST: f64 = 1e-18;

/// Unit of the labels of a plot axis. Plotted values are in SI units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DisplayUnit {
    /// Symbol.
    pub(super) symbol: &'static str,
    /// Size in SI units.
    pub(super) size: f64,
    /// Smallest range of a plot axis, in the unit, so that noise does not look like a signal.
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
    /// Millidegrees.
    pub const MILLIDEGREE: DisplayUnit = DisplayUnit::new("mdeg", DEGREE * 1e-3, 0.1);
    /// Meters per minute.
    pub const METER_PER_MINUTE: DisplayUnit = DisplayUnit::new("m/min", METER_PER_MINUTE, 0.01);
    /// Revolutions per minute.
    pub const RPM: DisplayUnit = DisplayUnit::new("rpm", RPM, 0.01);
    /// Amperes.
    pub const AMPERE: DisplayUnit = DisplayUnit::new("A", 1.0, 0.1);
    /// Dimensionless.
    pub const NONE: DisplayUnit = DisplayUnit::new("", 1.0, 1e-3);

    /// Creates a unit of `size` SI units. Plot axes show a range of at least `least_range`, in the unit.
    ///
    /// Both are limited to 1e-18 … 1e18.
    pub const fn new(symbol: &'static str, size: f64, least_range: f64) -> DisplayUnit {
        let largest = 1.0 / SMALLEST;
        DisplayUnit {
            symbol,
            size: size.max(SMALLEST).min(largest),
            least_range: least_range.max(SMALLEST).min(largest),
        }
    }

    /// Returns the unit of positions.
    pub fn position(kind: AxisKind) -> DisplayUnit {
        match kind {
            AxisKind::Linear => DisplayUnit::MILLIMETER,
            AxisKind::Rotary => DisplayUnit::DEGREE,
        }
    }

    /// Returns the unit of errors.
    pub fn error(kind: AxisKind) -> DisplayUnit {
        match kind {
            AxisKind::Linear => DisplayUnit::MICROMETER,
            AxisKind::Rotary => DisplayUnit::MILLIDEGREE,
        }
    }

    /// Returns the unit of velocities.
    pub fn velocity(kind: AxisKind) -> DisplayUnit {
        match kind {
            AxisKind::Linear => DisplayUnit::METER_PER_MINUTE,
            AxisKind::Rotary => DisplayUnit::RPM,
        }
    }

    /// Formats a value in SI units, rounded, with the unit.
    pub(super) fn format(&self, value: f64) -> String {
        let gap = if self.symbol.is_empty() { "" } else { "\u{a0}" };
        format!("{}{gap}{}", text::rounded(value / self.size), self.symbol)
    }

    /// Returns the label of a plot axis: the quantity with the unit in parentheses.
    pub(super) fn label(&self, quantity: &str) -> String {
        if self.symbol.is_empty() { quantity.to_owned() } else { format!("{quantity} ({})", self.symbol) }
    }
}
