//! `virtual_axes parameters --json`: the parameter schema as JSON.

use serde_json::{Value as Json, json};
use virtual_axes_core::config::{
    DEFINITIONS, DefaultValue, ParameterDefinition, ParameterKind, Presence, listing,
};

/// Returns all parameters as a JSON list.
pub fn json() -> String {
    let list: Vec<Json> = DEFINITIONS.iter().map(parameter).collect();
    format!("{:#}\n", json!(list))
}

fn parameter(definition: &ParameterDefinition) -> Json {
    let default = match definition.presence {
        Presence::Required | Presence::Optional => Json::Null,
        Presence::Default(DefaultValue::Number(value)) => json!(value),
        Presence::Default(DefaultValue::Integer(value)) => json!(value),
        Presence::Default(DefaultValue::Flag(value)) => json!(value),
        Presence::Default(DefaultValue::Text(value)) => json!(value),
    };
    json!({
        "key": listing::key(definition),
        "type": type_name(definition.kind),
        "allowed": allowed(definition.kind),
        "range": definition.range(),
        "unit": definition.unit,
        "required": definition.presence == Presence::Required,
        "default": default,
        "live": definition.is_live,
        "owner": listing::owner(definition),
        "group": listing::group(definition),
        "description": definition.description,
    })
}

/// Returns the ROS 2 type of a parameter.
fn type_name(kind: ParameterKind) -> &'static str {
    match kind {
        ParameterKind::Number { .. } => "double",
        ParameterKind::Integer { .. } => "integer",
        ParameterKind::Flag => "bool",
        ParameterKind::Text | ParameterKind::Choice(_) => "string",
        ParameterKind::TextList => "string_array",
        ParameterKind::NumberList { .. } => "double_array",
    }
}

/// Returns the allowed values: minimum and maximum, lengths, or choices; null if there is no restriction.
fn allowed(kind: ParameterKind) -> Json {
    match kind {
        ParameterKind::Number { min, max } => json!({ "min": min, "max": max }),
        ParameterKind::Integer { min, max } => json!({ "min": min, "max": max }),
        ParameterKind::NumberList { min_len, max_len } => {
            json!({ "min_length": min_len, "max_length": max_len })
        }
        ParameterKind::Choice(choices) => json!({ "choices": choices }),
        ParameterKind::Flag | ParameterKind::Text | ParameterKind::TextList => Json::Null,
    }
}
