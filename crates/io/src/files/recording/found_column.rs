//! Columns of a recording with their detected meanings.

use std::fmt;

use super::unit::{Channel, Unit};
use virtual_axes_core::config::{AxisConfig, AxisKind};
use virtual_axes_core::text::shortened;
use virtual_axes_core::units::{DEGREE, MILLIMETER};

/// Column of a recording with its detected channel, unit and axis.
#[derive(Debug, Clone, PartialEq)]
pub struct FoundColumn {
    /// Column number, from 1, as in column mappings.
    pub number: usize,
    /// Header as in the file; `#` and the number for a file without a header.
    pub header: String,
    /// Detected channel, if any.
    pub channel: Option<Channel>,
    /// Detected or assumed unit of a column with a channel.
    pub unit: Option<ColumnUnit>,
    /// Name of the axis, if the file names one: `x`, `X1`, `7`.
    pub axis: Option<String>,
    /// Number of the axis beside its name, if the file has both: `1` of `DES_POS|1` for the axis `X1`.
    pub axis_number: Option<String>,
    /// Reason of the detection, or that the column is no channel.
    pub reason: String,
    /// True if the column is used only when no other column has its channel.
    pub(super) is_secondary: bool,
}

impl FoundColumn {
    /// Returns a column without a channel.
    pub(super) fn unknown(number: usize, header: &str, reason: &str) -> Self {
        FoundColumn {
            number,
            header: header.to_owned(),
            channel: None,
            unit: None,
            axis: None,
            axis_number: None,
            reason: reason.to_owned(),
            is_secondary: false,
        }
    }
}

/// Unit of a column: from the header, from the format, or assumed.
#[derive(Debug, Clone, PartialEq)]
pub struct ColumnUnit(pub(super) UnitSource);

/// Source of the unit of a column.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum UnitSource {
    /// Unit that the file states.
    Known(Unit),
    /// Units of linear and rotary axes that the format defines.
    ByKind(Unit, Unit),
    /// Velocity of the axis in mm/s or deg/s, for a velocity feedforward.
    AxisSpeed,
    /// SI unit that the format defines.
    Si(Channel),
    /// SI unit, as the file states none.
    Assumed(Channel),
    /// Number of samples.
    Samples,
    /// Text that is no known unit.
    Unknown(String),
}

/// Factor to SI of a column.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum ColumnFactor {
    /// Factor to SI.
    Value(f64),
    /// Number of samples: the factor is the sampling period.
    Samples,
    /// Unit that the channel of this axis does not allow.
    Unfit,
    /// Unit that is unknown.
    Unknown,
}

impl ColumnUnit {
    /// Returns the units with these symbols for linear and rotary axes.
    pub(super) fn by_kind(linear: &'static str, rotary: &'static str) -> Self {
        let unit = |symbol| Unit { factor: 1.0, symbol };
        ColumnUnit(UnitSource::ByKind(unit(linear), unit(rotary)))
    }

    /// Returns true if the file does not state the unit and SI is assumed.
    pub fn is_assumed(&self) -> bool {
        matches!(self.0, UnitSource::Assumed(_))
    }

    /// Returns true for a number of samples, which requires a sampling rate.
    pub fn is_samples(&self) -> bool {
        matches!(self.0, UnitSource::Samples)
    }

    /// Returns the factor to SI for a channel of an axis.
    pub(super) fn factor(&self, channel: Channel, axis: &AxisConfig) -> ColumnFactor {
        let units = channel.units(axis);
        let of = |unit: &Unit| {
            let found = units.iter().find(|(symbol, _)| *symbol == unit.symbol);
            found.map_or(ColumnFactor::Unfit, |(_, worth)| ColumnFactor::Value(unit.factor * worth))
        };
        let is_linear = axis.kind == AxisKind::Linear;
        match &self.0 {
            UnitSource::Known(unit) => of(unit),
            UnitSource::ByKind(linear, rotary) => of(if is_linear { linear } else { rotary }),
            UnitSource::AxisSpeed => {
                let speed = if is_linear { MILLIMETER } else { DEGREE };
                ColumnFactor::Value(speed / axis.transmission_ratio)
            }
            UnitSource::Si(_) | UnitSource::Assumed(_) => ColumnFactor::Value(1.0),
            UnitSource::Samples => ColumnFactor::Samples,
            UnitSource::Unknown(_) => ColumnFactor::Unknown,
        }
    }
}

impl fmt::Display for ColumnUnit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.0 {
            UnitSource::Known(unit) => write!(f, "{unit}"),
            UnitSource::ByKind(linear, rotary) if linear == rotary => write!(f, "{linear}"),
            UnitSource::ByKind(linear, rotary) => write!(f, "{linear} or {rotary}"),
            UnitSource::AxisSpeed => f.write_str("mm/s or deg/s of the axis"),
            UnitSource::Si(channel) => f.write_str(channel.si_units()),
            UnitSource::Assumed(channel) => write!(f, "{} (assumed)", channel.si_units()),
            UnitSource::Samples => f.write_str("samples"),
            UnitSource::Unknown(text) => write!(f, "unknown: {}", shortened(text)),
        }
    }
}
