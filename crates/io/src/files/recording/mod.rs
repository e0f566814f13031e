//! Reading of recordings of one axis from CSV, MCAP and exports of controls, for identification.

mod assignment;
mod axis_match;
mod columns;
mod context;
mod csv;
mod format;
mod found_column;
mod halsampler;
mod header;
mod header_unit;
mod join;
mod layout;
mod line_counter;
mod mcap;
pub(super) mod recorded_psec;
mod recording_builder;
mod recording_columns;
mod series;
mod sinumerik_edge;
mod sinumerik_signal;
mod sinumerik_trace;
mod timestamp;
mod trace_samples;
mod twincat;
mod twincat_header;
mod unit;
mod vocabulary;

use std::fs::File;
use std::io::{Cursor, Read, Seek};
use std::path::Path;

pub use columns::Columns;
pub use context::RecordingOptions;
pub use format::RecordingFormat;
pub use found_column::{ColumnUnit, FoundColumn};
pub use recording_columns::RecordingColumns;
pub use unit::Channel;

use super::error::{ErrorKind, FileError};
use super::input::{FileKind, Input};
use context::Context;
use format::Found;
use virtual_axes_core::config::AxisConfig;
use virtual_axes_core::encoding::decode;
use virtual_axes_identify::recording::{Finding, RawRecording};

/// Number of bytes that determine the format of a file.
const HEAD_BYTES: u64 = 1 << 16;

/// Recording of one axis with the findings of reading it.
type Recording = (RawRecording, Vec<Finding>);

/// Function that returns true if a text file with these first characters has a format.
type Detection = fn(&str) -> bool;

impl RecordingFormat {
    /// Returns the format of a file with the given first bytes.
    fn detect(head: &[u8]) -> Self {
        if head.starts_with(::mcap::MAGIC) {
            return RecordingFormat::Mcap;
        }
        let text = decode(head);
        let of_controls: [(Self, Detection); 4] = [
            (RecordingFormat::SinumerikTrace, sinumerik_trace::detects),
            (RecordingFormat::SinumerikEdge, sinumerik_edge::detects),
            (RecordingFormat::TwinCatScope, twincat::detects),
            (RecordingFormat::Halsampler, halsampler::detects),
        ];
        let found = of_controls.into_iter().find(|(_, detects)| detects(&text));
        found.map_or(RecordingFormat::Csv, |(format, _)| format)
    }
}

/// Reads the first bytes of a file, and returns them with the format that is given or detected.
fn read_head(
    input: &mut dyn Read,
    name: &str,
    options: &RecordingOptions,
) -> Found<(RecordingFormat, Vec<u8>)> {
    let mut head = Vec::new();
    input.take(HEAD_BYTES).read_to_end(&mut head).map_err(|error| FileError::new(name, error))?;
    Ok((options.format.unwrap_or_else(|| RecordingFormat::detect(&head)), head))
}

/// Reads the recording of one axis with its findings; the format is detected from the content.
///
/// The axis determines the allowed units and the conversion from torque to current.
///
/// # Errors
/// Returns a [`FileError`] for the first error in the file.
pub fn read_recording(
    path: &Path,
    axis: &AxisConfig,
    options: &RecordingOptions,
) -> Result<(RawRecording, Vec<Finding>), FileError> {
    let name = path.display().to_string();
    let mut file = File::open(path).map_err(|error| FileError::new(&name, error))?;
    let (format, head) = read_head(&mut file, &name, options)?;
    let (recording, mut findings) = match format {
        RecordingFormat::Mcap => read_recording_mcap(file, &name, axis, options)?,
        _ => read_stream((format, head), file, &options.context(&name, axis)?).map_err(|error| {
            match detect_other_kind(path, &error).filter(|_| format == RecordingFormat::Csv) {
                Some(kind) => FileError::new(
                    &name,
                    format_args!(
                        "the file is {kind}, must be a recording (CSV with columns of time and position, or MCAP)"
                    ),
                ),
                None => error,
            }
        })?,
    };
    findings.extend(unused_options(&name, format, options));
    Ok((recording, findings))
}

/// Returns findings about the options that the format does not use.
fn unused_options(name: &str, format: RecordingFormat, options: &RecordingOptions) -> Vec<Finding> {
    let is_mcap = format == RecordingFormat::Mcap;
    let mut findings = Vec::new();
    if is_mcap && !options.columns.mappings.is_empty() {
        let what = format!("{name}: the column mapping is ignored for MCAP");
        findings.push(Finding::note("unused-columns", what));
    }
    if is_mcap && options.rate_hz.is_some() {
        let what = format!("{name}: --rate-hz is not used: the time is that of the messages");
        findings.push(Finding::note("unused-rate", what));
    }
    let mut unused = if format == RecordingFormat::Csv { Vec::new() } else { options.columns.format_keys() };
    if !is_mcap && !options.topics.is_empty() {
        unused.push("--topic");
    }
    if !unused.is_empty() {
        let what = format!("{name}: {} not used: the format is {format}", unused.join(", "));
        findings.push(Finding::note("unused-option", what));
    }
    findings
}

/// Reads the recording of one axis from a stream of any format but MCAP. `name` is the file name in errors.
///
/// # Errors
/// Returns a [`FileError`] for the first error in the stream.
pub fn read_recording_stream(
    mut input: impl Read,
    name: &str,
    axis: &AxisConfig,
    options: &RecordingOptions,
) -> Result<(RawRecording, Vec<Finding>), FileError> {
    let head = read_head(&mut input, name, options)?;
    read_stream(head, input, &options.context(name, axis)?)
}

/// Reads the recording from a stream after its first bytes.
fn read_stream(
    (format, head): (RecordingFormat, Vec<u8>),
    rest: impl Read,
    context: &Context,
) -> Found<Recording> {
    let input = &mut Cursor::new(head).chain(rest);
    match format {
        RecordingFormat::Csv => csv::read(input, context),
        RecordingFormat::SinumerikTrace => sinumerik_trace::read(input, context),
        RecordingFormat::SinumerikEdge => sinumerik_edge::read(input, context),
        RecordingFormat::TwinCatScope => twincat::read(input, context),
        RecordingFormat::Halsampler => halsampler::read(input, context),
        RecordingFormat::Mcap => {
            Err(FileError::content(context.name, format, "MCAP is read from a file, not from a stream"))
        }
    }
}

/// Lists the columns of a file with their detected meanings; the format is detected from the content.
///
/// # Errors
/// Returns a [`FileError`] if the file cannot be read, or contradicts its format.
pub fn inspect_recording(path: &Path, options: &RecordingOptions) -> Result<RecordingColumns, FileError> {
    let name = path.display().to_string();
    let file = File::open(path).map_err(|error| FileError::new(&name, error))?;
    inspect_recording_stream(file, &name, options)
}

/// Lists the columns of a stream. `name` is the file name in errors.
///
/// # Errors
/// Those of [`inspect_recording`].
pub fn inspect_recording_stream(
    mut input: impl Read,
    name: &str,
    options: &RecordingOptions,
) -> Result<RecordingColumns, FileError> {
    let (format, head) = read_head(&mut input, name, options)?;
    let input = &mut Cursor::new(head).chain(input);
    match format {
        RecordingFormat::Csv => csv::inspect(input, name, options),
        RecordingFormat::SinumerikTrace => sinumerik_trace::inspect(input, name),
        RecordingFormat::SinumerikEdge => sinumerik_edge::inspect(input, name),
        RecordingFormat::TwinCatScope => twincat::inspect(input, name),
        RecordingFormat::Halsampler => halsampler::inspect(input, name),
        RecordingFormat::Mcap => Ok(RecordingColumns::new(format, Vec::new(), true)),
    }
}

/// Reads the recording of one axis from MCAP. `name` is the file name in errors.
///
/// Positions are read from `virtual_axes/msg/DriveStates` or else from `sensor_msgs/msg/JointState`, currents from
/// `virtual_axes/msg/MotorCurrents` or else from the effort of the joint states. Time starts at the first message.
///
/// # Errors
/// Returns a [`FileError`] for the first error in the file.
pub fn read_recording_mcap(
    input: impl Read + Seek,
    name: &str,
    axis: &AxisConfig,
    options: &RecordingOptions,
) -> Result<(RawRecording, Vec<Finding>), FileError> {
    mcap::read(input, name, axis, (options.joint(axis), options.joint.is_some()), &options.topics)
}

/// Detects the kind of a file that is not CSV of an axis.
fn detect_other_kind(path: &Path, error: &FileError) -> Option<FileKind> {
    // A pipe cannot be read twice.
    if error.kind == ErrorKind::Other || !path.metadata().is_ok_and(|data| data.is_file()) {
        return None;
    }
    match Input::open(path).ok()?.kind() {
        FileKind::PsecCsv | FileKind::Mcap => None,
        kind => Some(kind),
    }
}
