//! Detection of the CSV layout: header, delimiter, and the columns of the channels.

use std::io::Read;

use super::assignment::ColumnAssignment;
use super::columns::Column;
use super::context::Context;
use super::format::Found;
use super::found_column::FoundColumn;
use super::header::detect_columns;
use super::timestamp::TimestampReader;
use super::unit::Channel;
use crate::files::error::FileError;
use crate::files::lines::{Lines, fields_between};

/// Number of lines searched for a header, for a hint.
pub(super) const PREAMBLE: u64 = 100;
/// Maximum number of columns in lines searched for a header.
pub(super) const MAX_SEARCHED: usize = 5000;

/// Layout of the lines of a CSV file.
#[derive(Debug)]
pub(super) struct Layout {
    pub delimiter: char,
    pub decimal_comma: bool,
    /// Headers, or column numbers if there is no header.
    pub columns: Vec<String>,
    /// Detected meanings of the columns.
    pub found: Vec<FoundColumn>,
    /// Channels of the columns.
    pub assignment: ColumnAssignment,
    /// Reader of dates and times of day.
    pub timestamps: TimestampReader,
    /// True if the first line contains values instead of a header.
    pub is_data: bool,
}

/// Parses a number: NaN for an empty field, `None` if invalid.
pub(super) fn parse_number(text: &str, decimal_comma: bool) -> Option<f64> {
    if text.is_empty() {
        return Some(f64::NAN);
    }
    let parsed = if decimal_comma {
        // A point would be a thousands separator.
        if text.contains('.') {
            return None;
        }
        text.replace(',', ".").parse()
    } else {
        text.parse()
    };
    parsed.ok().filter(|value: &f64| !value.is_infinite())
}

/// Returns the next line that is not blank; rejects zero bytes.
pub(super) fn next_line<'a>(lines: &'a mut Lines<impl Read>, name: &str) -> Found<Option<(u64, &'a str)>> {
    match lines.next() {
        Ok(Some((line, text))) if text.contains('\0') => {
            Err(FileError::not_text(format_args!("{name}:{line}"), "the line contains zero bytes"))
        }
        Ok(found) => Ok(found),
        Err((line, reason)) => Err(FileError::not_text(format_args!("{name}:{line}"), reason)),
    }
}

impl Context<'_> {
    /// Determines the layout from the header, or from the first line of values.
    pub fn layout(&self, line: u64, text: &str, factors: &[f64]) -> Found<Layout> {
        let at = || format!("{}:{line}", self.name);
        let delimiter = self.columns.delimiter_of(text);
        let decimal_comma = self.columns.decimal_comma;
        let mut columns: Vec<String> = fields_between(text, delimiter).map(str::to_owned).collect();
        if columns.len() > 1 && columns.last().is_some_and(String::is_empty) {
            columns.pop();
        }
        let found = detect_columns(&columns);
        let assignment = self.assign(&columns, &found, &at, factors)?;
        let is_by_index = Channel::ALL.into_iter().filter(|channel| self.is_required(*channel)).all(|channel| {
            matches!(self.columns.mapping(channel), Some(m) if matches!(m.column, Column::Index(_)))
        });
        let is_number = |column: &String| parse_number(column, decimal_comma).is_some_and(|v| !v.is_nan());
        let is_data = is_by_index
            && assignment.slots.iter().zip(&columns).all(|(slot, c)| slot.is_none() || is_number(c));
        if is_data {
            columns = (1..=columns.len()).map(|number| format!("#{number}")).collect();
        }
        Ok(Layout {
            delimiter,
            decimal_comma,
            columns,
            found,
            assignment,
            timestamps: TimestampReader::default(),
            is_data,
        })
    }

    /// Returns a hint if the columns are not found in the first line.
    pub fn hint(&self, line: u64, text: &str, lines: &mut Lines<impl Read>, factors: &[f64]) -> String {
        let delimiter = self.columns.delimiter_of(text);
        if fields_between(text, delimiter)
            .all(|field| parse_number(field, self.columns.decimal_comma).is_some())
        {
            return "; for a file without a header select columns by number: time=#1, position=#2".to_owned();
        }
        let mut searched = 0;
        while let Ok(Some((found, text))) = next_line(lines, self.name) {
            searched += text.matches(self.columns.delimiter_of(text)).count();
            if found > line + PREAMBLE || searched > MAX_SEARCHED {
                break;
            }
            if self.layout(found, text, factors).is_ok() {
                return format!("; line {found} contains the required columns: set skip_lines={}", found - 1);
            }
        }
        String::new()
    }
}
