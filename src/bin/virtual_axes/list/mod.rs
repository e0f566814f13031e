//! `virtual_axes machines`, `scenarios` and `parameters`: lists of built-in files and of parameters.

pub mod completion;
pub mod interface;

use std::error::Error;

use serde_json::{Value as Json, json};
use virtual_axes_core::config::{
    DEFINITIONS, DefaultValue, ParameterDefinition, ParameterKind, Parameters, Presence, listing,
};
use virtual_axes_core::scenario::Scenario;
use virtual_axes_core::text::builtin_text;
use virtual_axes_report::{Table, TableColumn};

use crate::builtin::{PROGRAM_DESCRIPTIONS, PROGRAMS, SCENARIOS};
use crate::input::with_programs;
use crate::output::text_table;

/// Returns the built-in machines, one per line or as JSON.
pub fn machines(as_json: bool) -> Result<String, Box<dyn Error>> {
    let mut list = Vec::new();
    for name in crate::builtin::MACHINES.iter().map(|(name, _)| *name) {
        let machine = Parameters::load(name, crate::builtin::MACHINES)?.machine_config()?;
        let joints: Vec<String> = machine.axes().iter().map(|axis| axis.name().to_owned()).collect();
        list.push((name, machine.name().to_owned(), joints));
    }
    if as_json {
        let list: Vec<_> = list
            .iter()
            .map(|(name, title, joints)| json!({ "name": name, "machine": title, "joints": joints }))
            .collect();
        return Ok(format!("{:#}\n", json!(list)));
    }
    Ok(list.iter().map(|(name, title, _)| format!("{name}: {title}\n")).collect())
}

/// Returns the file of a built-in machine.
pub fn machine(name: &str) -> Result<String, Box<dyn Error>> {
    Ok(Parameters::builtin_text(name, crate::builtin::MACHINES)?.to_owned())
}

/// Returns the built-in scenarios and part programs, one per line or as JSON.
pub fn scenarios(as_json: bool) -> Result<String, Box<dyn Error>> {
    let list: Vec<Scenario> =
        SCENARIOS.iter().map(|(name, text)| Scenario::from_yaml(text, name)).collect::<Result<_, _>>()?;
    if as_json {
        let list = list
            .iter()
            .map(|s| json!({ "name": s.name(), "description": s.description(), "source": s.source() }));
        let programs = PROGRAM_DESCRIPTIONS
            .iter()
            .map(|(name, description)| json!({ "name": name, "description": description, "source": null }));
        let list: Vec<_> = list.chain(programs).collect();
        return Ok(format!("{:#}\n", json!(list)));
    }
    let columns = ["scenario", "motion"].map(|name| TableColumn::new(name, "")).to_vec();
    let row = |s: &Scenario| {
        let source = s.source().map(|source| format!(" ({source})")).unwrap_or_default();
        vec![s.name().to_owned(), format!("{}{source}", s.description())]
    };
    let programs =
        PROGRAM_DESCRIPTIONS.iter().map(|(name, description)| vec![(*name).into(), (*description).into()]);
    let table = Table { columns, rows: list.iter().map(row).chain(programs).collect(), ..Table::default() };
    Ok(text_table::aligned(&table, &[0, 1]))
}

/// Returns the file of a built-in scenario or part program.
pub fn scenario(name: &str) -> Result<String, Box<dyn Error>> {
    if let Some(text) = builtin_text(PROGRAMS, name) {
        return Ok(text.to_owned());
    }
    Ok(Scenario::builtin_text(name, SCENARIOS).map_err(with_programs)?.to_owned())
}

/// Returns all parameters as a JSON list.
pub fn parameters() -> String {
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
