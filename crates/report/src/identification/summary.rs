//! What was found: every value, and what must be said of the whole.

use super::super::document::Section;
use super::super::table::Table;
use super::format::{columns, counted, digits, exact, full};
use super::{IdentificationPage, Step, notices};
use virtual_axes_identify::identify::IdentifiedValue;
use virtual_axes_identify::recording::Severity;

pub(super) fn section(page: &IdentificationPage) -> Section {
    let found = page.identification;
    let refined = found.refinement.is_some();
    let mut told: Vec<_> = found
        .findings
        .iter()
        .filter(|f| f.severity > Severity::Note || Step::of(f, refined).contains(&Step::Whole))
        .collect();
    // What is missing first.
    told.sort_by_key(|finding| std::cmp::Reverse(finding.severity));
    let count = counted(page.values.len(), "parameter");
    let text = if page.values.is_empty() {
        "The recordings told no parameter of the axis.".to_owned()
    } else {
        format!(
            "The recordings told {count}. ± is the standard error; of a delay the data tell an interval, open below \
             and closed above, in which all values move the axis alike."
        )
    };
    let heads = [("parameter", ""), ("value", ""), ("±", ""), ("unit", ""), ("before", ""), ("source", "")];
    let table = Table {
        caption: "Identified values".to_owned(),
        columns: columns(heads),
        rows: page.values.iter().map(row).collect(),
    };
    Section {
        paragraphs: vec![text],
        notices: told.into_iter().map(notices::notice).collect(),
        tables: vec![table],
        ..Section::new("What was found")
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
        full(value.before),
        value.source.clone(),
    ]
}
