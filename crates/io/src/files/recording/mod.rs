//! Reading of recordings of one axis from CSV and MCAP, for identification.

mod columns;
mod csv;
mod error;
mod join;
mod layout;
mod mcap;
mod series;
mod unit;

use std::fs::File;
use std::io::{Cursor, Read, Seek};
use std::path::Path;

pub use columns::{Columns, ColumnsError};
pub use error::AxisRecordingError;
pub use unit::Channel;

use super::input::{FileKind, Input, kind_from_head};
use virtual_axes_core::config::AxisConfig;
use virtual_axes_identify::recording::{Finding, RawRecording};

/// Options of reading a recording. The defaults fit traces and recordings of this package.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RecordingOptions {
    /// Column mapping and format of CSV files.
    pub columns: Columns,
    /// Topics of MCAP recordings, or prefixes of their names (`/mill`), if several topics have the same type.
    pub topics: Vec<String>,
    /// Full name of the joint; default is the name of the axis, with or without a prefix.
    pub joint: Option<String>,
}

impl RecordingOptions {
    fn joint<'a>(&'a self, axis: &'a AxisConfig) -> &'a str {
        self.joint.as_deref().unwrap_or(&axis.name)
    }
}

/// Reads the recording of one axis with its findings from CSV or MCAP, detected by content.
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
    let unreadable = |error: std::io::Error| AxisRecordingError::Unreadable {
        at: name.clone(),
        reason: error.to_string(),
    };
    let mut file = File::open(path).map_err(unreadable)?;
    let mut head = Vec::new();
    (&mut file).take(::mcap::MAGIC.len() as u64).read_to_end(&mut head).map_err(unreadable)?;
    if kind_from_head(&head) == Some(FileKind::Mcap) {
        let (recording, mut findings) = read_recording_mcap(file, &name, axis, options)?;
        if !options.columns.mappings.is_empty() {
            let what = format!("{name}: the column mapping is ignored for MCAP");
            findings.push(Finding::note("unused-columns", what));
        }
        return Ok((recording, findings));
    }
    let read = read_recording_csv(Cursor::new(head).chain(file), &name, axis, options);
    read.map_err(|error| match detect_other_kind(path, &error) {
        Some(kind) => AxisRecordingError::OtherKind { at: name, kind },
        None => error,
    })
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
    csv::read(input, name, axis, options.joint(axis), &options.columns)
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
