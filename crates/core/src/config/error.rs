//! What is wrong with a machine file or a parameter: where, which key, what was found, what is allowed.

use std::fmt;
use std::sync::Arc;

use thiserror::Error;

/// Where a value comes from; the first words of an error message.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Source {
    /// A parameter file, and the line in it where there is one.
    File {
        /// Name of the file as the user wrote it.
        name: Arc<str>,
        /// Line, counted from 1.
        line: Option<u64>,
    },
    /// Anything else: an option of the command line, a service call.
    Named(Arc<str>),
}

impl Source {
    /// A file as a whole.
    pub fn file(name: &str) -> Self {
        Self::File { name: name.into(), line: None }
    }

    /// An option of the command line or a service, by its name.
    pub fn named(name: &str) -> Self {
        Self::Named(name.into())
    }

    /// The same file at `line`; what is not a file has no lines and stays as it is.
    pub fn at_line(&self, line: u64) -> Self {
        match self {
            Self::File { name, .. } => Self::File {
                name: Arc::clone(name),
                // The YAML reader says 0 where it does not know.
                line: (line > 0).then_some(line),
            },
            Self::Named(_) => self.clone(),
        }
    }

    /// The same source without its line.
    pub(super) fn whole(&self) -> Self {
        self.at_line(0)
    }
}

impl fmt::Display for Source {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File { name, line: Some(line) } => write!(f, "{name}:{line}"),
            Self::File { name, line: None } => f.write_str(name),
            Self::Named(name) => f.write_str(name),
        }
    }
}

/// A refused machine file or parameter; its text is one line for the user.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum ConfigError {
    /// The file cannot be read, or is not text.
    #[error("{path}: cannot be read: {reason}")]
    Unreadable {
        /// The file as the user wrote it.
        path: String,
        /// What the operating system says.
        reason: String,
    },
    /// No machine of that name is shipped.
    #[error("no machine {name} is shipped; there are {known}")]
    UnknownMachine {
        /// Name that was asked for.
        name: String,
        /// The names that there are, with commas.
        known: String,
    },
    /// The text is not YAML, or a key stands twice in one mapping.
    #[error("{at}: {message}")]
    Syntax {
        /// Where.
        at: Source,
        /// What the YAML reader says.
        message: String,
    },
    /// Good YAML, but not a ROS 2 parameter file.
    #[error("{at}: not a ROS 2 parameter file: {reason}")]
    NotAParameterFile {
        /// Where.
        at: Source,
        /// What is missing.
        reason: String,
    },
    /// An assignment without `=`.
    #[error("{at}: {text}: KEY=VALUE wanted")]
    NotAnAssignment {
        /// Where.
        at: Source,
        /// What was found.
        text: String,
    },
    /// One parameter stands twice, nested and flat.
    #[error("{at}: {key} is set a second time; the first is {first}")]
    Duplicate {
        /// Where the second stands.
        at: Source,
        /// Full key.
        key: String,
        /// Where the first stands.
        first: Source,
    },
    /// No such parameter.
    #[error("{at}: unknown parameter {key}{}", nearest_text(.nearest))]
    UnknownKey {
        /// Where.
        at: Source,
        /// Key as found.
        key: String,
        /// The known key that looks most like it.
        nearest: Option<String>,
    },
    /// The parameter exists, but not for this joint.
    #[error("{at}: {key} does not apply: {reason}")]
    NotApplicable {
        /// Where.
        at: Source,
        /// Full key.
        key: String,
        /// Why, with the values that decide it.
        reason: String,
    },
    /// A required parameter is not there.
    #[error("{at}: {key} is missing: {wanted}")]
    Missing {
        /// File or setter.
        at: Source,
        /// Full key.
        key: String,
        /// What it is, with its unit.
        wanted: String,
    },
    /// A value of the wrong kind.
    #[error("{at}: {key}: found {found}, {wanted} wanted")]
    WrongKind {
        /// Where.
        at: Source,
        /// Full key.
        key: String,
        /// Kind and value found.
        found: String,
        /// Kind wanted.
        wanted: String,
    },
    /// A value outside its range, not one of the choices, or at odds with another parameter.
    #[error("{at}: {key} = {value}: must {allowed}")]
    NotAllowed {
        /// Where.
        at: Source,
        /// Full key.
        key: String,
        /// Value found.
        value: String,
        /// What is allowed, after "must".
        allowed: String,
    },
}

fn nearest_text(nearest: &Option<String>) -> String {
    match nearest {
        Some(key) => format!("; the nearest known one is {key}"),
        None => String::new(),
    }
}

/// Longest text from outside that a message repeats, characters.
const QUOTED_LENGTH: usize = 120;

/// `text` on one line, cut to a length that fits in a message.
pub fn shortened(text: &str) -> String {
    let mut out: String = text.chars().take(QUOTED_LENGTH).collect();
    if out.len() < text.len() {
        out.push('…');
    }
    out.replace(breaks_line, " ")
}

/// Whether a terminal or an editor would do more with `c` than to show it: control characters, line and paragraph
/// separators, and what marks or turns the direction of writing.
pub fn breaks_line(c: char) -> bool {
    let marks = matches!(c, '\u{61c}' | '\u{200e}' | '\u{200f}');
    marks || c.is_control() || matches!(c, '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}
