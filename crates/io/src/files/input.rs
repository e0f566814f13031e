//! What a file is, told by its content.

use std::fmt;
use std::fs::File;
use std::io::{self, Cursor, Read};
use std::path::Path;

use serde::de::{Deserialize, Deserializer, IgnoredAny, MapAccess, SeqAccess, Visitor};

use super::lines::fields;
use super::psec_csv::TIME;
use virtual_axes_core::text::shortened;
use virtual_axes_core::yaml;

/// What a file can be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FileKind {
    /// Setpoints as CSV.
    PsecCsv,
    /// Setpoints as YAML, a `JointTrajectory`.
    PsecYaml,
    /// A recording.
    Mcap,
    /// Parameters of a machine.
    Machine,
    /// A scenario.
    Scenario,
}

impl fmt::Display for FileKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            FileKind::PsecCsv => "setpoints as CSV",
            FileKind::PsecYaml => "setpoints as YAML",
            FileKind::Mcap => "an MCAP recording",
            FileKind::Machine => "a machine file",
            FileKind::Scenario => "a scenario",
        })
    }
}

/// What there is, for messages.
const KNOWN: &str = "there are setpoints as CSV (the first line is `time,x,…`), as YAML (a mapping with \
                     joint_names and points) and as MCAP recordings, machine files (ros__parameters) and \
                     scenarios (a mapping with moves)";

/// Why a file cannot be told.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum InputError {
    /// It cannot be opened or read.
    #[error("{at}: {reason}")]
    Unreadable {
        /// The file.
        at: String,
        /// What the operating system says.
        reason: String,
    },
    /// It is nothing that is known.
    #[error("{at}: {found}; {KNOWN}")]
    Unknown {
        /// The file.
        at: String,
        /// What stands there.
        found: String,
    },
    /// It looks like YAML and is not.
    #[error("{at}: not YAML: {reason}; {KNOWN}")]
    Syntax {
        /// File and line.
        at: String,
        /// What the reader says.
        reason: String,
    },
}

/// A file that was opened, with its kind; what was read to tell it is not lost, so that a pipe will do.
#[derive(Debug)]
pub struct Input {
    name: String,
    kind: FileKind,
    head: Vec<u8>,
    file: File,
}

/// Bytes in which a first line is sought.
const HEAD: u64 = 1 << 16;
/// Maximum size of a YAML file, bytes: half an hour of five axes, point by point.
const MAX_YAML_BYTES: u64 = 64 << 20;

impl Input {
    /// Opens a file and tells what it is: CSV and MCAP by their beginnings, YAML whole.
    ///
    /// # Errors
    /// [`InputError`].
    pub fn open(path: &Path) -> Result<Self, InputError> {
        let name = path.display().to_string();
        let unreadable =
            |error: io::Error| InputError::Unreadable { at: name.clone(), reason: error.to_string() };
        let mut file = File::open(path).map_err(unreadable)?;
        let mut head = Vec::new();
        (&mut file).take(HEAD).read_to_end(&mut head).map_err(unreadable)?;
        let kind = match kind_by_beginning(&head) {
            Some(kind) => kind,
            None => {
                (&mut file).take(MAX_YAML_BYTES - HEAD).read_to_end(&mut head).map_err(unreadable)?;
                kind_of_yaml(&head, &name)?
            }
        };
        Ok(Input { name, kind, head, file })
    }

    /// What it is.
    pub fn kind(&self) -> FileKind {
        self.kind
    }

    /// Its name as it was given.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The text, if it is YAML.
    pub fn text(&self) -> Option<&str> {
        match self.kind {
            FileKind::PsecCsv | FileKind::Mcap => None,
            FileKind::PsecYaml | FileKind::Machine | FileKind::Scenario => str::from_utf8(&self.head).ok(),
        }
    }

    /// All of it, from the beginning.
    pub fn into_reader(self) -> impl Read + fmt::Debug {
        Cursor::new(self.head).chain(self.file)
    }
}

pub(super) fn kind_by_beginning(head: &[u8]) -> Option<FileKind> {
    if head.starts_with(mcap::MAGIC) {
        return Some(FileKind::Mcap);
    }
    let text = String::from_utf8_lossy(head);
    let line = first_line(&text);
    (line.contains(',') && fields(line).next() == Some(TIME)).then_some(FileKind::PsecCsv)
}

/// The first line that is not blank.
fn first_line(text: &str) -> &str {
    let text = text.trim_start_matches('\u{feff}').trim_start();
    text.lines().next().unwrap_or_default().trim_end()
}

fn kind_of_yaml(bytes: &[u8], name: &str) -> Result<FileKind, InputError> {
    let unknown = |found: String| InputError::Unknown { at: name.to_owned(), found };
    if bytes.len() as u64 >= MAX_YAML_BYTES {
        return Err(unknown(format!("it is longer than {} bytes", MAX_YAML_BYTES)));
    }
    let Ok(text) = str::from_utf8(bytes) else {
        return Err(unknown("it is not text".to_owned()));
    };
    let documents: Vec<Sketch> = yaml::documents(text)
        .map_err(|error| InputError::Syntax { at: error.position(name), reason: error.reason })?;
    let first = documents.first();
    if let Some(kind) = first.and_then(Sketch::kind) {
        return Ok(kind);
    }
    Err(unknown(match first {
        None => "it is empty".to_owned(),
        Some(Sketch::Map(entries)) => {
            let keys: Vec<&str> = entries.iter().map(|(key, _)| key.as_str()).collect();
            format!("it is a mapping of {}", shortened(&keys.join(", ")))
        }
        Some(Sketch::Other) => format!("its first line is \"{}\"", shortened(first_line(text))),
    }))
}

/// YAML without its values.
enum Sketch {
    Map(Vec<(String, Sketch)>),
    Other,
}

impl Sketch {
    fn kind(&self) -> Option<FileKind> {
        let Sketch::Map(entries) = self else { return None };
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
        let Sketch::Map(entries) = self else { return false };
        entries.iter().any(|(key, value)| key == "ros__parameters" || value.has_parameters())
    }
}

impl<'de> Deserialize<'de> for Sketch {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(SketchVisitor)
    }
}

struct SketchVisitor;

impl<'de> Visitor<'de> for SketchVisitor {
    type Value = Sketch;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("YAML")
    }

    fn visit_unit<E>(self) -> Result<Sketch, E> {
        Ok(Sketch::Other)
    }

    fn visit_bool<E>(self, _: bool) -> Result<Sketch, E> {
        Ok(Sketch::Other)
    }

    fn visit_i64<E>(self, _: i64) -> Result<Sketch, E> {
        Ok(Sketch::Other)
    }

    fn visit_u64<E>(self, _: u64) -> Result<Sketch, E> {
        Ok(Sketch::Other)
    }

    fn visit_f64<E>(self, _: f64) -> Result<Sketch, E> {
        Ok(Sketch::Other)
    }

    fn visit_str<E>(self, _: &str) -> Result<Sketch, E> {
        Ok(Sketch::Other)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<Sketch, A::Error> {
        while items.next_element::<IgnoredAny>()?.is_some() {}
        Ok(Sketch::Other)
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Sketch, A::Error> {
        let mut entries = Vec::new();
        while let Some(entry) = map.next_entry()? {
            entries.push(entry);
        }
        Ok(Sketch::Map(entries))
    }
}
