//! Declaration of parameters: rows of the schema, fields of the typed configuration and their reading, in one place.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::slice;
use std::str::FromStr;

use super::definition::{AxisKind, MotorKind, ParameterDefinition, Presence};
use super::error::ValueSource;
use super::value::Value;

/// Defines a structure of the typed configuration with the parameters that fill it.
///
/// The doc comment of a field is the description of its parameter. A parameter whose unit depends on the type of axis or
/// motor has a definition for each, separated by commas; a field of several values has one for each value. A field without
/// a definition is a structure of parameters itself. A function behind `=>` reads a field in place of [`Field::read`], and
/// `use` adds parameters that such functions read.
macro_rules! parameters {
    (
        $(#[$meta:meta])*
        $vis:vis struct $name:ident of $scope:ident {
            $(
                $(#[doc = $doc:literal])+
                $field_vis:vis $field:ident: $type:ty
                    $(= $row:expr $(, $(#[doc = $more_doc:literal])+ = $more:expr)*)?
                    $(=> $read:expr)?;
                $(use $used:ty;)*
            )*
        }
    ) => {
        $(#[$meta])*
        $vis struct $name {
            $(
                $(#[doc = $doc])+
                $($(#[doc = ""] $(#[doc = $more_doc])+)*)?
                $field_vis $field: $type,
            )*
        }

        impl $name {
            /// Definitions of each field.
            const ROWS: &'static [&'static [$crate::config::ParameterDefinition]] = &[$(
                parameters!(@rows $scope [$($doc)+] $($row $(, [$($more_doc)+] $more)*)?),
            )*];
        }

        impl $crate::config::declaration::ParameterGroup for $name {
            fn define(out: &mut Vec<$crate::config::ParameterDefinition>) {
                let mut rows = Self::ROWS.iter().copied();
                $(
                    let own = rows.next().unwrap_or_default();
                    parameters!(@define out own $type [$($row)?] [$($read)?]);
                    $(<$used as $crate::config::declaration::ParameterGroup>::define(out);)*
                )*
            }

            fn read(values: &$crate::config::declaration::CheckedValues<'_>) -> Option<Self> {
                let mut rows = Self::ROWS.iter().copied();
                Some(Self {
                    $($field: {
                        let own = rows.next().unwrap_or_default();
                        parameters!(@read values own $type [$($row)?] [$($read)?])?
                    },)*
                })
            }
        }
    };

    (@rows $scope:ident [$($doc:literal)+]) => { &[] };
    (@rows $scope:ident [$($doc:literal)+] $row:expr $(, [$($more_doc:literal)+] $more:expr)*) => {
        &[
            $row.described($crate::config::Scope::$scope, concat!($($doc),+)),
            $($more.described($crate::config::Scope::$scope, concat!($($more_doc),+)),)*
        ]
    };
    (@define $out:ident $own:ident $type:ty [] []) => {{
        let _: &[_] = $own;
        <$type as $crate::config::declaration::ParameterGroup>::define($out);
    }};
    (@define $out:ident $own:ident $type:ty [$($row:expr)?] [$($read:expr)?]) => { $out.extend_from_slice($own) };
    (@read $values:ident $own:ident $type:ty [] []) => {{
        let _: &[_] = $own;
        <$type as $crate::config::declaration::ParameterGroup>::read($values)
    }};
    (@read $values:ident $own:ident $type:ty [$row:expr] []) => {
        <$type as $crate::config::declaration::Field>::read($values, $own)
    };
    (@read $values:ident $own:ident $type:ty [$($row:expr)?] [$read:expr]) => { $read($values, $own) };
}

pub(super) use parameters;

/// Value with its origin.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ParameterEntry {
    pub value: Value,
    pub source: ValueSource,
}

/// CheckedValues and origins by full key.
pub(super) type Entries = BTreeMap<String, ParameterEntry>;

/// Joint with the axis and motor types that determine its parameters.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct JointVariant {
    pub name: String,
    pub axis: AxisKind,
    pub motor: MotorKind,
}

/// Definitions of a field.
pub(super) type Definitions = &'static [ParameterDefinition];

/// CheckedValues of checked parameters of a machine and its node, or of one axis.
#[derive(Clone, Copy)]
pub(super) struct CheckedValues<'a> {
    pub entries: &'a Entries,
    pub joints: &'a [JointVariant],
    /// Axis; `None` for the machine and its node.
    pub joint: Option<&'a JointVariant>,
}

impl CheckedValues<'_> {
    /// Returns the first of `rows` that this type of axis has.
    fn applicable(&self, rows: Definitions) -> Option<&'static ParameterDefinition> {
        let applies = |row: &&ParameterDefinition| match self.joint {
            Some(joint) => row.applies_to(joint.axis, joint.motor),
            None => true,
        };
        rows.iter().find(applies)
    }

    /// Returns the value or the default of a parameter.
    fn value(&self, row: &ParameterDefinition) -> Option<Value> {
        let entry = match self.joint {
            Some(joint) => self.entries.get(&format!("{}.{}", joint.name, row.key)),
            None => self.entries.get(row.key),
        };
        entry.map_or_else(|| row.default_value(), |entry| Some(entry.value.clone()))
    }

    /// Returns the configuration of each axis.
    pub fn of_axes<T: ParameterGroup>(&self) -> Option<Vec<T>> {
        self.joints.iter().map(|joint| T::read(&CheckedValues { joint: Some(joint), ..*self })).collect()
    }
}

/// Structure of parameters.
pub(super) trait ParameterGroup: Sized {
    /// Appends the definitions of its parameters.
    fn define(out: &mut Vec<ParameterDefinition>);

    /// Returns the structure with its values; `None` without a value that has no default.
    fn read(values: &CheckedValues<'_>) -> Option<Self>;
}

impl<T: ParameterGroup> ParameterGroup for Option<T> {
    fn define(out: &mut Vec<ParameterDefinition>) {
        T::define(out);
    }

    fn read(values: &CheckedValues<'_>) -> Option<Self> {
        Some(T::read(values))
    }
}

/// Type of a field that parameters fill.
pub(super) trait Field: Sized {
    /// Field of an axis that does not have the parameter.
    const ABSENT: Option<Self> = None;

    /// Returns the field for a value, where `si` is the value in SI units of 1; `None` for a value of another type.
    fn from_value(value: Value, si: f64) -> Option<Self>;

    /// Returns the field; `None` without a value.
    fn read(values: &CheckedValues<'_>, rows: Definitions) -> Option<Self> {
        match values.applicable(rows) {
            Some(row) => Self::from_value(values.value(row)?, row.si),
            None => Self::ABSENT,
        }
    }
}

impl Field for f64 {
    const ABSENT: Option<Self> = Some(0.0);

    fn from_value(value: Value, si: f64) -> Option<Self> {
        if let Value::Double(number) = value { Some(number * si) } else { None }
    }
}

/// An integer, or a duration in nanoseconds.
impl Field for i64 {
    fn from_value(value: Value, si: f64) -> Option<Self> {
        match value {
            Value::Integer(integer) => Some((integer as f64 * si) as i64),
            Value::Double(number) => Some((number * si).round() as i64),
            _ => None,
        }
    }
}

impl Field for usize {
    fn from_value(value: Value, si: f64) -> Option<Self> {
        i64::from_value(value, si)?.try_into().ok()
    }
}

impl Field for u64 {
    fn from_value(value: Value, si: f64) -> Option<Self> {
        i64::from_value(value, si)?.try_into().ok()
    }
}

impl Field for bool {
    fn from_value(value: Value, _: f64) -> Option<Self> {
        Some(value == Value::Bool(true))
    }
}

impl Field for String {
    fn from_value(value: Value, _: f64) -> Option<Self> {
        if let Value::Text(text) = value { Some(text) } else { None }
    }
}

impl Field for PathBuf {
    fn from_value(value: Value, si: f64) -> Option<Self> {
        String::from_value(value, si).map(PathBuf::from)
    }
}

impl Field for Vec<f64> {
    fn from_value(value: Value, _: f64) -> Option<Self> {
        value.numbers()
    }
}

impl Field for Vec<String> {
    fn from_value(value: Value, _: f64) -> Option<Self> {
        if let Value::TextList(texts) = value { Some(texts) } else { None }
    }
}

/// A value, or `None` if there is none or 0 or an empty text disables a parameter with a default.
impl<T: Field> Field for Option<T> {
    const ABSENT: Option<Self> = Some(None);

    fn from_value(value: Value, si: f64) -> Option<Self> {
        Some(T::from_value(value, si))
    }

    fn read(values: &CheckedValues<'_>, rows: Definitions) -> Option<Self> {
        let Some(row) = values.applicable(rows) else { return Self::ABSENT };
        let is_disabled = row.presence != Presence::Optional
            && match values.value(row) {
                Some(Value::Double(number)) => number == 0.0,
                Some(Value::Integer(integer)) => integer == 0,
                Some(Value::Text(text)) => text.is_empty(),
                _ => false,
            };
        Some(if is_disabled { None } else { T::read(values, rows) })
    }
}

/// Returns the numbers of several parameters.
pub(super) fn numbers_of<const N: usize>(values: &CheckedValues<'_>, rows: Definitions) -> Option<[f64; N]> {
    let numbers: Option<Vec<f64>> = rows.iter().map(|row| f64::read(values, slice::from_ref(row))).collect();
    numbers?.try_into().ok()
}

/// Returns a choice among names.
pub(super) fn choice_of<T: FromStr>(values: &CheckedValues<'_>, rows: Definitions) -> Option<T> {
    String::read(values, rows)?.parse().ok()
}
