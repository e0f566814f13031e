//! One axis from a CSV file.

use std::io::Read;

use super::columns::Columns;
use super::error::AxisRecordingError;
use super::layout::{Context, Layout, number};
use super::unit::Channel;
use crate::files::lines::{Lines, fields_between};
use virtual_axes_core::text::shortened;
use virtual_axes_core::config::AxisConfig;
use virtual_axes_identify::recording::{Finding, RawRecording};

/// Most samples of a recording: at 1 kHz almost three hours.
pub(super) const MOST_ROWS: usize = 10_000_000;
type Found<T> = Result<T, AxisRecordingError>;

/// Reads the axis from CSV; `name` is for messages, `joint` heads the columns of a trace.
pub(super) fn read(
    input: impl Read,
    name: &str,
    axis: &AxisConfig,
    joint: &str,
    columns: &Columns,
) -> Found<(RawRecording, Vec<Finding>)> {
    let context = Context { name, axis, joint, columns };
    let factors = context.factors()?;
    let mut lines = Lines::new(input);
    let Some((line, text)) = first_line(&mut lines, columns.skip_lines, name)? else {
        let what = if columns.skip_lines > 0 { "no line after those to skip" } else { "the file is empty" };
        return Err(AxisRecordingError::Empty { at: name.to_owned(), what });
    };
    let layout = match context.layout(line, &text, &factors) {
        Ok(layout) => layout,
        Err(mut error) => {
            if let AxisRecordingError::NoColumn { hint, .. } = &mut error {
                *hint = context.hint(line, &text, &mut lines, &factors).into();
            }
            return Err(error);
        }
    };
    let mut channels: [Vec<f64>; Channel::ALL.len()] = Default::default();
    let mut rows = 0;
    let mut ended = true;
    if layout.is_data {
        layout.row(name, line, &text, &mut channels)?;
        rows = 1;
    }
    let mut last = line;
    while let Some((line, text)) = next_line(&mut lines, name)? {
        if rows == MOST_ROWS {
            return Err(AxisRecordingError::TooLong { at: format!("{name}:{line}") });
        }
        let read = layout.row(name, line, text, &mut channels);
        if let Err(mut error) = read {
            if let AxisRecordingError::Fields { found, wanted, hint, .. } = &mut error
                && found < wanted
                && matches!(lines.next(), Ok(None))
            {
                *hint = "; it is the last line: the file was cut off";
            }
            return Err(error);
        }
        rows += 1;
        last = line;
        ended = lines.is_ended();
    }
    if rows == 0 {
        let what = "no row below the header";
        return Err(AxisRecordingError::Empty { at: name.to_owned(), what });
    }
    let mut findings = Vec::new();
    if !ended {
        findings.push(Finding::warning(
            "unended",
            format!("{name}:{last}: the last line has no end: if the file was cut off, its last value is not whole"),
            "let the last line end, or leave it out",
        ));
    }
    context.tell_usual(&layout, &mut findings);
    Ok((recording(name, channels, &layout, rows, &mut findings)?, findings))
}

/// The channels that have values.
fn recording(
    name: &str,
    channels: [Vec<f64>; Channel::ALL.len()],
    layout: &Layout,
    rows: usize,
    findings: &mut Vec<Finding>,
) -> Found<RawRecording> {
    let mut recording = RawRecording { name: name.to_owned(), ..RawRecording::default() };
    for (place, (channel, values)) in Channel::ALL.into_iter().zip(channels).enumerate() {
        let Some(column) = layout.slots.iter().position(|slot| slot.is_some_and(|(p, _)| p == place)) else {
            continue;
        };
        if values.iter().all(|value| value.is_nan()) {
            if channel.is_needed() {
                return Err(AxisRecordingError::NoValue { at: name.to_owned(), channel, rows });
            }
            let column = &layout.columns[column];
            let what = format!("{name}: column {column} ({channel}) has no value: as if it were not there");
            findings.push(Finding::note("empty-channel", what));
            continue;
        }
        match channel {
            Channel::Time => recording.time = values,
            Channel::Psec => recording.psec = Some(values),
            Channel::Position => recording.position = Some(values),
            Channel::Velocity => recording.velocity = Some(values),
            Channel::Current => recording.current = Some(values),
            Channel::VelocityFeedforward => recording.velocity_feedforward = Some(values),
            Channel::TorqueFeedforward => recording.torque_feedforward = Some(values),
        }
    }
    Ok(recording)
}

/// The next line that is not blank.
pub(super) fn next_line<'a>(lines: &'a mut Lines<impl Read>, name: &str) -> Found<Option<(u64, &'a str)>> {
    let not_text = |line, reason| AxisRecordingError::NotText { at: format!("{name}:{line}"), reason };
    match lines.next() {
        Ok(Some((line, text))) if text.contains('\0') => {
            Err(not_text(line, "there are bytes of zero".to_owned()))
        }
        Ok(found) => Ok(found),
        Err((line, reason)) => Err(not_text(line, reason)),
    }
}

/// The first line that is not blank nor to be skipped.
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
        let wanted = self.slots.len();
        let mut found = 0;
        let mut values = [f64::NAN; Channel::ALL.len()];
        let mut wrong = None;
        let mut surplus_is_blank = true;
        for (column, field) in fields_between(text, self.delimiter).enumerate() {
            found += 1;
            let Some(slot) = self.slots.get(column) else {
                surplus_is_blank &= field.is_empty();
                continue;
            };
            let Some((place, factor)) = *slot else { continue };
            match number(field, self.decimal_comma) {
                Some(value) if place > 0 || value.is_finite() => values[place] = factor * value,
                _ => wrong = wrong.or(Some((column, place, field))),
            }
        }
        let at = || format!("{name}:{line}");
        // Many programs end each line with a delimiter.
        if found != wanted && !(found == wanted + 1 && surplus_is_blank) {
            let hint = if found > wanted && self.delimiter == ',' {
                "; do the numbers have decimal commas? then something else must stand between them"
            } else {
                ""
            };
            return Err(AxisRecordingError::Fields { at: at(), found, wanted, hint });
        }
        if let Some((column, place, field)) = wrong {
            let hint = match self.decimal_comma {
                false if field.contains(',') && number(field, true).is_some() => {
                    "; decimal commas are told by decimal_comma=true"
                }
                true if field.contains('.') && number(field, false).is_some() => {
                    "; it was said that decimals stand behind a comma (decimal_comma)"
                }
                _ => "",
            };
            let wanted = if place == 0 { "a finite number" } else { "a finite number, or nothing or NaN" };
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
