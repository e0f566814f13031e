//! First section of the page: whether the result is valid, and how the model compares with a constant lag.

use virtual_axes_identify::identify::summary::{BaselineSummary, IdentificationSummary, ResidualSummary};
use virtual_axes_identify::recording::Severity;

use super::figures;
use super::page::{IdentificationPage, file_name};
use crate::text::{capital, digits};
use crate::{Section, Table};

/// Creates the section; `machine_file` is a sentence about the machine file.
pub(super) fn section(page: &IdentificationPage, machine_file: Option<&str>) -> Section {
    let summary = &page.found.summary;
    let invalid: Vec<_> =
        summary.findings.iter().filter(|finding| finding.severity == Severity::Invalid).collect();
    let verdict = match invalid.len() {
        0 => "The result is valid.".to_owned(),
        1 => "The result is invalid and must not be used, for this reason:".to_owned(),
        count => format!("The result is invalid and must not be used, for these {count} reasons:"),
    };
    let mut section = Section::new("Result");
    section.paragraphs.push(format!("{verdict} {}.", capital(&figures::verdict(summary))));
    section.notices = invalid.into_iter().map(|finding| page.notice(finding)).collect();
    section.paragraphs.extend(machine_file.map(str::to_owned));
    if summary.validation.is_empty() {
        section.paragraphs.push(
            "No recording was kept for validation (--validate): how the model predicts another program is not shown."
                .to_owned(),
        );
    }
    section.tables.extend(table(page));
    section
}

/// Returns the residuals with a baseline, those of validation recordings first.
fn baselines(found: &IdentificationSummary) -> Vec<(String, bool, &ResidualSummary, &BaselineSummary)> {
    let unseen =
        found.validation.iter().map(|v| (file_name(found, &v.recording.name).to_owned(), true, &v.residuals));
    let own = found.agreement.iter().map(|a| (file_name(found, &a.name).to_owned(), false, &a.residuals));
    let with_baseline = |(name, is_unseen, residuals): (String, bool, _)| {
        let residuals: &ResidualSummary = residuals;
        Some((name, is_unseen, residuals, residuals.baseline.as_ref()?))
    };
    unseen.chain(own).filter_map(with_baseline).collect()
}

/// Lists the residuals of each recording; none without simulation.
fn table(page: &IdentificationPage) -> Option<Table> {
    let found = &page.found.summary;
    let unit = page.error_unit().symbol;
    let columns = [
        ("recording", ""),
        ("use", ""),
        ("model, RMS", unit),
        ("constant lag, RMS", unit),
        ("lag", "ms"),
        ("PSEC, RMS", unit),
        ("R² of the current", ""),
    ];
    let row = |(name, is_unseen, residuals, baseline): (String, bool, &ResidualSummary, &BaselineSummary)| {
        let simulated = residuals.parts.iter().filter_map(|part| part.current_r_squared).reduce(f64::min);
        let inverse = || residuals.inverse_dynamics.as_ref().map(|inverse| inverse.current_r_squared);
        let r_squared = simulated.or_else(inverse);
        vec![
            name,
            if is_unseen { "validation" } else { "identification" }.to_owned(),
            digits(baseline.model, 3),
            digits(baseline.delayed, 3),
            format!("{:.2}", baseline.lag_ms),
            digits(baseline.command, 3),
            r_squared.map_or(crate::text::NONE.to_owned(), |r2| format!("{r2:.4}")),
        ]
    };
    let rows: Vec<Vec<String>> = baselines(found).into_iter().map(row).collect();
    (!rows.is_empty()).then(|| Table {
        rows,
        ..Table::new("Deviation of the position: model against constant lag", &columns)
    })
}
