//! Detection of the CSV layout: header, delimiter, and the columns of the channels.

use std::io::Read;

use super::assignment::ColumnAssignment;
use super::columns::{Column, Columns};
use super::error::AxisRecordingError;
use super::found_column::FoundColumn;
use super::inspect::{MAX_SEARCHED, detect_columns};
use super::unit::Channel;
use crate::files::lines::{Lines, fields_between};
use virtual_axes_core::config::{AxisConfig, AxisKind};
use virtual_axes_core::text::shortened;

/// Number of lines searched for a header, for a hint.
const PREAMBLE: u64 = 100;
/// Maximum number of names in an error message.
const MAX_NAMES: usize = 40;
/// Detected delimiters; the one with the fewest other uses first.
const DELIMITERS: [char; 3] = [';', '\t', ','];

type Found<T> = Result<T, AxisRecordingError>;

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
    /// True if the first line contains values instead of a header.
    pub is_data: bool,
}

/// File, axis, column mapping and sampling rate of a recording.
#[derive(Clone, Copy)]
pub(super) struct Context<'a> {
    pub name: &'a str,
    pub axis: &'a AxisConfig,
    pub joint: &'a str,
    /// True if the user names the joint.
    pub is_joint_given: bool,
    pub columns: &'a Columns,
    /// Sampling rate, Hz, of a file without a column of time.
    pub rate: Option<f64>,
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

/// Formats names for an error message.
pub(super) fn format_names(names: &[String]) -> String {
    let shown: Vec<String> = names.iter().take(MAX_NAMES).map(|name| shortened(name)).collect();
    let more =
        if names.len() > MAX_NAMES { format!(", … ({} columns)", names.len()) } else { String::new() };
    shown.join(", ") + &more
}

/// Returns the next line that is not blank; rejects zero bytes.
pub(super) fn next_line<'a>(lines: &'a mut Lines<impl Read>, name: &str) -> Found<Option<(u64, &'a str)>> {
    let not_text = |line, reason| AxisRecordingError::NotText { at: format!("{name}:{line}"), reason };
    match lines.next() {
        Ok(Some((line, text))) if text.contains('\0') => {
            Err(not_text(line, "the line contains zero bytes".to_owned()))
        }
        Ok(found) => Ok(found),
        Err((line, reason)) => Err(not_text(line, reason)),
    }
}

impl Columns {
    /// Returns the delimiter of a line: that of the mapping, or the one detected.
    pub(super) fn delimiter_of(&self, text: &str) -> char {
        let found = || {
            let usable = |d: &char| !(self.decimal_comma && *d == ',');
            DELIMITERS.into_iter().find(|d| usable(d) && text.contains(*d)).unwrap_or(DELIMITERS[0])
        };
        self.delimiter.unwrap_or_else(found)
    }
}

impl Context<'_> {
    /// Returns the factors to SI of the channels, in the order of [`Channel::ALL`].
    pub fn factors(&self) -> Found<[f64; Channel::ALL.len()]> {
        let mut factors = [1.0; Channel::ALL.len()];
        for (factor, channel) in factors.iter_mut().zip(Channel::ALL) {
            let Some(mapping) = self.columns.mapping(channel) else { continue };
            let Some(unit) = mapping.unit else { continue };
            let units = channel.units(self.axis);
            let Some((_, worth)) = units.iter().find(|(symbol, _)| *symbol == unit.symbol) else {
                return Err(AxisRecordingError::Unit {
                    at: mapping.at.clone(),
                    channel,
                    found: unit.symbol,
                    allowed: units.iter().map(|(symbol, _)| *symbol).collect::<Vec<_>>().join(", "),
                    kind: match self.axis.kind {
                        AxisKind::Linear => "linear",
                        AxisKind::Rotary => "rotary",
                    },
                    axis: self.axis.name.clone(),
                });
            };
            *factor = unit.factor * worth;
        }
        Ok(factors)
    }

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
        Ok(Layout { delimiter, decimal_comma, columns, found, assignment, is_data })
    }

    /// Returns true if the recording must have a column of the channel.
    pub fn is_required(&self, channel: Channel) -> bool {
        channel.is_required() && !(channel == Channel::Time && self.rate.is_some())
    }

    /// Returns the header of a channel in a trace.
    pub fn trace_header(&self, channel: Channel) -> String {
        format!("{}.{channel}", self.joint)
    }

    /// Returns the possible headers of a channel; the first one found is used.
    pub fn candidate_headers(&self, channel: Channel, is_trace: bool) -> Vec<String> {
        let defaults = || match channel {
            Channel::Time => vec![channel.name().to_owned()],
            // In a trace, only trace headers are used.
            channel if is_trace => vec![self.trace_header(channel)],
            channel => vec![self.trace_header(channel), channel.name().to_owned()],
        };
        match self.columns.mapping(channel) {
            None => defaults(),
            Some(mapping) => match &mapping.column {
                Column::Default => defaults(),
                Column::Named(name) => vec![name.clone(), mapping.text.clone()],
                Column::Index(index) => vec![format!("#{}", index + 1)],
            },
        }
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
