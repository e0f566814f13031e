//! YAML tree with line numbers.

use std::fmt;

use serde::de::{Deserialize, Deserializer, MapAccess, SeqAccess, Visitor};
use serde_saphyr::Spanned;

use super::error::{ConfigError, ValueSource};
use super::value::Value;
use crate::yaml::{self, YamlError};

/// Reads one YAML document; its mappings may repeat keys.
pub(super) fn parse(text: &str, source: &ValueSource) -> Result<Spanned<YamlNode>, ConfigError> {
    yaml::document_with_repeated_keys(text).map_err(|error| invalid(&error, source))
}

/// Reads all YAML documents of a text; their mappings may repeat keys.
pub(super) fn parse_documents(
    text: &str,
    source: &ValueSource,
) -> Result<Vec<Spanned<YamlNode>>, ConfigError> {
    yaml::documents_with_repeated_keys(text).map_err(|error| invalid(&error, source))
}

fn invalid(YamlError { line, reason }: &YamlError, source: &ValueSource) -> ConfigError {
    ConfigError::at(&source.at_line(*line), format_args!("invalid YAML: {reason}"))
}

/// Node of a YAML tree with the node types that parameter files use.
pub(super) enum YamlNode {
    /// Key without a value.
    Null,
    /// Value of a ROS parameter type.
    Scalar(Value),
    /// Mapping, in the order of the file.
    Map(Vec<(Spanned<String>, Spanned<YamlNode>)>),
    /// List with mixed types or nested items, which is not a ROS parameter type.
    MixedList,
}

impl YamlNode {
    /// Returns a noun for messages.
    pub fn described(&self) -> &'static str {
        match self {
            Self::Null => "nothing",
            Self::Scalar(_) => "a value",
            Self::Map(_) => "a mapping",
            Self::MixedList => "a list with mixed types or nested items",
        }
    }
}

impl<'de> Deserialize<'de> for YamlNode {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(NodeVisitor)
    }
}

struct NodeVisitor;

impl<'de> Visitor<'de> for NodeVisitor {
    type Value = YamlNode;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("a parameter, a list or a mapping")
    }

    fn visit_unit<E>(self) -> Result<YamlNode, E> {
        Ok(YamlNode::Null)
    }

    fn visit_bool<E>(self, value: bool) -> Result<YamlNode, E> {
        Ok(YamlNode::Scalar(Value::Bool(value)))
    }

    fn visit_i64<E>(self, value: i64) -> Result<YamlNode, E> {
        Ok(YamlNode::Scalar(Value::Integer(value)))
    }

    fn visit_u64<E>(self, value: u64) -> Result<YamlNode, E> {
        match i64::try_from(value) {
            Ok(value) => Ok(YamlNode::Scalar(Value::Integer(value))),
            // As in rcl.
            Err(_) => Ok(YamlNode::Scalar(Value::Double(value as f64))),
        }
    }

    fn visit_f64<E>(self, value: f64) -> Result<YamlNode, E> {
        Ok(YamlNode::Scalar(Value::Double(value)))
    }

    fn visit_str<E>(self, value: &str) -> Result<YamlNode, E> {
        Ok(YamlNode::Scalar(Value::Text(value.to_owned())))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<YamlNode, A::Error> {
        let mut values = Vec::new();
        let mut scalars = true;
        while let Some(item) = items.next_element::<YamlNode>()? {
            match item {
                YamlNode::Scalar(value) => values.push(value),
                _ => scalars = false,
            }
        }
        let list = if scalars { list_of(&values) } else { None };
        Ok(list.map_or(YamlNode::MixedList, YamlNode::Scalar))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<YamlNode, A::Error> {
        let mut entries = Vec::new();
        while let Some(entry) = map.next_entry()? {
            entries.push(entry);
        }
        Ok(YamlNode::Map(entries))
    }
}

/// Returns the typed list of `values`, none for mixed types. Integers mixed with numbers become numbers; an empty list is
/// a list of texts.
fn list_of(values: &[Value]) -> Option<Value> {
    fn all<T>(values: &[Value], take: impl Fn(&Value) -> Option<T>) -> Option<Vec<T>> {
        values.iter().map(take).collect()
    }
    let texts = all(values, |value| match value {
        Value::Text(text) => Some(text.clone()),
        _ => None,
    });
    let bools = all(values, |value| match value {
        Value::Bool(flag) => Some(*flag),
        _ => None,
    });
    let integers = all(values, |value| match value {
        Value::Integer(integer) => Some(*integer),
        _ => None,
    });
    let doubles = all(values, |value| match value {
        Value::Integer(integer) => Some(*integer as f64),
        Value::Double(number) => Some(*number),
        _ => None,
    });
    texts
        .map(Value::TextList)
        .or(bools.map(Value::BoolList))
        .or(integers.map(Value::IntegerList))
        .or(doubles.map(Value::DoubleList))
}
