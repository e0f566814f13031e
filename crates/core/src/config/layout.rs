//! Parameters of a machine with given joints, and suggestions for unknown keys.

use std::sync::LazyLock;

use super::declaration::JointVariant;
use super::definition::{AxisKind, MotorKind, ParameterDefinition, Scope};
use super::error::{ConfigError, ValueSource};
use super::schema::DEFINITIONS;
use super::value::Value;
use crate::text::{is_slip, nearest_hint, nearest_name, shortened};

/// Key prefixes of aliases and of ROS parameter files that are not in the schema and that no joint may have as a name.
const RESERVED: &[&str] = &["constraints", "qos_overrides", "ros__parameters"];

/// Joints of a machine, in order.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct ParameterLayout {
    pub joints: Vec<JointVariant>,
}

impl ParameterLayout {
    /// Returns full keys and definitions of all parameters of this machine: machine, axes, node.
    pub fn definitions(&self) -> impl Iterator<Item = (String, &'static ParameterDefinition)> + '_ {
        let plain = |scope: Scope| {
            DEFINITIONS
                .iter()
                .filter(move |definition| definition.scope == scope)
                .map(|definition| (definition.key.to_owned(), definition))
        };
        let axes = self.joints.iter().flat_map(|joint| {
            axis_definitions()
                .filter(|definition| definition.applies_to(joint.axis, joint.motor))
                .map(|definition| (format!("{}.{}", joint.name, definition.key), definition))
        });
        plain(Scope::Machine).chain(axes).chain(plain(Scope::Node))
    }

    /// Returns the definition of the full key `key` on this machine.
    pub fn find(&self, key: &str, at: &ValueSource) -> Result<&'static ParameterDefinition, ConfigError> {
        if let Some(definition) = plain_definition(key) {
            return Ok(definition);
        }
        let found = key.split_once('.').and_then(|(name, suffix)| {
            let joint = self.joints.iter().find(|joint| joint.name == name)?;
            Some((joint, suffix))
        });
        if let Some((joint, suffix)) = found
            && let Some(definition) =
                axis_definitions_of(suffix).find(|definition| definition.applies_to(joint.axis, joint.motor))
        {
            return Ok(definition);
        }
        self.check_name(key, at)?;
        let excluded = found.and_then(|(joint, suffix)| Some((joint, axis_definitions_of(suffix).next()?)));
        Err(match excluded {
            Some((joint, definition)) => {
                ConfigError::not_applicable(at, key, &joint.exclusion_reason(definition))
            }
            None => self.unknown(key, at),
        })
    }

    /// Rejects a key that is unknown for machines with these joints, of any type.
    pub fn check_name(&self, key: &str, at: &ValueSource) -> Result<(), ConfigError> {
        let known = plain_definition(key).is_some()
            || key.split_once('.').is_some_and(|(name, suffix)| {
                self.joints.iter().any(|joint| joint.name == name)
                    && axis_definitions_of(suffix).next().is_some()
            });
        if known {
            return Ok(());
        }
        let other_joint =
            key.split_once('.').filter(|(_, suffix)| axis_definitions_of(suffix).next().is_some());
        match other_joint {
            Some((name, _)) if !self.joints.is_empty() => {
                let reason = format!("there is no joint {}; joints = {}", shortened(name), self.names());
                Err(ConfigError::not_applicable(at, key, &reason))
            }
            _ => Err(self.unknown(key, at)),
        }
    }

    /// Returns true if `key` is a parameter of the machine or of one of these joints, not of the node.
    pub fn is_of_machine(&self, key: &str) -> bool {
        self.check_name(key, &ValueSource::named("")).is_ok()
            && plain_definition(key).is_none_or(|definition| definition.scope != Scope::Node)
    }

    /// Returns true if `key` is a parameter of rclcpp without effect here, or resembles no parameter of this machine, so that
    /// it is probably meant for another node.
    pub fn is_foreign(&self, key: &str) -> bool {
        let resembles = || self.slip(key).is_some() || key.contains('.') && self.keys_with_end(key).is_some();
        is_rclcpp_parameter(key) || self.check_name(key, &ValueSource::named("")).is_err() && !resembles()
    }

    /// Rejects a value that the parameter `key` does not permit; a parameter of another kind of axis passes.
    pub fn check_value(&self, key: &str, value: &Value, at: &ValueSource) -> Result<(), ConfigError> {
        let Ok(definition) = self.find(key, at) else { return Ok(()) };
        definition.checked(key, value, at).map(|_| ())
    }

    /// Returns the names of the joints as a list.
    pub fn names(&self) -> String {
        let names: Vec<&str> = self.joints.iter().map(|joint| joint.name.as_str()).collect();
        format!("[{}]", names.join(", "))
    }

    fn nearest(&self, key: &str) -> Option<String> {
        self.keys_with_end(key).or_else(|| self.slip(key))
    }

    /// Returns the nearest key if `key` looks like a slip of it: in the same group, or with few other characters.
    fn slip(&self, key: &str) -> Option<String> {
        if is_rclcpp_parameter(key) {
            return self.qos_counterpart(key);
        }
        let group = |key: &str| key.split_once('.').map(|(first, _)| first.to_owned());
        nearest_name(key, self.definitions().map(|(known, _)| known))
            .filter(|name| group(key).is_some_and(|first| group(name) == Some(first)) || is_slip(key, name))
    }

    /// Returns `qos.TOPIC.POLICY` for `qos_overrides./TOPIC.publisher.POLICY`, if this node has it.
    fn qos_counterpart(&self, key: &str) -> Option<String> {
        let (topic, policy) = key.strip_prefix("qos_overrides.")?.split_once('.')?;
        let (topic, policy) = (topic.rsplit('/').next()?, policy.rsplit('.').next()?);
        let own = format!("qos.{topic}.{policy}");
        self.definitions().any(|(known, _)| known == own).then_some(own)
    }

    fn unknown(&self, key: &str, at: &ValueSource) -> ConfigError {
        let hint = nearest_hint(&self.nearest(key));
        ConfigError::at(at, format_args!("unknown parameter {}{hint}", shortened(key)))
    }

    /// Returns the keys of the first joint that has keys ending in `.` and `end`, and those of no joint, joined by "or";
    /// `None` if there are none.
    fn keys_with_end(&self, end: &str) -> Option<String> {
        let suffix = format!(".{end}");
        let found: Vec<String> = self
            .definitions()
            .map(|(known, _)| known.to_string())
            .filter(|known| known.ends_with(&suffix))
            .collect();
        let joint_of = |key: &str| {
            let first = key.split('.').next().unwrap_or_default();
            self.joints.iter().position(|joint| joint.name == first)
        };
        let joint = found.iter().find_map(|key| joint_of(key));
        let (of_joint, others): (Vec<&String>, Vec<&String>) =
            found.iter().partition(|key| joint_of(key).is_some());
        let keys = of_joint.into_iter().filter(|key| joint_of(key) == joint).chain(others);
        let keys: Vec<&str> = keys.map(String::as_str).collect();
        (!keys.is_empty()).then(|| keys.join(" or "))
    }
}

impl JointVariant {
    /// Returns the reason why this joint does not have the parameter `definition`.
    fn exclusion_reason(&self, definition: &ParameterDefinition) -> String {
        let name = &self.name;
        match (definition.axis, definition.motor) {
            (Some(AxisKind::Linear), _) if self.axis == AxisKind::Rotary => {
                format!("it is for linear axes, and {name}.type = rotary")
            }
            (Some(AxisKind::Rotary), _) if self.axis == AxisKind::Linear => {
                format!("it is for rotary axes, and {name}.type = linear")
            }
            (_, Some(MotorKind::Linear)) => format!(
                "it is for linear motors, and {name} has a rotary motor (a linear axis has a linear motor if \
                 {name}.transmission.direct = true)"
            ),
            _ => format!(
                "it is for rotary motors, and {name} has a linear motor, since {name}.transmission.direct = \
                 true"
            ),
        }
    }
}

/// Returns true for a parameter that each node of rclcpp may have and that has no effect on this node.
pub(super) fn is_rclcpp_parameter(key: &str) -> bool {
    key == "start_type_description_service" || key.starts_with("qos_overrides.")
}

/// Returns the definitions of axis parameters.
fn axis_definitions() -> impl Iterator<Item = &'static ParameterDefinition> {
    DEFINITIONS.iter().filter(|definition| definition.scope == Scope::Axis)
}

/// Returns the definitions of the axis parameter `key`, which depend on the types of axis and motor.
fn axis_definitions_of(key: &str) -> impl Iterator<Item = &'static ParameterDefinition> {
    definitions_of(key).filter(|definition| definition.scope == Scope::Axis)
}

/// Returns the one of the axis parameters `keys` that an axis of this type has.
pub(super) fn applicable_key<'a>(joint: &JointVariant, keys: &[&'a str]) -> &'a str {
    let applies = |key: &&&str| {
        axis_definitions_of(key).any(|definition| definition.applies_to(joint.axis, joint.motor))
    };
    keys.iter().find(applies).copied().unwrap_or_default()
}

/// Returns the definition of the machine or node parameter `key`.
pub(super) fn plain_definition(key: &str) -> Option<&'static ParameterDefinition> {
    definitions_of(key).find(|definition| definition.scope != Scope::Axis)
}

/// Returns the definitions with the key `key`, in the order of the schema.
fn definitions_of(key: &str) -> impl Iterator<Item = &'static ParameterDefinition> {
    static SORTED: LazyLock<Vec<&ParameterDefinition>> = LazyLock::new(|| {
        let mut sorted: Vec<&ParameterDefinition> = DEFINITIONS.iter().collect();
        sorted.sort_by_key(|definition| definition.key);
        sorted
    });
    let first = SORTED.partition_point(|definition| definition.key < key);
    SORTED[first..].iter().copied().take_while(move |definition| definition.key == key)
}

/// Returns the requirement that the joint name `name` violates, a verb phrase after "must".
pub(super) fn joint_name_violation(name: &str) -> Option<String> {
    let mut characters = name.chars();
    let valid = characters.next().is_some_and(|c| c.is_ascii_alphabetic())
        && characters.all(|c| c.is_ascii_alphanumeric() || c == '_');
    if !valid {
        return Some(format!(
            "contain names of letters, digits and _ that begin with a letter, found \"{}\"",
            shortened(name)
        ));
    }
    let is_reserved = DEFINITIONS
        .iter()
        .filter(|definition| definition.scope != Scope::Axis)
        .filter_map(|definition| definition.key.split('.').next())
        .chain(RESERVED.iter().copied())
        .any(|reserved| reserved == name);
    is_reserved.then(|| format!("not contain {name}, the name of a parameter"))
}
