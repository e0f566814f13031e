//! Reading of the CSV that TwinCAT Scope exports.
//!
//! Lines of metadata (`Name`, `SymbolName`, `Unit`, …) precede the values. The key of a line is repeated in front of each
//! group of channels, where the lines of values have the time of the group: milliseconds since the start, or file times of
//! 100 ns. Groups with different sampling times run down the lines independently of each other. Decimal marks are points or
//! commas; a line `EOF` can end the file. Sources: the settings of the export,
//! <https://infosys.beckhoff.com/content/1031/te13xx_tc3_scopeview/6193063051.html>, the example of TwinCAT 2,
//! <https://infosys.beckhoff.com/content/1033/tcscope2/11171654667.html>, and the exports in `tests/data` of
//! <https://github.com/CagtayFabry/pytcs>.

use std::io::Read;

use super::assignment::ColumnAssignment;
use super::context::Context;
use super::format::{Found, MAX_ROWS, RecordingFormat};
use super::layout::next_line;
use super::recording_builder::{ChannelValues, build_timed_recording};
use super::recording_columns::RecordingColumns;
use super::twincat_header::{ScopeHeader, is_twincat, number};
use super::unit::Channel;
use crate::files::error::FileError;
use crate::files::lines::Lines;
use virtual_axes_core::text::shortened;
use virtual_axes_core::units::MILLISECOND;
use virtual_axes_identify::recording::{Finding, RawRecording};

/// Last line of a file.
const END: &str = "EOF";
/// Smallest file time, 100 ns: 1979 in file times, 32000 years in milliseconds.
const MIN_FILE_TIME: i64 = 100_000_000_000_000_000;
/// Period of file times, s.
const FILE_TIME: f64 = 100e-9;

/// Returns true if a text file that begins with `head` has the format.
pub(super) fn detects(head: &str) -> bool {
    is_twincat(head)
}

/// Lists the columns with their detected meanings. `name` is the name of the file.
pub(super) fn inspect(input: &mut dyn Read, name: &str) -> Found<RecordingColumns> {
    let columns = ScopeHeader::read(&mut Lines::new(input), name)?.columns;
    Ok(RecordingColumns::new(RecordingFormat::TwinCatScope, columns, true))
}

/// Reads the recording of an axis with findings.
pub(super) fn read(input: &mut dyn Read, context: &Context) -> Found<(RawRecording, Vec<Finding>)> {
    let name = context.name;
    let mut lines = Lines::new(input);
    let header = ScopeHeader::read(&mut lines, name)?;
    let assignment = assign(context, &header)?;
    let mut table = Table { name, header: &header, first_time: None, series: series(&header, &assignment) };
    let (line, text) = &header.first;
    let mut is_open = table.add(*line, text)?;
    while is_open && let Some((line, text)) = next_line(&mut lines, name)? {
        is_open = table.add(line, text)?;
    }
    let mut findings = scaling_findings(context, &header, &assignment);
    let mut series = table.series;
    let is_position = |series: &ScopeSeries| Channel::ALL.get(series.channel) == Some(&Channel::Position);
    let times = series.iter().find(|series| is_position(series)).map(|series| series.times.clone());
    let times = times.unwrap_or_default();
    let mut channels = ChannelValues::default();
    for series in &mut series {
        let values = series.at(&times);
        if let Some(channel) = channels.get_mut(series.channel) {
            *channel = values;
        }
    }
    if times.is_empty() {
        return Err(FileError::no_value(name, Channel::Position, 0));
    }
    let columns = (&assignment, header.columns.as_slice());
    let recording = build_timed_recording(context, channels, columns, (times, "export"), &mut findings)?;
    Ok((recording, findings))
}

/// Values of a channel over time.
#[derive(Debug, Default)]
struct ScopeSeries {
    /// Index of the channel in [`Channel::ALL`].
    channel: usize,
    factor: f64,
    column: usize,
    time_column: usize,
    times: Vec<f64>,
    values: Vec<f64>,
}

/// Assigns the columns of values to channels; times are those of the groups.
fn assign(context: &Context, header: &ScopeHeader) -> Found<ColumnAssignment> {
    let mut columns = header.columns.clone();
    for column in columns.iter_mut().filter(|column| column.channel == Some(Channel::Time)) {
        column.channel = None;
    }
    let at = || format!("{}:{}", context.name, header.line);
    // A time is not required.
    let untimed = Context { rate: Some(1.0), ..*context };
    untimed.assign_found(&columns, &at)
}

fn series(header: &ScopeHeader, assignment: &ColumnAssignment) -> Vec<ScopeSeries> {
    let of_slot = |(column, slot): (usize, &Option<(usize, f64)>)| {
        let (channel, factor) = (*slot)?;
        let time_column = (*header.times.get(column)?)?;
        Some(ScopeSeries { channel, factor, column, time_column, ..ScopeSeries::default() })
    };
    assignment.slots.iter().enumerate().filter_map(of_slot).collect()
}

/// Reports scalings, which the export applies only on request.
fn scaling_findings(context: &Context, header: &ScopeHeader, assignment: &ColumnAssignment) -> Vec<Finding> {
    let of_slot = |(column, slot): (usize, &Option<(usize, f64)>)| {
        (*slot)?;
        let scaling = header.scalings.get(column)?.as_ref()?;
        let column = header.columns.get(column).map_or_else(String::new, |column| shortened(&column.header));
        let what = format!(
            "{}: column {column} has a scaling ({scaling}); the file does not state if the export applied it",
            context.name
        );
        let remedy = "export without scaling, or compare a value, and give the factor by --column";
        Some(Finding::warning("scaled", what, remedy))
    };
    assignment.slots.iter().enumerate().filter_map(of_slot).collect()
}

/// Lines of values.
struct Table<'a> {
    name: &'a str,
    header: &'a ScopeHeader,
    /// First file time.
    first_time: Option<i64>,
    series: Vec<ScopeSeries>,
}

impl Table<'_> {
    /// Adds a line of values; returns false at the end of the file.
    fn add(&mut self, line: u64, text: &str) -> Found<bool> {
        if text.trim() == END {
            return Ok(false);
        }
        let at = || format!("{}:{line}", self.name);
        let delimiter = self.header.delimiter;
        let fields: Vec<&str> = text.split(delimiter).map(str::trim).collect();
        let wanted = self.header.columns.len();
        let surplus = fields.get(wanted..).unwrap_or_default();
        if surplus.iter().any(|field| !field.is_empty()) {
            let hint =
                if delimiter == ',' { "; export with another separator than the decimal mark" } else { "" };
            return Err(FileError::fields(at(), fields.len(), wanted, hint));
        }
        let field =
            |column: usize| fields.get(column).copied().filter(|field| !field.is_empty() && *field != END);
        let wrong = |column: usize, found: &str| {
            let column = self.header.columns.get(column);
            let header = column.map_or_else(String::new, |column| shortened(&column.header));
            FileError::number(at(), &header, &shortened(found), "a finite number or empty", "")
        };
        for series in &mut self.series {
            let Some(time) = field(series.time_column) else { continue };
            let Some(time) = scope_time(time, delimiter, &mut self.first_time) else {
                return Err(wrong(series.time_column, time));
            };
            // Gaps of slow channels can be filled by repetition.
            if series.times.last() == Some(&time) {
                continue;
            }
            let value = match field(series.column) {
                None => f64::NAN,
                Some(text) => number(text, delimiter).ok_or_else(|| wrong(series.column, text))?,
            };
            if series.times.len() == MAX_ROWS {
                return Err(FileError::too_long(at()));
            }
            series.times.push(time);
            series.values.push(series.factor * value);
        }
        Ok(true)
    }
}

/// Parses a time, s: milliseconds, or a file time relative to the first one.
fn scope_time(field: &str, delimiter: char, first: &mut Option<i64>) -> Option<f64> {
    if let Ok(ticks) = field.parse::<i64>()
        && ticks >= MIN_FILE_TIME
    {
        let first = *first.get_or_insert(ticks);
        return Some(ticks.saturating_sub(first) as f64 * FILE_TIME);
    }
    number(field, delimiter).map(|milliseconds| milliseconds * MILLISECOND)
}

impl ScopeSeries {
    /// Returns the nearest values at `times`; NaN if none is within half the period of `times`.
    fn at(&mut self, times: &[f64]) -> Vec<f64> {
        if self.times == times {
            return std::mem::take(&mut self.values);
        }
        let mut samples: Vec<(f64, f64)> =
            self.times.iter().copied().zip(self.values.iter().copied()).collect();
        samples.sort_by(|(a, _), (b, _)| a.total_cmp(b));
        let period = match times {
            [first, .., last] => (last - first).abs() / (times.len() - 1) as f64,
            _ => 0.0,
        };
        let is_near = |distance: f64| distance == 0.0 || distance < 0.5 * period;
        let nearest = |time: f64| {
            let after = samples.partition_point(|(other, _)| *other < time);
            let near = samples.iter().skip(after.saturating_sub(1)).take(2);
            let nearest = near.min_by(|(a, _), (b, _)| (a - time).abs().total_cmp(&(b - time).abs()));
            nearest.filter(|(other, _)| is_near((other - time).abs())).map_or(f64::NAN, |(_, value)| *value)
        };
        times.iter().map(|time| nearest(*time)).collect()
    }
}
