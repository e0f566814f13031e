//! One axis from a CSV file.

use std::io::Read;

use super::columns::{Column, Columns};
use super::error::AxisRecordingError;
use super::unit::Channel;
use crate::config::{AxisConfig, AxisKind};
use crate::files::lines::{Lines, fields_between};
use crate::files::{nearest, shortened};
use crate::identify::{Finding, RawRecording};

/// Most samples of a recording: at 1 kHz almost three hours.
pub(super) const MOST_ROWS: usize = 10_000_000;
/// Lines in which a header is sought for a hint.
const PREAMBLE: u64 = 100;
/// Most names that a message lists.
const MOST_NAMES: usize = 40;
/// Delimiters that are found out, the one that stands least in other places first.
const DELIMITERS: [char; 3] = [';', '\t', ','];

/// Where the channels stand in the lines.
#[derive(Debug)]
struct Layout {
    delimiter: char,
    decimal_comma: bool,
    /// Headers, or numbers where there are none.
    columns: Vec<String>,
    /// Per column: the place of its channel in [`Channel::ALL`] and the factor to SI.
    slots: Vec<Option<(usize, f64)>>,
    /// The places of the channels that were found by their usual names.
    usual: Vec<usize>,
    /// Whether the line is one of values.
    is_data: bool,
}

/// What is the same for every line.
struct Context<'a> {
    name: &'a str,
    axis: &'a AxisConfig,
    joint: &'a str,
    columns: &'a Columns,
}

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
                *hint += &context.hint(line, &text, &mut lines, &factors);
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
fn next_line<'a>(lines: &'a mut Lines<impl Read>, name: &str) -> Found<Option<(u64, &'a str)>> {
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

/// A number, NaN where nothing was recorded.
fn number(text: &str, decimal_comma: bool) -> Option<f64> {
    if text.is_empty() {
        return Some(f64::NAN);
    }
    let parsed = if decimal_comma {
        // A point would be one of thousands.
        if text.contains('.') {
            return None;
        }
        text.replace(',', ".").parse()
    } else {
        text.parse()
    };
    parsed.ok().filter(|value: &f64| !value.is_infinite())
}

/// Names for a message.
fn listed(names: &[String]) -> String {
    let shown: Vec<String> = names.iter().take(MOST_NAMES).map(|name| shortened(name)).collect();
    let more =
        if names.len() > MOST_NAMES { format!(", … ({} columns)", names.len()) } else { String::new() };
    shown.join(", ") + &more
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
                false if number(field, true).is_some() => "; decimal commas are told by decimal_comma=true",
                true if number(field, false).is_some() => {
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

impl Context<'_> {
    /// Factors to SI of the channels, in the order of [`Channel::ALL`].
    fn factors(&self) -> Found<[f64; Channel::ALL.len()]> {
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

    /// How lines are to be read if this is the header, or the first of values.
    fn layout(&self, line: u64, text: &str, factors: &[f64]) -> Found<Layout> {
        let at = || format!("{}:{line}", self.name);
        let delimiter = self.delimiter(text);
        let decimal_comma = self.columns.decimal_comma;
        let mut columns: Vec<String> = fields_between(text, delimiter).map(str::to_owned).collect();
        if columns.len() > 1 && columns.last().is_some_and(String::is_empty) {
            columns.pop();
        }
        let mut slots = vec![None; columns.len()];
        let mut usual = Vec::new();
        let headed = Channel::ALL.iter().any(|c| *c != Channel::Time && columns.contains(&self.headed(*c)));
        for (place, channel) in Channel::ALL.into_iter().enumerate() {
            let wanted = self.wanted(channel, headed);
            let Some(column) = self.find(channel, &wanted, &columns, &at)? else {
                if channel.is_needed() || self.columns.mapping(channel).is_some() {
                    return Err(self.no_column(channel, &wanted, &columns, at()));
                }
                continue;
            };
            if let Some((before, _)) = slots[column] {
                let (first, number): (usize, _) = (before, column + 1);
                let first = Channel::ALL[first];
                return Err(AxisRecordingError::SameColumn { at: at(), first, second: channel, number });
            }
            slots[column] = Some((place, factors[place]));
            if self.columns.mapping(channel).is_none() {
                usual.push(place);
            }
        }
        let by_place = Channel::ALL.into_iter().filter(|channel| channel.is_needed()).all(|channel| {
            matches!(self.columns.mapping(channel), Some(m) if matches!(m.column, Column::Place(_)))
        });
        let is_number = |column: &String| number(column, decimal_comma).is_some_and(|v| !v.is_nan());
        let is_data = by_place && slots.iter().zip(&columns).all(|(slot, c)| slot.is_none() || is_number(c));
        if is_data {
            columns = (1..=columns.len()).map(|number| format!("#{number}")).collect();
        }
        Ok(Layout { delimiter, decimal_comma, columns, slots, usual, is_data })
    }

    /// The header of a channel in a trace.
    fn headed(&self, channel: Channel) -> String {
        format!("{}.{channel}", self.joint)
    }

    /// The headers that a channel can have, the first that is there being the one.
    fn wanted(&self, channel: Channel, headed: bool) -> Vec<String> {
        let usual = || match channel {
            Channel::Time => vec![channel.name().to_owned()],
            // Not one channel from a trace and another from who knows where.
            channel if headed => vec![self.headed(channel)],
            channel => vec![self.headed(channel), channel.name().to_owned()],
        };
        match self.columns.mapping(channel) {
            None => usual(),
            Some(mapping) => match &mapping.column {
                Column::Usual => usual(),
                Column::Named(name) => vec![name.clone(), mapping.text.clone()],
                Column::Place(place) => vec![format!("#{}", place + 1)],
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
        if let Some(Column::Place(place)) = self.columns.mapping(channel).map(|mapping| &mapping.column) {
            return Ok((*place < columns.len()).then_some(*place));
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
        let nearest = wanted.iter().find_map(|name| nearest(name, names()));
        // The bare name of an axis is likely its position.
        let axis = || names().find(|name| *name == self.joint).map(str::to_owned);
        let mut wanted: Vec<String> = wanted.iter().map(|name| format!("\"{}\"", shortened(name))).collect();
        wanted.dedup();
        AxisRecordingError::NoColumn {
            at,
            channel,
            wanted: wanted.join(" or "),
            found: listed(columns),
            nearest: nearest.or_else(axis),
            hint: String::new(),
        }
    }

    /// What may help where columns are not found in the first line.
    fn hint(&self, line: u64, text: &str, lines: &mut Lines<impl Read>, factors: &[f64]) -> String {
        let delimiter = self.delimiter(text);
        if fields_between(text, delimiter).all(|field| number(field, self.columns.decimal_comma).is_some()) {
            return "; without a header, by numbers: time=#1, position=#2".to_owned();
        }
        while let Ok(Some((found, text))) = next_line(lines, self.name) {
            if found > line + PREAMBLE {
                break;
            }
            if self.layout(found, text, factors).is_ok() {
                return format!("; line {found} has all that is needed: skip_lines={}", found - 1);
            }
        }
        String::new()
    }

    /// Says which channels were taken by their usual names beside those that were named.
    fn tell_usual(&self, layout: &Layout, findings: &mut Vec<Finding>) {
        if self.columns.mappings.is_empty() || layout.usual.is_empty() {
            return;
        }
        let taken: Vec<String> = layout
            .usual
            .iter()
            .filter_map(|&place| {
                let channel = Channel::ALL[place];
                let slot = layout.slots.iter().position(|slot| slot.is_some_and(|(p, _)| p == place))?;
                let unit = channel.units(self.axis).first().map_or("", |(symbol, _)| *symbol);
                Some(format!("{channel} from column {} in {unit}", shortened(&layout.columns[slot])))
            })
            .collect();
        let what = format!("{}: not named and taken as usual: {}", self.name, taken.join(", "));
        findings.push(Finding::note("usual-columns", what));
    }
}
