//! Result of `virtual_axes identify`.

use std::error::Error;
use std::fmt;

use virtual_axes_identify::identify::summary::IdentificationSummary;
use virtual_axes_identify::recording::Severity;

/// Results that must not be used, with the output and the reason.
#[derive(Debug)]
pub struct InvalidResult {
    /// Output of the command.
    pub text: String,
    /// Reasons, one per line.
    pub reason: String,
}

impl InvalidResult {
    /// Returns the reasons why results must not be used; none if they can be. `failures` are axes without a result.
    pub fn reason<'a>(
        summaries: impl Iterator<Item = &'a IdentificationSummary>,
        failures: &[String],
    ) -> Option<String> {
        let invalid = summaries.flat_map(|summary| {
            let findings = summary.findings.iter().filter(|finding| finding.severity == Severity::Invalid);
            findings.map(|finding| format!("{}: {finding}", summary.axis))
        });
        let reasons: Vec<String> = failures.iter().cloned().chain(invalid).collect();
        (!reasons.is_empty())
            .then(|| format!("invalid result, no machine file is written:\n{}", reasons.join("\n")))
    }
}

impl fmt::Display for InvalidResult {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.reason)
    }
}

impl Error for InvalidResult {}
