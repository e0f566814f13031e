//! Parser of the argument vector, which returns a [`Command`].

use super::{
    super::names::{NodeFqn, check_namespace, check_node_name, check_rule_side},
    ArgsError, Command, LogLevel, LogSinks, NameKind, ParameterSource, RemapRule, RosArgs,
};

const FLAGS: &str = "-p/--param, --params-file, -r/--remap, --log-level, -e/--enclave, --log-file-name, \
     --log-config-file, and --enable- or --disable- with rosout-logs, stdout-logs, external-lib-logs";
const PARAM: &str = "[node:]name:=value, the value in YAML";
const REMAP: &str = "[node:]from:=to, [node:]__node:=name or [node:]__ns:=/namespace";
const LEVEL: &str = "[logger:=]LEVEL with DEBUG, INFO, WARN, ERROR, FATAL or UNSET";
const FILE: &str = "a file's path";
const PREFIX: &str = "the beginning of a file's name";
const ENCLAVE: &str = "an absolute path such as /cell/mill";

impl Command {
    /// Parses the arguments, without the program name. The default node name is `default_name` in the root
    /// namespace.
    ///
    /// # Errors
    /// [`ArgsError`] for the first invalid argument, or for a `default_name` that is not a valid node name.
    ///
    /// ```
    /// use virtual_axes::validation::args::Command;
    ///
    /// let arguments = ["--ros-args", "-r", "__ns:=/cell", "-r", "psec:=/setpoints"];
    /// let Command::Run(args) = Command::parse(arguments, "mill").unwrap() else { panic!() };
    /// assert_eq!(args.node().to_string(), "/cell/mill");
    /// assert_eq!(args.resolve_topic("psec").unwrap(), "/setpoints");
    /// assert_eq!(args.resolve_topic("~/tool_pose").unwrap(), "/cell/mill/tool_pose");
    /// ```
    pub fn parse<S: AsRef<str>>(
        arguments: impl IntoIterator<Item = S>,
        default_name: &str,
    ) -> Result<Self, ArgsError> {
        let arguments: Vec<S> = arguments.into_iter().collect();
        let mut arguments = arguments.iter().map(AsRef::as_ref);
        let mut draft = ArgsDraft::default();
        let mut command = None;
        let mut in_ros_args = false;
        while let Some(argument) = arguments.next() {
            match (in_ros_args, argument) {
                (_, "--ros-args") => in_ros_args = true,
                (true, "--") => in_ros_args = false,
                (true, flag) => draft.parse_flag(flag, || arguments.next())?,
                (false, "--help" | "-h") => command = command.or(Some(Self::Help)),
                (false, "--version" | "-V") => command = command.or(Some(Self::Version)),
                (false, "--lifecycle") => draft.is_managed = true,
                (false, other) => {
                    return Err(ArgsError::Outside { found: other.to_owned() });
                }
            }
        }
        match command {
            Some(command) => Ok(command),
            None => draft.finish(default_name).map(Self::Run),
        }
    }
}

/// Remapping rule of the node name or namespace.
struct NodeRemap {
    node: Option<String>,
    value: String,
}

/// Function that parses the value of a flag into the draft, or returns the reason why it is invalid.
type ValueParser = fn(&mut ArgsDraft, &str, &str) -> Result<(), String>;

#[derive(Default)]
struct ArgsDraft {
    names: Vec<NodeRemap>,
    namespaces: Vec<NodeRemap>,
    parameters: Vec<ParameterSource>,
    remaps: Vec<RemapRule>,
    log_level: Option<LogLevel>,
    logger_levels: Vec<(String, LogLevel)>,
    enclave: Option<String>,
    log_sinks: LogSinks,
    is_managed: bool,
    warnings: Vec<String>,
}

impl ArgsDraft {
    fn parse_flag<'a>(
        &mut self,
        flag: &'a str,
        next: impl FnOnce() -> Option<&'a str>,
    ) -> Result<(), ArgsError> {
        if let Some((sink, on)) = self.sink(flag) {
            *sink = on;
            return Ok(());
        }
        let (allowed, read): (_, ValueParser) = match flag {
            "-p" | "--param" => (PARAM, |draft, _, value| draft.parameter(value)),
            "--params-file" => (FILE, |draft, _, value| draft.parameters_file(value)),
            "-r" | "--remap" => (REMAP, |draft, _, value| draft.remap(value)),
            "--log-level" => (LEVEL, |draft, _, value| draft.level(value)),
            "-e" | "--enclave" => (ENCLAVE, |draft, _, value| {
                check_namespace(value).map_err(|error| error.to_string())?;
                draft.enclave = Some(value.to_owned());
                Ok(())
            }),
            "--log-file-name" => {
                (PREFIX, |draft, flag, value| draft.ignore(flag, value, "this node writes no log file"))
            }
            "--log-config-file" => (FILE, |draft, flag, value| {
                draft.ignore(flag, value, "this node uses no external logging library")
            }),
            _ => {
                return Err(ArgsError::Unknown { found: flag.to_owned(), allowed: FLAGS });
            }
        };
        let value = next().ok_or_else(|| ArgsError::MissingValue { flag: flag.to_owned(), allowed })?;
        read(self, flag, value).map_err(|reason| ArgsError::BadValue {
            flag: flag.to_owned(),
            found: value.to_owned(),
            reason,
            allowed,
        })
    }

    fn sink(&mut self, flag: &str) -> Option<(&mut bool, bool)> {
        let (which, on) = flag
            .strip_prefix("--enable-")
            .map(|which| (which, true))
            .or_else(|| flag.strip_prefix("--disable-").map(|which| (which, false)))?;
        let sink = match which {
            "rosout-logs" => &mut self.log_sinks.rosout,
            "stdout-logs" => &mut self.log_sinks.stdout,
            "external-lib-logs" => &mut self.log_sinks.external_lib,
            _ => return None,
        };
        Some((sink, on))
    }

    fn ignore(&mut self, flag: &str, value: &str, why: &str) -> Result<(), String> {
        if value.is_empty() {
            return Err("it is empty".to_owned());
        }
        self.warnings.push(format!("'{flag} {value}' has no effect: {why}"));
        Ok(())
    }

    fn parameter(&mut self, rule: &str) -> Result<(), String> {
        let (left, text) = split_rule(rule)?;
        if text.trim().is_empty() {
            return Err("there is no value after ':='; write an empty string as ''".to_owned());
        }
        let (node, name) = split_node(left)?;
        let is_valid = !name.is_empty()
            && !name.starts_with(|c: char| c.is_ascii_digit())
            && name.chars().all(|c| c.is_ascii_alphanumeric() || matches!(c, '_' | '.' | '/'));
        if !is_valid {
            return Err(format!("'{name}' is not a valid parameter name"));
        }
        self.parameters.push(ParameterSource::Value { node, name: name.to_owned(), text: text.to_owned() });
        Ok(())
    }

    fn parameters_file(&mut self, path: &str) -> Result<(), String> {
        if path.is_empty() {
            return Err("it is empty".to_owned());
        }
        self.parameters.push(ParameterSource::File(path.into()));
        Ok(())
    }

    fn remap(&mut self, rule: &str) -> Result<(), String> {
        let (left, to) = split_rule(rule)?;
        // The colon of rostopic:// does not follow a node name.
        let (node, from) = if is_url(left) { (None, left) } else { split_node(left)? };
        match from {
            "__node" | "__name" => {
                check_node_name(to).map_err(|error| error.to_string())?;
                let value = to.to_owned();
                self.names.push(NodeRemap { node, value });
            }
            "__ns" => {
                check_namespace(to).map_err(|error| error.to_string())?;
                let value = to.to_owned();
                self.namespaces.push(NodeRemap { node, value });
            }
            _ => {
                let (kind, from) = if let Some(topic) = from.strip_prefix("rostopic://") {
                    (Some(NameKind::Topic), topic)
                } else if let Some(service) = from.strip_prefix("rosservice://") {
                    (Some(NameKind::Service), service)
                } else {
                    (None, from)
                };
                if from.contains('*') {
                    return Err("wildcards are not supported, as in rcl".to_owned());
                }
                for side in [from, to] {
                    check_rule_side(side).map_err(|error| error.to_string())?;
                }
                self.remaps.push(RemapRule { node, kind, from: from.to_owned(), to: to.to_owned() });
            }
        }
        Ok(())
    }

    fn level(&mut self, text: &str) -> Result<(), String> {
        let (logger, name) = match text.split_once(":=") {
            Some(("", _)) => return Err("there is no logger before ':='".to_owned()),
            Some((logger, name)) => (Some(logger), name),
            None => (None, text),
        };
        let level = LogLevel::from_name(name).ok_or_else(|| format!("'{name}' is not a log level"))?;
        match logger {
            None => self.log_level = Some(level),
            Some(logger) => self.logger_levels.push((logger.to_owned(), level)),
        }
        Ok(())
    }

    fn finish(self, default_name: &str) -> Result<RosArgs, ArgsError> {
        // As in rcl, the first rule applies, and a prefix is compared with the default node name.
        let first = |rules: &[NodeRemap]| {
            rules
                .iter()
                .find(|rule| rule.node.as_deref().is_none_or(|node| node == default_name))
                .map(|rule| rule.value.clone())
        };
        let name = first(&self.names).unwrap_or_else(|| default_name.to_owned());
        let namespace = first(&self.namespaces).unwrap_or_else(|| "/".to_owned());
        let node = NodeFqn::new(&namespace, &name).map_err(|error| ArgsError::BadValue {
            flag: "-r".to_owned(),
            found: format!("__ns:={namespace} __node:={name}"),
            reason: error.to_string(),
            allowed: "a valid namespace and node name",
        })?;
        Ok(RosArgs {
            node,
            parameters: self.parameters,
            remaps: self.remaps,
            log_level: self.log_level,
            logger_levels: self.logger_levels,
            enclave: self.enclave,
            is_managed: self.is_managed,
            log_sinks: self.log_sinks,
            warnings: self.warnings,
        })
    }
}

fn split_rule(rule: &str) -> Result<(&str, &str), String> {
    rule.split_once(":=").ok_or_else(|| "there is no ':=' in it".to_owned())
}

fn is_url(name: &str) -> bool {
    name.starts_with("rostopic://") || name.starts_with("rosservice://")
}

/// Splits `node:name` into node and name.
fn split_node(left: &str) -> Result<(Option<String>, &str), String> {
    match left.split_once(':') {
        None => Ok((None, left)),
        Some((node, name)) => {
            check_node_name(node).map_err(|error| error.to_string())?;
            Ok((Some(node.to_owned()), name))
        }
    }
}
