//! Where the channels of an axis stand in the lines of a CSV file.

use std::io::Read;

use super::columns::{Column, Columns};
use super::csv::next_line;
use super::error::AxisRecordingError;
use super::unit::Channel;
use crate::files::lines::{Lines, fields_between};
use virtual_axes_core::text::{nearest_name, shortened};
use virtual_axes_core::config::{AxisConfig, AxisKind};
use virtual_axes_identify::recording::Finding;

/// Lines in which a header is sought for a hint.
const PREAMBLE: u64 = 100;
/// Most names that a message lists.
const MOST_NAMES: usize = 40;
/// Delimiters that are found out, the one that stands least in other places first.
const DELIMITERS: [char; 3] = [';', '\t', ','];

type Found<T> = Result<T, AxisRecordingError>;

/// Where the channels stand in the lines.
#[derive(Debug)]
pub(super) struct Layout {
    pub delimiter: char,
    pub decimal_comma: bool,
    /// Headers, or numbers where there are none.
    pub columns: Vec<String>,
    /// Per column: the place of its channel in [`Channel::ALL`] and the factor to SI.
    pub slots: Vec<Option<(usize, f64)>>,
    /// The places of the channels that were found by their usual names.
    pub usual: Vec<usize>,
    /// Whether the line is one of values.
    pub is_data: bool,
}

/// What is the same for every line.
pub(super) struct Context<'a> {
    pub name: &'a str,
    pub axis: &'a AxisConfig,
    pub joint: &'a str,
    pub columns: &'a Columns,
}

/// A number, NaN where nothing was recorded.
pub(super) fn number(text: &str, decimal_comma: bool) -> Option<f64> {
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

impl Context<'_> {
    /// Factors to SI of the channels, in the order of [`Channel::ALL`].
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

    /// How lines are to be read if this is the header, or the first of values.
    pub fn layout(&self, line: u64, text: &str, factors: &[f64]) -> Found<Layout> {
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
        let nearest = wanted.iter().find_map(|name| nearest_name(name, names()));
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
            hint: Box::default(),
        }
    }

    /// What may help where columns are not found in the first line.
    pub fn hint(&self, line: u64, text: &str, lines: &mut Lines<impl Read>, factors: &[f64]) -> String {
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
    pub fn tell_usual(&self, layout: &Layout, findings: &mut Vec<Finding>) {
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
