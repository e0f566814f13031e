//! Why a file is not a recording of an axis.

use super::csv::MOST_ROWS;
use super::unit::Channel;
use crate::files::{FileKind, McapFault};
use virtual_axes_core::text::nearest_hint;

/// Why a file cannot be used as a recording of an axis; each names the file, and the line or the message
/// where there is one.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum AxisRecordingError {
    /// The file cannot be read.
    #[error("{at}: {reason}")]
    Unreadable {
        /// File, and line where there is one.
        at: String,
        /// What the operating system says.
        reason: String,
    },
    /// It holds what no text has.
    #[error("{at}: {reason}; a recording is text in UTF-8 (CSV) or MCAP")]
    NotText {
        /// File and line.
        at: String,
        /// What stands there.
        reason: String,
    },
    /// It is something else.
    #[error("{at}: it is {kind}, not a recording (CSV with a column of time and one of positions, or MCAP)")]
    OtherKind {
        /// The file.
        at: String,
        /// What it is.
        kind: FileKind,
    },
    /// It holds no row.
    #[error("{at}: {what}")]
    Empty {
        /// The file.
        at: String,
        /// What is missing.
        what: &'static str,
    },
    /// It is longer than any campaign.
    #[error("{at}: more than {MOST_ROWS} samples; cut it into parts")]
    TooLong {
        /// File, and line or topic.
        at: String,
    },
    /// A unit does not fit the channel or the axis.
    #[error("{at}: {channel} in [{found}]: must be in {allowed} on the {kind} axis {axis}")]
    Unit {
        /// Who said so.
        at: String,
        /// The channel.
        channel: Channel,
        /// The symbol.
        found: &'static str,
        /// What is allowed, with commas.
        allowed: String,
        /// `linear` or `rotary`.
        kind: &'static str,
        /// Name of the axis.
        axis: String,
    },
    /// A column that is needed or was named is not there.
    #[error(
        "{at}: there is no column {wanted} for {channel}; there are {found}{}; time and position are needed: \
         name a column by CHANNEL=COLUMN[UNIT]{hint}",
        nearest_hint(.nearest)
    )]
    NoColumn {
        /// File and line.
        at: String,
        /// The channel.
        channel: Channel,
        /// The names that were sought.
        wanted: String,
        /// The columns that there are.
        found: String,
        /// The one that looks most like it.
        nearest: Option<String>,
        /// What may help.
        hint: Box<str>,
    },
    /// A header stands above two columns.
    #[error(
        "{at}: {count} columns are called \"{column}\"; name the one of {channel} by its number, as in #3"
    )]
    SameHeader {
        /// File and line.
        at: String,
        /// The channel.
        channel: Channel,
        /// The header.
        column: String,
        /// How many have it.
        count: usize,
    },
    /// Two channels were given one column.
    #[error("{at}: {first} and {second} are both column #{number}")]
    SameColumn {
        /// File and line.
        at: String,
        /// A channel.
        first: Channel,
        /// Another.
        second: Channel,
        /// The column, from 1.
        number: usize,
    },
    /// A line has too many or too few values.
    #[error("{at}: {found} values, {wanted} columns{hint}")]
    Fields {
        /// File and line.
        at: String,
        /// Values there are.
        found: usize,
        /// Columns there are.
        wanted: usize,
        /// What may help.
        hint: &'static str,
    },
    /// A field is not a number.
    #[error("{at}: {column} is \"{found}\", must be {wanted}{hint}")]
    Number {
        /// File and line.
        at: String,
        /// Header or number of the column.
        column: String,
        /// What stands there.
        found: String,
        /// What it must be.
        wanted: &'static str,
        /// What may help.
        hint: &'static str,
    },
    /// A channel that is needed has no value.
    #[error("{at}: {channel} has no value in any of {rows} rows")]
    NoValue {
        /// The file.
        at: String,
        /// The channel.
        channel: Channel,
        /// How many rows there are.
        rows: usize,
    },
    /// It is not MCAP that can be read.
    #[error(transparent)]
    Mcap(#[from] McapFault),
    /// There is no message of an axis in it.
    #[error("{at}: there is no message of type {wanted}; there are {found}")]
    NoMessages {
        /// The file.
        at: String,
        /// The types of which one is needed.
        wanted: String,
        /// The topics with messages, and their types.
        found: String,
    },
    /// Several topics carry one type.
    #[error("{at}: several topics carry {kind}, {}: name one of them or the beginning of its name", .topics.join(", "))]
    SeveralTopics {
        /// The file.
        at: String,
        /// The type.
        kind: &'static str,
        /// The topics.
        topics: Vec<String>,
    },
    /// A topic that was asked for carries nothing of use.
    #[error("{at}: no message of an axis on {topic}; there are some on {}{}", .topics.join(", "), nearest_hint(.nearest))]
    UnknownTopic {
        /// The file.
        at: String,
        /// What was asked for.
        topic: String,
        /// The topics that carry some.
        topics: Vec<String>,
        /// The one that looks most like it.
        nearest: Option<String>,
    },
    /// The joint is not there, or cannot be told.
    #[error("{at}: {reason} {joint}; there are {}{}", .joints.join(", "), nearest_hint(.nearest))]
    Joint {
        /// File and topic.
        at: String,
        /// What is wrong.
        reason: &'static str,
        /// What was sought.
        joint: String,
        /// The joints that there are.
        joints: Vec<String>,
        /// The one that looks most like it.
        nearest: Option<String>,
    },
    /// A message cannot be read.
    #[error("{at}: {reason}")]
    Message {
        /// File, topic, number of the message from 0 and log time.
        at: String,
        /// What is wrong.
        reason: String,
    },
}
