//! YAML as a tree with line numbers.

use std::fmt;

use serde::de::{self, Deserialize, Deserializer, MapAccess, SeqAccess, Visitor};
use serde_saphyr::{NonFiniteFloatPolicy, Spanned};

use super::error::{ConfigError, Source, shortened};
use super::value::Value;

/// Reads one YAML document; a key that stands twice in one mapping is refused.
pub(super) fn parse(text: &str, source: &Source) -> Result<Spanned<Node>, ConfigError> {
    let options = serde_saphyr::options! {
        // In YAML 1.1 `y` is true; here it is the name of an axis.
        strict_booleans: true,
        // Let through, to be refused together with the key.
        non_finite_float_policy: NonFiniteFloatPolicy::PassThrough,
        with_snippet: false,
    };
    serde_saphyr::from_str_with_options(text, options).map_err(|error| ConfigError::Syntax {
        at: source.at_line(error.location().map_or(0, |location| location.line())),
        message: syntax_message(error.without_snippet()),
    })
}

/// What the YAML reader says, without the position, which stands before the message.
fn syntax_message(error: &serde_saphyr::Error) -> String {
    if let serde_saphyr::Error::DuplicateMappingKey { key, .. } = error {
        let key = key.as_deref().unwrap_or("a key");
        return format!("{} stands twice in one mapping", shortened(key));
    }
    if let serde_saphyr::Error::MultipleDocuments { .. } = error {
        return "a second YAML document begins; a file of parameters is one".to_owned();
    }
    let text = error.to_string();
    let message = text.rsplit_once(" at line ").map_or(text.as_str(), |(message, _)| message);
    format!("not YAML: {}", shortened(message))
}

/// A YAML value as far as parameters need it.
pub(super) enum Node {
    /// Nothing behind the key.
    Null,
    /// What a ROS parameter can hold.
    Scalar(Value),
    /// Keys and values in their order.
    Map(Vec<(Spanned<String>, Spanned<Node>)>),
    /// A list that no ROS parameter can hold.
    MixedList,
}

impl Node {
    /// What it is, for a message.
    pub fn described(&self) -> &'static str {
        match self {
            Self::Null => "nothing",
            Self::Scalar(_) => "a value",
            Self::Map(_) => "a mapping",
            Self::MixedList => "a list of unlike or nested items",
        }
    }
}

impl<'de> Deserialize<'de> for Node {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(NodeVisitor)
    }
}

struct NodeVisitor;

impl<'de> Visitor<'de> for NodeVisitor {
    type Value = Node;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("a parameter, a list or a mapping")
    }

    fn visit_unit<E>(self) -> Result<Node, E> {
        Ok(Node::Null)
    }

    fn visit_bool<E>(self, value: bool) -> Result<Node, E> {
        Ok(Node::Scalar(Value::Bool(value)))
    }

    fn visit_i64<E>(self, value: i64) -> Result<Node, E> {
        Ok(Node::Scalar(Value::Integer(value)))
    }

    fn visit_u64<E: de::Error>(self, value: u64) -> Result<Node, E> {
        match i64::try_from(value) {
            Ok(value) => self.visit_i64(value),
            Err(_) => Err(E::custom(format!("{value} is too large for an integer"))),
        }
    }

    fn visit_f64<E>(self, value: f64) -> Result<Node, E> {
        Ok(Node::Scalar(Value::Double(value)))
    }

    fn visit_str<E>(self, value: &str) -> Result<Node, E> {
        Ok(Node::Scalar(Value::Text(value.to_owned())))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<Node, A::Error> {
        let mut values = Vec::new();
        let mut scalars = true;
        while let Some(item) = items.next_element::<Node>()? {
            match item {
                Node::Scalar(value) => values.push(value),
                _ => scalars = false,
            }
        }
        let list = if scalars { list_of(&values) } else { None };
        Ok(list.map_or(Node::MixedList, Node::Scalar))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Node, A::Error> {
        let mut entries = Vec::new();
        while let Some(entry) = map.next_entry()? {
            entries.push(entry);
        }
        Ok(Node::Map(entries))
    }
}

/// A list of like values; integers beside numbers count as numbers, an empty list as one of texts.
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
