//! Definition of a parameter: type, range, default, owner and description, and the check of a value.

use super::error::{ConfigError, ValueSource};
use super::value::{Value, number_text};

/// Type of a parameter and its allowed values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ParameterKind {
    /// Finite number in the closed range `min..=max`.
    Number {
        /// Minimum.
        min: f64,
        /// Maximum.
        max: f64,
    },
    /// Integer in the closed range `min..=max`.
    Integer {
        /// Minimum.
        min: i64,
        /// Maximum.
        max: i64,
    },
    /// Boolean, `true` or `false`.
    Flag,
    /// Any text.
    Text,
    /// Choice among texts.
    Choice(&'static [&'static str]),
    /// List of texts.
    TextList,
    /// List of finite numbers.
    NumberList {
        /// Minimum length.
        min_len: usize,
        /// Maximum length.
        max_len: usize,
    },
}

/// Default value in the constant schema table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum DefaultValue {
    /// Default of a [`ParameterKind::Number`].
    Number(f64),
    /// Default of a [`ParameterKind::Integer`].
    Integer(i64),
    /// Default of a [`ParameterKind::Flag`].
    Flag(bool),
    /// Default of a [`ParameterKind::Text`] or [`ParameterKind::Choice`].
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

/// Handling of an omitted parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Presence {
    /// The machine is rejected without it.
    Required,
    /// It has no value; the description states the effect.
    Optional,
    /// It has this default.
    Default(DefaultValue),
}

/// Owner of a parameter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scope {
    /// Machine; the key has no prefix.
    Machine,
    /// Axis; the key is prefixed with the joint name and a dot.
    Axis,
    /// Node; the key has no prefix.
    Node,
}

crate::named_values! {
    /// Type of an axis.
    pub enum AxisKind {
        /// Linear axis, position in m.
        Linear = "linear",
        /// Rotary axis, position in rad.
        Rotary = "rotary",
    }
}

/// Type of the motor of an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MotorKind {
    /// Rotary motor: torque, inertia, rad.
    Rotary,
    /// Linear motor: force, mass, m; on linear axes with `transmission.direct`.
    Linear,
}

/// Definition of a parameter: one row of the schema.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ParameterDefinition {
    /// Key; for axis parameters without the joint name: `motor.inertia_kg_m2`.
    pub key: &'static str,
    /// Unit, empty if dimensionless.
    pub unit: &'static str,
    /// Value in SI units (times in nanoseconds) of a value of 1.
    pub(super) si: f64,
    /// Type and range.
    pub kind: ParameterKind,
    /// Required, optional or default.
    pub presence: Presence,
    /// True if settable at run time.
    pub is_live: bool,
    /// Owner.
    pub scope: Scope,
    /// Type of axis that has the parameter; `None` for both types.
    pub axis: Option<AxisKind>,
    /// Type of motor that has the parameter; `None` for both types.
    pub motor: Option<MotorKind>,
    /// Description, one sentence.
    pub description: &'static str,
}

impl ParameterDefinition {
    /// Returns the allowed values as a verb phrase after "must": `lie in 1e-9 … 1e3 kg·m²`.
    pub fn allowed(&self) -> String {
        match self.kind {
            ParameterKind::Flag => "be true or false".to_owned(),
            ParameterKind::Text => "be a text".to_owned(),
            ParameterKind::TextList => "be a list of texts".to_owned(),
            ParameterKind::Choice(choices) => format!("be {}", choices.join(" or ")),
            ParameterKind::NumberList { min_len, max_len } => {
                format!("be a list of {min_len} … {max_len} finite numbers")
            }
            ParameterKind::Number { .. } | ParameterKind::Integer { .. } => {
                format!("lie in {}", self.range())
            }
        }
    }

    /// Returns the range with its unit, or the choices: `1e-9 … 1e3 kg·m²`, `real, fast`, `1 … 32 numbers in s⁻¹`.
    pub fn range(&self) -> String {
        let (min, max) = match self.kind {
            ParameterKind::Number { min, max } => (number_text(min), number_text(max)),
            ParameterKind::Integer { min, max } => (min.to_string(), max.to_string()),
            ParameterKind::Flag => return "true, false".to_owned(),
            ParameterKind::Text => return "text".to_owned(),
            ParameterKind::TextList => return "list of texts".to_owned(),
            ParameterKind::Choice(choices) => return choices.join(", "),
            ParameterKind::NumberList { min_len, max_len } if self.unit.is_empty() => {
                return format!("{min_len} … {max_len} numbers");
            }
            ParameterKind::NumberList { min_len, max_len } => {
                return format!("{min_len} … {max_len} numbers in {}", self.unit);
            }
        };
        if self.unit.is_empty() {
            format!("{min} … {max}")
        } else {
            format!("{min} … {max} {}", self.unit)
        }
    }

    /// Returns the default value.
    pub fn default_value(&self) -> Option<Value> {
        match self.presence {
            Presence::Default(value) => Some(value.into()),
            Presence::Required | Presence::Optional => None,
        }
    }

    /// Returns description and range, for messages about a missing parameter.
    pub(super) fn description_with_range(&self) -> String {
        format!("{} ({})", self.description.trim_end_matches('.'), self.range())
    }

    /// Returns true if an axis of these types has the parameter.
    pub fn applies_to(&self, axis: AxisKind, motor: MotorKind) -> bool {
        self.axis.is_none_or(|own| own == axis) && self.motor.is_none_or(|own| own == motor)
    }

    /// Checks `value` and returns it in the type of this parameter: an integer for a number parameter becomes a number.
    ///
    /// # Errors
    ///
    /// [`ConfigError`] for a value of another type or out of range.
    pub(super) fn checked(&self, key: &str, value: &Value, at: &ValueSource) -> Result<Value, ConfigError> {
        let checked = match (self.kind, value) {
            (ParameterKind::Number { min, max }, Value::Double(_) | Value::Integer(_)) => {
                let number = match value {
                    Value::Integer(integer) => *integer as f64,
                    Value::Double(number) => *number,
                    _ => f64::NAN,
                };
                // NaN is in no range.
                (min..=max).contains(&number).then_some(Value::Double(number))
            }
            (ParameterKind::Integer { min, max }, Value::Integer(integer)) => {
                (min..=max).contains(integer).then_some(Value::Integer(*integer))
            }
            (ParameterKind::Choice(choices), Value::Text(text)) => {
                choices.contains(&text.as_str()).then(|| value.clone())
            }
            (ParameterKind::NumberList { min_len, max_len }, list) if list.numbers().is_some() => list
                .numbers()
                .filter(|numbers| {
                    (min_len..=max_len).contains(&numbers.len()) && numbers.iter().all(|n| n.is_finite())
                })
                .map(Value::DoubleList),
            (ParameterKind::Flag, flag) if flag.flag().is_some() => flag.flag().map(Value::Bool),
            (ParameterKind::Text, Value::Text(_)) | (ParameterKind::TextList, Value::TextList(_)) => {
                Some(value.clone())
            }
            _ => {
                return Err(ConfigError::wrong_type(at, key, &value.described(), &self.expected_type()));
            }
        };
        checked.ok_or_else(|| ConfigError::not_allowed(at, key, &value.rounded(), &self.allowed()))
    }

    fn expected_type(&self) -> String {
        match self.kind {
            ParameterKind::Number { .. } => "number".to_owned(),
            ParameterKind::Integer { .. } => "integer".to_owned(),
            ParameterKind::Flag => "true or false".to_owned(),
            // Without quotation marks, 12 and true are not texts in YAML.
            ParameterKind::Text => "text (in quotation marks)".to_owned(),
            ParameterKind::Choice(choices) => choices.join(" or "),
            ParameterKind::TextList => "list of texts".to_owned(),
            ParameterKind::NumberList { .. } => "list of numbers".to_owned(),
        }
    }
}

/// Defines a required parameter.
const fn parameter(key: &'static str, unit: &'static str, kind: ParameterKind) -> ParameterDefinition {
    ParameterDefinition {
        key,
        unit,
        si: 1.0,
        kind,
        presence: Presence::Required,
        is_live: false,
        scope: Scope::Machine,
        axis: None,
        motor: None,
        description: "",
    }
}

/// Defines a number in the closed range `min..=max`.
pub(super) const fn number(key: &'static str, unit: &'static str, min: f64, max: f64) -> ParameterDefinition {
    parameter(key, unit, ParameterKind::Number { min, max })
}

/// Defines a list of 1 to `max_len` numbers.
pub(super) const fn numbers(key: &'static str, unit: &'static str, max_len: usize) -> ParameterDefinition {
    parameter(key, unit, ParameterKind::NumberList { min_len: 1, max_len })
}

/// Defines an integer in the closed range `min..=max`.
pub(super) const fn integer(
    key: &'static str,
    unit: &'static str,
    min: i64,
    max: i64,
) -> ParameterDefinition {
    parameter(key, unit, ParameterKind::Integer { min, max })
}

/// Defines a flag.
pub(super) const fn flag(key: &'static str) -> ParameterDefinition {
    parameter(key, "", ParameterKind::Flag)
}

/// Defines a text.
pub(super) const fn text(key: &'static str) -> ParameterDefinition {
    parameter(key, "", ParameterKind::Text)
}

/// Defines a list of texts.
pub(super) const fn texts(key: &'static str) -> ParameterDefinition {
    parameter(key, "", ParameterKind::TextList)
}

/// Defines a choice among texts.
pub(super) const fn choice(key: &'static str, choices: &'static [&'static str]) -> ParameterDefinition {
    parameter(key, "", ParameterKind::Choice(choices))
}

/// Builder methods of definitions; each changes one property.
impl ParameterDefinition {
    /// Sets the value in SI units of a value of 1.
    pub(super) const fn si(mut self, si: f64) -> Self {
        self.si = si;
        self
    }

    /// Restricts the parameter to a type of axis.
    pub(super) const fn on(mut self, axis: AxisKind) -> Self {
        self.axis = Some(axis);
        self
    }

    /// Restricts the parameter to a type of motor.
    pub(super) const fn driven_by(mut self, motor: MotorKind) -> Self {
        self.motor = Some(motor);
        self
    }

    pub(super) const fn optional(mut self) -> Self {
        self.presence = Presence::Optional;
        self
    }

    pub(super) const fn default(mut self, value: DefaultValue) -> Self {
        self.presence = Presence::Default(value);
        self
    }

    /// Sets the default 0.
    pub(super) const fn zero(self) -> Self {
        self.default(DefaultValue::Number(0.0))
    }

    /// Makes the parameter settable at run time.
    pub(super) const fn live(mut self) -> Self {
        self.is_live = true;
        self
    }

    /// Sets owner and description.
    pub(super) const fn described(mut self, scope: Scope, description: &'static str) -> Self {
        self.scope = scope;
        self.description = description.trim_ascii_start();
        self
    }
}
