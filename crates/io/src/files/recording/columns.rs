//! Mapping of CSV columns to recording channels and units.

use std::fs;
use std::io::Read;
use std::path::Path;

use serde::Deserialize;
use serde::de::{self, Deserializer, Visitor};

use super::unit::{Channel, Unit};
use crate::files::error::FileError;
use virtual_axes_core::encoding::decode_text;
use virtual_axes_core::text::{nearest_hint, nearest_name, shortened};
use virtual_axes_core::yaml;

/// Mapping of CSV columns to channels and units, with the CSV format. Unset values are detected or have defaults.
///
/// An entry is a text `CHANNEL=COLUMN[UNIT]`:
///
/// ```
/// use virtual_axes_io::files::Columns;
///
/// let mut columns = Columns::default();
/// for text in ["time=t[ms]", "position=Pos1 [mm]", "current=#4[-1 A]", "velocity=[m/min]", "delimiter=;"] {
///     columns.set(text, "--column")?;
/// }
/// # Ok::<(), virtual_axes_io::files::FileError>(())
/// ```
///
/// COLUMN is a header, or `#` and a number from 1; default is the channel name. UNIT is a symbol with an optional
/// factor; default is SI. The keys `delimiter`, `decimal_comma` and `skip_lines` set the format.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Columns {
    pub(super) mappings: Vec<Mapping>,
    pub(super) delimiter: Option<char>,
    pub(super) decimal_comma: bool,
    pub(super) skip_lines: u64,
}

/// Column and unit of a channel.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Mapping {
    pub channel: Channel,
    pub column: Column,
    /// Unit of the column; SI if `None`.
    pub unit: Option<Unit>,
    /// Text of column and unit: a header can end in its unit.
    pub text: String,
    /// Origin of the entry, for errors: option or file.
    pub at: String,
}

/// Selector of a column.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Column {
    /// Default header of the channel.
    Default,
    /// Header of the column.
    Named(String),
    /// Column index, from 0.
    Index(usize),
}

/// Key of the delimiter character.
const DELIMITER: &str = "delimiter";
const DECIMAL_COMMA: &str = "decimal_comma";
const SKIP_LINES: &str = "skip_lines";
/// Words for the tab character, and for any number of blanks.
const TAB: &str = "tab";
const SPACE: &str = "space";

/// Detected delimiters; the one with the fewest other uses first. Without them blanks delimit.
const USUAL_DELIMITERS: [char; 3] = [';', '\t', ','];

fn keys() -> impl Iterator<Item = &'static str> {
    Channel::ALL.into_iter().map(Channel::name).chain([DELIMITER, DECIMAL_COMMA, SKIP_LINES])
}

impl Columns {
    /// Reads an optional YAML file, then applies `texts`, which take precedence. `at` is the origin of `texts` in errors.
    ///
    /// # Errors
    /// Returns a [`FileError`] if the file or a text is invalid, or if two texts set the same key.
    pub fn read<T: AsRef<str>>(file: Option<&Path>, texts: &[T], at: &str) -> Result<Self, FileError> {
        let mut columns = match file {
            Some(file) => Self::open(file)?,
            None => Columns::default(),
        };
        let mut given: Vec<&str> = Vec::new();
        for text in texts {
            let text = text.as_ref();
            columns.set(text, at)?;
            let key = text.split('=').next().unwrap_or_default().trim();
            if given.contains(&key) {
                return Err(FileError::new(at, format_args!("{key} is given twice")));
            }
            given.push(key);
        }
        Ok(columns)
    }

    /// Reads a YAML file; see [`Columns::from_yaml`].
    ///
    /// # Errors
    /// Returns a [`FileError`] if the file cannot be read or is invalid.
    pub fn open(path: &Path) -> Result<Self, FileError> {
        let at = path.display().to_string();
        let unreadable = |error: std::io::Error| FileError::new(&at, error);
        let mut bytes = Vec::new();
        let file = fs::File::open(path).map_err(unreadable)?;
        file.take(MAX_FILE_BYTES).read_to_end(&mut bytes).map_err(unreadable)?;
        if bytes.len() as u64 == MAX_FILE_BYTES {
            let reason = format!("a column mapping file must be shorter than {MAX_FILE_BYTES} bytes");
            return Err(FileError::new(at, reason));
        }
        let text = decode_text(&bytes).map_err(|reason| FileError::new(&at, reason))?;
        Self::from_yaml(&text, &at)
    }

    /// Parses YAML: a mapping from channels to texts `COLUMN[UNIT]`, and from format keys to values. `name` is the
    /// file name in errors.
    ///
    /// # Errors
    /// Returns a [`FileError`] for the first invalid entry.
    pub fn from_yaml(text: &str, name: &str) -> Result<Self, FileError> {
        let mut documents: Vec<Entries> =
            yaml::documents(text).map_err(|error| FileError::new(error.position(name), error.reason))?;
        let (Some(entries), true) = (documents.pop(), documents.is_empty()) else {
            let reason = "the file must contain exactly one mapping of channels to columns";
            return Err(FileError::new(name, reason));
        };
        let mut columns = Columns::default();
        for (key, value) in entries.into_all() {
            columns.put(key, &value, name)?;
        }
        Ok(columns)
    }

    /// Sets one entry from `KEY=VALUE`, replacing an earlier one. `at` is the origin of the text in errors.
    ///
    /// # Errors
    /// Returns a [`FileError`] if the key or the value is invalid.
    pub fn set(&mut self, text: &str, at: &str) -> Result<(), FileError> {
        let Some((key, value)) = text.split_once('=') else {
            let reason = format!(
                "\"{}\" is not a column mapping, must be CHANNEL=COLUMN[UNIT], for example position=Pos1[mm]",
                shortened(text)
            );
            return Err(FileError::new(at, reason));
        };
        self.put(key.trim(), value, at)
    }

    fn put(&mut self, key: &str, value: &str, at: &str) -> Result<(), FileError> {
        // White space can be a delimiter.
        let value = if key == DELIMITER { value } else { value.trim() };
        let wrong = |reason: &str| FileError::new(at, format_args!("{key}={}: {reason}", shortened(value)));
        if let Some(channel) = Channel::from_name(key) {
            let (column, unit) = column_and_unit(value).map_err(|reason| wrong(&reason))?;
            self.mappings.retain(|mapping| mapping.channel != channel);
            let (text, at) = (value.to_owned(), at.to_owned());
            self.mappings.push(Mapping { channel, column, unit, text, at });
            return Ok(());
        }
        match key {
            DELIMITER => self.delimiter = Some(delimiter(value).ok_or_else(|| wrong(DELIMITERS))?),
            DECIMAL_COMMA => {
                self.decimal_comma = value.parse().map_err(|_| wrong("must be true or false"))?;
            }
            SKIP_LINES => {
                self.skip_lines = value.parse().map_err(|_| wrong("must be an integer of at least 0"))?;
            }
            _ => {
                let reason = format!(
                    "unknown key \"{}\"; known are {}{}",
                    shortened(key),
                    keys().collect::<Vec<_>>().join(", "),
                    nearest_hint(&nearest_name(key, keys()))
                );
                return Err(FileError::new(at, reason));
            }
        }
        if self.decimal_comma && self.delimiter == Some(',') {
            return Err(wrong("a comma cannot be both the delimiter and the decimal separator"));
        }
        Ok(())
    }

    /// Returns the first entry that selects the column of a channel of one axis, with its origin: `--column
    /// position=Pos1`. Time, and units of default columns, belong to all axes.
    pub fn single_axis_mapping(&self) -> Option<String> {
        let selects = |mapping: &&Mapping| {
            mapping.channel != Channel::Time && !matches!(mapping.column, Column::Default)
        };
        let mapping = self.mappings.iter().find(selects)?;
        let separator = if mapping.at.starts_with("--") { " " } else { ": " };
        Some(format!("{}{separator}{}={}", mapping.at, mapping.channel, shortened(&mapping.text)))
    }

    /// Returns the keys of the CSV format that are set.
    pub(super) fn format_keys(&self) -> Vec<&'static str> {
        let keys = [
            (DELIMITER, self.delimiter.is_some()),
            (DECIMAL_COMMA, self.decimal_comma),
            (SKIP_LINES, self.skip_lines > 0),
        ];
        keys.into_iter().filter(|(_, is_set)| *is_set).map(|(key, _)| key).collect()
    }

    /// Returns the delimiter of a line: that of the mapping, or the one detected.
    pub(super) fn delimiter_of(&self, text: &str) -> char {
        let found = || {
            let usable = |d: &char| !(self.decimal_comma && *d == ',');
            USUAL_DELIMITERS.into_iter().find(|d| usable(d) && text.contains(*d)).unwrap_or(' ')
        };
        self.delimiter.unwrap_or_else(found)
    }

    /// Returns the mapping of a channel, if set.
    pub(super) fn mapping(&self, channel: Channel) -> Option<&Mapping> {
        self.mappings.iter().find(|mapping| mapping.channel == channel)
    }
}

/// Maximum size of a mapping file, bytes.
const MAX_FILE_BYTES: u64 = 1 << 16;

/// Allowed delimiters, for error messages.
const DELIMITERS: &str =
    "must be one character that does not occur in numbers, such as ; or |, or one of the words tab and space";

fn delimiter(text: &str) -> Option<char> {
    let text = match text {
        TAB | "\\t" => "\t",
        SPACE => return Some(' '),
        text => text,
    };
    let mut characters = text.chars();
    let found = characters.next().filter(|_| characters.next().is_none())?;
    let of_numbers = found.is_alphanumeric() || ['.', '+', '-', '"', ' ', '\n', '\r', '\0'].contains(&found);
    (!of_numbers).then_some(found)
}

pub(super) fn column_and_unit(text: &str) -> Result<(Column, Option<Unit>), String> {
    let (column, unit) = match text.strip_suffix(']').and_then(|text| text.rsplit_once('[')) {
        Some((column, unit)) => (column.trim(), Some(Unit::parse(unit)?)),
        None => (text, None),
    };
    let column = match column.strip_prefix('#') {
        Some(number) => match number.trim().parse::<usize>() {
            Ok(number) if number > 0 => Column::Index(number - 1),
            _ => return Err("a column number must be an integer of at least 1, for example #3".to_owned()),
        },
        None if column.is_empty() && unit.is_some() => Column::Default,
        None if column.is_empty() => return Err("the column is missing".to_owned()),
        None => Column::Named(column.to_owned()),
    };
    Ok((column, unit))
}

/// Entries of a mapping file, by key.
#[derive(Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Entries {
    time: EntryText,
    psec: EntryText,
    position: EntryText,
    velocity: EntryText,
    current: EntryText,
    torque: EntryText,
    velocity_feedforward: EntryText,
    torque_feedforward: EntryText,
    motor_position: EntryText,
    wind_up: EntryText,
    delimiter: EntryText,
    decimal_comma: EntryText,
    skip_lines: EntryText,
}

impl Entries {
    fn into_all(self) -> impl Iterator<Item = (&'static str, String)> {
        let values = [
            self.time,
            self.psec,
            self.position,
            self.velocity,
            self.current,
            self.torque,
            self.velocity_feedforward,
            self.torque_feedforward,
            self.motor_position,
            self.wind_up,
            self.delimiter,
            self.decimal_comma,
            self.skip_lines,
        ];
        keys().zip(values).filter_map(|(key, value)| Some((key, value.0?)))
    }
}

/// YAML scalar of any type as text; none without the key.
#[derive(Default)]
struct EntryText(Option<String>);

impl<'de> Deserialize<'de> for EntryText {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(ScalarVisitor).map(|text| EntryText(Some(text)))
    }
}

struct ScalarVisitor;

impl Visitor<'_> for ScalarVisitor {
    type Value = String;

    fn expecting(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str("a text (put a column number in quotation marks: \"#3[mm]\")")
    }

    fn visit_str<E>(self, value: &str) -> Result<String, E> {
        Ok(value.to_owned())
    }

    fn visit_bool<E>(self, value: bool) -> Result<String, E> {
        Ok(value.to_string())
    }

    fn visit_u64<E>(self, value: u64) -> Result<String, E> {
        Ok(value.to_string())
    }

    fn visit_i64<E>(self, value: i64) -> Result<String, E> {
        Ok(value.to_string())
    }

    fn visit_unit<E: de::Error>(self) -> Result<String, E> {
        Err(E::custom("the value is missing; put a column number in quotation marks: \"#3[mm]\""))
    }
}
