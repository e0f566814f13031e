//! Parameter table as text and as Markdown for the README.

use std::fmt::Write;

use super::definition::{MotorKind, ParameterDefinition, Presence, Scope};
use super::machine::AxisKind;
use super::schema::DEFINITIONS;

/// Column headings.
const HEADINGS: [&str; 6] = ["key", "range", "default", "live", "for", "description"];

/// Returns a row per parameter: key (with `<joint>` for the joint name), range with unit, default, settable at run time,
/// owner, description.
pub fn rows() -> Vec<[String; 6]> {
    DEFINITIONS.iter().map(row).collect()
}

fn row(definition: &ParameterDefinition) -> [String; 6] {
    let key = match definition.scope {
        Scope::Axis => format!("<joint>.{}", definition.key),
        Scope::Machine | Scope::Node => definition.key.to_owned(),
    };
    let default = match definition.presence {
        Presence::Required => "required".to_owned(),
        Presence::Optional => "none".to_owned(),
        Presence::Default(_) => match definition.default_value().map(|value| value.to_string()) {
            Some(text) if !text.is_empty() => text,
            _ => "empty".to_owned(),
        },
    };
    let owner = match (definition.scope, definition.axis, definition.motor) {
        (Scope::Machine, ..) => "machine",
        (Scope::Node, ..) => "node",
        (_, Some(AxisKind::Linear), _) => "linear axis",
        (_, Some(AxisKind::Rotary), _) => "rotary axis",
        (_, _, Some(MotorKind::Linear)) => "linear motor",
        (_, _, Some(MotorKind::Rotary)) => "rotary motor",
        (Scope::Axis, None, None) => "axis",
    };
    [
        key,
        definition.range(),
        default,
        if definition.is_live { "yes" } else { "no" }.to_owned(),
        owner.to_owned(),
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

/// Returns the table as aligned text.
pub fn text() -> String {
    let mut rows = rows();
    rows.insert(0, HEADINGS.map(str::to_owned));
    let width = |column: usize| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or_default();
    let widths: Vec<usize> = (0..HEADINGS.len()).map(width).collect();
    let mut out = String::new();
    for row in &rows {
        let mut line = String::new();
        for (cell, &width) in row.iter().zip(&widths) {
            let _ = write!(line, "{cell:<width$}  ");
        }
        let _ = writeln!(out, "{}", line.trim_end());
    }
    out
}
