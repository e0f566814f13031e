//! Units of an axis in text and in JSON keys.

use virtual_axes_core::config::AxisKind;
use virtual_axes_core::units::{DEGREE, METER_PER_MINUTE, MILLIMETER, RPM};

/// Units of an axis on the command line and in JSON keys.
#[derive(Debug, Clone, Copy)]
pub struct AxisUnits {
    /// Unit of positions, m or rad.
    pub length: f64,
    /// Symbol of the unit of positions.
    pub length_name: &'static str,
    /// Suffix of JSON keys for positions.
    pub length_key: &'static str,
    /// Unit of speeds, m/s or rad/s.
    pub speed: f64,
    /// Symbol of the unit of speeds.
    pub speed_name: &'static str,
    /// Suffix of JSON keys for speeds.
    pub speed_key: &'static str,
}

impl AxisUnits {
    /// Returns the units of a kind of axis.
    pub fn for_kind(kind: AxisKind) -> Self {
        match kind {
            AxisKind::Linear => AxisUnits {
                length: MILLIMETER,
                length_name: "mm",
                length_key: "mm",
                speed: METER_PER_MINUTE,
                speed_name: "m/min",
                speed_key: "m_min",
            },
            AxisKind::Rotary => AxisUnits {
                length: DEGREE,
                length_name: "°",
                length_key: "deg",
                speed: RPM,
                speed_name: "rpm",
                speed_key: "rpm",
            },
        }
    }
}
