//! Section with all identified values and general findings.

use super::super::document::Section;
use super::super::table::Table;
use super::super::text::capital;
use super::format::{columns, counted, digits, exact, full};
use super::{IdentificationPage, Step, notices};
use virtual_axes_core::units::Rounded;
use virtual_axes_identify::identify::IdentifiedValue;
use virtual_axes_identify::recording::Severity;

pub(super) fn section(page: &IdentificationPage) -> Section {
    let found = page.identification;
    let refined = found.refinement.is_some();
    let mut general: Vec<_> = found
        .findings
        .iter()
        .filter(|f| f.severity > Severity::Note || Step::of(f, refined).contains(&Step::Whole))
        .collect();
    // Missing results come first.
    general.sort_by_key(|finding| std::cmp::Reverse(finding.severity));
    let count = capital(&counted(page.summary.values.len(), "parameter"));
    let text = if page.summary.values.is_empty() {
        "No parameter was identified from the recordings.".to_owned()
    } else {
        format!(
            "{count} identified from the recordings. ± is the standard error. The value of a delay lies in \
             an interval, open below and closed above; all delays of the interval give the same motion."
        )
    };
    let heads = [("parameter", ""), ("value", ""), ("±", ""), ("unit", ""), ("initial", ""), ("source", "")];
    let table = Table {
        caption: "Identified values".to_owned(),
        columns: columns(heads),
        rows: page.summary.values.iter().map(row).collect(),
    };
    Section {
        paragraphs: vec![text],
        notices: general.into_iter().map(notices::notice).collect(),
        tables: vec![table],
        ..Section::new("Identified parameters")
    }
}

fn row(value: &IdentifiedValue) -> Vec<String> {
    let uncertainty = match (value.interval, value.error) {
        (Some([low, high]), _) => format!("{}\u{a0}…\u{a0}{}", exact(low), exact(high)),
        (None, Some(error)) => digits(error, 2),
        (None, None) => String::new(),
    };
    vec![
        value.key.clone(),
        full(value.value),
        uncertainty,
        value.unit.to_owned(),
        Rounded(value.before).to_string(),
        value.source.clone(),
    ]
}
