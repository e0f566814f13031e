//! One axis of a machine, and the units that people give its motion in.

use virtual_axes_core::config::{AxisKind, MachineConfig};
use virtual_axes_core::units::{DEGREE, METER_PER_MINUTE, MILLIMETER, RPM};

/// Least similarity (Jaro-Winkler) of a name that is offered in place of an unknown one.
const NEAR_ENOUGH: f64 = 0.7;

/// The place of the axis `name`, as `--axis` gives it.
///
/// # Errors
/// The axes that there are, and the one that looks most like it.
pub fn place(config: &MachineConfig, name: &str) -> Result<usize, String> {
    let known: Vec<&str> = config.axes().iter().map(|axis| axis.name()).collect();
    known.iter().position(|known| *known == name).ok_or_else(|| {
        // `X` and `X1` are meant for x.
        let similarity = |known: &str| strsim::jaro_winkler(&name.to_lowercase(), &known.to_lowercase());
        let near = known.iter().map(|known| (similarity(known), known));
        let nearest = near.max_by(|a, b| a.0.total_cmp(&b.0)).filter(|(near, _)| *near >= NEAR_ENOUGH);
        let nearest = nearest.map_or_else(String::new, |(_, name)| format!("; the nearest is {name}"));
        format!("--axis {name}: the machine has {}{nearest}", known.join(", "))
    })
}

/// Units of an axis on the command line.
#[derive(Debug, Clone, Copy)]
pub struct Units {
    /// Of lengths, in SI.
    pub length: f64,
    /// Of lengths, for people.
    pub length_name: &'static str,
    /// Of lengths, in keys.
    pub length_key: &'static str,
    /// Of speeds, in SI.
    pub speed: f64,
    /// Of speeds, for people.
    pub speed_name: &'static str,
    /// Of speeds, in keys.
    pub speed_key: &'static str,
}

impl Units {
    /// Of a kind of axis.
    pub fn of(kind: AxisKind) -> Self {
        match kind {
            AxisKind::Linear => Units {
                length: MILLIMETER,
                length_name: "mm",
                length_key: "mm",
                speed: METER_PER_MINUTE,
                speed_name: "m/min",
                speed_key: "m_min",
            },
            AxisKind::Rotary => Units {
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
