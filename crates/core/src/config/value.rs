//! Parameter values of the types that ROS 2 parameters and YAML have.

use std::fmt;

use crate::text::shortened;
use crate::units::Rounded;

/// Value of a parameter.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// ROS parameter type `bool`.
    Bool(bool),
    /// ROS parameter type `integer`.
    Integer(i64),
    /// ROS parameter type `double`.
    Double(f64),
    /// ROS parameter type `string`.
    Text(String),
    /// ROS parameter type `bool_array`.
    BoolList(Vec<bool>),
    /// ROS parameter type `integer_array`.
    IntegerList(Vec<i64>),
    /// ROS parameter type `double_array`.
    DoubleList(Vec<f64>),
    /// ROS parameter type `string_array`.
    TextList(Vec<String>),
}

impl Value {
    /// Returns the value for messages: a number with at most six significant digits, or a shortened text.
    pub(super) fn rounded(&self) -> String {
        match self {
            Self::Double(value) => Rounded(*value).to_string(),
            other => shortened(&other.to_string()),
        }
    }

    /// Returns the numbers of a list of numbers or integers. An empty list of any type counts as a list of numbers.
    pub(super) fn numbers(&self) -> Option<Vec<f64>> {
        match self {
            Self::DoubleList(numbers) => Some(numbers.clone()),
            Self::IntegerList(integers) => Some(integers.iter().map(|integer| *integer as f64).collect()),
            // An empty list in YAML has no item type.
            Self::TextList(texts) if texts.is_empty() => Some(Vec::new()),
            Self::BoolList(flags) if flags.is_empty() => Some(Vec::new()),
            _ => None,
        }
    }

    /// Returns the value of a flag; of texts the words of YAML 1.1, which ROS reads: `yes`, `no`, `on`, `off`, `y`, `n`.
    pub(super) fn flag(&self) -> Option<bool> {
        match self {
            Self::Bool(flag) => Some(*flag),
            Self::Text(text) => match text.to_ascii_lowercase().as_str() {
                "y" | "yes" | "on" => Some(true),
                "n" | "no" | "off" => Some(false),
                _ => None,
            },
            _ => None,
        }
    }

    /// Returns type and value for a message: `text "abc"`.
    pub(super) fn described(&self) -> String {
        match self {
            Self::Bool(_) => format!("flag {self}"),
            Self::Integer(_) => format!("integer {self}"),
            Self::Double(_) => format!("number {self}"),
            Self::Text(text) => format!("text \"{}\"", shortened(text)),
            Self::BoolList(_) => format!("a list of flags {self}"),
            Self::IntegerList(_) => format!("a list of integers {self}"),
            Self::DoubleList(_) => format!("a list of numbers {self}"),
            Self::TextList(_) => format!("a list of texts {self}"),
        }
    }
}

impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Bool(value) => write!(f, "{value}"),
            Self::Integer(value) => write!(f, "{value}"),
            Self::Double(value) => f.write_str(&number_text(*value)),
            Self::Text(value) => f.write_str(&shortened(value)),
            Self::BoolList(values) => list_text(f, values.iter().map(bool::to_string)),
            Self::IntegerList(values) => list_text(f, values.iter().map(i64::to_string)),
            Self::DoubleList(values) => list_text(f, values.iter().map(|v| number_text(*v))),
            Self::TextList(values) => list_text(f, values.iter().cloned()),
        }
    }
}

fn list_text(f: &mut fmt::Formatter<'_>, items: impl Iterator<Item = String>) -> fmt::Result {
    let items: Vec<String> = items.collect();
    write!(f, "[{}]", shortened(&items.join(", ")))
}

/// Returns the shortest decimal text that reads back as the same number: `0.028`, `1e-9`, `1e3`.
pub(super) fn number_text(value: f64) -> String {
    let plain = format!("{value}");
    let exponent = format!("{value:e}");
    if exponent.len() < plain.len() { exponent } else { plain }
}
