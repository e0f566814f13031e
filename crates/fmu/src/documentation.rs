//! `documentation/index.html`.

use std::fmt::Write;

use virtual_axes_core::config::Parameters;

use crate::description::{causality, escaped, start_text};
use crate::resources::MACHINE_FILE;
use crate::variables::{FmuVariables, text_value};

/// Returns a page with rules and variables of the FMU of the machine in a machine file.
///
/// # Errors
/// The text of an error of the machine file or of the machine.
pub fn documentation(machine_file: &str) -> Result<String, String> {
    let parameters = Parameters::from_yaml(machine_file, MACHINE_FILE).map_err(|error| error.to_string())?;
    let variables = FmuVariables::new(&parameters)?;
    let periods = parameters.machine_config().map_err(|error| error.to_string())?.periods();
    let name = parameters.get("machine").map_or_else(String::new, |name| text_value(&name));
    let name = escaped(&name);
    let mut out = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head><meta charset=\"utf-8\"><title>{name}</title></head>\n<body>\n\
         <h1>{name}</h1>\n\
         <p>Feed drives of a machine tool, written by virtual_axes {version}.</p>\n\
         <p>A step is any multiple of {tick} s, the current cycle Tsi, unless <code>periods.current_us</code> is changed. \
         The drives read the setpoints every {cycle} s, the position cycle Tsp, and hold them in between; loads act from \
         the start of a step. Other steps are rejected with a message.</p>\n\
         <table>\n<tr><th>variable</th><th>causality</th><th>variability</th><th>type</th><th>unit</th><th>start</th>\
         <th>description</th></tr>\n",
        version = env!("CARGO_PKG_VERSION"),
        tick = periods.current as f64 / 1e9,
        cycle = periods.position as f64 / 1e9,
    );
    for variable in variables.list() {
        let (causality, variability) = causality(variable);
        // Writing to a String is infallible.
        let _ = writeln!(
            out,
            "<tr><td>{}</td><td>{causality}</td><td>{variability}</td><td>{:?}</td><td>{}</td><td>{}</td><td>{}</td></tr>",
            escaped(&variable.name),
            variable.kind,
            escaped(variable.unit),
            variable.start.as_ref().map(|start| escaped(&start_text(start))).unwrap_or_default(),
            escaped(&variable.description),
        );
    }
    out.push_str("</table>\n</body>\n</html>\n");
    Ok(out)
}
