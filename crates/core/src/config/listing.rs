//! Parameter table as text and as Markdown, and the groups of parameters.

use std::fmt::Write;

use super::definition::{AxisKind, MotorKind, ParameterDefinition, Presence, Scope};
use super::schema::DEFINITIONS;
use crate::text::wrapped;

/// Column headings.
const HEADINGS: [&str; 6] = ["key", "range", "default", "live", "for", "description"];

/// Returns a row per parameter: key (with `<joint>` for the joint name), range with unit, default, settable at run time,
/// owner, description.
pub fn rows() -> Vec<[String; 6]> {
    DEFINITIONS.iter().map(row).collect()
}

/// Returns the name of the parameter, with `<joint>` for the joint name.
pub fn key(definition: &ParameterDefinition) -> String {
    match definition.scope {
        Scope::Axis => format!("<joint>.{}", definition.key),
        Scope::Machine | Scope::Node => definition.key.to_owned(),
    }
}

/// Returns the owner of the parameter: machine, node, or a kind of axis or motor.
pub fn owner(definition: &ParameterDefinition) -> &'static str {
    match (definition.scope, definition.axis, definition.motor) {
        (Scope::Machine, ..) => "machine",
        (Scope::Node, ..) => "node",
        (_, Some(AxisKind::Linear), _) => "linear axis",
        (_, Some(AxisKind::Rotary), _) => "rotary axis",
        (_, _, Some(MotorKind::Linear)) => "linear motor",
        (_, _, Some(MotorKind::Rotary)) => "rotary motor",
        (Scope::Axis, None, None) => "axis",
    }
}

/// Returns the group of the parameter, a page of the reference.
pub fn group(definition: &ParameterDefinition) -> &'static str {
    let first = definition.key.split('.').next().unwrap_or_default();
    match (definition.scope, first) {
        (Scope::Node, "qos") => "qos",
        (Scope::Node, _) => "node",
        (Scope::Machine, _) => "machine",
        (Scope::Axis, "friction" | "gravity") => "friction",
        (Scope::Axis, "position_loop") => "position-loop",
        (
            Scope::Axis,
            "velocity_loop" | "current_filter_1" | "current_filter_2" | "current_loop" | "feedforward"
            | "delays",
        ) => "inner-loops",
        (Scope::Axis, "limits" | "tolerances") => "limits",
        (Scope::Axis, "deviation") => "deviation",
        (Scope::Axis, _) => "axis",
    }
}

fn row(definition: &ParameterDefinition) -> [String; 6] {
    let default = match definition.presence {
        Presence::Required => "required".to_owned(),
        Presence::Optional => "none".to_owned(),
        Presence::Default(_) => match definition.default_value().map(|value| value.to_string()) {
            Some(text) if !text.is_empty() => text,
            _ => "empty".to_owned(),
        },
    };
    [
        key(definition),
        definition.range(),
        default,
        if definition.is_live { "yes" } else { "no" }.to_owned(),
        owner(definition).to_owned(),
        definition.description.to_owned(),
    ]
}

/// Returns the table in Markdown.
pub fn markdown() -> String {
    let mut out = format!("| {} |\n", HEADINGS.join(" | "));
    let _ = writeln!(out, "|{}", "---|".repeat(HEADINGS.len()));
    for [key, range, default, live, owner, description] in rows() {
        // Writing to a String is infallible.
        let _ = writeln!(out, "| `{key}` | {range} | {default} | {live} | {owner} | {description} |");
    }
    out
}

/// Returns a paragraph per parameter: name, range, default and owner in one line, then the description.
pub fn text() -> String {
    let mut out = String::new();
    for [key, range, default, live, owner, description] in rows() {
        let default = if default == "required" { default } else { format!("default {default}") };
        let live = if live == "yes" { ", live" } else { "" };
        let _ = writeln!(out, "{key}");
        for line in [format!("{range}; {default}{live}; {owner}"), description]
            .iter()
            .flat_map(|text| wrapped(text, 76))
        {
            let _ = writeln!(out, "    {line}");
        }
    }
    out
}
