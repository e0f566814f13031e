//! `virtual_axes machines` and `virtual_axes scenarios`: lists of shipped files.

use std::error::Error;

use serde_json::json;
use virtual_axes_core::config::Parameters;
use virtual_axes_core::scenario::Scenario;

/// Returns the shipped machines, one per line or as JSON.
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

/// Returns the file of a shipped machine.
pub fn machine(name: &str) -> Result<String, Box<dyn Error>> {
    Ok(Parameters::builtin_text(name)?.to_owned())
}

/// Returns the shipped scenarios, one per line or as JSON.
pub fn scenarios(as_json: bool) -> Result<String, Box<dyn Error>> {
    let list: Vec<Scenario> = Scenario::builtin_names().map(Scenario::builtin).collect::<Result<_, _>>()?;
    if as_json {
        let list: Vec<_> = list
            .iter()
            .map(|s| json!({ "name": s.name(), "description": s.description(), "source": s.source() }))
            .collect();
        return Ok(format!("{:#}\n", json!(list)));
    }
    let width = list.iter().map(|s| s.name().len()).max().unwrap_or(0);
    Ok(list
        .iter()
        .map(|s| {
            let source = s.source().map(|source| format!(" ({source})")).unwrap_or_default();
            format!("{:width$}  {}{source}\n", s.name(), s.description())
        })
        .collect())
}

/// Returns the file of a shipped scenario.
pub fn scenario(name: &str) -> Result<String, Box<dyn Error>> {
    Ok(Scenario::builtin_text(name)?.to_owned())
}
