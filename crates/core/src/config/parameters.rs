//! Complete and valid parameter set, from machine files, parameter files and single values.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use super::aliases::{self, ParameterAlias};
use super::check::{Entries, ParameterEntry, check, joint_names};
use super::definition::{ParameterDefinition, Scope};
use super::error::{ConfigError, ValueSource};
use super::layout::{ParameterLayout, plain_definition};
use super::parameter_file::{self, Assignment, parse_assignment};
use super::value::Value;
use crate::text::{nearest_hint, nearest_name, shortened};

/// Built-in machines: name and parameter file, the default first.
const BUILTIN: &[(&str, &str)] = &[
    ("mikron_ucp710", include_str!("../../config/mikron_ucp710.yaml")),
    ("linear_motor_center", include_str!("../../config/linear_motor_center.yaml")),
];
/// Name of the default machine, the Mikron UCP 710.
pub const DEFAULT_MACHINE: &str = "mikron_ucp710";
/// Maximum size of a parameter file, bytes; a machine file has about 10 kB.
const MAX_FILE_BYTES: u64 = 4 << 20;

/// Parameters of a machine and its node. All values are checked against the schema and against each other, so that every
/// `Parameters` value is valid.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameters {
    entries: Entries,
    layout: ParameterLayout,
}

/// Result of [`Parameters::overlay_yaml`].
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct OverlayReport {
    /// Number of parameters set by the file.
    pub parameters: usize,
    /// True if the file is a complete machine, which replaced the previous machine.
    pub is_machine_replaced: bool,
    /// Number of sections of the file for this node; with 0 no parameter was set.
    pub sections: usize,
    /// Names of the sections for other nodes.
    pub skipped: Vec<String>,
}

/// Returns the names of the built-in machines, separated by commas.
fn builtin_name_list() -> String {
    Parameters::builtin_names().collect::<Vec<_>>().join(", ")
}

impl Parameters {
    /// Returns the default machine, the Mikron UCP 710.
    ///
    /// # Errors
    ///
    /// Any [`ConfigError`], which a test excludes for the embedded file.
    pub fn embedded_default() -> Result<Self, ConfigError> {
        Self::builtin(DEFAULT_MACHINE)
    }

    /// Returns the names of the built-in machines, the default first.
    pub fn builtin_names() -> impl Iterator<Item = &'static str> {
        BUILTIN.iter().map(|(name, _)| *name)
    }

    /// Returns true if `text` is or resembles the name of a built-in machine or of a machine file; as a value of the
    /// parameter `machine`, which is a name only, it is probably meant to select that machine.
    pub fn names_machine(text: &str) -> bool {
        let is_file = text.contains('/') || text.ends_with(".yaml") || text.ends_with(".yml");
        is_file || nearest_name(text, Self::builtin_names()).is_some()
    }

    /// Returns the built-in machine `name`.
    ///
    /// # Errors
    ///
    /// [`ConfigError::UnknownMachine`].
    pub fn builtin(name: &str) -> Result<Self, ConfigError> {
        Self::from_yaml(Self::builtin_text(name)?, &format!("{name}.yaml"))
    }

    /// Returns the machine file of the built-in machine `name`.
    ///
    /// # Errors
    ///
    /// [`ConfigError::UnknownMachine`].
    pub fn builtin_text(name: &str) -> Result<&'static str, ConfigError> {
        let found = BUILTIN.iter().find(|(known, _)| *known == name);
        found.map(|(_, text)| *text).ok_or_else(|| ConfigError::UnknownMachine {
            name: shortened(name),
            nearest: nearest_name(name, Self::builtin_names()),
            known: builtin_name_list(),
        })
    }

    /// Parses a complete machine file; messages name it `source`.
    ///
    /// If the file has several sections, those that match a node `/virtual_axes` apply.
    ///
    /// # Errors
    ///
    /// Any [`ConfigError`] except [`ConfigError::Unreadable`].
    pub fn from_yaml(text: &str, source: &str) -> Result<Self, ConfigError> {
        let source = ValueSource::file(source);
        let file = parameter_file::read(text, &source, None)?;
        Self::from_assignments(Entries::new(), file.assignments, &source)
    }

    /// Loads a complete machine file.
    ///
    /// # Errors
    ///
    /// Any [`ConfigError`].
    pub fn from_file(path: impl AsRef<Path>) -> Result<Self, ConfigError> {
        let path = path.as_ref();
        Self::from_yaml(&read_text(path)?, &path.to_string_lossy())
    }

    /// Loads the built-in machine `machine`, or the machine file `machine` if there is none.
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
                let hint = nearest_hint(&nearest_name(machine, Self::builtin_names()));
                ConfigError::Unreadable {
                    path,
                    reason: format!("{reason}{hint}; built-in machines: {}", builtin_name_list()),
                }
            }
            other => other,
        })
    }

    /// Sets the parameters of a ROS 2 parameter file for the node `node` (fully qualified, `/ns/name`). With `None`, the
    /// only section of the file applies, or the sections that match `/virtual_axes`.
    ///
    /// Sections match by the rules of ROS 2 (`*`, `**`); later sections take precedence. A file with `machine`, or with
    /// `joints` and the type of one, is a complete machine and replaces the present machine; the parameters of the node
    /// remain.
    ///
    /// # Errors
    ///
    /// Any [`ConfigError`] except [`ConfigError::Unreadable`]; `self` remains unchanged.
    pub fn overlay_yaml(
        &mut self,
        text: &str,
        source: &str,
        node: Option<&str>,
    ) -> Result<OverlayReport, ConfigError> {
        let source = ValueSource::file(source);
        let file = parameter_file::read(text, &source, node)?;
        let has = |wanted: &dyn Fn(&str) -> bool| file.assignments.iter().any(|one| wanted(&one.key));
        let has_joints = has(&|key| key == "joints");
        let report = OverlayReport {
            parameters: file.assignments.len(),
            is_machine_replaced: has(&|key| key == "machine")
                || has_joints && has(&|key| key.ends_with(".type")),
            sections: file.matched,
            skipped: file.skipped,
        };
        let mut base = self.entries.clone();
        if report.is_machine_replaced {
            base.retain(|key, _| {
                plain_definition(key).is_some_and(|definition| definition.scope == Scope::Node)
            });
        }
        let needs_machine = report.is_machine_replaced || has_joints;
        *self = Self::from_parts(base, &self.layout, file.assignments, &source)
            .map_err(|error| if needs_machine { explain_replacement(error) } else { error })?;
        Ok(report)
    }

    /// Sets the parameters of the file `path`, see [`overlay_yaml`](Self::overlay_yaml).
    ///
    /// # Errors
    ///
    /// Any [`ConfigError`]; `self` remains unchanged.
    pub fn overlay_file(
        &mut self,
        path: impl AsRef<Path>,
        node: Option<&str>,
    ) -> Result<OverlayReport, ConfigError> {
        let path = path.as_ref();
        self.overlay_yaml(&read_text(path)?, &path.to_string_lossy(), node)
    }

    /// Sets one parameter. An integer is accepted for a number.
    ///
    /// # Errors
    ///
    /// Any [`ConfigError`] except [`ConfigError::Unreadable`]; `self` remains unchanged.
    pub fn set(&mut self, key: &str, value: Value, source: &ValueSource) -> Result<(), ConfigError> {
        self.set_all(vec![Assignment { key: key.to_owned(), value, source: source.clone() }])
    }

    /// Sets one parameter from `KEY=VALUE` or `KEY:=VALUE`, with the value in YAML.
    ///
    /// # Errors
    ///
    /// The errors of [`set`](Self::set), and [`ConfigError::NotAnAssignment`].
    pub fn set_text(&mut self, text: &str, source: &ValueSource) -> Result<(), ConfigError> {
        self.set_all(vec![parse_assignment(text, source)?])
    }

    /// Sets all of `assignments`, or none on error. The last of several values for one key applies.
    ///
    /// # Errors
    ///
    /// The errors of [`set`](Self::set).
    pub fn set_all(&mut self, assignments: Vec<Assignment>) -> Result<(), ConfigError> {
        let Some(first) = assignments.first() else {
            return Ok(());
        };
        let origin = first.source.clone();
        *self = Self::from_parts(self.entries.clone(), &self.layout, assignments, &origin)?;
        Ok(())
    }

    /// Removes the value of a parameter, which returns to its default or to none; messages begin with `source`.
    ///
    /// # Errors
    ///
    /// [`ConfigError::Missing`] if the parameter is required; `self` remains unchanged.
    pub fn unset(&mut self, key: &str, source: &ValueSource) -> Result<(), ConfigError> {
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
        origin: &ValueSource,
    ) -> Result<Self, ConfigError> {
        Self::from_parts(base, &ParameterLayout::default(), assignments, origin)
    }

    fn from_parts(
        mut entries: Entries,
        old: &ParameterLayout,
        assignments: Vec<Assignment>,
        origin: &ValueSource,
    ) -> Result<Self, ConfigError> {
        let mut changed = Vec::with_capacity(assignments.len());
        let (aliases, assignments): (Vec<_>, Vec<_>) =
            assignments.into_iter().partition(|assignment| aliases::is_alias(&assignment.key));
        for Assignment { key, value, source } in assignments {
            if aliases::describes_node(&key, &value, &source)? {
                continue;
            }
            changed.push(key.clone());
            entries.insert(key, ParameterEntry { value, source });
        }
        // The parameter of an alias depends on the type of the axis, and takes precedence over its own name.
        for Assignment { key, value, source } in aliases {
            let (key, value) = aliases::resolve(&key, &value, &source, &entries)?;
            changed.push(key.clone());
            entries.insert(key, ParameterEntry { value, source });
        }
        if changed.iter().any(|key| key == "joints") {
            // The parameters of removed joints are removed.
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

    /// Returns the parameter that the alias `key` names; `None` if it is no alias.
    pub fn alias(&self, key: &str) -> Option<ParameterAlias> {
        let plain = aliases::without_prefix(key, &self.text("joint_prefix"));
        aliases::find(&plain, |name| Some(self.layout.joints.iter().find(|joint| joint.name == name)?.axis))
    }

    /// Returns the value or the default of the parameter or alias `key`, none if it has neither or is unknown.
    pub fn get(&self, key: &str) -> Option<Value> {
        if aliases::is_alias(key) {
            let alias = self.alias(key)?;
            return Some(alias.alias_value(self.get(&alias.key)?));
        }
        match self.entries.get(key) {
            Some(entry) => Some(entry.value.clone()),
            None => self.definition(key)?.default_value(),
        }
    }

    /// Returns the origin of the value of `key`, none for a default.
    pub fn source(&self, key: &str) -> Option<&ValueSource> {
        self.entries.get(key).map(|entry| &entry.source)
    }

    /// Returns the definition of the parameter with the full key `key` on this machine, for an alias that of its
    /// parameter.
    pub fn definition(&self, key: &str) -> Option<&'static ParameterDefinition> {
        if aliases::is_alias(key) {
            return self.definition(&self.alias(key)?.key);
        }
        self.layout.find(key, &ValueSource::named("")).ok()
    }

    /// Returns the full keys and definitions of all parameters of this machine and its node: machine, axes in the order of
    /// `joints`, node.
    pub fn definitions(&self) -> impl Iterator<Item = (String, &'static ParameterDefinition)> + '_ {
        self.layout.definitions()
    }

    /// Returns the parameters with a value or a default, in the order of [`definitions`](Self::definitions).
    pub fn iter(&self) -> impl Iterator<Item = (String, Value)> + '_ {
        self.definitions().filter_map(|(key, _)| self.get(&key).map(|value| (key, value)))
    }

    pub(super) fn layout(&self) -> &ParameterLayout {
        &self.layout
    }
}

/// Adds to a missing key that the file replaces the whole machine.
fn explain_replacement(error: ConfigError) -> ConfigError {
    match error {
        ConfigError::Missing { at, key, wanted } => ConfigError::Missing {
            at,
            key,
            wanted: format!(
                "{wanted}; a file with `machine` or other `joints` must be a complete machine, omit both to \
                 change parameters of the present machine"
            ),
        },
        other => other,
    }
}

/// Reads a text file of limited size.
fn read_text(path: &Path) -> Result<String, ConfigError> {
    let unreadable =
        |reason: String| ConfigError::Unreadable { path: path.to_string_lossy().into_owned(), reason };
    let mut bytes = Vec::new();
    File::open(path)
        .and_then(|file| file.take(MAX_FILE_BYTES + 1).read_to_end(&mut bytes))
        .map_err(|error| unreadable(error.to_string()))?;
    if bytes.len() as u64 > MAX_FILE_BYTES {
        return Err(unreadable(format!("file is larger than {MAX_FILE_BYTES} bytes")));
    }
    String::from_utf8(bytes).map_err(|error| {
        let position = error.utf8_error().valid_up_to();
        unreadable(format!("invalid UTF-8 at byte {position}"))
    })
}
