//! Between plain values and rcl_interfaces' messages.

use virtual_axes_io::messages::rcl_interfaces::msg;

use super::types::{Descriptor, ParameterType, ParameterValue, Range};
use virtual_axes_core::config::shortened;

/// The type number of a parameter that does not exist.
const NOT_SET: u8 = 0;

/// A value as a message; none as that of a parameter that does not exist.
pub fn value_to_wire(value: Option<ParameterValue>) -> msg::ParameterValue {
    let mut wire = msg::ParameterValue {
        type_: value.as_ref().map_or(NOT_SET, |value| value.kind() as u8),
        ..Default::default()
    };
    match value {
        None => {}
        Some(ParameterValue::Bool(value)) => wire.bool_value = value,
        Some(ParameterValue::Integer(value)) => wire.integer_value = value,
        Some(ParameterValue::Double(value)) => wire.double_value = value,
        Some(ParameterValue::String(value)) => wire.string_value = value,
        Some(ParameterValue::ByteArray(value)) => wire.byte_array_value = value,
        Some(ParameterValue::BoolArray(value)) => wire.bool_array_value = value,
        Some(ParameterValue::IntegerArray(value)) => wire.integer_array_value = value,
        Some(ParameterValue::DoubleArray(value)) => wire.double_array_value = value,
        Some(ParameterValue::StringArray(value)) => wire.string_array_value = value,
    }
    wire
}

/// A parameter that somebody wants to set.
///
/// # Errors
/// The reason, in a sentence that names the parameter.
pub fn parameter_from_wire(wire: msg::Parameter) -> Result<(String, ParameterValue), String> {
    let msg::Parameter { name, value } = wire;
    let value = match value.type_ {
        1 => ParameterValue::Bool(value.bool_value),
        2 => ParameterValue::Integer(value.integer_value),
        3 => ParameterValue::Double(value.double_value),
        4 => ParameterValue::String(value.string_value),
        5 => ParameterValue::ByteArray(value.byte_array_value),
        6 => ParameterValue::BoolArray(value.bool_array_value),
        7 => ParameterValue::IntegerArray(value.integer_array_value),
        8 => ParameterValue::DoubleArray(value.double_array_value),
        9 => ParameterValue::StringArray(value.string_array_value),
        NOT_SET => {
            return Err(format!(
                "parameter '{}' is to be removed; the parameters of this node cannot be",
                shortened(&name)
            ));
        }
        other => {
            let name = shortened(&name);
            return Err(format!("parameter '{name}' comes with type number {other}; allowed is 1 to 9"));
        }
    };
    Ok((name, value))
}

/// A description as a message; none as that of a parameter that does not exist.
pub fn descriptor_to_wire(name: String, descriptor: Option<Descriptor>) -> msg::ParameterDescriptor {
    let Some(descriptor) = descriptor else {
        return msg::ParameterDescriptor { name, ..Default::default() };
    };
    let mut wire = msg::ParameterDescriptor {
        name,
        type_: descriptor.kind as u8,
        description: descriptor.description,
        additional_constraints: descriptor.additional_constraints,
        read_only: descriptor.read_only,
        dynamic_typing: descriptor.dynamic_typing,
        ..Default::default()
    };
    match descriptor.range {
        None => {}
        Some(Range::Integer { from, to, step }) => {
            wire.integer_range.push(msg::IntegerRange { from_value: from, to_value: to, step })
        }
        Some(Range::Double { from, to, step }) => {
            wire.floating_point_range.push(msg::FloatingPointRange { from_value: from, to_value: to, step });
        }
    }
    wire
}

/// What became of a request to set.
pub fn result_to_wire(result: Result<(), String>) -> msg::SetParametersResult {
    msg::SetParametersResult { successful: result.is_ok(), reason: result.err().unwrap_or_default() }
}

/// The type number of a value, or of none.
pub fn type_number(kind: Option<ParameterType>) -> u8 {
    kind.map_or(NOT_SET, |kind| kind as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_of_value_survives_the_wire() {
        for value in [
            ParameterValue::Bool(true),
            ParameterValue::Integer(-3),
            ParameterValue::Double(4.5),
            ParameterValue::String("cascade".to_owned()),
            ParameterValue::ByteArray(vec![0, 255]),
            ParameterValue::BoolArray(vec![true, false]),
            ParameterValue::IntegerArray(vec![i64::MIN, i64::MAX]),
            ParameterValue::DoubleArray(vec![]),
            ParameterValue::StringArray(vec!["x".to_owned(), String::new()]),
        ] {
            let wire =
                msg::Parameter { name: "x.gain".to_owned(), value: value_to_wire(Some(value.clone())) };
            assert_eq!(parameter_from_wire(wire), Ok(("x.gain".to_owned(), value)));
        }
    }

    #[test]
    fn removal_and_unknown_types_are_refused_by_name() {
        for type_ in [0, 10, 255] {
            let wire = msg::Parameter {
                name: "x.gain".to_owned(),
                value: msg::ParameterValue { type_, ..Default::default() },
            };
            assert!(parameter_from_wire(wire).unwrap_err().contains("'x.gain'"));
        }
    }

    #[test]
    fn a_name_without_end_does_not_come_back_in_the_refusal() {
        for type_ in [0, 77] {
            let value = msg::ParameterValue { type_, ..Default::default() };
            let reason =
                parameter_from_wire(msg::Parameter { name: "k\n".repeat(100_000), value }).unwrap_err();
            assert!(reason.len() < 600 && !reason.contains('\n'), "{} bytes", reason.len());
        }
    }
}
