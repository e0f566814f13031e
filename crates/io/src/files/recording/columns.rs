//! Mapping of CSV columns to recording channels and units.

use std::fs;
use std::io::Read;
use std::path::Path;

use serde::Deserialize;
use serde::de::{self, Deserializer, Visitor};

use super::unit::{Channel, Unit};
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
/// # Ok::<(), virtual_axes_io::files::ColumnsError>(())
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

/// Error of a column mapping.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ColumnsError {
    /// The mapping file cannot be read.
    #[error("{at}: {reason}")]
    Unreadable {
        /// File, and line if known.
        at: String,
        /// Error message of the reader.
        reason: String,
    },
    /// An entry has no `=`.
    #[error(
        "{at}: \"{found}\" is not a column mapping, must be CHANNEL=COLUMN[UNIT], for example position=Pos1[mm]"
    )]
    Syntax {
        /// Origin of the entry: option or file.
        at: String,
        /// Text found.
        found: String,
    },
    /// The key of an entry is unknown.
    #[error("{at}: unknown key \"{found}\"; known are {}{}", known_keys(), nearest_hint(.nearest))]
    Unknown {
        /// Origin of the entry: option or file.
        at: String,
        /// Key found.
        found: String,
        /// Most similar key.
        nearest: Option<String>,
    },
    /// A key occurs twice.
    #[error("{at}: {key} is given twice")]
    Duplicate {
        /// Origin of the entry: option or file.
        at: String,
        /// Duplicate key.
        key: String,
    },
    /// The value of a key is invalid.
    #[error("{at}: {key}={found}: {reason}")]
    Value {
        /// Origin of the entry: option or file.
        at: String,
        /// Key of the value.
        key: String,
        /// Value found.
        found: String,
        /// Reason, with the allowed values.
        reason: String,
    },
}

/// Key of the delimiter character.
const DELIMITER: &str = "delimiter";
const DECIMAL_COMMA: &str = "decimal_comma";
const SKIP_LINES: &str = "skip_lines";
/// Word for the tab character.
const TAB: &str = "tab";

fn keys() -> impl Iterator<Item = &'static str> {
    Channel::ALL.into_iter().map(Channel::name).chain([DELIMITER, DECIMAL_COMMA, SKIP_LINES])
}

fn known_keys() -> String {
    keys().collect::<Vec<_>>().join(", ")
}

impl Columns {
    /// Reads an optional YAML file, then applies `texts`, which take precedence. `at` is the origin of `texts` in errors.
    ///
    /// # Errors
    /// Returns a [`ColumnsError`] if the file or a text is invalid, or if two texts set the same key.
    pub fn read<T: AsRef<str>>(file: Option<&Path>, texts: &[T], at: &str) -> Result<Self, ColumnsError> {
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
                return Err(ColumnsError::Duplicate { at: at.to_owned(), key: key.to_owned() });
            }
            given.push(key);
        }
        Ok(columns)
    }

    /// Reads a YAML file; see [`Columns::from_yaml`].
    ///
    /// # Errors
    /// Returns a [`ColumnsError`] if the file cannot be read or is invalid.
    pub fn open(path: &Path) -> Result<Self, ColumnsError> {
        let at = path.display().to_string();
        let unreadable =
            |error: std::io::Error| ColumnsError::Unreadable { at: at.clone(), reason: error.to_string() };
        let mut text = String::new();
        let file = fs::File::open(path).map_err(unreadable)?;
        file.take(MAX_FILE_BYTES).read_to_string(&mut text).map_err(unreadable)?;
        if text.len() as u64 == MAX_FILE_BYTES {
            let reason = format!("a column mapping file must be shorter than {MAX_FILE_BYTES} bytes");
            return Err(ColumnsError::Unreadable { at, reason });
        }
        Self::from_yaml(&text, &at)
    }

    /// Parses YAML: a mapping from channels to texts `COLUMN[UNIT]`, and from format keys to values. `name` is the
    /// file name in errors.
    ///
    /// # Errors
    /// Returns a [`ColumnsError`] for the first invalid entry.
    pub fn from_yaml(text: &str, name: &str) -> Result<Self, ColumnsError> {
        let unreadable = |at: String, reason: String| Err(ColumnsError::Unreadable { at, reason });
        let mut documents: Vec<Entries> = match yaml::documents(text) {
            Ok(documents) => documents,
            Err(error) => return unreadable(error.position(name), error.reason),
        };
        let (Some(entries), true) = (documents.pop(), documents.is_empty()) else {
            return unreadable(
                name.to_owned(),
                "the file must contain exactly one mapping of channels to columns".to_owned(),
            );
        };
        let mut columns = Columns::default();
        for (key, Scalar(value)) in entries.into_all() {
            columns.put(key, &value, name)?;
        }
        Ok(columns)
    }

    /// Sets one entry from `KEY=VALUE`, replacing an earlier one. `at` is the origin of the text in errors.
    ///
    /// # Errors
    /// Returns a [`ColumnsError`] if the key or the value is invalid.
    pub fn set(&mut self, text: &str, at: &str) -> Result<(), ColumnsError> {
        let Some((key, value)) = text.split_once('=') else {
            return Err(ColumnsError::Syntax { at: at.to_owned(), found: shortened(text) });
        };
        self.put(key.trim(), value, at)
    }

    fn put(&mut self, key: &str, value: &str, at: &str) -> Result<(), ColumnsError> {
        // White space can be a delimiter.
        let value = if key == DELIMITER { value } else { value.trim() };
        let wrong = |reason: &str| ColumnsError::Value {
            at: at.to_owned(),
            key: key.to_owned(),
            found: shortened(value),
            reason: reason.to_owned(),
        };
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
                let nearest = nearest_name(key, keys());
                return Err(ColumnsError::Unknown { at: at.to_owned(), found: shortened(key), nearest });
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

    /// Returns the mapping of a channel, if set.
    pub(super) fn mapping(&self, channel: Channel) -> Option<&Mapping> {
        self.mappings.iter().find(|mapping| mapping.channel == channel)
    }
}

/// Maximum size of a mapping file, bytes.
const MAX_FILE_BYTES: u64 = 1 << 16;

/// Allowed delimiters, for error messages.
const DELIMITERS: &str =
    "must be one character that does not occur in numbers, such as ; or |, or the word tab";

fn delimiter(text: &str) -> Option<char> {
    let text = match text {
        TAB | "\\t" => "\t",
        text => text,
    };
    let mut characters = text.chars();
    let found = characters.next().filter(|_| characters.next().is_none())?;
    let of_numbers = found.is_alphanumeric() || ['.', '+', '-', '"', ' ', '\n', '\r', '\0'].contains(&found);
    (!of_numbers).then_some(found)
}

fn column_and_unit(text: &str) -> Result<(Column, Option<Unit>), String> {
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
    #[serde(deserialize_with = "non_empty_value")]
    time: Option<Scalar>,
    #[serde(deserialize_with = "non_empty_value")]
    psec: Option<Scalar>,
    #[serde(deserialize_with = "non_empty_value")]
    position: Option<Scalar>,
    #[serde(deserialize_with = "non_empty_value")]
    velocity: Option<Scalar>,
    #[serde(deserialize_with = "non_empty_value")]
    current: Option<Scalar>,
    #[serde(deserialize_with = "non_empty_value")]
    velocity_feedforward: Option<Scalar>,
    #[serde(deserialize_with = "non_empty_value")]
    torque_feedforward: Option<Scalar>,
    #[serde(deserialize_with = "non_empty_value")]
    motor_position: Option<Scalar>,
    #[serde(deserialize_with = "non_empty_value")]
    wind_up: Option<Scalar>,
    #[serde(deserialize_with = "non_empty_value")]
    delimiter: Option<Scalar>,
    #[serde(deserialize_with = "non_empty_value")]
    decimal_comma: Option<Scalar>,
    #[serde(deserialize_with = "non_empty_value")]
    skip_lines: Option<Scalar>,
}

impl Entries {
    fn into_all(self) -> impl Iterator<Item = (&'static str, Scalar)> {
        let values = [
            self.time,
            self.psec,
            self.position,
            self.velocity,
            self.current,
            self.velocity_feedforward,
            self.torque_feedforward,
            self.motor_position,
            self.wind_up,
            self.delimiter,
            self.decimal_comma,
            self.skip_lines,
        ];
        keys().zip(values).filter_map(|(key, value)| Some((key, value?)))
    }
}

/// Deserializes the value of a key that is present; rejects an empty value.
fn non_empty_value<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Scalar>, D::Error> {
    deserializer.deserialize_any(ScalarVisitor).map(Some)
}

/// YAML scalar of any type as text.
struct Scalar(String);

struct ScalarVisitor;

impl Visitor<'_> for ScalarVisitor {
    type Value = Scalar;

    fn expecting(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str("a text (put a column number in quotation marks: \"#3[mm]\")")
    }

    fn visit_str<E>(self, value: &str) -> Result<Scalar, E> {
        Ok(Scalar(value.to_owned()))
    }

    fn visit_bool<E>(self, value: bool) -> Result<Scalar, E> {
        Ok(Scalar(value.to_string()))
    }

    fn visit_u64<E>(self, value: u64) -> Result<Scalar, E> {
        Ok(Scalar(value.to_string()))
    }

    fn visit_i64<E>(self, value: i64) -> Result<Scalar, E> {
        Ok(Scalar(value.to_string()))
    }

    fn visit_unit<E: de::Error>(self) -> Result<Scalar, E> {
        Err(E::custom("the value is missing; put a column number in quotation marks: \"#3[mm]\""))
    }
}
