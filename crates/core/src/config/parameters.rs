//! Complete and valid parameter set, from machine files, parameter files and single values.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use super::aliases::{self, ParameterAlias};
use super::check::{check, joint_names};
use super::controller;
use super::declaration::{CheckedValues, Entries, ParameterEntry, ParameterGroup};
use super::definition::{ParameterDefinition, Scope};
use super::error::{ConfigError, ValueSource};
use super::ignored::FileFilter;
use super::layout::{ParameterLayout, plain_definition};
use super::machine::MachineConfig;
use super::node::{self, NodeConfig, QosConfig};
use super::parameter_file::{self, Assignment, parse_assignment};
use super::value::Value;
use crate::encoding::decode_text;
use crate::text::{BuiltinFiles, builtin_names, builtin_text, nearest_hint, nearest_name, shortened};

/// Name of the default machine, the Mikron UCP 710.
pub const DEFAULT_MACHINE: &str = "mikron_ucp710";
/// Parameter file of the default machine.
const DEFAULT_FILE: &str = include_str!("../../config/mikron_ucp710.yaml");
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
    /// Reasons why parameters are ignored: this node does not have them, or cannot follow the value for a controller.
    pub ignored: Vec<String>,
    /// Parameters that a section for several nodes sets twice; the last value applies.
    pub repeated: Vec<String>,
}

/// Returns the end of a message about an unknown machine: the nearest built-in machine, and all of them.
fn nearest_machine(name: &str, builtin: &BuiltinFiles) -> String {
    let hint = nearest_hint(&nearest_name(name, builtin_names(builtin)));
    format!("{hint}; built-in machines: {}", builtin_names(builtin).collect::<Vec<_>>().join(", "))
}

impl Parameters {
    /// Returns the default machine, the Mikron UCP 710.
    ///
    /// # Errors
    ///
    /// Any [`ConfigError`], which a test excludes for the embedded file.
    pub fn embedded_default() -> Result<Self, ConfigError> {
        Self::from_yaml(DEFAULT_FILE, &format!("{DEFAULT_MACHINE}.yaml"))
    }

    /// Returns true if `text` is or resembles the name of a machine of `builtin` or of a machine file; as a value of the
    /// parameter `machine`, which is a name only, it is probably meant to select that machine.
    pub fn names_machine(text: &str, builtin: &BuiltinFiles) -> bool {
        let is_file = text.contains('/') || text.ends_with(".yaml") || text.ends_with(".yml");
        is_file || nearest_name(text, builtin_names(builtin)).is_some()
    }

    /// Returns the file of the machine `name` of `builtin`.
    ///
    /// # Errors
    ///
    /// [`ConfigError`] for the name of no built-in machine.
    pub fn builtin_text(name: &str, builtin: &BuiltinFiles) -> Result<&'static str, ConfigError> {
        builtin_text(builtin, name).ok_or_else(|| {
            ConfigError::new(format_args!(
                "unknown machine {}{}",
                shortened(name),
                nearest_machine(name, builtin)
            ))
        })
    }

    /// Parses a complete machine file; messages name it `source`.
    ///
    /// If the file has several sections, those that match a node `/virtual_axes` apply.
    ///
    /// # Errors
    ///
    /// Any [`ConfigError`].
    pub fn from_yaml(text: &str, source: &str) -> Result<Self, ConfigError> {
        let source = ValueSource::file(source);
        let file = parameter_file::read(text, &source, None)?;
        let errors = file.unusable.into_iter().chain(file.repeated).map(|(_, error)| error);
        errors.chain(file.unset).next().map_or(Ok(()), Err)?;
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

    /// Loads the machine `machine` of `builtin`, or the machine file `machine` if there is none.
    ///
    /// # Errors
    ///
    /// Any [`ConfigError`].
    pub fn load(machine: &str, builtin: &BuiltinFiles) -> Result<Self, ConfigError> {
        if let Some(text) = builtin_text(builtin, machine) {
            return Self::from_yaml(text, &format!("{machine}.yaml"));
        }
        let text = read_text(Path::new(machine)).map_err(|error| match Path::new(machine).exists() {
            true => error,
            false => error.with_hint(&nearest_machine(machine, builtin)),
        })?;
        Self::from_yaml(&text, machine)
    }

    /// Sets the parameters of a ROS 2 parameter file for the node `node` (fully qualified, `/ns/name`). With `None`, the
    /// only section of the file applies, or the sections that match `/virtual_axes`.
    ///
    /// Sections match by the rules of ROS 2 (`*`, `**`); later sections take precedence. Parameters that this node does not
    /// have are ignored in sections for several nodes and in files of controllers; in a complete machine they are errors. A file with `machine`, or with
    /// `joints` and the type of one, is a complete machine and replaces the present machine; the parameters of the node
    /// remain.
    ///
    /// # Errors
    ///
    /// Any [`ConfigError`]; `self` remains unchanged.
    pub fn overlay_yaml(
        &mut self,
        text: &str,
        source: &str,
        node: Option<&str>,
    ) -> Result<OverlayReport, ConfigError> {
        let source = ValueSource::file(source);
        let file = parameter_file::read(text, &source, node)?;
        let mut assignments = file.assignments;
        let has = |wanted: &dyn Fn(&str) -> bool| assignments.iter().any(|one| wanted(&one.key));
        let has_joints = has(&|key| key == "joints");
        // A section for several nodes may have parameters `machine` and `joints` of another node.
        let has_machine = has(&|key| key == "machine")
            && (!file.shared.contains("machine")
                || has(&|key| !["machine", "joints"].contains(&key) && self.layout.is_of_machine(key)));
        let is_machine_replaced = has_machine || has_joints && has(&|key| key.ends_with(".type"));
        // The node reads its own dump, in which a parameter without value is null.
        file.unset.filter(|_| is_machine_replaced && node.is_none()).map_or(Ok(()), Err)?;
        let filter = FileFilter {
            entries: &self.entries,
            layout: &self.layout,
            shared: &file.shared,
            is_machine: is_machine_replaced,
            has_manager: file.skipped.iter().any(|path| path.ends_with("/controller_manager")),
        };
        let is_of_controller = filter.is_of_controller(&assignments);
        let ignored = filter.remove_ignored(&mut assignments, file.unusable)?;
        let is_error = |(key, _): &&(String, ConfigError)| {
            node.is_none() || is_machine_replaced || !is_of_controller && !file.shared.contains(key)
        };
        if let Some((_, error)) = file.repeated.iter().find(is_error) {
            return Err(error.clone());
        }
        let report = OverlayReport {
            parameters: assignments.len(),
            is_machine_replaced,
            sections: file.matched,
            skipped: file.skipped,
            ignored: ignored.iter().map(ToString::to_string).collect(),
            repeated: file
                .repeated
                .iter()
                .filter(|(key, _)| assignments.iter().any(|one| one.key == *key))
                .map(|(_, error)| error.to_string())
                .collect(),
        };
        let mut base = self.entries.clone();
        if report.is_machine_replaced {
            base.retain(|key, _| {
                plain_definition(key).is_some_and(|definition| definition.scope == Scope::Node)
            });
        }
        let needs_machine = report.is_machine_replaced || has_joints;
        *self = Self::from_parts(base, &self.layout, assignments, &source).map_err(|error| {
            match needs_machine && error.is_missing {
                true => error.with_hint(REPLACEMENT_HINT),
                false => error,
            }
        })?;
        Ok(report)
    }

    /// Returns the reason why the node ignores a parameter of its command line: it resembles no parameter of this node and is
    /// probably meant for another one, is a parameter of rclcpp without effect here, or of a controller with a value that the
    /// node cannot follow.
    pub fn ignored(&self, Assignment { key, value, source }: &Assignment) -> Option<ConfigError> {
        match controller::find(key) {
            Some(parameter) => parameter.check(key, value, source).err(),
            None if aliases::is_alias(key) || !self.layout.is_foreign(key) => None,
            None => self.layout.check_name(key, source).err(),
        }
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
    /// Any [`ConfigError`]; `self` remains unchanged.
    pub fn set(&mut self, key: &str, value: Value, source: &ValueSource) -> Result<(), ConfigError> {
        self.set_all(vec![Assignment { key: key.to_owned(), value, source: source.clone() }])
    }

    /// Sets one parameter from `KEY=VALUE` or `KEY:=VALUE`, with the value in YAML.
    ///
    /// # Errors
    ///
    /// The errors of [`set`](Self::set), and that about a text without `=`.
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
    /// [`ConfigError`] if the parameter is required; `self` remains unchanged.
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
            if let Some(parameter) = controller::find(&key) {
                parameter.check(&key, &value, &source)?;
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
        // A file for all nodes sets `use_sim_time`, and later this one is made the publisher of `/clock`.
        let has_changed = |wanted: &str| changed.iter().any(|key| key == wanted);
        let is_fast =
            || entries.get("time").is_some_and(|entry| entry.value == Value::Text("fast".to_owned()));
        if has_changed("time") && !has_changed("use_sim_time") && is_fast() {
            entries.remove("use_sim_time");
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
        let plain = aliases::without_prefix(key, aliases::joint_prefix(&self.entries));
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

    fn values(&self) -> CheckedValues<'_> {
        CheckedValues { entries: &self.entries, joints: &self.layout.joints, joint: None }
    }

    /// Returns the machine configuration in SI units.
    ///
    /// # Errors
    ///
    /// [`ConfigError`] for a missing parameter, which cannot happen in a checked parameter set.
    pub fn machine_config(&self) -> Result<MachineConfig, ConfigError> {
        MachineConfig::read(&self.values()).ok_or_else(|| {
            ConfigError::missing(&ValueSource::named("parameters"), "machine", "expected all its parameters")
        })
    }

    /// Returns the node configuration.
    pub fn node_config(&self) -> NodeConfig {
        // All parameters of the node have defaults.
        NodeConfig::read(&self.values()).unwrap_or_default()
    }

    /// Returns the quality of service of a topic, such as `psec` or `motor_currents`; none for a topic that is not in the
    /// schema.
    pub fn qos(&self, topic: &str) -> Option<QosConfig> {
        node::qos(&self.values(), topic)
    }
}

/// Remedy for a missing key of a file that replaces the whole machine.
const REPLACEMENT_HINT: &str = "; a file with `machine` or other `joints` must be a complete machine, omit both to \
                                change parameters of the present machine";

/// Reads a text file of limited size.
fn read_text(path: &Path) -> Result<String, ConfigError> {
    let unreadable = |reason: String| {
        ConfigError::new(format_args!("{}: cannot be read: {reason}", path.to_string_lossy()))
    };
    let mut bytes = Vec::new();
    File::open(path)
        .and_then(|file| file.take(MAX_FILE_BYTES + 1).read_to_end(&mut bytes))
        .map_err(|error| unreadable(error.to_string()))?;
    if bytes.len() as u64 > MAX_FILE_BYTES {
        return Err(unreadable(format!("file is larger than {MAX_FILE_BYTES} bytes")));
    }
    decode_text(&bytes).map_err(unreadable)
}
