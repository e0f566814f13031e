//! Which column of a file is which channel of a recording, and in which unit.

use std::fs;
use std::io::Read;
use std::path::Path;

use serde::Deserialize;
use serde::de::{self, Deserializer, Visitor};

use super::unit::{Channel, Unit};
use virtual_axes_core::text::{nearest_hint, nearest_name, shortened};
use virtual_axes_core::yaml;

/// How the columns of a CSV file are to be read; what is not said is found out or as usual.
///
/// One entry is a text `CHANNEL=COLUMN[UNIT]`:
///
/// ```
/// use virtual_axes::files::Columns;
///
/// let mut columns = Columns::default();
/// for text in ["time=t[ms]", "position=Pos1 [mm]", "current=#4[-1 A]", "velocity=[m/min]", "delimiter=;"] {
///     columns.set(text, "--column")?;
/// }
/// # Ok::<(), virtual_axes::files::ColumnsError>(())
/// ```
///
/// COLUMN is a header, or a number from 1 behind `#`; without it, the usual header of the channel. UNIT is
/// a symbol, behind a factor if need be; without it, SI. `delimiter`, `decimal_comma` and `skip_lines`
/// are set likewise.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Columns {
    pub(super) mappings: Vec<Mapping>,
    pub(super) delimiter: Option<char>,
    pub(super) decimal_comma: bool,
    pub(super) skip_lines: u64,
}

/// Where a channel stands.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Mapping {
    pub channel: Channel,
    pub column: Column,
    /// SI if there is none.
    pub unit: Option<Unit>,
    /// All that was given as column and unit: a header can end in its unit.
    pub text: String,
    /// Who said so.
    pub at: String,
}

/// A column.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Column {
    /// By its usual name.
    Usual,
    /// By its header.
    Named(String),
    /// By its place, from 0.
    Place(usize),
}

/// Why a mapping of columns cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ColumnsError {
    /// The file of the mapping cannot be read.
    #[error("{at}: {reason}")]
    Unreadable {
        /// The file, and line where there is one.
        at: String,
        /// What the reader says.
        reason: String,
    },
    /// An entry without `=`.
    #[error("{at}: \"{found}\" maps nothing, must be CHANNEL=COLUMN[UNIT] as in position=Pos1[mm]")]
    Syntax {
        /// Who said so.
        at: String,
        /// What stands there.
        found: String,
    },
    /// An entry for what does not exist.
    #[error("{at}: there is no \"{found}\"; there are {}{}", known_keys(), nearest_hint(.nearest))]
    Unknown {
        /// Who said so.
        at: String,
        /// What stands there.
        found: String,
        /// What looks most like it.
        nearest: Option<String>,
    },
    /// An entry that is given twice by one.
    #[error("{at}: {key} is given twice")]
    Twice {
        /// Who said so.
        at: String,
        /// What is given twice.
        key: String,
    },
    /// A value that cannot be.
    #[error("{at}: {key}={found}: {reason}")]
    Value {
        /// Who said so.
        at: String,
        /// What is set.
        key: String,
        /// To what.
        found: String,
        /// What is wrong with it.
        reason: String,
    },
}

/// Keys besides the channels.
const DELIMITER: &str = "delimiter";
const DECIMAL_COMMA: &str = "decimal_comma";
const SKIP_LINES: &str = "skip_lines";
/// What a tab can be called.
const TAB: &str = "tab";

fn keys() -> impl Iterator<Item = &'static str> {
    Channel::ALL.into_iter().map(Channel::name).chain([DELIMITER, DECIMAL_COMMA, SKIP_LINES])
}

fn known_keys() -> String {
    keys().collect::<Vec<_>>().join(", ")
}

impl Columns {
    /// From a YAML file, if there is one, and `texts` that go before it; `at` names where those are from.
    ///
    /// # Errors
    /// [`ColumnsError`]; one text must not contradict another.
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
                return Err(ColumnsError::Twice { at: at.to_owned(), key: key.to_owned() });
            }
            given.push(key);
        }
        Ok(columns)
    }

    /// From a YAML file; see [`Columns::from_yaml`].
    ///
    /// # Errors
    /// [`ColumnsError`].
    pub fn open(path: &Path) -> Result<Self, ColumnsError> {
        let at = path.display().to_string();
        let unreadable =
            |error: std::io::Error| ColumnsError::Unreadable { at: at.clone(), reason: error.to_string() };
        let mut text = String::new();
        let file = fs::File::open(path).map_err(unreadable)?;
        file.take(LONGEST_FILE).read_to_string(&mut text).map_err(unreadable)?;
        if text.len() as u64 == LONGEST_FILE {
            let reason = format!("a mapping of columns is shorter than {LONGEST_FILE} bytes");
            return Err(ColumnsError::Unreadable { at, reason });
        }
        Self::from_yaml(&text, &at)
    }

    /// From YAML: a mapping from channels to texts `COLUMN[UNIT]`, and the other keys; `name` is for
    /// messages.
    ///
    /// # Errors
    /// [`ColumnsError`].
    pub fn from_yaml(text: &str, name: &str) -> Result<Self, ColumnsError> {
        let unreadable = |at: String, reason: String| Err(ColumnsError::Unreadable { at, reason });
        let mut documents: Vec<Entries> = match yaml::documents(text) {
            Ok(documents) => documents,
            Err(error) => return unreadable(error.position(name), error.reason),
        };
        let (Some(entries), true) = (documents.pop(), documents.is_empty()) else {
            return unreadable(name.to_owned(), "it is not one mapping of channels to columns".to_owned());
        };
        let mut columns = Columns::default();
        for (key, Scalar(value)) in entries.into_all() {
            columns.put(key, &value, name)?;
        }
        Ok(columns)
    }

    /// Sets one thing from `KEY=VALUE`, in place of what was said before; `at` names where it is from.
    ///
    /// # Errors
    /// [`ColumnsError`].
    pub fn set(&mut self, text: &str, at: &str) -> Result<(), ColumnsError> {
        let Some((key, value)) = text.split_once('=') else {
            return Err(ColumnsError::Syntax { at: at.to_owned(), found: shortened(text) });
        };
        self.put(key.trim(), value, at)
    }

    fn put(&mut self, key: &str, value: &str, at: &str) -> Result<(), ColumnsError> {
        // A delimiter can be a blank.
        let value = if key == DELIMITER { value } else { value.trim() };
        let wrong = |reason: &str| ColumnsError::Value {
            at: at.to_owned(),
            key: key.to_owned(),
            found: shortened(value),
            reason: reason.to_owned(),
        };
        if let Some(channel) = Channel::named(key) {
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
                self.skip_lines = value.parse().map_err(|_| wrong("must be a number of lines, 0 or more"))?;
            }
            _ => {
                let nearest = nearest_name(key, keys());
                return Err(ColumnsError::Unknown { at: at.to_owned(), found: shortened(key), nearest });
            }
        }
        if self.decimal_comma && self.delimiter == Some(',') {
            return Err(wrong("a comma cannot be both between numbers and in them"));
        }
        Ok(())
    }

    /// Where `channel` stands, if that was said.
    pub(super) fn mapping(&self, channel: Channel) -> Option<&Mapping> {
        self.mappings.iter().find(|mapping| mapping.channel == channel)
    }
}

/// Longest file of a mapping, bytes.
const LONGEST_FILE: u64 = 1 << 16;

/// What a delimiter can be.
const DELIMITERS: &str = "must be one character such as ; or | or the word tab, and none of numbers";

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
            Ok(number) if number > 0 => Column::Place(number - 1),
            _ => return Err("a column's number is whole and begins with 1, as in #3".to_owned()),
        },
        None if column.is_empty() && unit.is_some() => Column::Usual,
        None if column.is_empty() => return Err("there is no column".to_owned()),
        None => Column::Named(column.to_owned()),
    };
    Ok((column, unit))
}

/// The file, by its keys.
#[derive(Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Entries {
    #[serde(deserialize_with = "given")]
    time: Option<Scalar>,
    #[serde(deserialize_with = "given")]
    psec: Option<Scalar>,
    #[serde(deserialize_with = "given")]
    position: Option<Scalar>,
    #[serde(deserialize_with = "given")]
    velocity: Option<Scalar>,
    #[serde(deserialize_with = "given")]
    current: Option<Scalar>,
    #[serde(deserialize_with = "given")]
    velocity_feedforward: Option<Scalar>,
    #[serde(deserialize_with = "given")]
    torque_feedforward: Option<Scalar>,
    #[serde(deserialize_with = "given")]
    delimiter: Option<Scalar>,
    #[serde(deserialize_with = "given")]
    decimal_comma: Option<Scalar>,
    #[serde(deserialize_with = "given")]
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
            self.delimiter,
            self.decimal_comma,
            self.skip_lines,
        ];
        keys().zip(values).filter_map(|(key, value)| Some((key, value?)))
    }
}

/// A key that stands there has a value.
fn given<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Scalar>, D::Error> {
    deserializer.deserialize_any(ScalarVisitor).map(Some)
}

/// A text, whatever YAML takes it for.
struct Scalar(String);

struct ScalarVisitor;

impl Visitor<'_> for ScalarVisitor {
    type Value = Scalar;

    fn expecting(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str("a text (a column by its number stands in quotation marks: \"#3[mm]\")")
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
        Err(E::custom("there is no value; a column by its number stands in quotation marks: \"#3[mm]\""))
    }
}
