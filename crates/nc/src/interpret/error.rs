//! Error of a part program.

/// Rejection of a part program. The text is one line that begins with the file and the line.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{name}:{line}: {reason}")]
pub struct ProgramError {
    /// File.
    pub name: String,
    /// Source line, from 1.
    pub line: usize,
    /// Word or text of the line, what is wrong and what is allowed.
    pub reason: String,
}

/// Result of a part of the interpreter; the error is [`ProgramError::reason`].
pub(super) type Outcome<T> = Result<T, String>;
