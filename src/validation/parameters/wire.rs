//! Conversion between parameter values and `rcl_interfaces` messages.

use virtual_axes_io::messages::rcl_interfaces::msg;

use super::types::{ParameterDescriptor, ParameterRange, ParameterType, ParameterValue};
use virtual_axes_core::text::shortened;

/// Type number of an unknown parameter.
const NOT_SET: u8 = 0;

/// Converts a value to a message; `None` becomes the value of an unknown parameter.
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

/// Converts a parameter of a set request to its name and value.
///
/// # Errors
/// Text with the parameter name if its type is `NOT_SET` or unknown.
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
                "parameter '{}' has type 0 (not set); parameters of this node cannot be removed",
                shortened(&name)
            ));
        }
        other => {
            let name = shortened(&name);
            return Err(format!("parameter '{name}' has type {other}; it must be 1 to 9"));
        }
    };
    Ok((name, value))
}

/// Converts a descriptor to a message; `None` becomes the descriptor of an unknown parameter.
pub fn descriptor_to_wire(name: String, descriptor: Option<ParameterDescriptor>) -> msg::ParameterDescriptor {
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
        Some(ParameterRange::Integer { from, to, step }) => {
            wire.integer_range.push(msg::IntegerRange { from_value: from, to_value: to, step })
        }
        Some(ParameterRange::Double { from, to, step }) => {
            wire.floating_point_range.push(msg::FloatingPointRange { from_value: from, to_value: to, step });
        }
    }
    wire
}

/// Converts the result of a set request to a message.
pub fn result_to_wire(result: Result<(), String>) -> msg::SetParametersResult {
    msg::SetParametersResult { successful: result.is_ok(), reason: result.err().unwrap_or_default() }
}

/// Returns the type number of a parameter; 0 if it is unknown.
pub fn type_number(kind: Option<ParameterType>) -> u8 {
    kind.map_or(NOT_SET, |kind| kind as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_type_is_unchanged_by_a_round_trip() {
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
    fn removal_and_unknown_types_are_rejected_with_the_name() {
        for type_ in [0, 10, 255] {
            let wire = msg::Parameter {
                name: "x.gain".to_owned(),
                value: msg::ParameterValue { type_, ..Default::default() },
            };
            assert!(parameter_from_wire(wire).unwrap_err().contains("'x.gain'"));
        }
    }

    #[test]
    fn a_long_name_is_truncated_in_the_rejection() {
        for type_ in [0, 77] {
            let value = msg::ParameterValue { type_, ..Default::default() };
            let reason =
                parameter_from_wire(msg::Parameter { name: "k\n".repeat(100_000), value }).unwrap_err();
            assert!(reason.len() < 600 && !reason.contains('\n'), "{} bytes", reason.len());
        }
    }
}
