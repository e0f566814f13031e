//! Functions of expressions.

use virtual_axes_core::units::{DEGREE, MILLIMETER};

use super::super::error::Outcome;
use super::frame::AxisFrame;
use super::value::{ProgramValue, axis_of};
use crate::motion::AXIS_COUNT;

/// Function of one number.
type FunctionOfOne = fn(f64) -> f64;
/// Function of two numbers.
type FunctionOfTwo = fn(f64, f64) -> f64;
/// Functions of one number.
const ONE: [(&str, FunctionOfOne); 13] = [
    ("SIN", |x| x.to_radians().sin()),
    ("COS", |x| x.to_radians().cos()),
    ("TAN", |x| x.to_radians().tan()),
    ("ASIN", |x| x.asin().to_degrees()),
    ("ACOS", |x| x.acos().to_degrees()),
    ("SQRT", f64::sqrt),
    ("ABS", f64::abs),
    ("POT", |x| x * x),
    ("TRUNC", f64::trunc),
    ("ROUND", f64::round),
    ("ROUNDUP", f64::ceil),
    ("LN", f64::ln),
    ("EXP", f64::exp),
];
/// Functions of two numbers.
const TWO: [(&str, FunctionOfTwo); 3] =
    [("ATAN2", |y, x| y.atan2(x).to_degrees()), ("MINVAL", f64::min), ("MAXVAL", f64::max)];

/// Returns the value of a function.
pub(super) fn function(name: &str, arguments: Vec<Option<ProgramValue>>) -> Outcome<ProgramValue> {
    let arguments: Vec<ProgramValue> = arguments.into_iter().flatten().collect();
    if let Some((_, function)) = ONE.iter().find(|(known, _)| *known == name) {
        let [x] = numbers(name, arguments)?;
        return finite(function(x), || format!("{name}({x})"));
    }
    if let Some((_, function)) = TWO.iter().find(|(known, _)| *known == name) {
        let [x, y] = numbers(name, arguments)?;
        return finite(function(x, y), || format!("{name}({x},{y})"));
    }
    match (name, arguments.as_slice()) {
        ("BOUND", _) => {
            let [low, value, high] = numbers(name, arguments)?;
            Ok(ProgramValue::Number(value.min(high).max(low)))
        }
        ("ISFILE", _) => {
            Err("ISFILE: files of the control are not simulated: write TRUE or FALSE in its place".to_owned())
        }
        ("STRLEN", [ProgramValue::Text(text)]) => Ok(ProgramValue::Number(text.len() as f64)),
        ("TOUPPER", [ProgramValue::Text(text)]) => Ok(ProgramValue::Text(text.to_ascii_uppercase())),
        ("TOLOWER", [ProgramValue::Text(text)]) => Ok(ProgramValue::Text(text.to_ascii_lowercase())),
        ("NUMBER", [ProgramValue::Text(text)]) => {
            let value = text.trim().parse().ok().filter(|value: &f64| value.is_finite());
            Ok(ProgramValue::Number(value.ok_or_else(|| format!("NUMBER({text:?}): not a number"))?))
        }
        ("ISNUMBER", [ProgramValue::Text(text)]) => {
            Ok(ProgramValue::boolean(text.trim().parse::<f64>().is_ok()))
        }
        ("INDEX", [ProgramValue::Text(text), ProgramValue::Text(part)]) => {
            Ok(position(text.find(part.as_str())))
        }
        ("RINDEX", [ProgramValue::Text(text), ProgramValue::Text(part)]) => {
            Ok(position(text.rfind(part.as_str())))
        }
        ("MINDEX", [ProgramValue::Text(text), ProgramValue::Text(part)]) => {
            Ok(position(text.find(|character| part.contains(character))))
        }
        ("SUBSTR", [ProgramValue::Text(text), ProgramValue::Number(start), rest @ ..]) => {
            let length = match rest {
                [ProgramValue::Number(length)] => *length as usize,
                _ => usize::MAX,
            };
            let start = start.max(0.0) as usize;
            Ok(ProgramValue::Text(text.chars().skip(start).take(length).collect()))
        }
        ("AXNAME", [ProgramValue::Text(text)]) => {
            let axis = axis_of(&text.to_ascii_uppercase());
            Ok(ProgramValue::Axis(axis.ok_or_else(|| format!("AXNAME({text:?}): no such axis"))?))
        }
        ("AXSTRING", [axis @ ProgramValue::Axis(_)]) => Ok(ProgramValue::Text(axis.to_string())),
        ("CTRANS" | "CFINE" | "CROT" | "CSCALE" | "CMIRROR", _) => frame(name, &arguments),
        _ => Err(format!(
            "{name}(): no such function with {} values; functions: SIN COS TAN ASIN ACOS ATAN2 SQRT ABS POT TRUNC ROUND ROUNDUP LN EXP MINVAL MAXVAL BOUND",
            arguments.len()
        )),
    }
}

/// Returns a frame from axes and values: `CTRANS(X,10,Y,5)`.
fn frame(name: &str, arguments: &[ProgramValue]) -> Outcome<ProgramValue> {
    let mut values = [None; AXIS_COUNT];
    let mut rest = arguments;
    while let [first, others @ ..] = rest {
        let ProgramValue::Axis(axis) = first else {
            return Err(format!("{name}({first}): an axis is required"));
        };
        let (value, others) = match others {
            [ProgramValue::Number(value), others @ ..] => (*value, others),
            others if name == "CMIRROR" => (0.0, others),
            _ => return Err(format!("{name}({first}): a value is required behind the axis")),
        };
        values[*axis] = Some(value);
        rest = others;
    }
    let of = |axis: usize| values[axis].unwrap_or(0.0);
    let unit = |axis: usize| if (3..6).contains(&axis) { DEGREE } else { MILLIMETER };
    let offset = std::array::from_fn(|axis| of(axis) * unit(axis));
    let frame = match name {
        "CTRANS" => AxisFrame::translation(offset),
        "CFINE" => AxisFrame { fine: offset, ..AxisFrame::default() },
        "CROT" => AxisFrame::rotation([of(0), of(1), of(2)].map(|angle| angle * DEGREE)),
        "CSCALE" => AxisFrame::scaling([0, 1, 2].map(|axis| values[axis].unwrap_or(1.0))),
        _ => AxisFrame::scaling([0, 1, 2].map(|axis| if values[axis].is_some() { -1.0 } else { 1.0 })),
    };
    Ok(ProgramValue::CoordinateFrame(Box::new(frame)))
}

fn numbers<const N: usize>(name: &str, arguments: Vec<ProgramValue>) -> Outcome<[f64; N]> {
    let found = arguments.len();
    let numbers = arguments.into_iter().map(ProgramValue::number).collect::<Outcome<Vec<f64>>>()?;
    numbers.try_into().map_err(|_| format!("{name}() requires {N} values, found {found}"))
}

fn finite(value: f64, call: impl Fn() -> String) -> Outcome<ProgramValue> {
    match value.is_finite() {
        true => Ok(ProgramValue::Number(value)),
        false => Err(format!("{}: the value is not finite", call())),
    }
}

/// Returns the position of a part in a string, −1 without one.
fn position(found: Option<usize>) -> ProgramValue {
    ProgramValue::Number(found.map_or(-1.0, |found| found as f64))
}
