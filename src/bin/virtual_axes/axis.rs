//! The `--axis` option, and the units of an axis on the command line.

use virtual_axes_core::config::{AxisKind, MachineConfig};
use virtual_axes_core::units::{DEGREE, METER_PER_MINUTE, MILLIMETER, RPM};

/// Smallest Jaro–Winkler similarity of a name that is suggested for an unknown one.
const LEAST_SIMILARITY: f64 = 0.7;

/// Returns the index of the axis `name`, the value of `--axis`.
///
/// # Errors
///
/// Returns a message with the axes of the machine and the most similar name if no axis has this name.
pub fn index(config: &MachineConfig, name: &str) -> Result<usize, String> {
    let known: Vec<&str> = config.axes().iter().map(|axis| axis.name()).collect();
    known.iter().position(|known| *known == name).ok_or_else(|| {
        // `X` and `X1` are similar to x.
        let similarity = |known: &str| strsim::jaro_winkler(&name.to_lowercase(), &known.to_lowercase());
        let near = known.iter().map(|known| (similarity(known), known));
        let nearest = near.max_by(|a, b| a.0.total_cmp(&b.0)).filter(|(near, _)| *near >= LEAST_SIMILARITY);
        let nearest = nearest.map_or_else(String::new, |(_, name)| format!("; the nearest is {name}"));
        format!("--axis {name}: the machine has {}{nearest}", known.join(", "))
    })
}

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
