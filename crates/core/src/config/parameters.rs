//! A complete set of parameters, valid at any time, and the ways in which values come into it.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use super::check::{Entries, Entry, check, joint_names};
use super::definition::{Definition, Scope};
use super::error::{ConfigError, Source, shortened};
use super::layout::{Layout, plain_definition};
use super::parameter_file::{self, Assignment, parse_assignment};
use super::value::Value;

/// Shipped machines: name and parameter file, the default first.
const BUILTIN: &[(&str, &str)] = &[
    ("mikron_ucp710", include_str!("../../config/mikron_ucp710.yaml")),
    ("linear_motor_center", include_str!("../../config/linear_motor_center.yaml")),
];
/// Name of the machine that runs when none is given.
pub const DEFAULT_MACHINE: &str = "mikron_ucp710";
/// Largest parameter file that is read; a machine takes about 10 kB.
const MAX_FILE_BYTES: u64 = 4 << 20;

/// Parameters of a machine and its node. Every value is checked against the schema, and all against
/// one another: a `Parameters` that exists is valid.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameters {
    entries: Entries,
    layout: Layout,
}

/// What [`Parameters::overlay_yaml`] did.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Overlay {
    /// Number of parameters that the file set.
    pub parameters: usize,
    /// Whether the file is a complete machine, which replaced the one before.
    pub machine_replaced: bool,
    /// Number of sections of the file that are for this node; with 0 nothing was set.
    pub sections: usize,
    /// Sections of the file that are for other nodes.
    pub skipped: Vec<String>,
}

/// The names of the shipped machines, with commas.
fn shipped() -> String {
    Parameters::builtin_names().collect::<Vec<_>>().join(", ")
}

impl Parameters {
    /// The machine that runs when none is given, the Mikron UCP 710.
    ///
    /// # Errors
    ///
    /// None with the shipped file, as the tests show.
    pub fn embedded_default() -> Result<Self, ConfigError> {
        Self::builtin(DEFAULT_MACHINE)
    }

    /// Names of the shipped machines, the default first.
    pub fn builtin_names() -> impl Iterator<Item = &'static str> {
        BUILTIN.iter().map(|(name, _)| *name)
    }

    /// A shipped machine by its name.
    ///
    /// # Errors
    ///
    /// [`ConfigError::UnknownMachine`].
    pub fn builtin(name: &str) -> Result<Self, ConfigError> {
        Self::from_yaml(Self::builtin_text(name)?, &format!("{name}.yaml"))
    }

    /// The file of a shipped machine.
    ///
    /// # Errors
    ///
    /// [`ConfigError::UnknownMachine`].
    pub fn builtin_text(name: &str) -> Result<&'static str, ConfigError> {
        let found = BUILTIN.iter().find(|(known, _)| *known == name);
        found
            .map(|(_, text)| *text)
            .ok_or_else(|| ConfigError::UnknownMachine { name: shortened(name), known: shipped() })
    }

    /// A machine file's content, complete in itself; `source` is its name in messages.
    ///
    /// Of a file with sections for several nodes, those count that fit a node `/virtual_axes`.
    ///
    /// # Errors
    ///
    /// Any [`ConfigError`] but those of reading.
    pub fn from_yaml(text: &str, source: &str) -> Result<Self, ConfigError> {
        let source = Source::file(source);
        let file = parameter_file::read(text, &source, None)?;
        Self::from_assignments(Entries::new(), file.assignments, &source)
    }

    /// A complete machine file.
    ///
    /// # Errors
    ///
    /// Any [`ConfigError`].
    pub fn from_file(path: impl AsRef<Path>) -> Result<Self, ConfigError> {
        let path = path.as_ref();
        Self::from_yaml(&read_text(path)?, &path.to_string_lossy())
    }

    /// A shipped machine if `machine` is the name of one, otherwise the machine file `machine`.
    ///
    /// # Errors
    ///
    /// Any [`ConfigError`].
    pub fn load(machine: &str) -> Result<Self, ConfigError> {
        if Self::builtin_names().any(|name| name == machine) {
            return Self::builtin(machine);
        }
        Self::from_file(machine).map_err(|error| match error {
            ConfigError::Unreadable { path, reason } if !Path::new(machine).exists() => {
                ConfigError::Unreadable {
                    path,
                    reason: format!("{reason}; machines that are shipped: {}", shipped()),
                }
            }
            other => other,
        })
    }

    /// Sets what a ROS 2 parameter file holds for the node `node` (fully qualified, `/ns/name`;
    /// `None`: for any node, or its only section). Sections match as in ROS 2 (`*`, `**`), later
    /// ones win. A file that holds `machine` or `joints` is a complete machine and replaces the one
    /// before; the node's own parameters stay.
    ///
    /// # Errors
    ///
    /// Any [`ConfigError`] but those of reading; nothing is changed then.
    pub fn overlay_yaml(
        &mut self,
        text: &str,
        source: &str,
        node: Option<&str>,
    ) -> Result<Overlay, ConfigError> {
        let source = Source::file(source);
        let file = parameter_file::read(text, &source, node)?;
        let report = Overlay {
            parameters: file.assignments.len(),
            machine_replaced: file
                .assignments
                .iter()
                .any(|assignment| matches!(assignment.key.as_str(), "machine" | "joints")),
            sections: file.matched,
            skipped: file.skipped,
        };
        let mut base = self.entries.clone();
        if report.machine_replaced {
            base.retain(|key, _| {
                plain_definition(key).is_some_and(|definition| definition.scope == Scope::Node)
            });
        }
        *self = Self::from_assignments(base, file.assignments, &source)
            .map_err(|error| if report.machine_replaced { explain_replacement(error) } else { error })?;
        Ok(report)
    }

    /// [`overlay_yaml`](Self::overlay_yaml) of a file.
    ///
    /// # Errors
    ///
    /// Any [`ConfigError`]; nothing is changed then.
    pub fn overlay_file(
        &mut self,
        path: impl AsRef<Path>,
        node: Option<&str>,
    ) -> Result<Overlay, ConfigError> {
        let path = path.as_ref();
        self.overlay_yaml(&read_text(path)?, &path.to_string_lossy(), node)
    }

    /// Sets one parameter; an integer serves where a number is wanted.
    ///
    /// # Errors
    ///
    /// Any [`ConfigError`] but those of reading; nothing is changed then.
    pub fn set(&mut self, key: &str, value: Value, source: &Source) -> Result<(), ConfigError> {
        self.set_all(vec![Assignment { key: key.to_owned(), value, source: source.clone() }])
    }

    /// Sets one parameter from `KEY=VALUE` or `KEY:=VALUE`, the value by the rules of YAML.
    ///
    /// # Errors
    ///
    /// As [`set`](Self::set), and [`ConfigError::NotAnAssignment`].
    pub fn set_text(&mut self, text: &str, source: &Source) -> Result<(), ConfigError> {
        self.set_all(vec![parse_assignment(text, source)?])
    }

    /// Sets all of `assignments` or none; the later wins where two have the same key.
    ///
    /// # Errors
    ///
    /// As [`set`](Self::set).
    pub fn set_all(&mut self, assignments: Vec<Assignment>) -> Result<(), ConfigError> {
        let Some(first) = assignments.first() else {
            return Ok(());
        };
        let origin = first.source.clone();
        *self = Self::from_parts(self.entries.clone(), &self.layout, assignments, &origin)?;
        Ok(())
    }

    /// Takes a value away, so that the parameter has its default or none; `source` is for messages.
    ///
    /// # Errors
    ///
    /// [`ConfigError::Missing`] if it is required; nothing is changed then.
    pub fn unset(&mut self, key: &str, source: &Source) -> Result<(), ConfigError> {
        let mut entries = self.entries.clone();
        if entries.remove(key).is_some() {
            let layout = check(&mut entries, &[], source)?;
            *self = Self { entries, layout };
        }
        Ok(())
    }

    fn from_assignments(
        base: Entries,
        assignments: Vec<Assignment>,
        origin: &Source,
    ) -> Result<Self, ConfigError> {
        Self::from_parts(base, &Layout::default(), assignments, origin)
    }

    fn from_parts(
        mut entries: Entries,
        old: &Layout,
        assignments: Vec<Assignment>,
        origin: &Source,
    ) -> Result<Self, ConfigError> {
        let mut changed = Vec::with_capacity(assignments.len());
        for Assignment { key, value, source } in assignments {
            changed.push(key.clone());
            entries.insert(key, Entry { value, source });
        }
        if changed.iter().any(|key| key == "joints") {
            // A joint that is left out takes its parameters with it.
            let names = joint_names(&entries)?;
            let gone: Vec<&str> = old
                .joints
                .iter()
                .map(|joint| joint.name.as_str())
                .filter(|name| !names.iter().any(|kept| kept == name))
                .collect();
            entries.retain(|key, _| {
                let name = key.split_once('.').map_or("", |(name, _)| name);
                !gone.contains(&name) || changed.contains(key)
            });
        }
        let layout = check(&mut entries, &changed, &origin.whole())?;
        Ok(Self { entries, layout })
    }

    /// The value of the parameter `key`, or its default; `None` if it has neither, or does not
    /// exist.
    pub fn get(&self, key: &str) -> Option<Value> {
        match self.entries.get(key) {
            Some(entry) => Some(entry.value.clone()),
            None => self.definition(key)?.default_value(),
        }
    }

    /// Where the value of `key` comes from; `None` for a default.
    pub fn source(&self, key: &str) -> Option<&Source> {
        self.entries.get(key).map(|entry| &entry.source)
    }

    /// The definition of the parameter with the full key `key` on this machine.
    pub fn definition(&self, key: &str) -> Option<&'static Definition> {
        self.layout.find(key, &Source::named("")).ok()
    }

    /// Every parameter that this machine and its node can have, with its full key: machine, axes in
    /// the order of `joints`, node.
    pub fn definitions(&self) -> impl Iterator<Item = (String, &'static Definition)> + '_ {
        self.layout.definitions()
    }

    /// Every parameter that has a value, set or by default, in the order of
    /// [`definitions`](Self::definitions).
    pub fn iter(&self) -> impl Iterator<Item = (String, Value)> + '_ {
        self.definitions().filter_map(|(key, _)| self.get(&key).map(|value| (key, value)))
    }

    pub(super) fn layout(&self) -> &Layout {
        &self.layout
    }
}

/// Says why keys of the machine before are missing now.
fn explain_replacement(error: ConfigError) -> ConfigError {
    match error {
        ConfigError::Missing { at, key, wanted } => ConfigError::Missing {
            at,
            key,
            wanted: format!(
                "{wanted}; a file with `machine` or `joints` is a complete machine, leave both out \
                 to change some parameters of the present one"
            ),
        },
        other => other,
    }
}

/// The text of a file of sensible size.
fn read_text(path: &Path) -> Result<String, ConfigError> {
    let unreadable =
        |reason: String| ConfigError::Unreadable { path: path.to_string_lossy().into_owned(), reason };
    let mut bytes = Vec::new();
    File::open(path)
        .and_then(|file| file.take(MAX_FILE_BYTES + 1).read_to_end(&mut bytes))
        .map_err(|error| unreadable(error.to_string()))?;
    if bytes.len() as u64 > MAX_FILE_BYTES {
        return Err(unreadable(format!("it is larger than {MAX_FILE_BYTES} bytes")));
    }
    String::from_utf8(bytes).map_err(|error| {
        let position = error.utf8_error().valid_up_to();
        unreadable(format!("it is not UTF-8 text at byte {position}"))
    })
}
