//! What must be said about a recording or a result.

use std::fmt;

/// How much a finding matters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// Good to know; nothing is lost.
    Note,
    /// The result is less certain than it could be.
    Warning,
    /// Something was not identified for want of data.
    Missing,
}

/// One thing that the user must know, with what to record to mend it.
#[derive(Debug, Clone, PartialEq)]
pub struct Finding {
    /// How much it matters.
    pub severity: Severity,
    /// A stable name: `gap`, `few-speeds`, …
    pub code: &'static str,
    /// What was found, with its numbers and the name of the recording.
    pub what: String,
    /// What to record or to change; empty where there is nothing to do.
    pub remedy: String,
}

impl Finding {
    /// Something good to know.
    pub fn note(code: &'static str, what: impl Into<String>) -> Self {
        Finding { severity: Severity::Note, code, what: what.into(), remedy: String::new() }
    }

    /// Something that makes the result less certain.
    pub fn warning(code: &'static str, what: impl Into<String>, remedy: impl Into<String>) -> Self {
        Finding { severity: Severity::Warning, code, what: what.into(), remedy: remedy.into() }
    }

    /// Something that was not identified.
    pub fn missing(code: &'static str, what: impl Into<String>, remedy: impl Into<String>) -> Self {
        Finding { severity: Severity::Missing, code, what: what.into(), remedy: remedy.into() }
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.what)?;
        if !self.remedy.is_empty() {
            write!(f, "; {}", self.remedy)?;
        }
        Ok(())
    }
}
