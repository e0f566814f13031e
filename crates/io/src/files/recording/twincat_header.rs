//! Header of the CSV that TwinCAT Scope exports: names, symbols and units of the channels.

use std::io::Read;

use super::format::{Found, RecordingFormat};
use super::found_column::{ColumnUnit, FoundColumn, UnitSource};
use super::header;
use super::layout::next_line;
use super::unit::{Channel, Unit};
use crate::files::error::FileError;
use crate::files::lines::Lines;
use virtual_axes_core::text::shortened;

/// Key of the line with the names of the channels, and of the first line.
const NAME: &str = "Name";
const SYMBOL: &str = "SymbolName";
const UNIT: &str = "Unit";
/// Unit of a channel without unit.
const NO_UNIT: &str = "(None)";
/// Keys of scalings with their neutral values.
const SCALINGS: [(&str, f64); 4] =
    [("ScaleFactor", 1.0), ("Offset", 0.0), ("Unit ScaleFactor", 1.0), ("Unit Offset", 0.0)];
/// Keys of the start of the recording, in TwinCAT 3 and 2.
const STARTS: [&str; 2] = ["Starttime of export", "StartRecord"];
/// Maximum number of lines of a header.
const MAX_LINES: usize = 200;

/// Returns true for the export of a scope: `Name` in the first line, and the start of the recording.
pub(super) fn is_twincat(text: &str) -> bool {
    delimiter_of(text).is_some()
        && text.lines().take(MAX_LINES).any(|line| STARTS.iter().any(|key| line.starts_with(key)))
}

/// Returns the character behind the first `Name`.
fn delimiter_of(line: &str) -> Option<char> {
    line.strip_prefix(NAME)?.chars().next().filter(|c| !c.is_alphanumeric() && *c != '"')
}

/// Header of an export.
#[derive(Debug)]
pub(super) struct ScopeHeader {
    pub delimiter: char,
    /// Columns of times and values.
    pub columns: Vec<FoundColumn>,
    /// Per column: index of the column of its time; `None` for a column of times.
    pub times: Vec<Option<usize>>,
    /// Scalings of the columns other than neutral, as text.
    pub scalings: Vec<Option<String>>,
    /// Number of the line with the names of the channels.
    pub line: u64,
    /// First line of values.
    pub first: (u64, String),
}

/// Line of the header, split at the delimiter.
struct MetadataLine {
    number: u64,
    fields: Vec<String>,
}

impl ScopeHeader {
    /// Reads the header up to the first line of values.
    pub fn read(lines: &mut Lines<impl Read>, name: &str) -> Found<Self> {
        let wrong = |line: u64, reason: &str| {
            FileError::content(format_args!("{name}:{line}"), RecordingFormat::TwinCatScope, reason)
        };
        let mut delimiter = None;
        let mut metadata: Vec<MetadataLine> = Vec::new();
        while let Some((line, text)) = next_line(lines, name)? {
            let delimiter = match delimiter {
                Some(delimiter) => delimiter,
                None => {
                    let found = delimiter_of(text).ok_or_else(|| {
                        wrong(line, "the first line must begin with \"Name\" and a separator")
                    })?;
                    if found == ' ' {
                        return Err(wrong(line, "a blank as separator is ambiguous; export with tabs"));
                    }
                    *delimiter.insert(found)
                }
            };
            let fields: Vec<String> = text.split(delimiter).map(|field| field.trim().to_owned()).collect();
            if fields.first().is_some_and(|field| number(field, delimiter).is_some()) {
                let first = (line, text.to_owned());
                return Self::new(delimiter, &metadata, first)
                    .ok_or_else(|| wrong(line, "there is no line with the names of the channels"));
            }
            if metadata.len() == MAX_LINES {
                return Err(wrong(line, "the header has more than 200 lines"));
            }
            metadata.push(MetadataLine { number: line, fields });
        }
        Err(FileError::new(name, "there are no lines of values"))
    }

    fn new(delimiter: char, metadata: &[MetadataLine], first: (u64, String)) -> Option<Self> {
        let is_names = |line: &&MetadataLine| line.fields.first().is_some_and(|key| key == NAME);
        let names = metadata.iter().rfind(is_names)?;
        let mut fields = names.fields.clone();
        while fields.len() > 1 && fields.last().is_some_and(String::is_empty) {
            fields.pop();
        }
        // Each group of channels with one time begins with the key.
        let mut times = Vec::new();
        let mut time = None;
        for (column, field) in fields.iter().enumerate() {
            let is_time = field == NAME;
            time = if is_time { Some(column) } else { time };
            times.push(time.filter(|_| !is_time));
        }
        let values = |key: &str, column: usize| -> Option<&str> {
            let line = metadata.iter().rfind(|line| line.fields.first().is_some_and(|first| first == key))?;
            // With a comma as separator and as decimal mark the columns of a line are ambiguous.
            let is_aligned = times
                .iter()
                .zip(&line.fields)
                .all(|(time, field)| (time.is_none() && field == key) || (time.is_some() && field != key));
            let value =
                line.fields.get(column).filter(|_| is_aligned && line.fields.len() <= fields.len() + 1);
            value.map(String::as_str).filter(|value| !value.is_empty())
        };
        let columns = fields.iter().enumerate().map(|(column, field)| match times.get(column) {
            Some(Some(_)) => {
                let symbol = values(SYMBOL, column);
                let original = original_name(field).and_then(|name| fields.iter().position(|f| f == name));
                match original.filter(|original| symbol.is_some() && values(SYMBOL, *original) == symbol) {
                    Some(original) => {
                        let reason = format!("copy of column #{} with the same symbol", original + 1);
                        FoundColumn::unknown(column + 1, field, &reason)
                    }
                    None => describe(column + 1, field, symbol, values(UNIT, column)),
                }
            }
            _ => time_column(column + 1),
        });
        let columns = columns.collect();
        let scaling = |column: usize| {
            let other = |(key, neutral): (&str, f64)| {
                let value = values(key, column)?;
                (number(value, delimiter)? != neutral).then(|| format!("{key} {}", shortened(value)))
            };
            let found: Vec<String> = SCALINGS.into_iter().filter_map(other).collect();
            (!found.is_empty()).then(|| found.join(", "))
        };
        let scalings = (0..fields.len()).map(scaling).collect();
        Some(ScopeHeader { delimiter, columns, times, scalings, line: names.number, first })
    }
}

/// Returns `name` of `name (1)`: a channel in several charts is exported several times.
fn original_name(name: &str) -> Option<&str> {
    let (name, number) = name.strip_suffix(')')?.rsplit_once(" (")?;
    (!number.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit())).then_some(name)
}

/// Parses a number whose decimal mark is a point or a comma; `None` if it is no number.
pub(super) fn number(field: &str, delimiter: char) -> Option<f64> {
    let field = field.trim();
    let text = match field.contains(',') {
        true if delimiter == ',' || field.contains('.') => return None,
        true => field.replace(',', "."),
        false => field.to_owned(),
    };
    text.parse().ok().filter(|value: &f64| value.is_finite())
}

fn time_column(number: usize) -> FoundColumn {
    let reason = "time of the columns behind it, up to the next column of times";
    let mut column = FoundColumn::unknown(number, NAME, reason);
    let millisecond = Unit { factor: 1.0, symbol: "ms" };
    (column.channel, column.unit) = (Some(Channel::Time), Some(ColumnUnit(UnitSource::Known(millisecond))));
    column
}

/// Returns the meaning of a channel from its name, or else from its symbol.
fn describe(number: usize, name: &str, symbol: Option<&str>, unit: Option<&str>) -> FoundColumn {
    let unit = unit.filter(|unit| *unit != NO_UNIT).and_then(|unit| unit.split_whitespace().next());
    let with_unit = |text: &str| unit.map_or_else(|| text.to_owned(), |unit| format!("{text} [{unit}]"));
    let mut column = header::detect(number, &with_unit(original_name(name).unwrap_or(name)));
    if let Some(symbol) = symbol {
        let of_symbol = header::detect(number, &with_unit(symbol));
        if column.channel.is_none() && of_symbol.channel.is_some() {
            column = of_symbol;
            column.reason = format!("{} of the symbol {}", column.reason, shortened(symbol));
        } else if column.axis.is_none() {
            column.axis = of_symbol.axis;
        }
    }
    if column.channel == Some(Channel::Time) {
        column = FoundColumn::unknown(number, name, "a time, the times are those of the scope");
    }
    name.clone_into(&mut column.header);
    column
}
