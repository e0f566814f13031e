//! Report of an interpretation: words without effect, assumptions, and all words that are not supported.

use std::collections::BTreeMap;
use std::sync::Arc;

/// Largest number of different entries of a report.
const MAX_ENTRIES: usize = 1000;

/// Line of the file of a subprogram.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FileLine {
    /// Name of the file without its folder.
    pub name: Arc<str>,
    /// Line, from 1.
    pub line: usize,
}

/// Occurrences of a code or an error in the lines executed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Occurrences {
    /// Number of executed lines.
    pub count: u64,
    /// First line of the program, from 1: for a line in the file of a subprogram, that of the call.
    pub first_line: usize,
    /// First line in the file of a subprogram; `None` for a line of the program.
    pub file: Option<FileLine>,
}

impl Occurrences {
    /// Returns file and line of the first occurrence; `name` is the file of the program.
    pub fn place(&self, name: &str) -> String {
        match &self.file {
            Some(FileLine { name, line }) => format!("{name}:{line}"),
            None => format!("{name}:{}", self.first_line),
        }
    }

    /// Returns a text with the place of its first occurrence, if that is in the file of a subprogram.
    pub fn located(&self, text: &str) -> String {
        match &self.file {
            Some(FileLine { name, line }) => format!("{text} ({name}:{line})"),
            None => text.to_owned(),
        }
    }
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
pub(super) fn count(table: &mut OccurrenceTable, text: String, line: usize, file: &Option<FileLine>) {
    if table.len() < MAX_ENTRIES || table.contains_key(&text) {
        let first = || Occurrences { count: 0, first_line: line, file: file.clone() };
        table.entry(text).or_insert_with(first).count += 1;
    }
}
