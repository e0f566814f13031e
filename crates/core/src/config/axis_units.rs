//! Units of an axis in text and in JSON keys.

use super::axis::AxisConfig;
use super::definition::AxisKind;
use crate::units::{DEGREE, METER_PER_MINUTE, MICROMETER, MILLIDEGREE, MILLIMETER, RPM};

/// Units of an axis in text and in JSON keys, with their sizes in SI units.
#[derive(Debug, Clone, Copy)]
pub struct AxisUnits {
    /// Symbol of the SI unit of positions.
    pub si_name: &'static str,
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
    /// Unit of position errors, m or rad.
    pub error: f64,
    /// Symbol of the unit of position errors.
    pub error_name: &'static str,
    /// Suffix of JSON keys for position errors.
    pub error_key: &'static str,
}

impl AxisUnits {
    /// Returns the units of axes of the kind.
    pub fn for_kind(kind: AxisKind) -> Self {
        match kind {
            AxisKind::Linear => AxisUnits {
                si_name: "m",
                length: MILLIMETER,
                length_name: "mm",
                length_key: "mm",
                speed: METER_PER_MINUTE,
                speed_name: "m/min",
                speed_key: "m_min",
                error: MICROMETER,
                error_name: "µm",
                error_key: "um",
            },
            AxisKind::Rotary => AxisUnits {
                si_name: "rad",
                length: DEGREE,
                length_name: "°",
                length_key: "deg",
                speed: RPM,
                speed_name: "rpm",
                speed_key: "rpm",
                error: MILLIDEGREE,
                error_name: "mdeg",
                error_key: "mdeg",
            },
        }
    }
}

impl AxisConfig {
    /// Returns the units of the axis.
    pub fn units(&self) -> AxisUnits {
        AxisUnits::for_kind(self.kind)
    }
}
