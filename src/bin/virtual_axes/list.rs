//! `virtual_axes machines` and `virtual_axes scenarios`: lists of built-in files.

use std::error::Error;

use serde_json::json;
use virtual_axes_core::config::Parameters;
use virtual_axes_core::scenario::Scenario;
use virtual_axes_nc::builtin::{BUILTIN_PROGRAMS, BuiltinProgram};
use virtual_axes_report::{Table, TableColumn};

use crate::input::with_programs;
use crate::text_table;

/// Returns the built-in machines, one per line or as JSON.
pub fn machines(as_json: bool) -> Result<String, Box<dyn Error>> {
    let mut list = Vec::new();
    for name in Parameters::builtin_names() {
        let machine = Parameters::builtin(name)?.machine_config()?;
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
    Ok(Parameters::builtin_text(name)?.to_owned())
}

/// Returns the built-in scenarios and part programs, one per line or as JSON.
pub fn scenarios(as_json: bool) -> Result<String, Box<dyn Error>> {
    let list: Vec<Scenario> = Scenario::builtin_names().map(Scenario::builtin).collect::<Result<_, _>>()?;
    if as_json {
        let list = list
            .iter()
            .map(|s| json!({ "name": s.name(), "description": s.description(), "source": s.source() }));
        let programs = BUILTIN_PROGRAMS.iter().map(
            |program| json!({ "name": program.name, "description": program.description, "source": null }),
        );
        let list: Vec<_> = list.chain(programs).collect();
        return Ok(format!("{:#}\n", json!(list)));
    }
    let columns = ["scenario", "motion"].map(|name| TableColumn::new(name, "")).to_vec();
    let row = |s: &Scenario| {
        let source = s.source().map(|source| format!(" ({source})")).unwrap_or_default();
        vec![s.name().to_owned(), format!("{}{source}", s.description())]
    };
    let programs =
        BUILTIN_PROGRAMS.iter().map(|program| vec![program.name.into(), program.description.into()]);
    let table = Table { columns, rows: list.iter().map(row).chain(programs).collect(), ..Table::default() };
    Ok(text_table::aligned(&table, &[0, 1]))
}

/// Returns the file of a built-in scenario or part program.
pub fn scenario(name: &str) -> Result<String, Box<dyn Error>> {
    if let Some(program) = BuiltinProgram::find(name) {
        return Ok(program.text.to_owned());
    }
    Ok(Scenario::builtin_text(name).map_err(with_programs)?.to_owned())
}
