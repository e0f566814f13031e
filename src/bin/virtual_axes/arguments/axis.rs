//! The `--axis` option.

use std::error::Error;

pub use virtual_axes_core::config::AxisUnits;
use virtual_axes_core::config::{AxisConfig, MachineConfig};

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

/// Returns the axes with these names in machine order; all axes if `names` is empty.
pub fn selected_axes<'a>(
    axes: &'a [AxisConfig],
    names: &[String],
) -> Result<Vec<&'a AxisConfig>, Box<dyn Error>> {
    if let Some(unknown) = names.iter().find(|name| axes.iter().all(|axis| axis.name() != name.as_str())) {
        let known: Vec<&str> = axes.iter().map(AxisConfig::name).collect();
        return Err(format!("--axis {unknown}: the machine has {}", known.join(", ")).into());
    }
    let is_selected = |axis: &&AxisConfig| names.is_empty() || names.iter().any(|name| axis.name() == name);
    Ok(axes.iter().filter(is_selected).collect())
}
