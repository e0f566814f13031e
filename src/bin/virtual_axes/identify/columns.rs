//! Columns of recordings: what `virtual_axes identify` finds without an axis.

use std::error::Error;
use std::path::PathBuf;

use virtual_axes_core::config::{MachineConfig, Parameters};
use virtual_axes_core::text::escaped;
use virtual_axes_identify::recording::StatedValues;
use virtual_axes_io::files::{Channel, RecordingColumns, RecordingFormat, inspect_recording};
use virtual_axes_report::Table;

use crate::identify::next_command::Listed;
use crate::identify::recordings::RecordingArguments;
use crate::identify::selection::{SelectedAxis, without_axis};
use crate::output::text_table;

/// Returns the columns of the recordings, what they are taken for, what is missing, and the next command; those of
/// `transmission` have both encoders. `machine` has parameters, name and `--set`, and `stated` returns the values of an axis
/// that the user has stated.
///
/// # Errors
/// Returns an error if a recording or an option is invalid.
pub fn listing(
    (recordings, transmission): (&[PathBuf], &[PathBuf]),
    reading: &RecordingArguments,
    (parameters, machine, set): (&Parameters, &str, &[String]),
    stated: &dyn Fn(&str) -> StatedValues,
) -> Result<String, Box<dyn Error>> {
    let options = reading.options()?;
    let config = &parameters.machine_config()?;
    let (mut text, mut columns) = (String::new(), Vec::new());
    let mut axes: Vec<usize> = Vec::new();
    for path in recordings.iter().chain(transmission) {
        let found = inspect_recording(path, &options)?;
        text += &format!("{}: {}\n\n", escaped(&path.display().to_string()), found.format);
        text += &text_table::aligned(&table(&found), &[0, 1, 2, 3, 4]);
        text.push('\n');
        let needed = if transmission.contains(path) { &BOTH_ENCODERS[..] } else { &ONE_ENCODER[..] };
        for line in missing(&found, needed, reading.has_rate()) {
            text += &text_table::wrapped_line(&line);
        }
        axes.extend(axes_of(&found, config));
        columns.push(found);
    }
    axes.sort_unstable();
    axes.dedup();
    let assumed = "assumed without other information: recordings without cutting, and all values of the initial machine that \
                   they do not show";
    text += &text_table::wrapped_line(assumed);
    let options = set.iter().flat_map(|set| ["--set", set]);
    let machine = ["--machine", machine].into_iter().chain(options).map(str::to_owned).collect();
    let listed = Listed { recordings: (recordings, transmission), columns, reading, config, machine, stated };
    for line in listed.lines(axes.into_iter().map(|index| selected(config, index)).collect())? {
        // A command is one line.
        let is_command = line.contains(": virtual_axes ");
        text += &if is_command { line + "\n" } else { text_table::wrapped_line(&line) };
    }
    Ok(text)
}

/// Returns an axis of the machine that has its own name in the recordings.
fn selected(config: &MachineConfig, index: usize) -> SelectedAxis {
    SelectedAxis { name: config.axes()[index].name().to_owned(), joint: None }
}

/// Returns the axes of the machine that the recordings contain.
///
/// # Errors
/// Returns an error if a recording cannot be read, or contains no axis of the machine.
pub fn recorded_axes(
    recordings: &[PathBuf],
    reading: &RecordingArguments,
    config: &MachineConfig,
) -> Result<Vec<SelectedAxis>, Box<dyn Error>> {
    let options = reading.options()?;
    let mut common: Option<Vec<usize>> = None;
    for path in recordings {
        let found = inspect_recording(path, &options)?;
        if found.format == RecordingFormat::Mcap {
            return Err(format!(
                "{}: --axis all requires columns; give the names of the axes",
                path.display()
            )
            .into());
        }
        let axes = axes_of(&found, config);
        if axes.is_empty() && found.readable_axes().is_empty() {
            return Err(without_axis(&path.display().to_string(), &found).into());
        }
        if axes.is_empty() {
            let known: Vec<&str> = config.axes().iter().map(|axis| axis.name()).collect();
            let present = found.readable_axes().join(", ");
            return Err(format!(
                "{}: --axis all: no axis of the machine ({}) among those of the file ({present}); name both, for example --axis \
                 x,y --joint 1,2",
                path.display(),
                known.join(", ")
            )
            .into());
        }
        common = Some(match common {
            Some(known) => known.into_iter().filter(|axis| axes.contains(axis)).collect(),
            None => axes,
        });
    }
    Ok(common.unwrap_or_default().into_iter().map(|index| selected(config, index)).collect())
}

/// Returns the indices of the axes of the machine whose position the file has.
fn axes_of(found: &RecordingColumns, config: &MachineConfig) -> Vec<usize> {
    let readable = found.readable_axes();
    let is_readable =
        |name: &str| found.axis_of(name).is_some_and(|axis| readable.iter().any(|known| known == axis));
    config
        .axes()
        .iter()
        .enumerate()
        .filter(|(_, axis)| is_readable(axis.name()))
        .map(|(index, _)| index)
        .collect()
}

/// Channels, each with its name and the effect of its absence; one of the channels is enough.
type NeededChannel = (&'static [Channel], &'static str, &'static str);

const POSITION: NeededChannel = (&[Channel::Position], "actual position", "without it nothing is identified");
/// Channels of a recording with one encoder.
const ONE_ENCODER: [NeededChannel; 3] = [
    POSITION,
    (&[Channel::Psec], "commanded position", "without it there are no delays, gains and feedforward weights"),
    (
        &[Channel::Current, Channel::Torque],
        "motor current",
        "without it there are no friction, gravity and inertia",
    ),
];
/// Channels of a recording with both encoders.
const BOTH_ENCODERS: [NeededChannel; 3] = [
    POSITION,
    (
        &[Channel::MotorPosition, Channel::WindUp],
        "position of the motor",
        "without it there is no transmission",
    ),
    (
        &[Channel::Current, Channel::Torque],
        "motor current",
        "without it there are only antiresonance and backlash",
    ),
];

/// Returns what a recording lacks, one line each; `has_rate` if a sampling rate is given.
fn missing(found: &RecordingColumns, needed: &[NeededChannel], has_rate: bool) -> Vec<String> {
    let has = |channel: Channel| found.columns.iter().any(|column| column.channel == Some(channel));
    let mut lines = Vec::new();
    if found.format == RecordingFormat::Mcap {
        return vec!["the messages are read with the name of the axis".to_owned()];
    }
    if !found.has_time() && !has_rate {
        lines.push("missing: time; give the sampling rate with --rate-hz".to_owned());
    }
    for (channels, name, effect) in needed {
        if !channels.iter().any(|channel| has(*channel)) {
            lines.push(format!("missing: {name}; {effect}; name its column with --column"));
        }
    }
    let assumed =
        found.columns.iter().filter(|column| column.unit.as_ref().is_some_and(|unit| unit.is_assumed()));
    let assumed: Vec<&str> = assumed.map(|column| column.header.as_str()).collect();
    if !assumed.is_empty() {
        lines.push(format!("without a unit, SI is assumed: {}", escaped(&assumed.join(", "))));
    }
    if let Some(line) = found.header_line {
        lines.push(format!(
            "the header is in line {line}: give --column skip_lines={}",
            line.saturating_sub(1)
        ));
    }
    lines
}

fn table(found: &RecordingColumns) -> Table {
    let columns = [("column", ""), ("taken for", ""), ("axis", ""), ("unit", ""), ("because", "")];
    let rows = found.columns.iter().map(|column| {
        vec![
            format!("#{} {}", column.number, escaped(&column.header)),
            column.channel.map_or("–".to_owned(), |channel| channel.name().to_owned()),
            escaped(column.axis.as_deref().unwrap_or("")),
            column.unit.as_ref().map_or(String::new(), ToString::to_string),
            escaped(&column.reason),
        ]
    });
    Table { rows: rows.collect(), ..Table::new("", &columns) }
}
