//! Errors of reading recordings of an axis.

use super::format::RecordingFormat;
use super::unit::Channel;
use crate::files::{FileKind, McapFileError};
use virtual_axes_core::text::nearest_hint;

/// Maximum number of samples of a recording: almost three hours at 1 kHz.
pub(super) const MAX_ROWS: usize = 10_000_000;

/// Error of reading a recording of an axis, with the file, and the line or message if known.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum AxisRecordingError {
    /// The file cannot be read.
    #[error("{at}: {reason}")]
    Unreadable {
        /// File, and line if known.
        at: String,
        /// Error message of the operating system.
        reason: String,
    },
    /// A line is not text.
    #[error("{at}: {reason}; a recording is text in UTF-8 (CSV) or MCAP")]
    NotText {
        /// File and line.
        at: String,
        /// Description of the content.
        reason: String,
    },
    /// The file is of another kind.
    #[error("{at}: the file is {kind}, must be a recording (CSV with columns of time and position, or MCAP)")]
    OtherKind {
        /// Name of the file.
        at: String,
        /// Kind of the file.
        kind: FileKind,
    },
    /// The file contains no row.
    #[error("{at}: {what}")]
    Empty {
        /// Name of the file.
        at: String,
        /// Description of the missing part.
        what: &'static str,
    },
    /// The recording has too many samples.
    #[error("{at}: more than {MAX_ROWS} samples; split the recording")]
    TooLong {
        /// File, and line or topic.
        at: String,
    },
    /// A unit does not fit the channel or the axis.
    #[error("{at}: the unit of {channel} is [{found}], must be one of {allowed} for the {kind} axis {axis}")]
    Unit {
        /// Origin of the mapping: option or file.
        at: String,
        /// Channel of the recording.
        channel: Channel,
        /// Symbol of the unit.
        found: &'static str,
        /// Allowed units, separated by commas.
        allowed: String,
        /// `linear` or `rotary`.
        kind: &'static str,
        /// Name of the axis.
        axis: String,
    },
    /// A required or selected column does not exist.
    #[error(
        "{at}: there is no column {wanted} for {channel}; there are {found}{}; time and position are required: \
         select a column by --column CHANNEL=COLUMN[UNIT]{hint}",
        nearest_hint(.nearest)
    )]
    NoColumn {
        /// File and line.
        at: String,
        /// Channel of the recording.
        channel: Channel,
        /// Headers searched for.
        wanted: String,
        /// Columns of the file.
        found: String,
        /// Most similar name.
        nearest: Option<String>,
        /// Hint for the user; may be empty.
        hint: Box<str>,
    },
    /// Several columns have the same header.
    #[error(
        "{at}: {count} columns have the header \"{column}\"; select the column of {channel} by number, for example #3"
    )]
    SameHeader {
        /// File and line.
        at: String,
        /// Channel of the recording.
        channel: Channel,
        /// Header of the columns.
        column: String,
        /// Number of columns with this header.
        count: usize,
    },
    /// Several columns fit a channel.
    #[error(
        "{at}: columns {} all fit {channel}: select one, for example by --column '{channel}=#{number}'",
        .columns.join(", ")
    )]
    Ambiguous {
        /// File and line.
        at: String,
        /// Channel of the recording.
        channel: Channel,
        /// Numbers and headers of the columns.
        columns: Vec<String>,
        /// Number of the first column.
        number: usize,
    },
    /// The axis is not in the file, or not unique.
    #[error("{at}: {reason} axis {axis}; there are the axes {}: select one by --joint", .axes.join(", "))]
    Axis {
        /// File and line.
        at: String,
        /// Reason of the error.
        reason: &'static str,
        /// Name of the axis or joint searched for.
        axis: String,
        /// Axes of the file.
        axes: Vec<String>,
    },
    /// The unit of a detected column does not fit the channel or the axis.
    #[error(
        "{at}: {channel} from column {column} {found}, must be in one of {allowed}; give the unit by \
         --column '{channel}=COLUMN[UNIT]', for example with a factor: [25.4 mm]"
    )]
    ColumnUnit {
        /// File and line.
        at: String,
        /// Channel of the recording.
        channel: Channel,
        /// Header of the column.
        column: String,
        /// Description of the unit found.
        found: String,
        /// Allowed units, separated by commas.
        allowed: String,
    },
    /// The sampling rate is invalid.
    #[error("--rate-hz: the sampling rate is {found}, must be a finite number above 0")]
    Rate {
        /// Sampling rate found, Hz.
        found: f64,
    },
    /// The content does not have the selected format.
    #[error("{at}: not a recording of the format {format}: {reason}")]
    Content {
        /// File, and line if known.
        at: String,
        /// Selected or detected format.
        format: RecordingFormat,
        /// Content found, and what is allowed.
        reason: String,
    },
    /// Two channels use the same column.
    #[error("{at}: {first} and {second} both use column #{number}")]
    SameColumn {
        /// File and line.
        at: String,
        /// First channel.
        first: Channel,
        /// Second channel.
        second: Channel,
        /// Column number, from 1.
        number: usize,
    },
    /// A line has too many or too few values.
    #[error("{at}: {found} values, {wanted} columns{hint}")]
    Fields {
        /// File and line.
        at: String,
        /// Number of values found.
        found: usize,
        /// Number of columns.
        wanted: usize,
        /// Hint for the user; may be empty.
        hint: &'static str,
    },
    /// A field is not a number.
    #[error("{at}: {column} is \"{found}\", must be {wanted}{hint}")]
    Number {
        /// File and line.
        at: String,
        /// Header or number of the column.
        column: String,
        /// Field found.
        found: String,
        /// Allowed values.
        wanted: &'static str,
        /// Hint for the user; may be empty.
        hint: &'static str,
    },
    /// A required channel has no values.
    #[error("{at}: {channel} has no value in any of {rows} rows")]
    NoValue {
        /// Name of the file.
        at: String,
        /// Channel of the recording.
        channel: Channel,
        /// Number of rows.
        rows: usize,
    },
    /// The MCAP file cannot be read.
    #[error(transparent)]
    Mcap(#[from] McapFileError),
    /// The recording contains no messages of an axis.
    #[error("{at}: there is no message of type {wanted}; there are {found}")]
    NoMessages {
        /// Name of the file.
        at: String,
        /// Required message types, of which one is sufficient.
        wanted: String,
        /// Topics with messages, and their types.
        found: String,
    },
    /// Several topics have the same message type.
    #[error("{at}: several topics carry {kind}, {}: select one by its name or a prefix of it", .topics.join(", "))]
    SeveralTopics {
        /// Name of the file.
        at: String,
        /// Message type.
        kind: &'static str,
        /// Topics of this type.
        topics: Vec<String>,
    },
    /// A selected topic has no messages of an axis.
    #[error("{at}: no message of an axis on {topic}; there are some on {}{}", .topics.join(", "), nearest_hint(.nearest))]
    UnknownTopic {
        /// Name of the file.
        at: String,
        /// Selected topic.
        topic: String,
        /// Topics with messages of an axis.
        topics: Vec<String>,
        /// Most similar name.
        nearest: Option<String>,
    },
    /// The joint does not exist or is ambiguous.
    #[error("{at}: {reason} {joint}; there are {}{}", .joints.join(", "), nearest_hint(.nearest))]
    Joint {
        /// File and topic.
        at: String,
        /// Reason of the error.
        reason: &'static str,
        /// Name searched for.
        joint: String,
        /// Joints of the topic.
        joints: Vec<String>,
        /// Most similar name.
        nearest: Option<String>,
    },
    /// A message cannot be decoded.
    #[error("{at}: {reason}")]
    Message {
        /// File, topic, message index from 0 and log time.
        at: String,
        /// Reason of the error.
        reason: String,
    },
}
