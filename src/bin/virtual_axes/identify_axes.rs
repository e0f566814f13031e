//! Axes of `virtual_axes identify --axis all`.

use std::error::Error;
use std::path::PathBuf;

use virtual_axes_core::config::MachineConfig;
use virtual_axes_io::files::read_recording;

use crate::identify_columns::recorded_axes;
use crate::recordings::RecordingArguments;

/// Range of the setpoint, or else of the position, of an axis at rest, m or rad.
const AT_REST: f64 = 2e-5;

/// Rejects options that name the signals of one axis.
pub fn check_options(reading: &RecordingArguments) -> Result<(), Box<dyn Error>> {
    match reading.single_axis_option()? {
        None => Ok(()),
        Some(option) => Err(format!(
            "--axis all: {option} names the signals of one axis; give the name of that axis in place of all"
        )
        .into()),
    }
}

/// Returns the axes that move in one of the recordings, and the names of the others.
pub fn moving_axes(
    recordings: &[PathBuf],
    reading: &RecordingArguments,
    config: &MachineConfig,
) -> Result<(Vec<usize>, Vec<String>), Box<dyn Error>> {
    let options = reading.options()?;
    let moves = |index: &usize| {
        let axis = &config.axes()[*index];
        recordings.iter().any(|path| {
            // The identification reports a recording that cannot be read.
            let Ok((raw, _)) = read_recording(path, axis, &options) else { return true };
            let signal = raw.psec.or(raw.position).unwrap_or_default();
            let range = |bounds: (f64, f64), x: &f64| (bounds.0.min(*x), bounds.1.max(*x));
            let (least, most) = signal.iter().fold((f64::INFINITY, f64::NEG_INFINITY), range);
            most - least > AT_REST
        })
    };
    let axes = recorded_axes(recordings, reading, config)?;
    let (moving, resting): (Vec<usize>, Vec<usize>) = axes.into_iter().partition(moves);
    let names: Vec<String> = resting.iter().map(|index| config.axes()[*index].name().to_owned()).collect();
    if moving.is_empty() {
        return Err(format!("--axis all: no axis moves in the recordings ({})", names.join(", ")).into());
    }
    Ok((moving, names))
}
