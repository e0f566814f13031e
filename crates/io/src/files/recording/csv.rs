//! Reading of a recording of one axis from CSV.

use std::io::Read;

use super::error::{AxisRecordingError, MAX_ROWS};
use super::layout::{Context, Layout, next_line, parse_number};
use super::recording_builder::build_recording;
use super::unit::Channel;
use crate::files::lines::{Lines, fields_between};
use virtual_axes_core::text::shortened;
use virtual_axes_identify::recording::{Finding, RawRecording};

type Found<T> = Result<T, AxisRecordingError>;

/// Reads the recording of an axis from CSV.
pub(super) fn read(input: impl Read, context: &Context) -> Found<(RawRecording, Vec<Finding>)> {
    let Context { name, columns, .. } = *context;
    let factors = context.factors()?;
    let mut lines = Lines::new(input);
    let Some((line, text)) = first_line(&mut lines, columns.skip_lines, name)? else {
        let what =
            if columns.skip_lines > 0 { "no line after the skipped lines" } else { "the file is empty" };
        return Err(AxisRecordingError::Empty { at: name.to_owned(), what });
    };
    let layout = context.layout(line, &text, &factors).map_err(|mut error| {
        if let AxisRecordingError::NoColumn { hint, .. } = &mut error {
            *hint = format!("{hint}{}", context.hint(line, &text, &mut lines, &factors)).into();
        }
        error
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
            return Err(AxisRecordingError::TooLong { at: format!("{name}:{line}") });
        }
        let read = layout.row(name, line, text, &mut channels);
        if let Err(mut error) = read {
            if let AxisRecordingError::Fields { found, wanted, hint, .. } = &mut error
                && found < wanted
                && matches!(lines.next(), Ok(None))
            {
                *hint = "; this is the last line: the file is truncated";
            }
            return Err(error);
        }
        rows += 1;
        last = line;
        is_ended = lines.is_ended();
    }
    if rows == 0 {
        let what = "no row below the header";
        return Err(AxisRecordingError::Empty { at: name.to_owned(), what });
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
                _ => wrong = wrong.or(Some((column, index, field))),
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
            return Err(AxisRecordingError::Fields { at: at(), found, wanted, hint });
        }
        if let Some((column, index, field)) = wrong {
            let hint = match self.decimal_comma {
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
            return Err(AxisRecordingError::Number {
                at: at(),
                column,
                found: shortened(field),
                wanted,
                hint,
            });
        }
        for (channel, value) in channels.iter_mut().zip(values) {
            channel.push(value);
        }
        Ok(())
    }
}
