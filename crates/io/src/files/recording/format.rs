//! Formats of recordings, detected from the content, and errors that several of them share.

use std::fmt::Display;

use super::unit::Channel;
use crate::files::error::{ErrorKind, FileError};

virtual_axes_core::named_values! {
    /// Format of a recording of axes, with the names of the option `--format`.
    pub enum RecordingFormat {
        /// CSV with a header, or with columns selected by number.
        Csv = "csv",
        /// Trace of Sinumerik Operate on Sinumerik 840D sl, XML.
        SinumerikTrace = "sinumerik-trace",
        /// High-frequency data of Sinumerik Edge, JSON.
        SinumerikEdge = "sinumerik-edge",
        /// CSV exported by TwinCAT Scope.
        TwinCatScope = "twincat-scope",
        /// Text of LinuxCNC's halsampler.
        Halsampler = "halsampler",
        /// MCAP with ROS messages.
        Mcap = "mcap",
    }
}

/// Maximum number of samples of a recording.
pub(super) const MAX_ROWS: usize = 10_000_000;

/// Result of reading a recording.
pub(super) type Found<T> = Result<T, FileError>;

impl FileError {
    /// Creates an error of text that cannot be read.
    pub(super) fn not_text(at: impl Display, reason: impl Display) -> Self {
        Self::new(at, format_args!("{reason}; a recording is text (CSV) or MCAP"))
    }

    /// Creates an error of a recording with too many samples.
    pub(super) fn too_long(at: impl Display) -> Self {
        Self::new(at, format_args!("more than {MAX_ROWS} samples; split the recording"))
    }

    /// Creates an error of content that contradicts the format.
    pub(super) fn content(at: impl Display, format: RecordingFormat, reason: impl Display) -> Self {
        Self::new(at, format_args!("not a recording of the format {format}: {reason}"))
    }

    /// Creates an error of a row with a wrong number of values.
    pub(super) fn fields(at: impl Display, found: usize, wanted: usize, hint: &str) -> Self {
        let kind = if found < wanted { ErrorKind::FewFields } else { ErrorKind::Content };
        Self::new(at, format_args!("{found} values, {wanted} columns{hint}")).with_kind(kind)
    }

    /// Creates an error of a value that is not the `wanted` number.
    pub(super) fn number(at: impl Display, column: &str, found: &str, wanted: &str, hint: &str) -> Self {
        let reason = format_args!("{column} is \"{found}\", must be {wanted}{hint}");
        Self::new(at, reason).with_kind(ErrorKind::Content)
    }

    /// Creates an error of a channel without values.
    pub(super) fn no_value(at: impl Display, channel: Channel, rows: usize) -> Self {
        Self::new(at, format_args!("{channel} has no value in any of {rows} rows"))
    }
}
