//! Values of variables and expressions.

use super::super::error::Outcome;
use super::frame::AxisFrame;
use crate::motion::AXIS_LETTERS;

/// Value of an expression.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum ProgramValue {
    /// REAL, INT, CHAR, and BOOL as 0 and 1.
    Number(f64),
    /// STRING.
    Text(String),
    /// AXIS: index in [`Coordinates`](crate::motion::Coordinates).
    Axis(usize),
    /// FRAME.
    CoordinateFrame(Box<AxisFrame>),
}

impl ProgramValue {
    /// Returns the number.
    pub(super) fn number(self) -> Outcome<f64> {
        match self {
            ProgramValue::Number(value) => Ok(value),
            other => Err(format!("{other}: a number is required")),
        }
    }

    /// Returns the text; a number as the control writes it.
    pub(super) fn text(self) -> String {
        match self {
            ProgramValue::Text(text) => text,
            other => other.to_string(),
        }
    }

    pub(super) fn boolean(value: bool) -> Self {
        ProgramValue::Number(f64::from(value))
    }
}

impl std::fmt::Display for ProgramValue {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            // As the control concatenates numbers: at most five decimals.
            ProgramValue::Number(value) => write!(f, "{}", (value * 1e5).round() / 1e5),
            ProgramValue::Text(text) => write!(f, "{text:?}"),
            ProgramValue::Axis(axis) => write!(f, "{}", AXIS_LETTERS[*axis]),
            ProgramValue::CoordinateFrame(_) => write!(f, "a frame"),
        }
    }
}

/// Type of a variable.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Real,
    Int,
    Bool,
    Char,
    Text,
    Axis,
    CoordinateFrame,
}

impl Kind {
    /// Returns the type by its keyword.
    pub(super) fn from_name(name: &str) -> Option<Self> {
        Some(match name {
            "REAL" => Kind::Real,
            "INT" => Kind::Int,
            "BOOL" => Kind::Bool,
            "CHAR" => Kind::Char,
            "STRING" => Kind::Text,
            "AXIS" => Kind::Axis,
            "FRAME" => Kind::CoordinateFrame,
            _ => return None,
        })
    }

    /// Returns the value of a variable without setting.
    pub(super) fn initial(self) -> ProgramValue {
        match self {
            Kind::Text => ProgramValue::Text(String::new()),
            Kind::Axis => ProgramValue::Axis(0),
            Kind::CoordinateFrame => ProgramValue::CoordinateFrame(Box::default()),
            _ => ProgramValue::Number(0.0),
        }
    }

    /// Converts a value as an assignment does.
    pub(super) fn convert(self, value: ProgramValue) -> Outcome<ProgramValue> {
        Ok(match (self, value) {
            (Kind::Int | Kind::Char, ProgramValue::Number(value)) => ProgramValue::Number(value.round()),
            (Kind::Bool, ProgramValue::Number(value)) => ProgramValue::boolean(value != 0.0),
            (Kind::Char, ProgramValue::Text(text)) => {
                ProgramValue::Number(text.bytes().next().map_or(0.0, f64::from))
            }
            (Kind::Real, value @ ProgramValue::Number(_))
            | (Kind::Text, value @ ProgramValue::Text(_))
            | (Kind::Axis, value @ ProgramValue::Axis(_))
            | (Kind::CoordinateFrame, value @ ProgramValue::CoordinateFrame(_)) => value,
            (kind, value) => {
                return Err(format!("{value} cannot be assigned to a variable of type {kind:?}"));
            }
        })
    }
}

/// Returns the axis of a name: a letter, alone or with the number 1, as X1.
pub(super) fn axis_of(name: &str) -> Option<usize> {
    let mut characters = name.chars();
    let letter = characters.next()?;
    let is_axis = matches!(characters.as_str(), "" | "1");
    AXIS_LETTERS.iter().position(|axis| *axis == letter).filter(|_| is_axis)
}
