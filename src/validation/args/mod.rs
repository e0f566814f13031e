//! Command line of a ROS 2 node: `[--help | --version] [--lifecycle] [--ros-args … [--]]…`.
//!
//! Grammar and semantics are those of rcl:
//!
//! | argument | effect |
//! |---|---|
//! | `-p`, `--param [node:]name:=value` | parameter with a YAML value; the last one applies |
//! | `--params-file FILE` | parameters from a file; the last one applies |
//! | `-r`, `--remap [node:]from:=to` | other name of a topic or service; the first one applies |
//! | `-r [node:]__node:=name` (or `__name`), `-r [node:]__ns:=/namespace` | name and namespace of the node |
//! | `--log-level [logger:=]LEVEL` | `DEBUG`, `INFO`, `WARN`, `ERROR`, `FATAL`, `UNSET`, in any case |
//! | `--enable-X-logs`, `--disable-X-logs` | X is `rosout`, `stdout` or `external-lib` |
//! | `-e`, `--enclave /path` | enclave of the node; the last one applies |
//! | `--log-file-name P`, `--log-config-file F` | accepted without effect |
//!
//! `from` can begin with `rostopic://` or `rosservice://`. Of the arguments that rcl passes to the program, those above are
//! accepted.

mod parse;
#[cfg(test)]
mod tests;

use std::path::PathBuf;

use super::names::{NameError, NodeFqn};

/// Severity of a log message, in the order of rcutils.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum LogLevel {
    /// Level of the parent logger; `Info` for the root logger.
    Unset,
    /// Details for debugging.
    Debug,
    /// Normal operation.
    Info,
    /// Fault that does not affect the operation.
    Warn,
    /// Failed request.
    Error,
    /// Fault that ends the node.
    Fatal,
}

impl LogLevel {
    const NAMES: [(&'static str, Self); 6] = [
        ("UNSET", Self::Unset),
        ("DEBUG", Self::Debug),
        ("INFO", Self::Info),
        ("WARN", Self::Warn),
        ("ERROR", Self::Error),
        ("FATAL", Self::Fatal),
    ];

    /// Returns the level with this name, case-insensitive.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::NAMES.iter().find(|(known, _)| known.eq_ignore_ascii_case(name)).map(|(_, level)| *level)
    }

    /// Returns the name in capitals.
    #[must_use]
    pub fn name(self) -> &'static str {
        Self::NAMES[self as usize].0
    }
}

/// Source of parameter values. Sources are in the order of the command line; later ones override earlier
/// ones.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ParameterSource {
    /// Argument `-p [node:]name:=text`.
    Value {
        /// Node of the parameter; `None` is every node.
        node: Option<String>,
        /// Parameter name.
        name: String,
        /// Value as YAML text, not empty.
        text: String,
    },
    /// Argument `--params-file path`.
    File(PathBuf),
}

/// Kind of names to which a remapping rule applies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NameKind {
    /// Publishers and subscriptions.
    Topic,
    /// Services, including those of actions.
    Service,
}

/// Remapping rule `-r [node:][rostopic://|rosservice://]from:=to`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RemapRule {
    /// Node of the rule; `None` is every node.
    pub node: Option<String>,
    /// Kind of names; `None` is both kinds.
    pub kind: Option<NameKind>,
    /// Name in the program: absolute, relative or private.
    pub from: String,
    /// New name: absolute, relative or private.
    pub to: String,
}

/// Outputs of log messages.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LogSinks {
    /// Publication on `/rosout`.
    pub rosout: bool,
    /// Output to the terminal.
    pub stdout: bool,
    /// Output to an external logging library; not used by this node.
    pub external_lib: bool,
}

impl Default for LogSinks {
    fn default() -> Self {
        Self { rosout: true, stdout: true, external_lib: true }
    }
}

/// Invalid argument.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ArgsError {
    /// Argument that is not UTF-8.
    #[error("argument '{found}' is not UTF-8")]
    NotUtf8 {
        /// Argument, with U+FFFD in place of invalid bytes.
        found: String,
    },
    /// Unknown argument outside `--ros-args … --`.
    #[error(
        "unknown argument '{found}'; allowed are --help, --version, --lifecycle, and ROS arguments after --ros-args"
    )]
    Outside {
        /// Argument.
        found: String,
    },
    /// Unknown flag inside `--ros-args … --`.
    #[error("unknown ROS argument '{found}'; allowed are {allowed}")]
    Unknown {
        /// Argument.
        found: String,
        /// Known flags.
        allowed: &'static str,
    },
    /// Flag without a value.
    #[error("ROS argument '{flag}' lacks its value; expected {allowed}")]
    MissingValue {
        /// Flag.
        flag: String,
        /// Expected value.
        allowed: &'static str,
    },
    /// Flag with an invalid value.
    #[error("ROS argument '{flag} {found}': {reason}; expected {allowed}")]
    BadValue {
        /// Flag.
        flag: String,
        /// Value.
        found: String,
        /// Reason.
        reason: String,
        /// Expected value.
        allowed: &'static str,
    },
}

/// Command of the node program.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Command {
    /// Run the node.
    Run(RosArgs),
    /// Print the help.
    Help,
    /// Print the version.
    Version,
}

/// Validated ROS arguments of a node.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RosArgs {
    node: NodeFqn,
    parameters: Vec<ParameterSource>,
    remaps: Vec<RemapRule>,
    log_level: Option<LogLevel>,
    logger_levels: Vec<(String, LogLevel)>,
    log_sinks: LogSinks,
    enclave: Option<String>,
    is_managed: bool,
    warnings: Vec<String>,
}

impl RosArgs {
    /// Returns the node name after remapping by `__ns` and `__node`.
    #[must_use]
    pub fn node(&self) -> &NodeFqn {
        &self.node
    }

    /// Returns the parameter values and files of this node; later ones override earlier ones. Values for other
    /// nodes are omitted.
    pub fn parameters(&self) -> impl Iterator<Item = &ParameterSource> {
        self.parameters.iter().filter(|source| match source {
            ParameterSource::Value { node, .. } => self.is_for_this_node(node.as_deref()),
            ParameterSource::File(_) => true,
        })
    }

    /// Returns the remapping rules, in the order of the command line.
    #[must_use]
    pub fn remaps(&self) -> &[RemapRule] {
        &self.remaps
    }

    /// Returns the log level of all loggers, if given.
    #[must_use]
    pub fn log_level(&self) -> Option<LogLevel> {
        self.log_level
    }

    /// Returns the log levels of single loggers.
    #[must_use]
    pub fn logger_levels(&self) -> &[(String, LogLevel)] {
        &self.logger_levels
    }

    /// Returns the outputs of log messages.
    #[must_use]
    pub fn log_sinks(&self) -> LogSinks {
        self.log_sinks
    }

    /// Returns the security enclave of the node, if given.
    #[must_use]
    pub fn enclave(&self) -> Option<&str> {
        self.enclave.as_deref()
    }

    /// Returns true if the node is a managed node with a lifecycle.
    #[must_use]
    pub fn is_managed(&self) -> bool {
        self.is_managed
    }

    /// Returns the warnings about accepted arguments without effect, for the log.
    #[must_use]
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// Returns the fully qualified name of the topic `name` after remapping.
    ///
    /// # Errors
    /// [`NameError`] if the name is invalid, see [`NodeFqn::expand`].
    pub fn resolve_topic(&self, name: &str) -> Result<String, NameError> {
        self.resolve(NameKind::Topic, name)
    }

    /// Returns the fully qualified name of the service `name` after remapping.
    ///
    /// # Errors
    /// [`NameError`] if the name is invalid, see [`NodeFqn::expand`].
    pub fn resolve_service(&self, name: &str) -> Result<String, NameError> {
        self.resolve(NameKind::Service, name)
    }

    /// Returns the fully qualified name of the topic or service `part` of the action `action`, after remapping. As in rcl,
    /// a rule can name the part; otherwise, unlike there, one for the whole action applies.
    ///
    /// # Errors
    /// [`NameError`] if a name is invalid, see [`NodeFqn::expand`].
    pub fn resolve_action_part(&self, kind: NameKind, action: &str, part: &str) -> Result<String, NameError> {
        let name = format!("{action}/_action/{part}");
        let resolved = self.resolve(kind, &name)?;
        if resolved != self.node.expand(&name)? {
            return Ok(resolved);
        }
        Ok(format!("{}/_action/{part}", self.resolve_service(action)?))
    }

    /// Expands `name`, then applies the first matching rule.
    fn resolve(&self, kind: NameKind, name: &str) -> Result<String, NameError> {
        let absolute = self.node.expand(name)?;
        for rule in &self.remaps {
            if rule.kind.is_none_or(|of| of == kind)
                && self.is_for_this_node(rule.node.as_deref())
                && self.node.expand(&rule.from)? == absolute
            {
                return self.node.expand(&rule.to);
            }
        }
        Ok(absolute)
    }

    fn is_for_this_node(&self, node: Option<&str>) -> bool {
        node.is_none_or(|pattern| self.node.matches(pattern))
    }
}
