//! Detection of the kind of an input file by its content.

use std::fmt;
use std::fs::File;
use std::io::{self, Cursor, Read};
use std::path::Path;

use serde::de::{Deserialize, Deserializer, IgnoredAny, MapAccess, SeqAccess, Visitor};

use super::lines::fields;
use super::psec_error::{TIME, header_unit_hint};
use virtual_axes_core::encoding::{decode, decode_text};
use virtual_axes_core::text::shortened;
use virtual_axes_core::yaml;

virtual_axes_core::named_values! {
    /// Kind of an input file.
    pub enum FileKind {
        /// Position setpoints as CSV.
        PsecCsv = "setpoints as CSV",
        /// Position setpoints as YAML, a `JointTrajectory`.
        PsecYaml = "setpoints as YAML",
        /// MCAP recording.
        Mcap = "an MCAP recording",
        /// Machine file with `ros__parameters`.
        Machine = "a machine file",
        /// Scenario.
        Scenario = "a scenario",
    }
}

/// Supported kinds of files, for error messages.
const KNOWN: &str = "supported are setpoints as CSV (the first line is `time,x,…`), as YAML (a mapping with \
                     joint_names and points) and as MCAP recordings, machine files (ros__parameters) and \
                     scenarios (a mapping with moves)";

/// Error of detecting the kind of a file.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum InputError {
    /// The file cannot be opened or read.
    #[error("{at}: {reason}")]
    Unreadable {
        /// Name of the file.
        at: String,
        /// Error message of the operating system.
        reason: String,
    },
    /// The content is of no supported kind.
    #[error("{at}: {found}; {KNOWN}")]
    Unknown {
        /// Name of the file.
        at: String,
        /// Description of the content.
        found: String,
    },
    /// The content is not valid YAML.
    #[error("{at}: invalid YAML: {reason}{}", if *.is_first_line { format!("; {KNOWN}") } else { String::new() })]
    Syntax {
        /// File and line.
        at: String,
        /// Error message of the YAML parser.
        reason: String,
        /// True if not even the first line is YAML, or the line is unknown.
        is_first_line: bool,
    },
}

/// Opened input file and its kind. The bytes read for the detection are kept, so that pipes work.
#[derive(Debug)]
pub struct Input {
    name: String,
    kind: FileKind,
    /// Text of a YAML file.
    text: Option<String>,
    head: Vec<u8>,
    file: File,
}

/// Number of bytes searched for the first line.
const HEAD_BYTES: u64 = 1 << 16;
/// Maximum size of a YAML file, bytes: about half an hour of setpoints for five axes.
const MAX_YAML_BYTES: u64 = 64 << 20;

impl Input {
    /// Opens a file and detects its kind: CSV and MCAP by their first bytes, YAML by the whole text.
    ///
    /// # Errors
    /// Returns an [`InputError`] if the file cannot be read or is of no supported kind.
    pub fn open(path: &Path) -> Result<Self, InputError> {
        let name = path.display().to_string();
        let unreadable =
            |error: io::Error| InputError::Unreadable { at: name.clone(), reason: error.to_string() };
        let mut file = File::open(path).map_err(unreadable)?;
        let mut head = Vec::new();
        (&mut file).take(HEAD_BYTES).read_to_end(&mut head).map_err(unreadable)?;
        if let Some(kind) = kind_from_head(&head) {
            return Ok(Input { name, kind, text: None, head, file });
        }
        (&mut file).take(MAX_YAML_BYTES - HEAD_BYTES).read_to_end(&mut head).map_err(unreadable)?;
        let unknown = |found: String| InputError::Unknown { at: name.clone(), found };
        if head.len() as u64 >= MAX_YAML_BYTES {
            return Err(unknown(format!("the file is longer than {MAX_YAML_BYTES} bytes")));
        }
        let text = decode_text(&head).map_err(unknown)?;
        let kind = kind_from_yaml(&text, &name)?;
        Ok(Input { name, kind, text: Some(text), head, file })
    }

    /// Returns the kind of the file.
    pub fn kind(&self) -> FileKind {
        self.kind
    }

    /// Returns the file name as given by the user.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the text of a YAML file.
    pub fn text(&self) -> Option<&str> {
        self.text.as_deref()
    }

    /// Returns a reader of the whole content.
    pub fn into_reader(self) -> impl Read + fmt::Debug {
        Cursor::new(self.head).chain(self.file)
    }
}

pub(super) fn kind_from_head(head: &[u8]) -> Option<FileKind> {
    if head.starts_with(mcap::MAGIC) {
        return Some(FileKind::Mcap);
    }
    let text = decode(head);
    let line = first_line(&text);
    (line.contains(',') && fields(line).next() == Some(TIME)).then_some(FileKind::PsecCsv)
}

/// Returns the first line that is not blank.
fn first_line(text: &str) -> &str {
    text.trim_start().lines().next().unwrap_or_default().trim_end()
}

fn kind_from_yaml(text: &str, name: &str) -> Result<FileKind, InputError> {
    let unknown = |found: String| InputError::Unknown { at: name.to_owned(), found };
    let documents: Vec<YamlOutline> = yaml::documents(text).map_err(|error| InputError::Syntax {
        at: error.position(name),
        is_first_line: error.line <= 1,
        reason: error.reason,
    })?;
    let first = documents.first();
    if let Some(kind) = first.and_then(YamlOutline::kind) {
        return Ok(kind);
    }
    Err(unknown(match first {
        None => "the file is empty".to_owned(),
        Some(YamlOutline::Map(entries)) => {
            let keys: Vec<&str> = entries.iter().map(|(key, _)| key.as_str()).collect();
            format!("the file is a mapping with keys {}", shortened(&keys.join(", ")))
        }
        Some(YamlOutline::Other) => {
            let line = first_line(text);
            format!("the first line is \"{}\"{}", shortened(line), header_hint(line))
        }
    }))
}

/// Returns the cause of a header with units, in capital letters, or whose columns are separated by another character
/// than a comma; else an empty text.
fn header_hint(line: &str) -> String {
    let first = fields(line).next().unwrap_or_default();
    if line.contains(',') && first.eq_ignore_ascii_case(TIME) {
        return "; names are in lower case, as in `time,x`".to_owned();
    }
    if line.contains(',') && first.to_ascii_lowercase().starts_with(TIME) {
        return header_unit_hint(first).to_owned();
    }
    let Some(separator) = line.strip_prefix(TIME).and_then(|rest| rest.chars().next()) else {
        return String::new();
    };
    match separator {
        _ if line.contains(';') => "; columns must be separated by commas, not by semicolons".to_owned(),
        '\t' | ' ' => "; columns must be separated by commas, not by tabs or spaces".to_owned(),
        _ => String::new(),
    }
}

/// Structure of a YAML document: its keys without scalar values.
enum YamlOutline {
    Map(Vec<(String, YamlOutline)>),
    Other,
}

impl YamlOutline {
    fn kind(&self) -> Option<FileKind> {
        let YamlOutline::Map(entries) = self else { return None };
        let has = |key: &str| entries.iter().any(|(k, _)| k == key);
        if has("moves") {
            Some(FileKind::Scenario)
        } else if has("points") || has("joint_names") {
            Some(FileKind::PsecYaml)
        } else {
            self.has_parameters().then_some(FileKind::Machine)
        }
    }

    fn has_parameters(&self) -> bool {
        let YamlOutline::Map(entries) = self else { return false };
        entries.iter().any(|(key, value)| key == "ros__parameters" || value.has_parameters())
    }
}

impl<'de> Deserialize<'de> for YamlOutline {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(YamlOutlineVisitor)
    }
}

struct YamlOutlineVisitor;

impl<'de> Visitor<'de> for YamlOutlineVisitor {
    type Value = YamlOutline;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("YAML")
    }

    fn visit_unit<E>(self) -> Result<YamlOutline, E> {
        Ok(YamlOutline::Other)
    }

    fn visit_bool<E>(self, _: bool) -> Result<YamlOutline, E> {
        Ok(YamlOutline::Other)
    }

    fn visit_i64<E>(self, _: i64) -> Result<YamlOutline, E> {
        Ok(YamlOutline::Other)
    }

    fn visit_u64<E>(self, _: u64) -> Result<YamlOutline, E> {
        Ok(YamlOutline::Other)
    }

    fn visit_f64<E>(self, _: f64) -> Result<YamlOutline, E> {
        Ok(YamlOutline::Other)
    }

    fn visit_str<E>(self, _: &str) -> Result<YamlOutline, E> {
        Ok(YamlOutline::Other)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<YamlOutline, A::Error> {
        while items.next_element::<IgnoredAny>()?.is_some() {}
        Ok(YamlOutline::Other)
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<YamlOutline, A::Error> {
        let mut entries = Vec::new();
        while let Some(entry) = map.next_entry()? {
            entries.push(entry);
        }
        Ok(YamlOutline::Map(entries))
    }
}
