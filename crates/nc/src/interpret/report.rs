//! Report of an interpretation: words without effect, assumptions, and all words that are not supported.

use std::collections::BTreeMap;

/// Largest number of different entries of a report.
const MAX_ENTRIES: usize = 1000;

/// Occurrences of a code or an error in the lines executed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Occurrences {
    /// Number of executed lines.
    pub count: u64,
    /// First source line, from 1.
    pub first_line: usize,
}

/// Texts with their occurrences.
pub type OccurrenceTable = BTreeMap<String, Occurrences>;

/// Report of an interpretation.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct InterpretationReport {
    /// Codes without effect: by their nature, or by the options.
    pub without_effect: OccurrenceTable,
    /// Assumptions on what the program leaves open: units, tools, offsets.
    pub assumptions: OccurrenceTable,
    /// Errors of the lines, of an interpreter that continues after them.
    pub errors: OccurrenceTable,
}

/// Adds an occurrence of a text.
pub(super) fn count(table: &mut OccurrenceTable, text: String, line: usize) {
    if table.len() < MAX_ENTRIES || table.contains_key(&text) {
        table.entry(text).or_insert(Occurrences { count: 0, first_line: line }).count += 1;
    }
}
