//! Reading of a recording of one axis from CSV.

use std::io::Read;

use super::context::{Context, RecordingOptions};
use super::format::{Found, MAX_ROWS, RecordingFormat};
use super::found_column::FoundColumn;
use super::header::detect_columns;
use super::layout::{Layout, MAX_SEARCHED, PREAMBLE, next_line, parse_number};
use super::recording_builder::build_recording;
use super::recording_columns::RecordingColumns;
use super::unit::Channel;
use crate::files::error::{ErrorKind, FileError};
use crate::files::lines::{Lines, fields_between};
use virtual_axes_core::text::shortened;
use virtual_axes_identify::recording::{Finding, RawRecording};

/// Minimum number of detected channels in a header behind other lines.
const MIN_CHANNELS: usize = 2;

/// Reads the recording of an axis with findings.
pub(super) fn read(input: &mut dyn Read, context: &Context) -> Found<(RawRecording, Vec<Finding>)> {
    let Context { name, columns, .. } = *context;
    let factors = context.factors()?;
    let mut lines = Lines::new(input);
    let Some((line, text)) = first_line(&mut lines, columns.skip_lines, name)? else {
        let what =
            if columns.skip_lines > 0 { "no line after the skipped lines" } else { "the file is empty" };
        return Err(FileError::new(name, what));
    };
    let layout = context.layout(line, &text, &factors).map_err(|error| match error.kind {
        ErrorKind::NoColumn => error.with_hint(&context.hint(line, &text, &mut lines, &factors)),
        _ => error,
    })?;
    let mut channels: [Vec<f64>; Channel::ALL.len()] = Default::default();
    let mut rows = 0;
    let mut is_ended = true;
    if layout.is_data {
        layout.row(name, line, &text, &mut channels)?;
        rows = 1;
    }
    let mut last = line;
    while let Some((line, text)) = next_line(&mut lines, name)? {
        if rows == MAX_ROWS {
            return Err(FileError::too_long(format_args!("{name}:{line}")));
        }
        if let Err(error) = layout.row(name, line, text, &mut channels) {
            let is_truncated = error.kind == ErrorKind::FewFields && matches!(lines.next(), Ok(None));
            let hint = if is_truncated { "; this is the last line: the file is truncated" } else { "" };
            return Err(error.with_hint(hint));
        }
        rows += 1;
        last = line;
        is_ended = lines.is_ended();
    }
    if rows == 0 {
        let what = "no row below the header";
        return Err(FileError::new(name, what));
    }
    let mut findings = Vec::new();
    if !is_ended {
        let what = format!(
            "{name}:{last}: the last line has no line break: if the file is truncated, its last value is incomplete"
        );
        findings.push(Finding::warning("unended", what, "end the last line with a line break, or delete it"));
    }
    let recording =
        build_recording(context, channels, (&layout.assignment, &layout.found), rows, &mut findings)?;
    Ok((recording, findings))
}

/// Lists the columns with their detected meanings. `name` is the name of the file.
pub(super) fn inspect(
    input: &mut dyn Read,
    name: &str,
    options: &RecordingOptions,
) -> Found<RecordingColumns> {
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
        return Err(FileError::new(name, "the file is empty"));
    };
    Ok(RecordingColumns { header_line, ..RecordingColumns::new(RecordingFormat::Csv, columns, false) })
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

/// Returns the first line that is neither blank nor skipped.
fn first_line(lines: &mut Lines<impl Read>, skip: u64, name: &str) -> Found<Option<(u64, String)>> {
    while let Some((line, text)) = next_line(lines, name)? {
        if line > skip {
            return Ok(Some((line, text.to_owned())));
        }
    }
    Ok(None)
}

impl Layout {
    /// Adds the values of a line to their channels.
    fn row(&self, name: &str, line: u64, text: &str, channels: &mut [Vec<f64>]) -> Found<()> {
        let wanted = self.assignment.slots.len();
        let mut found = 0;
        let mut values = [f64::NAN; Channel::ALL.len()];
        let mut wrong = None;
        let mut surplus_is_blank = true;
        for (column, field) in fields_between(text, self.delimiter).enumerate() {
            found += 1;
            let Some(slot) = self.assignment.slots.get(column) else {
                surplus_is_blank &= field.is_empty();
                continue;
            };
            let Some((index, factor)) = *slot else { continue };
            match parse_number(field, self.decimal_comma) {
                Some(value) if index > 0 || value.is_finite() => values[index] = factor * value,
                _ => match self.timestamps.seconds(field).filter(|_| index == 0) {
                    Some(value) => values[index] = value,
                    None => wrong = wrong.or(Some((column, index, field))),
                },
            }
        }
        let at = || format!("{name}:{line}");
        // Many programs write a delimiter at the end of each line.
        if found != wanted && !(found == wanted + 1 && surplus_is_blank) {
            let hint = if found > wanted && self.delimiter == ',' {
                "; if the numbers have decimal commas, the delimiter must be another character"
            } else {
                ""
            };
            return Err(FileError::fields(at(), found, wanted, hint));
        }
        if let Some((column, index, field)) = wrong {
            let is_date = index == 0 && field.matches([':', '-', 'T']).count() > 1;
            let hint = match self.decimal_comma {
                _ if is_date => {
                    "; write dates and times of day as 2024-02-29T13:45:00.002, or delete the column and give the sampling rate by --rate-hz"
                }
                false if field.contains(',') && parse_number(field, true).is_some() => {
                    "; set --column decimal_comma=true for decimal commas"
                }
                true if field.contains('.') && parse_number(field, false).is_some() => {
                    "; decimal_comma=true requires decimal commas"
                }
                _ => "",
            };
            let wanted = if index == 0 { "a finite number" } else { "a finite number, empty or NaN" };
            let column = shortened(&self.columns[column]);
            return Err(FileError::number(at(), &column, &shortened(field), wanted, hint));
        }
        for (channel, value) in channels.iter_mut().zip(values) {
            channel.push(value);
        }
        Ok(())
    }
}
