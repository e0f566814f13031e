//! Reasons why a result of `virtual_axes identify` must not be used.

use virtual_axes_identify::identify::summary::IdentificationSummary;
use virtual_axes_identify::recording::Severity;

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
