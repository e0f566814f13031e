//! Findings: messages about a recording or an identification result.

use std::fmt;

use serde::Serialize;

/// Severity of a finding.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// Information without effect on the result.
    Note,
    /// Reduced certainty of the result.
    Warning,
    /// Parameter that was not identified because data are missing.
    Missing,
    /// Result that must not be used.
    Invalid,
}

/// Message about a recording or result, with the remedy.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Finding {
    /// Severity.
    pub severity: Severity,
    /// Stable identifier such as `gap` or `few-speeds`.
    pub code: &'static str,
    /// Message with its numbers and the name of the recording.
    #[serde(rename = "text")]
    pub what: String,
    /// Remedy: what to record or to change; empty if nothing is to be done.
    pub remedy: String,
}

impl Finding {
    /// Creates an informational finding.
    pub fn note(code: &'static str, what: impl Into<String>) -> Self {
        Finding { severity: Severity::Note, code, what: what.into(), remedy: String::new() }
    }

    /// Creates a finding about reduced certainty.
    pub fn warning(code: &'static str, what: impl Into<String>, remedy: impl Into<String>) -> Self {
        Finding { severity: Severity::Warning, code, what: what.into(), remedy: remedy.into() }
    }

    /// Creates a finding about a parameter that was not identified.
    pub fn missing(code: &'static str, what: impl Into<String>, remedy: impl Into<String>) -> Self {
        Finding { severity: Severity::Missing, code, what: what.into(), remedy: remedy.into() }
    }

    /// Creates a finding about a result that must not be used.
    pub fn invalid(code: &'static str, what: impl Into<String>, remedy: impl Into<String>) -> Self {
        Finding { severity: Severity::Invalid, code, what: what.into(), remedy: remedy.into() }
    }

    /// Returns severity, message and remedy on one line.
    pub fn line(&self) -> String {
        let severity = match self.severity {
            Severity::Invalid => "invalid",
            Severity::Missing => "missing",
            Severity::Warning => "warning",
            Severity::Note => "note",
        };
        format!("{severity}: {self}")
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
