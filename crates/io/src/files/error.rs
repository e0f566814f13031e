//! Error of reading a file.

use std::fmt::Display;

use virtual_axes_core::text::shortened;

/// Maximum number of names in an error message.
pub(super) const MAX_LISTED: usize = 10;

/// Kind of an error, for hints that only a caller can give.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ErrorKind {
    /// No column for a channel.
    NoColumn,
    /// Row with fewer values than columns.
    FewFields,
    /// Other rows and values that can belong to a file of another kind.
    Content,
    /// Any other error.
    Other,
}

/// Error of reading a file: file with line, what was found, what is allowed, and the remedy.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{text}")]
pub struct FileError {
    text: String,
    pub(super) kind: ErrorKind,
}

impl FileError {
    /// Creates an error at a place of the input.
    pub(super) fn new(at: impl Display, reason: impl Display) -> Self {
        FileError { text: format!("{at}: {reason}"), kind: ErrorKind::Other }
    }

    /// Replaces the kind.
    pub(super) fn with_kind(self, kind: ErrorKind) -> Self {
        FileError { kind, ..self }
    }

    /// Appends a hint.
    pub(super) fn with_hint(self, hint: &str) -> Self {
        FileError { text: self.text + hint, ..self }
    }
}

/// Returns the first names, each shortened, for an error message.
pub(super) fn shorten_names<'a>(names: impl IntoIterator<Item = &'a String>) -> Vec<String> {
    names.into_iter().take(MAX_LISTED).map(|name| shortened(name)).collect()
}
