//! Which parameters a machine with given joints has, and what an unknown key was meant to be.

use super::definition::{Definition, MotorKind, Scope};
use super::error::{ConfigError, Source, shortened};
use super::machine::AxisKind;
use super::schema::DEFINITIONS;

/// First parts of names in ROS parameter files that are in no row of the schema, and no joint's either.
const RESERVED: &[&str] = &["qos_overrides", "ros__parameters"];
/// Similarity (Jaro-Winkler) below which a known key is no help.
const NEAR_ENOUGH: f64 = 0.7;
/// Longest key for which a similar one is looked up, characters.
const KEY_LENGTH: usize = 120;

/// One joint and what decides about its parameters.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Joint {
    pub name: String,
    pub axis: AxisKind,
    pub motor: MotorKind,
}

/// The joints of a machine, in order.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct Layout {
    pub joints: Vec<Joint>,
}

impl Layout {
    /// Every parameter of this machine with its full key: machine, axes, node.
    pub fn definitions(&self) -> impl Iterator<Item = (String, &'static Definition)> + '_ {
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

    /// The definition of the full key `key` on this machine.
    pub fn find(&self, key: &str, at: &Source) -> Result<&'static Definition, ConfigError> {
        if let Some(definition) = plain_definition(key) {
            return Ok(definition);
        }
        self.check_name(key, at)?;
        let found = key.split_once('.').and_then(|(name, suffix)| {
            let joint = self.joints.iter().find(|joint| joint.name == name)?;
            Some((joint, suffix))
        });
        let Some((joint, suffix)) = found else {
            return Err(self.unknown(key, at));
        };
        let candidates = || axis_definitions().filter(|definition| definition.key == suffix);
        candidates().find(|definition| definition.applies_to(joint.axis, joint.motor)).ok_or_else(|| {
            match candidates().next() {
                Some(definition) => ConfigError::NotApplicable {
                    at: at.clone(),
                    key: key.to_owned(),
                    reason: joint.why_not(definition),
                },
                None => self.unknown(key, at),
            }
        })
    }

    /// Refuses a key that no machine with these joints, of whatever type, can have.
    pub fn check_name(&self, key: &str, at: &Source) -> Result<(), ConfigError> {
        let known = plain_definition(key).is_some()
            || key.split_once('.').is_some_and(|(name, suffix)| {
                self.joints.iter().any(|joint| joint.name == name)
                    && axis_definitions().any(|definition| definition.key == suffix)
            });
        if known {
            return Ok(());
        }
        let other_joint = key
            .split_once('.')
            .filter(|(_, suffix)| axis_definitions().any(|definition| definition.key == *suffix));
        match other_joint {
            Some((name, _)) if !self.joints.is_empty() => Err(ConfigError::NotApplicable {
                at: at.clone(),
                key: shortened(key),
                reason: format!("there is no joint {}; joints = {}", shortened(name), self.names()),
            }),
            _ => Err(self.unknown(key, at)),
        }
    }

    fn names(&self) -> String {
        let names: Vec<&str> = self.joints.iter().map(|joint| joint.name.as_str()).collect();
        format!("[{}]", names.join(", "))
    }

    fn unknown(&self, key: &str, at: &Source) -> ConfigError {
        let nearest = (key.chars().count() <= KEY_LENGTH)
            .then(|| {
                self.definitions()
                    .map(|(known, _)| (strsim::damerau_levenshtein(key, &known), known))
                    .min_by_key(|(distance, _)| *distance)
            })
            .flatten()
            .filter(|(_, known)| strsim::jaro_winkler(key, known) >= NEAR_ENOUGH);
        ConfigError::UnknownKey {
            at: at.clone(),
            key: shortened(key),
            nearest: nearest.map(|(_, known)| known),
        }
    }
}

impl Joint {
    /// Why this joint has no parameter `definition`.
    fn why_not(&self, definition: &Definition) -> String {
        let name = &self.name;
        match (definition.axis, definition.motor) {
            (Some(AxisKind::Linear), _) if self.axis == AxisKind::Rotary => {
                format!("it is for linear axes, and {name}.type = rotary")
            }
            (Some(AxisKind::Rotary), _) if self.axis == AxisKind::Linear => {
                format!("it is for rotary axes, and {name}.type = linear")
            }
            (_, Some(MotorKind::Linear)) => format!(
                "it is for linear motors; {name} has a rotating one (a linear axis has a linear \
                 motor where {name}.transmission.direct = true)"
            ),
            _ => format!(
                "it is for rotating motors, and {name}.transmission.direct = true makes {name} a \
                 linear motor"
            ),
        }
    }
}

/// Definitions that stand behind a joint's name.
fn axis_definitions() -> impl Iterator<Item = &'static Definition> {
    DEFINITIONS.iter().filter(|definition| definition.scope == Scope::Axis)
}

/// The machine's or node's definition of that key.
pub(super) fn plain_definition(key: &str) -> Option<&'static Definition> {
    DEFINITIONS.iter().find(|definition| definition.scope != Scope::Axis && definition.key == key)
}

/// What `joints` must do for `name` to be in it, when it is not allowed.
pub(super) fn refused_joint_name(name: &str) -> Option<String> {
    let mut characters = name.chars();
    let valid = characters.next().is_some_and(|c| c.is_ascii_alphabetic())
        && characters.all(|c| c.is_ascii_alphanumeric() || c == '_');
    if !valid {
        return Some(format!(
            "hold names of letters, digits and _ that begin with a letter, not \"{}\"",
            shortened(name)
        ));
    }
    let taken = DEFINITIONS
        .iter()
        .filter(|definition| definition.scope != Scope::Axis)
        .filter_map(|definition| definition.key.split('.').next())
        .chain(RESERVED.iter().copied())
        .any(|taken| taken == name);
    taken.then(|| format!("not hold {name}, the name of another parameter"))
}
