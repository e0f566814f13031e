//! Detection of the CSV layout: header, delimiter, and the columns of the channels.

use std::io::Read;

use super::columns::{Column, Columns};
use super::error::AxisRecordingError;
use super::unit::Channel;
use crate::files::lines::{Lines, fields_between};
use virtual_axes_core::config::{AxisConfig, AxisKind};
use virtual_axes_core::text::{nearest_name, shortened};
use virtual_axes_identify::recording::Finding;

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
    /// Per column: index of its channel in [`Channel::ALL`], and factor to SI.
    pub slots: Vec<Option<(usize, f64)>>,
    /// Indices of the channels found by their default headers.
    pub default_channels: Vec<usize>,
    /// True if the first line contains values instead of a header.
    pub is_data: bool,
}

/// File, axis and column mapping of a CSV file.
pub(super) struct Context<'a> {
    pub name: &'a str,
    pub axis: &'a AxisConfig,
    pub joint: &'a str,
    pub columns: &'a Columns,
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
fn format_names(names: &[String]) -> String {
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

    fn delimiter(&self, text: &str) -> char {
        let found = || {
            let usable = |d: &char| !(self.columns.decimal_comma && *d == ',');
            DELIMITERS.into_iter().find(|d| usable(d) && text.contains(*d)).unwrap_or(DELIMITERS[0])
        };
        self.columns.delimiter.unwrap_or_else(found)
    }

    /// Determines the layout from the header, or from the first line of values.
    pub fn layout(&self, line: u64, text: &str, factors: &[f64]) -> Found<Layout> {
        let at = || format!("{}:{line}", self.name);
        let delimiter = self.delimiter(text);
        let decimal_comma = self.columns.decimal_comma;
        let mut columns: Vec<String> = fields_between(text, delimiter).map(str::to_owned).collect();
        if columns.len() > 1 && columns.last().is_some_and(String::is_empty) {
            columns.pop();
        }
        let mut slots = vec![None; columns.len()];
        let mut default_channels = Vec::new();
        let is_trace =
            Channel::ALL.iter().any(|c| *c != Channel::Time && columns.contains(&self.trace_header(*c)));
        for (index, channel) in Channel::ALL.into_iter().enumerate() {
            let wanted = self.candidate_headers(channel, is_trace);
            let Some(column) = self.find(channel, &wanted, &columns, &at)? else {
                if channel.is_required() || self.columns.mapping(channel).is_some() {
                    return Err(self.no_column(channel, &wanted, &columns, at()));
                }
                continue;
            };
            if let Some((before, _)) = slots[column] {
                let (first, number): (usize, _) = (before, column + 1);
                let first = Channel::ALL[first];
                return Err(AxisRecordingError::SameColumn { at: at(), first, second: channel, number });
            }
            slots[column] = Some((index, factors[index]));
            if self.columns.mapping(channel).is_none() {
                default_channels.push(index);
            }
        }
        let is_by_index = Channel::ALL.into_iter().filter(|channel| channel.is_required()).all(|channel| {
            matches!(self.columns.mapping(channel), Some(m) if matches!(m.column, Column::Index(_)))
        });
        let is_number = |column: &String| parse_number(column, decimal_comma).is_some_and(|v| !v.is_nan());
        let is_data =
            is_by_index && slots.iter().zip(&columns).all(|(slot, c)| slot.is_none() || is_number(c));
        if is_data {
            columns = (1..=columns.len()).map(|number| format!("#{number}")).collect();
        }
        Ok(Layout { delimiter, decimal_comma, columns, slots, default_channels, is_data })
    }

    /// Returns the header of a channel in a trace.
    fn trace_header(&self, channel: Channel) -> String {
        format!("{}.{channel}", self.joint)
    }

    /// Returns the possible headers of a channel; the first one found is used.
    fn candidate_headers(&self, channel: Channel, is_trace: bool) -> Vec<String> {
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

    fn find(
        &self,
        channel: Channel,
        wanted: &[String],
        columns: &[String],
        at: &dyn Fn() -> String,
    ) -> Found<Option<usize>> {
        if let Some(Column::Index(index)) = self.columns.mapping(channel).map(|mapping| &mapping.column) {
            return Ok((*index < columns.len()).then_some(*index));
        }
        for name in wanted {
            let count = columns.iter().filter(|column| *column == name).count();
            if count > 1 {
                let column = shortened(name);
                return Err(AxisRecordingError::SameHeader { at: at(), channel, column, count });
            }
            if count == 1 {
                return Ok(columns.iter().position(|column| column == name));
            }
        }
        Ok(None)
    }

    fn no_column(
        &self,
        channel: Channel,
        wanted: &[String],
        columns: &[String],
        at: String,
    ) -> AxisRecordingError {
        let names = || columns.iter().map(String::as_str);
        let nearest = wanted.iter().find_map(|name| nearest_name(name, names()));
        // A column named after the axis is probably its position.
        let axis = || names().find(|name| *name == self.joint).map(str::to_owned);
        let mut wanted: Vec<String> = wanted.iter().map(|name| format!("\"{}\"", shortened(name))).collect();
        wanted.dedup();
        AxisRecordingError::NoColumn {
            at,
            channel,
            wanted: wanted.join(" or "),
            found: format_names(columns),
            nearest: nearest.or_else(axis),
            hint: Box::default(),
        }
    }

    /// Returns a hint if the columns are not found in the first line.
    pub fn hint(&self, line: u64, text: &str, lines: &mut Lines<impl Read>, factors: &[f64]) -> String {
        let delimiter = self.delimiter(text);
        if fields_between(text, delimiter)
            .all(|field| parse_number(field, self.columns.decimal_comma).is_some())
        {
            return "; for a file without a header select columns by number: time=#1, position=#2".to_owned();
        }
        while let Ok(Some((found, text))) = next_line(lines, self.name) {
            if found > line + PREAMBLE {
                break;
            }
            if self.layout(found, text, factors).is_ok() {
                return format!("; line {found} contains the required columns: set skip_lines={}", found - 1);
            }
        }
        String::new()
    }

    /// Reports the channels found by their default headers, if a mapping selects others.
    pub fn report_default_columns(&self, layout: &Layout, findings: &mut Vec<Finding>) {
        if self.columns.mappings.is_empty() || layout.default_channels.is_empty() {
            return;
        }
        let columns: Vec<String> = layout
            .default_channels
            .iter()
            .filter_map(|&index| {
                let channel = Channel::ALL[index];
                let slot = layout.slots.iter().position(|slot| slot.is_some_and(|(p, _)| p == index))?;
                let unit = channel.units(self.axis).first().map_or("", |(symbol, _)| *symbol);
                Some(format!("{channel} from column {} in {unit}", shortened(&layout.columns[slot])))
            })
            .collect();
        let what =
            format!("{}: channels without a mapping use default columns: {}", self.name, columns.join(", "));
        findings.push(Finding::note("usual-columns", what));
    }
}
