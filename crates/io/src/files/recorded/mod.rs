//! Recordings of one axis, from CSV and MCAP, for identification.

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

use super::input::{FileKind, Input, kind_by_beginning};
use virtual_axes_core::config::AxisConfig;
use virtual_axes_identify::recording::{Finding, RawRecording};

/// How recordings are to be read; by default as this project's own traces and recordings are.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RecordingOptions {
    /// Of CSV: which column is what.
    pub columns: Columns,
    /// Of MCAP: topics, or beginnings of their names (`/mill`), where one type of message is on several.
    pub topics: Vec<String>,
    /// The joint's whole name, if it is not the axis's, nor that behind a prefix.
    pub joint: Option<String>,
}

impl RecordingOptions {
    fn joint<'a>(&'a self, axis: &'a AxisConfig) -> &'a str {
        self.joint.as_deref().unwrap_or(&axis.name)
    }
}

/// Reads what a file tells of one axis, with what must be said about it; CSV or MCAP is told by content.
///
/// The axis gives the units that fit and what turns a torque into a current.
///
/// # Errors
/// [`AxisRecordingError`], the first fault.
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
    if kind_by_beginning(&head) == Some(FileKind::Mcap) {
        let (recording, mut findings) = read_recording_mcap(file, &name, axis, options)?;
        if !options.columns.mappings.is_empty() {
            let what = format!("{name}: MCAP has no columns: their mapping is not used");
            findings.push(Finding::note("unused-columns", what));
        }
        return Ok((recording, findings));
    }
    let read = read_recording_csv(Cursor::new(head).chain(file), &name, axis, options);
    read.map_err(|error| match other_kind(path, &error) {
        Some(kind) => AxisRecordingError::OtherKind { at: name, kind },
        None => error,
    })
}

/// Reads the axis from CSV; `name` is for messages.
///
/// # Errors
/// [`AxisRecordingError`], the first fault from the top.
pub fn read_recording_csv(
    input: impl Read,
    name: &str,
    axis: &AxisConfig,
    options: &RecordingOptions,
) -> Result<(RawRecording, Vec<Finding>), AxisRecordingError> {
    csv::read(input, name, axis, options.joint(axis), &options.columns)
}

/// Reads the axis from an MCAP recording; `name` is for messages.
///
/// Positions are those of `virtual_axes/msg/DriveStates` or else of `sensor_msgs/msg/JointState`, currents
/// those of `virtual_axes/msg/MotorCurrents` or else from the joint states' effort; time begins at the
/// first.
///
/// # Errors
/// [`AxisRecordingError`], the first fault.
pub fn read_recording_mcap(
    input: impl Read + Seek,
    name: &str,
    axis: &AxisConfig,
    options: &RecordingOptions,
) -> Result<(RawRecording, Vec<Finding>), AxisRecordingError> {
    mcap::read(input, name, axis, (options.joint(axis), options.joint.is_some()), &options.topics)
}

/// What a file is that is not CSV of an axis.
fn other_kind(path: &Path, error: &AxisRecordingError) -> Option<FileKind> {
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
