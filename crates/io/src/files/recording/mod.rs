//! Reading of recordings of one axis from CSV, MCAP and exports of controls, for identification.

mod assignment;
mod axis_match;
mod columns;
mod csv;
mod error;
mod format;
mod found_column;
mod halsampler;
mod header;
mod header_unit;
mod inspect;
mod join;
mod layout;
mod line_counter;
mod mcap;
mod recording_builder;
mod series;
mod sinumerik_edge;
mod sinumerik_signal;
mod sinumerik_trace;
mod trace_samples;
mod twincat;
mod twincat_header;
mod unit;
mod vocabulary;

use std::fs::File;
use std::io::{Cursor, Read, Seek};
use std::path::Path;

pub use columns::{Columns, ColumnsError};
pub use error::AxisRecordingError;
pub use format::{RecordingFormat, RecordingFormatError};
pub use found_column::{ColumnUnit, FoundColumn};
pub use inspect::{RecordingColumns, inspect_recording, inspect_recording_stream};
pub use unit::Channel;

use super::input::{FileKind, Input};
use layout::Context;
use virtual_axes_core::config::AxisConfig;
use virtual_axes_identify::recording::{Finding, RawRecording};

/// Options of reading a recording. The defaults fit traces and recordings of this package.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RecordingOptions {
    /// Column mapping and format of CSV files.
    pub columns: Columns,
    /// Topics of MCAP recordings, or prefixes of their names (`/mill`), if several topics have the same type.
    pub topics: Vec<String>,
    /// Full name of the joint, or the name or number of the axis in the file; default is the name of the axis, with or
    /// without a prefix.
    pub joint: Option<String>,
    /// Format of the file; detected from the content if `None`.
    pub format: Option<RecordingFormat>,
    /// Sampling rate, Hz, of a file without a column of time.
    pub rate_hz: Option<f64>,
}

/// Number of bytes that determine the format of a file.
const HEAD_BYTES: u64 = 1 << 16;

impl RecordingOptions {
    fn joint<'a>(&'a self, axis: &'a AxisConfig) -> &'a str {
        self.joint.as_deref().unwrap_or(&axis.name)
    }

    fn context<'a>(&'a self, name: &'a str, axis: &'a AxisConfig) -> Result<Context<'a>, AxisRecordingError> {
        if let Some(found) = self.rate_hz.filter(|rate| !(rate.is_finite() && *rate > 0.0)) {
            return Err(AxisRecordingError::Rate { found });
        }
        Ok(Context {
            name,
            axis,
            joint: self.joint(axis),
            is_joint_given: self.joint.is_some(),
            columns: &self.columns,
            rate: self.rate_hz,
        })
    }
}

/// Opens a file and reads its first bytes.
fn open(path: &Path, name: &str) -> Result<(Vec<u8>, File), AxisRecordingError> {
    let mut file = File::open(path).map_err(|error| unreadable(name, &error))?;
    let head = read_head(&mut file, name)?;
    Ok((head, file))
}

/// Reads the first bytes of a file.
fn read_head(input: &mut impl Read, name: &str) -> Result<Vec<u8>, AxisRecordingError> {
    let mut head = Vec::new();
    input.take(HEAD_BYTES).read_to_end(&mut head).map_err(|error| unreadable(name, &error))?;
    Ok(head)
}

fn unreadable(name: &str, error: &std::io::Error) -> AxisRecordingError {
    AxisRecordingError::Unreadable { at: name.to_owned(), reason: error.to_string() }
}

/// Reads the recording of one axis with its findings; the format is detected from the content.
///
/// The axis determines the allowed units and the conversion from torque to current.
///
/// # Errors
/// Returns an [`AxisRecordingError`] for the first error in the file.
pub fn read_recording(
    path: &Path,
    axis: &AxisConfig,
    options: &RecordingOptions,
) -> Result<(RawRecording, Vec<Finding>), AxisRecordingError> {
    let name = path.display().to_string();
    let (head, file) = open(path, &name)?;
    let format = options.format.unwrap_or_else(|| RecordingFormat::detect(&head));
    if format == RecordingFormat::Mcap {
        let (recording, mut findings) = read_recording_mcap(file, &name, axis, options)?;
        findings.extend(unused_options(&name, format, options));
        return Ok((recording, findings));
    }
    let read = read_stream(head, file, &name, axis, options).map(|(recording, mut findings)| {
        findings.extend(unused_options(&name, format, options));
        (recording, findings)
    });
    if format != RecordingFormat::Csv {
        return read;
    }
    read.map_err(|error| match detect_other_kind(path, &error) {
        Some(kind) => AxisRecordingError::OtherKind { at: name.clone(), kind },
        None => error,
    })
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
/// Returns an [`AxisRecordingError`] for the first error in the stream.
pub fn read_recording_stream(
    mut input: impl Read,
    name: &str,
    axis: &AxisConfig,
    options: &RecordingOptions,
) -> Result<(RawRecording, Vec<Finding>), AxisRecordingError> {
    let head = read_head(&mut input, name)?;
    read_stream(head, input, name, axis, options)
}

/// Reads the recording from a stream after its first bytes.
fn read_stream(
    head: Vec<u8>,
    rest: impl Read,
    name: &str,
    axis: &AxisConfig,
    options: &RecordingOptions,
) -> Result<(RawRecording, Vec<Finding>), AxisRecordingError> {
    let context = options.context(name, axis)?;
    let format = options.format.unwrap_or_else(|| RecordingFormat::detect(&head));
    let input = Cursor::new(head).chain(rest);
    match format {
        RecordingFormat::Csv => csv::read(input, &context),
        RecordingFormat::SinumerikTrace => sinumerik_trace::read(input, &context),
        RecordingFormat::SinumerikEdge => sinumerik_edge::read(input, &context),
        RecordingFormat::TwinCatScope => twincat::read(input, &context),
        RecordingFormat::Halsampler => halsampler::read(input, &context),
        RecordingFormat::Mcap => Err(AxisRecordingError::Content {
            at: name.to_owned(),
            format,
            reason: "MCAP is read from a file, not from a stream".to_owned(),
        }),
    }
}

/// Reads the recording of one axis from CSV. `name` is the file name in errors.
///
/// # Errors
/// Returns an [`AxisRecordingError`] for the first error in the file.
pub fn read_recording_csv(
    input: impl Read,
    name: &str,
    axis: &AxisConfig,
    options: &RecordingOptions,
) -> Result<(RawRecording, Vec<Finding>), AxisRecordingError> {
    csv::read(input, &options.context(name, axis)?)
}

/// Reads the recording of one axis from MCAP. `name` is the file name in errors.
///
/// Positions are read from `virtual_axes/msg/DriveStates` or else from `sensor_msgs/msg/JointState`, currents from
/// `virtual_axes/msg/MotorCurrents` or else from the effort of the joint states. Time starts at the first message.
///
/// # Errors
/// Returns an [`AxisRecordingError`] for the first error in the file.
pub fn read_recording_mcap(
    input: impl Read + Seek,
    name: &str,
    axis: &AxisConfig,
    options: &RecordingOptions,
) -> Result<(RawRecording, Vec<Finding>), AxisRecordingError> {
    mcap::read(input, name, axis, (options.joint(axis), options.joint.is_some()), &options.topics)
}

/// Detects the kind of a file that is not CSV of an axis.
fn detect_other_kind(path: &Path, error: &AxisRecordingError) -> Option<FileKind> {
    let by_content = matches!(
        error,
        AxisRecordingError::NoColumn { .. }
            | AxisRecordingError::Fields { .. }
            | AxisRecordingError::Number { .. }
    );
    // A pipe cannot be read twice.
    if !by_content || !path.metadata().is_ok_and(|data| data.is_file()) {
        return None;
    }
    match Input::open(path).ok()?.kind() {
        FileKind::PsecCsv | FileKind::Mcap => None,
        kind => Some(kind),
    }
}
