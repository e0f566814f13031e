//! CSV files of production traces.

use std::fmt::Write;
use std::fs;
use std::path::Path;

use virtual_axes_core::units::MILLIMETER;
use virtual_axes_identify::recording::RawRecording;

use super::error::TraceError;

/// Writes recordings with equal stamps as one CSV file: time in s, and per recording commanded position in mm, actual
/// position in mm, actual velocity in mm/s and current in A.
///
/// Headers contain the name of the recording in upper case: `X commanded position [mm]`. Resolutions are 1 µs, 0.1 µm,
/// 1 µm/s and 1 mA. Missing values are empty.
///
/// # Errors
/// [`TraceError::Io`] if the file cannot be written.
pub fn write_csv(path: &Path, recordings: &[RawRecording]) -> Result<(), TraceError> {
    fs::write(path, csv(recordings))
        .map_err(|source| TraceError::Io { path: path.display().to_string(), source })
}

/// Column of a trace.
struct Column<'a> {
    header: String,
    values: Option<&'a Vec<f64>>,
    /// Unit of the column in SI units.
    unit: f64,
    decimals: usize,
}

fn csv(recordings: &[RawRecording]) -> String {
    let columns: Vec<Column<'_>> = recordings.iter().flat_map(columns).collect();
    let mut text = "Time [s]".to_owned();
    for column in &columns {
        text.push(',');
        text.push_str(&column.header);
    }
    text.push('\n');
    let time = recordings.first().map_or(&[][..], |recording| &recording.time);
    for (k, stamp) in time.iter().enumerate() {
        // Writing to a string does not fail.
        let _ = write!(text, "{stamp:.6}");
        for Column { values, unit, decimals, .. } in &columns {
            text.push(',');
            if let Some(value) = values.and_then(|values| values.get(k)).filter(|value| value.is_finite()) {
                let power = 10.0_f64.powi(*decimals as i32);
                // Adding 0 turns -0 into 0.
                let _ = write!(text, "{:.decimals$}", (value / unit * power).round() / power + 0.0);
            }
        }
        text.push('\n');
    }
    text
}

fn columns(recording: &RawRecording) -> [Column<'_>; 4] {
    let name = recording.name.to_uppercase();
    let column = |signal: &str, values, unit, decimals| Column {
        header: format!("{name} {signal}"),
        values,
        unit,
        decimals,
    };
    [
        column("commanded position [mm]", recording.psec.as_ref(), MILLIMETER, 4),
        column("actual position [mm]", recording.position.as_ref(), MILLIMETER, 4),
        column("actual velocity [mm/s]", recording.velocity.as_ref(), MILLIMETER, 3),
        column("current [A]", recording.current.as_ref(), 1.0, 3),
    ]
}
