//! The `--axis` option.

use virtual_axes_core::config::MachineConfig;
pub use virtual_axes_report::runs::AxisUnits;

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
