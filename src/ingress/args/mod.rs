//! The command line of a ROS 2 node: `[--help | --version] [--ros-args … [--]]…`.
//!
//! The grammar is rcl's, and so is its meaning:
//!
//! | argument | effect |
//! |---|---|
//! | `-p`, `--param [node:]name:=value` | a parameter; the value is YAML; the last one wins |
//! | `--params-file FILE` | parameters from a file; the last one wins |
//! | `-r`, `--remap [node:]from:=to` | another name for a topic or service; the first one wins |
//! | `-r [node:]__node:=name` (or `__name`), `-r [node:]__ns:=/namespace` | who the node is |
//! | `--log-level [logger:=]LEVEL` | `DEBUG`, `INFO`, `WARN`, `ERROR`, `FATAL`, `UNSET`, in any case |
//! | `--enable-X-logs`, `--disable-X-logs` | X is `rosout`, `stdout` or `external-lib` |
//! | `-e`, `--enclave /path` | the enclave of the node; the last one wins |
//! | `--log-file-name P`, `--log-config-file F` | taken, without effect |
//!
//! `from` may begin with `rostopic://` or `rosservice://`. What rcl leaves for the program to look
//! at, this program refuses: it has no arguments of its own.

mod parse;
#[cfg(test)]
mod tests;

use std::path::PathBuf;

use super::names::{NameError, NodeFqn};

/// Severity of a log message, in rcutils' order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum LogLevel {
    /// No choice made: as the parent logger, in the end `Info`.
    Unset,
    /// Details for somebody who searches a fault.
    Debug,
    /// What happens in normal operation.
    Info,
    /// Something is wrong that the node can live with.
    Warn,
    /// Something that was asked for cannot be done.
    Error,
    /// The node cannot go on.
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

    /// The level of this name, in capitals or not.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::NAMES.iter().find(|(known, _)| known.eq_ignore_ascii_case(name)).map(|(_, level)| *level)
    }

    /// Its name in capitals.
    #[must_use]
    pub fn name(self) -> &'static str {
        Self::NAMES[self as usize].0
    }
}

/// One source of parameter values. Sources are in the order of the command line, and later ones
/// win over earlier ones.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ParameterSource {
    /// `-p [node:]name:=text`
    Value {
        /// The node that it is meant for; `None` is every node.
        node: Option<String>,
        /// The parameter.
        name: String,
        /// Its value as it was written, in YAML, not empty.
        text: String,
    },
    /// `--params-file path`
    File(PathBuf),
}

/// What a remapping rule applies to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NameKind {
    /// Publishers and subscriptions.
    Topic,
    /// Services, also the ones of which an action consists.
    Service,
}

/// `-r [node:][rostopic://|rosservice://]from:=to`
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RemapRule {
    /// The node whose names it changes; `None` is every node.
    pub node: Option<String>,
    /// Only names of this kind; `None` is both.
    pub kind: Option<NameKind>,
    /// The name in the program: absolute, relative or private.
    pub from: String,
    /// The name to use: absolute, relative or private.
    pub to: String,
}

/// Where log messages go besides the choice of level.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LogSinks {
    /// Publish on `/rosout`.
    pub rosout: bool,
    /// Write to the terminal.
    pub stdout: bool,
    /// Hand to a logging library; there is none here.
    pub external_lib: bool,
}

impl Default for LogSinks {
    fn default() -> Self {
        Self { rosout: true, stdout: true, external_lib: true }
    }
}

/// An argument that cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ArgsError {
    /// Not text.
    #[error("argument '{found}' is not UTF-8")]
    NotUtf8 {
        /// The argument, with U+FFFD for what is none.
        found: String,
    },
    /// Outside `--ros-args … --`.
    #[error(
        "argument '{found}' is not known; allowed are --help, --version, and ROS arguments after --ros-args"
    )]
    Outside {
        /// The argument.
        found: String,
    },
    /// Inside `--ros-args … --`, and no flag.
    #[error("ROS argument '{found}' is not known; allowed are {allowed}")]
    Unknown {
        /// The argument.
        found: String,
        /// The flags that are known.
        allowed: &'static str,
    },
    /// A flag at the end, or before another flag's place.
    #[error("ROS argument '{flag}' lacks its value; expected is {allowed}")]
    MissingValue {
        /// The flag.
        flag: String,
        /// What must follow.
        allowed: &'static str,
    },
    /// A flag with a value that it cannot use.
    #[error("ROS argument '{flag} {found}': {reason}; expected is {allowed}")]
    BadValue {
        /// The flag.
        flag: String,
        /// The value.
        found: String,
        /// What is wrong with it.
        reason: String,
        /// What must follow.
        allowed: &'static str,
    },
}

/// What the command line asks the program to do.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Command {
    /// Run the node.
    Run(RosArgs),
    /// Say how it is used.
    Help,
    /// Say which version it is.
    Version,
}

/// The ROS arguments of a node, all of them valid.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RosArgs {
    node: NodeFqn,
    parameters: Vec<ParameterSource>,
    remaps: Vec<RemapRule>,
    log_level: Option<LogLevel>,
    logger_levels: Vec<(String, LogLevel)>,
    log_sinks: LogSinks,
    enclave: Option<String>,
    warnings: Vec<String>,
}

impl RosArgs {
    /// Who the node is, after `__ns` and `__node`.
    #[must_use]
    pub fn node(&self) -> &NodeFqn {
        &self.node
    }

    /// Parameter values and files for this node, later ones winning. Values that are meant for
    /// other nodes are left out.
    pub fn parameters(&self) -> impl Iterator<Item = &ParameterSource> {
        self.parameters.iter().filter(|source| match source {
            ParameterSource::Value { node, .. } => self.is_for_this_node(node.as_deref()),
            ParameterSource::File(_) => true,
        })
    }

    /// The remapping rules, in the order of the command line.
    #[must_use]
    pub fn remaps(&self) -> &[RemapRule] {
        &self.remaps
    }

    /// The level for all loggers, if one was given.
    #[must_use]
    pub fn log_level(&self) -> Option<LogLevel> {
        self.log_level
    }

    /// Levels for single loggers.
    #[must_use]
    pub fn logger_levels(&self) -> &[(String, LogLevel)] {
        &self.logger_levels
    }

    /// Where log messages go.
    #[must_use]
    pub fn log_sinks(&self) -> LogSinks {
        self.log_sinks
    }

    /// The enclave whose keys the node has, if one was given.
    #[must_use]
    pub fn enclave(&self) -> Option<&str> {
        self.enclave.as_deref()
    }

    /// Sentences for the log about arguments that were taken but have no effect.
    #[must_use]
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// The name in the graph of a topic that the program calls `name`.
    ///
    /// # Errors
    /// As [`NodeFqn::expand`].
    pub fn resolve_topic(&self, name: &str) -> Result<String, NameError> {
        self.resolve(NameKind::Topic, name)
    }

    /// The name in the graph of a service that the program calls `name`.
    ///
    /// # Errors
    /// As [`NodeFqn::expand`].
    pub fn resolve_service(&self, name: &str) -> Result<String, NameError> {
        self.resolve(NameKind::Service, name)
    }

    /// Expands `name`, then applies the first rule that fits it.
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
        node.is_none_or(|pattern| self.node.is_meant_by(pattern))
    }
}
