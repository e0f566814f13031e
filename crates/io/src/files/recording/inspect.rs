//! List of the columns of a recording with their detected channels, units and axes.

use std::io::{Cursor, Read};
use std::path::Path;

use super::axis_match::{axes_of, matching_axes};
use super::error::AxisRecordingError;
use super::format::RecordingFormat;
use super::found_column::FoundColumn;
use super::layout::{next_line, parse_number};
use super::sinumerik_signal::{edge_signal, trace_signal};
use super::unit::Channel;
use super::{
    RecordingOptions, halsampler, header, open, read_head, sinumerik_edge, sinumerik_trace, twincat,
};
use crate::files::lines::{Lines, fields_between};

/// Number of lines searched for a header.
const PREAMBLE: u64 = 100;
/// Maximum number of columns whose headers are interpreted.
const MAX_COLUMNS: usize = 1000;
/// Maximum number of columns in lines searched for a header.
pub(super) const MAX_SEARCHED: usize = 5000;
/// Minimum number of detected channels in a header behind other lines.
const MIN_CHANNELS: usize = 2;

/// Columns of a recording with their detected meanings.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordingColumns {
    /// Detected or selected format.
    pub format: RecordingFormat,
    /// Columns in the order of the file; empty for MCAP.
    pub columns: Vec<FoundColumn>,
    /// Line of the header of CSV, if it is not the first line that is read: `skip_lines` must be one less.
    pub header_line: Option<u64>,
    /// True if the format states the sampling period or the times.
    is_periodic: bool,
}

impl RecordingColumns {
    /// Returns the names of the axes of the detected channels, in the order of the file.
    pub fn axes(&self) -> Vec<String> {
        axes_of(self.columns.iter()).into_iter().map(|(name, _)| name.to_owned()).collect()
    }

    /// Returns the names of the axes that have a position, in the order of the file.
    pub fn readable_axes(&self) -> Vec<String> {
        let positions = self.columns.iter().filter(|column| column.channel == Some(Channel::Position));
        axes_of(positions).into_iter().map(|(name, _)| name.to_owned()).collect()
    }

    /// Returns the name of the axis in the file that [`read_recording`](super::read_recording) reads for a joint: `X1` for
    /// `x`; `None` if there is none, or more than one.
    pub fn axis_of(&self, joint: &str) -> Option<&str> {
        match matching_axes(&axes_of(self.columns.iter()), joint).as_slice() {
            [axis] => Some(axis),
            _ => None,
        }
    }

    /// Returns true if the file states the time; other recordings require a sampling rate.
    pub fn has_time(&self) -> bool {
        let is_time = |column: &FoundColumn| {
            column.channel == Some(Channel::Time)
                && column.unit.as_ref().is_some_and(|unit| !unit.is_samples())
        };
        self.is_periodic || self.columns.iter().any(is_time)
    }
}

/// Lists the columns of a recording. The options determine format, delimiter and skipped lines.
///
/// # Errors
/// Returns an [`AxisRecordingError`] if the file cannot be read or has no columns.
pub fn inspect_recording(
    path: &Path,
    options: &RecordingOptions,
) -> Result<RecordingColumns, AxisRecordingError> {
    let name = path.display().to_string();
    let (head, file) = open(path, &name)?;
    inspect(head, file, &name, options)
}

/// Lists the columns of a recording in a stream. `name` is the file name in errors.
///
/// # Errors
/// Returns an [`AxisRecordingError`] if the stream cannot be read or has no columns.
pub fn inspect_recording_stream(
    mut input: impl Read,
    name: &str,
    options: &RecordingOptions,
) -> Result<RecordingColumns, AxisRecordingError> {
    let head = read_head(&mut input, name)?;
    inspect(head, input, name, options)
}

fn inspect(
    head: Vec<u8>,
    rest: impl Read,
    name: &str,
    options: &RecordingOptions,
) -> Result<RecordingColumns, AxisRecordingError> {
    let format = options.format.unwrap_or_else(|| RecordingFormat::detect(&head));
    let input = Cursor::new(head).chain(rest);
    let (columns, is_periodic) = match format {
        RecordingFormat::Csv => return inspect_csv(input, name, options),
        RecordingFormat::SinumerikTrace => (sinumerik_trace::inspect(input, name)?, true),
        RecordingFormat::SinumerikEdge => sinumerik_edge::inspect(input, name)?,
        RecordingFormat::TwinCatScope => (twincat::inspect(input, name)?, true),
        RecordingFormat::Halsampler => (halsampler::inspect(input, name)?, false),
        RecordingFormat::Mcap => (Vec::new(), true),
    };
    Ok(RecordingColumns { format, columns, header_line: None, is_periodic })
}

fn inspect_csv(
    input: impl Read,
    name: &str,
    options: &RecordingOptions,
) -> Result<RecordingColumns, AxisRecordingError> {
    let mut lines = Lines::new(input);
    let mut first: Option<(u64, Vec<FoundColumn>)> = None;
    let mut header_line = None;
    let mut searched = 0;
    while let Some((line, text)) = next_line(&mut lines, name)? {
        if line <= options.columns.skip_lines {
            continue;
        }
        let columns = columns_of_line(text, options);
        searched += columns.len();
        let count = columns.iter().filter(|column| column.channel.is_some()).count();
        match &mut first {
            None => first = Some((line, columns)),
            Some((_, known)) if count >= MIN_CHANNELS => {
                *known = columns;
                header_line = Some(line);
            }
            Some(_) => {}
        }
        let begin = first.as_ref().map_or(line, |(line, _)| *line);
        if count > 0 || header_line.is_some() || line > begin + PREAMBLE || searched > MAX_SEARCHED {
            break;
        }
    }
    let Some((_, columns)) = first else {
        return Err(AxisRecordingError::Empty { at: name.to_owned(), what: "the file is empty" });
    };
    Ok(RecordingColumns { format: RecordingFormat::Csv, columns, header_line, is_periodic: false })
}

/// Returns the columns of a line: by their headers, or by number for a line of numbers.
fn columns_of_line(text: &str, options: &RecordingOptions) -> Vec<FoundColumn> {
    let delimiter = options.columns.delimiter_of(text);
    let mut fields: Vec<String> = fields_between(text, delimiter).map(str::to_owned).collect();
    if fields.len() > 1 && fields.last().is_some_and(String::is_empty) {
        fields.pop();
    }
    let is_number = |field: &String| parse_number(field, options.columns.decimal_comma).is_some();
    if !fields.iter().all(is_number) {
        return detect_columns(&fields);
    }
    let reason = "there is no header: select the column by number";
    let numbered = fields.iter().zip(1..).map(|(_, n)| FoundColumn::unknown(n, &format!("#{n}"), reason));
    numbered.collect()
}

/// Returns the meanings of columns from their headers.
pub(super) fn detect_columns(headers: &[String]) -> Vec<FoundColumn> {
    let detect = |(text, number): (&String, usize)| {
        if number > MAX_COLUMNS {
            return FoundColumn::unknown(number, text, "behind the first 1000 columns");
        }
        let signal = edge_signal(number, text).or_else(|| trace_signal(number, text));
        signal.unwrap_or_else(|| header::detect(number, text))
    };
    let mut columns: Vec<FoundColumn> = headers.iter().zip(1..).map(detect).collect();
    header::resolve_axis_a(&mut columns);
    header::resolve_motor_positions(&mut columns);
    columns
}
