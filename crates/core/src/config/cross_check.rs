//! Checks of parameters against each other: values, defaults and errors that all checks share.

use super::declaration::{Entries, JointVariant};
use super::error::{ConfigError, ValueSource};
use super::layout::{ParameterLayout, applicable_key};
use super::value::Value;

/// Parameters whose values are checked, and the origin that errors about missing keys name.
pub(super) struct CrossChecks<'a> {
    pub entries: &'a Entries,
    pub changed: &'a [String],
    pub layout: &'a ParameterLayout,
    pub origin: &'a ValueSource,
}

impl CrossChecks<'_> {
    /// Returns an error for the one of `keys` that was set last.
    pub fn rejection(&self, keys: &[&str], allowed: String) -> ConfigError {
        let set = |key: &&&str| self.entries.contains_key(**key);
        let newest = keys.iter().filter(set).max_by_key(|key| {
            self.changed.iter().rposition(|changed| changed == **key).map_or(0, |position| position + 1)
        });
        let key = newest.or(keys.first()).copied().unwrap_or_default();
        match self.entries.get(key) {
            Some(entry) => ConfigError::not_allowed(&entry.source, key, &entry.value.to_string(), &allowed),
            None => ConfigError::missing(&ValueSource::named("parameters"), key, &allowed),
        }
    }

    /// Returns the value or default of `key`.
    pub fn value(&self, key: &str) -> Option<Value> {
        match self.entries.get(key) {
            Some(entry) => Some(entry.value.clone()),
            None => self.layout.find(key, &ValueSource::named("")).ok()?.default_value(),
        }
    }

    /// Returns the value or default of `key` as a number.
    pub fn number(&self, key: &str) -> Option<f64> {
        match self.value(key)? {
            Value::Double(number) => Some(number),
            Value::Integer(integer) => Some(integer as f64),
            _ => None,
        }
    }

    /// Returns true if `key` has a list or a number that is not 0.
    pub fn is_given(&self, key: &str) -> bool {
        match self.value(key) {
            Some(Value::TextList(_)) => true,
            Some(Value::Double(number)) => number != 0.0,
            Some(Value::Integer(integer)) => integer != 0,
            _ => false,
        }
    }

    /// Returns true if the choice `key` has the value `name`.
    pub fn is_chosen(&self, key: &str, name: &str) -> bool {
        matches!(self.value(key), Some(Value::Text(text)) if text == name)
    }

    /// Rejects the parameter `beside` without `key`, of which `condition` is expected.
    pub fn require(&self, key: &str, condition: &str, beside: &str) -> Result<(), ConfigError> {
        match self.is_given(beside) && !self.is_given(key) {
            true => {
                let wanted = format!("expected {condition} beside {beside}");
                Err(ConfigError::missing(self.origin, key, &wanted))
            }
            false => Ok(()),
        }
    }

    /// Rejects two parameters together, for `reason`.
    pub fn exclude(&self, keys: [&str; 2], reason: &str) -> Result<(), ConfigError> {
        match keys.iter().all(|key| self.is_given(key)) {
            true => {
                let [first, second] = keys;
                Err(self.rejection(&keys, format!("not be given together: {first} and {second}{reason}")))
            }
            false => Ok(()),
        }
    }
}

impl JointVariant {
    /// Returns the full key of the one of the parameters `suffixes` that this type of axis has.
    pub(super) fn key(&self, suffixes: &[&str]) -> String {
        format!("{}.{}", self.name, applicable_key(self, suffixes))
    }
}
