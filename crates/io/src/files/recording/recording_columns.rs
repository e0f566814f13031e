//! List of the columns of a recording with their detected channels, units and axes.

use super::axis_match::{axes_of, matching_axes};
use super::format::RecordingFormat;
use super::found_column::FoundColumn;
use super::unit::Channel;

/// Columns of a recording with their detected meanings.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordingColumns {
    /// Detected or selected format.
    pub format: RecordingFormat,
    /// Columns in the order of the file; empty for MCAP.
    pub columns: Vec<FoundColumn>,
    /// Line of the header of CSV, if it is not the first line that is read: `skip_lines` must be one less.
    pub header_line: Option<u64>,
    /// True if the format states the sampling period or the times.
    pub(super) is_periodic: bool,
}

impl RecordingColumns {
    /// Creates the list of a format that has one header; `is_periodic` if the format states the times.
    pub(super) fn new(format: RecordingFormat, columns: Vec<FoundColumn>, is_periodic: bool) -> Self {
        RecordingColumns { format, columns, header_line: None, is_periodic }
    }

    /// Returns the names of the axes of the detected channels, in the order of the file.
    pub fn axes(&self) -> Vec<String> {
        axes_of(self.columns.iter()).into_iter().map(|(name, _)| name.to_owned()).collect()
    }

    /// Returns the names of the axes that have a position, in the order of the file.
    pub fn readable_axes(&self) -> Vec<String> {
        let positions = self.columns.iter().filter(|column| column.channel == Some(Channel::Position));
        axes_of(positions).into_iter().map(|(name, _)| name.to_owned()).collect()
    }

    /// Returns the name of the axis in the file that [`read_recording`](super::read_recording) reads for a joint: `X1` for
    /// `x`; `None` if there is none, or more than one.
    pub fn axis_of(&self, joint: &str) -> Option<&str> {
        match matching_axes(&axes_of(self.columns.iter()), joint).as_slice() {
            [axis] => Some(axis),
            _ => None,
        }
    }

    /// Returns true if the file states the time; other recordings require a sampling rate.
    pub fn has_time(&self) -> bool {
        let is_time = |column: &FoundColumn| {
            column.channel == Some(Channel::Time)
                && column.unit.as_ref().is_some_and(|unit| !unit.is_samples())
        };
        self.is_periodic || self.columns.iter().any(is_time)
    }
}
