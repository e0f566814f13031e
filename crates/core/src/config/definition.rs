//! What is known about one parameter, and the check of a value against it.

use super::error::{ConfigError, Source, shortened};
use super::machine::AxisKind;
use super::value::{Value, number_text};

/// Kind of a parameter's value, with what is allowed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kind {
    /// A finite number in the closed range `min..=max`.
    Number {
        /// Smallest allowed value.
        min: f64,
        /// Largest allowed value.
        max: f64,
    },
    /// An integer in the closed range `min..=max`.
    Integer {
        /// Smallest allowed value.
        min: i64,
        /// Largest allowed value.
        max: i64,
    },
    /// `true` or `false`.
    Flag,
    /// Any text.
    Text,
    /// One of these texts.
    Choice(&'static [&'static str]),
    /// A list of texts.
    TextList,
    /// A list of finite numbers.
    NumberList {
        /// Fewest numbers.
        min_len: usize,
        /// Most numbers.
        max_len: usize,
    },
}

/// A default value that can stand in a constant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum DefaultValue {
    /// For [`Kind::Number`].
    Number(f64),
    /// For [`Kind::Integer`].
    Integer(i64),
    /// For [`Kind::Flag`].
    Flag(bool),
    /// For [`Kind::Text`] and [`Kind::Choice`].
    Text(&'static str),
}

impl From<DefaultValue> for Value {
    fn from(value: DefaultValue) -> Self {
        match value {
            DefaultValue::Number(value) => Value::Double(value),
            DefaultValue::Integer(value) => Value::Integer(value),
            DefaultValue::Flag(value) => Value::Bool(value),
            DefaultValue::Text(value) => Value::Text(value.to_owned()),
        }
    }
}

/// What happens when a parameter is left out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Presence {
    /// The machine is refused.
    Required,
    /// It has no value; the description says what that means.
    Optional,
    /// It has this value.
    Default(DefaultValue),
}

/// To whom a parameter belongs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scope {
    /// The machine; the key stands as it is.
    Machine,
    /// Each axis; the key stands behind the name of the joint and a dot.
    Axis,
    /// The node; the key stands as it is.
    Node,
}

/// Kind of motor that drives an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MotorKind {
    /// Torque, inertia, rad.
    Rotating,
    /// Force, mass, m: a linear axis with `transmission.direct`.
    Linear,
}

/// One row of the schema.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Definition {
    /// Key, for an axis without the name of the joint: `motor.inertia_kg_m2`.
    pub key: &'static str,
    /// Unit as text; empty where there is none.
    pub unit: &'static str,
    /// Kind and range.
    pub kind: Kind,
    /// Default, or whether it can be left out.
    pub presence: Presence,
    /// Whether it can be set while the axes run.
    pub live: bool,
    /// Machine, axis or node.
    pub scope: Scope,
    /// The kind of axis that has it; `None`: both.
    pub axis: Option<AxisKind>,
    /// The kind of motor that has it; `None`: both.
    pub motor: Option<MotorKind>,
    /// One sentence.
    pub description: &'static str,
}

impl Definition {
    /// What is allowed, as a verb phrase after "must": `lie in 1e-9 … 1e3 kg·m²`.
    pub fn allowed(&self) -> String {
        match self.kind {
            Kind::Flag => "be true or false".to_owned(),
            Kind::Text => "be a text".to_owned(),
            Kind::TextList => "be a list of texts".to_owned(),
            Kind::Choice(choices) => format!("be {}", choices.join(" or ")),
            Kind::NumberList { min_len, max_len } => {
                format!("be a list of {min_len} … {max_len} finite numbers")
            }
            Kind::Number { .. } | Kind::Integer { .. } => format!("lie in {}", self.range()),
        }
    }

    /// The range with its unit, or the choices: `1e-9 … 1e3 kg·m²`, `real, fast`, `1 … 32 numbers in s⁻¹`.
    pub fn range(&self) -> String {
        let (min, max) = match self.kind {
            Kind::Number { min, max } => (number_text(min), number_text(max)),
            Kind::Integer { min, max } => (min.to_string(), max.to_string()),
            Kind::Flag => return "true, false".to_owned(),
            Kind::Text => return "text".to_owned(),
            Kind::TextList => return "list of texts".to_owned(),
            Kind::Choice(choices) => return choices.join(", "),
            Kind::NumberList { min_len, max_len } if self.unit.is_empty() => {
                return format!("{min_len} … {max_len} numbers");
            }
            Kind::NumberList { min_len, max_len } => {
                return format!("{min_len} … {max_len} numbers in {}", self.unit);
            }
        };
        if self.unit.is_empty() {
            format!("{min} … {max}")
        } else {
            format!("{min} … {max} {}", self.unit)
        }
    }

    /// The default as a value.
    pub fn default_value(&self) -> Option<Value> {
        match self.presence {
            Presence::Default(value) => Some(value.into()),
            Presence::Required | Presence::Optional => None,
        }
    }

    /// What a missing parameter would be: description, and unit where there is one.
    pub(super) fn wanted(&self) -> String {
        format!("{} ({})", self.description.trim_end_matches('.'), self.range())
    }

    /// Whether an axis of these kinds has the parameter.
    pub fn applies_to(&self, axis: AxisKind, motor: MotorKind) -> bool {
        self.axis.is_none_or(|wanted| wanted == axis) && self.motor.is_none_or(|wanted| wanted == motor)
    }

    /// `value` as this parameter holds it (an integer becomes a number where one is wanted).
    ///
    /// # Errors
    ///
    /// [`ConfigError::WrongKind`] and [`ConfigError::NotAllowed`], with `key` and `at`.
    pub(super) fn checked(&self, key: &str, value: &Value, at: &Source) -> Result<Value, ConfigError> {
        let kept = match (self.kind, value) {
            (Kind::Number { min, max }, Value::Double(_) | Value::Integer(_)) => {
                let number = match value {
                    Value::Integer(integer) => *integer as f64,
                    Value::Double(number) => *number,
                    _ => f64::NAN,
                };
                // NaN lies in no range.
                (min..=max).contains(&number).then_some(Value::Double(number))
            }
            (Kind::Integer { min, max }, Value::Integer(integer)) => {
                (min..=max).contains(integer).then_some(Value::Integer(*integer))
            }
            (Kind::Choice(choices), Value::Text(text)) => {
                choices.contains(&text.as_str()).then(|| value.clone())
            }
            (Kind::NumberList { min_len, max_len }, list) if list.numbers().is_some() => list
                .numbers()
                .filter(|numbers| {
                    (min_len..=max_len).contains(&numbers.len()) && numbers.iter().all(|n| n.is_finite())
                })
                .map(Value::DoubleList),
            (Kind::Flag, Value::Bool(_))
            | (Kind::Text, Value::Text(_))
            | (Kind::TextList, Value::TextList(_)) => Some(value.clone()),
            _ => {
                return Err(ConfigError::WrongKind {
                    at: at.clone(),
                    key: shortened(key),
                    found: value.described(),
                    wanted: self.wanted_kind(),
                });
            }
        };
        kept.ok_or_else(|| ConfigError::NotAllowed {
            at: at.clone(),
            key: shortened(key),
            value: shortened(&value.to_string()),
            allowed: self.allowed(),
        })
    }

    fn wanted_kind(&self) -> String {
        match self.kind {
            Kind::Number { .. } => "number".to_owned(),
            Kind::Integer { .. } => "integer".to_owned(),
            Kind::Flag => "true or false".to_owned(),
            // A bare 12 or true is no text in YAML.
            Kind::Text => "text (in quotation marks)".to_owned(),
            Kind::Choice(choices) => choices.join(" or "),
            Kind::TextList => "list of texts".to_owned(),
            Kind::NumberList { .. } => "list of numbers".to_owned(),
        }
    }
}

/// Builders for the constant table: each returns the definition with one thing changed.
impl Definition {
    /// A required machine key that is not live.
    pub(super) const fn new(key: &'static str, unit: &'static str, kind: Kind) -> Self {
        Self {
            key,
            unit,
            kind,
            presence: Presence::Required,
            live: false,
            scope: Scope::Machine,
            axis: None,
            motor: None,
            description: "",
        }
    }

    pub(super) const fn number(key: &'static str, unit: &'static str, min: f64, max: f64) -> Self {
        Self::new(key, unit, Kind::Number { min, max })
    }

    pub(super) const fn of_axis(mut self) -> Self {
        self.scope = Scope::Axis;
        self
    }

    pub(super) const fn of_node(mut self) -> Self {
        self.scope = Scope::Node;
        self
    }

    pub(super) const fn on(mut self, axis: AxisKind) -> Self {
        self.axis = Some(axis);
        self.of_axis()
    }

    pub(super) const fn driven_by(mut self, motor: MotorKind) -> Self {
        self.motor = Some(motor);
        self.of_axis()
    }

    pub(super) const fn optional(mut self) -> Self {
        self.presence = Presence::Optional;
        self
    }

    pub(super) const fn default(mut self, value: DefaultValue) -> Self {
        self.presence = Presence::Default(value);
        self
    }

    pub(super) const fn live(mut self) -> Self {
        self.live = true;
        self
    }

    pub(super) const fn is(mut self, description: &'static str) -> Self {
        self.description = description;
        self
    }
}
