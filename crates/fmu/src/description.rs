//! `modelDescription.xml`.

use std::collections::BTreeSet;
use std::fmt::Write;

use virtual_axes_core::config::{Parameters, Value};
use virtual_axes_core::state_codec::checksum;

use crate::resources::MACHINE_FILE;
use crate::units::{base_unit, display_unit, display_units};
use crate::variables::{Causality, FmuType, FmuVariable, FmuVariables, text_value};

/// Name of the library in the archive, without extension, and `modelIdentifier` of the model description.
pub const MODEL_IDENTIFIER: &str = "virtual_axes_fmu";

/// Returns the identifier that connects model description, library and machine file: a hash of the text of the machine
/// file and of all variables.
///
/// # Errors
/// The text of an error of the machine file or of the machine.
pub fn guid(machine_file: &str) -> Result<String, String> {
    let version = env!("CARGO_PKG_VERSION");
    let hash = checksum(format!("{machine_file}\n{}", description_with(machine_file, "")?).as_bytes());
    Ok(format!("{MODEL_IDENTIFIER}-{version}-{hash:016x}"))
}

/// Returns the model description of the machine in a machine file.
///
/// # Errors
/// The text of an error of the machine file or of the machine.
pub fn model_description(machine_file: &str) -> Result<String, String> {
    description_with(machine_file, &guid(machine_file)?)
}

fn description_with(machine_file: &str, guid: &str) -> Result<String, String> {
    let parameters = Parameters::from_yaml(machine_file, MACHINE_FILE).map_err(|error| error.to_string())?;
    let variables = FmuVariables::new(&parameters)?;
    let variables = variables.list();
    let periods = parameters.machine_config().map_err(|error| error.to_string())?.periods();
    let name = parameters.get("machine").map_or_else(String::new, |name| text_value(&name));
    let convention =
        if variables.iter().all(|variable| is_structured(&variable.name)) { "structured" } else { "flat" };
    let mut out = String::from("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n");
    // Writing to a String is infallible.
    let _ = write!(
        out,
        "<fmiModelDescription fmiVersion=\"2.0\" modelName=\"{name}\" guid=\"{guid}\"\n\
         \x20   description=\"Feed drives of a machine tool: controllers, motors, friction\"\n\
         \x20   version=\"{version}\" generationTool=\"virtual_axes {version}\"\n\
         \x20   variableNamingConvention=\"{convention}\" numberOfEventIndicators=\"0\">\n\
         <CoSimulation modelIdentifier=\"{MODEL_IDENTIFIER}\" canHandleVariableCommunicationStepSize=\"true\"\n\
         \x20   canNotUseMemoryManagementFunctions=\"true\" canGetAndSetFMUstate=\"true\"\n\
         \x20   canSerializeFMUstate=\"true\"/>\n",
        name = escaped(&name),
        guid = escaped(guid),
        version = env!("CARGO_PKG_VERSION"),
    );
    write_units(&mut out, variables);
    out.push_str(
        "<LogCategories>\n<Category name=\"logStatusError\" description=\"Rejected calls, with the reason\"/>\n\
         <Category name=\"logStatusFatal\" description=\"Errors of the library\"/>\n</LogCategories>\n",
    );
    let _ = writeln!(
        out,
        "<DefaultExperiment startTime=\"0\" stopTime=\"1\" stepSize=\"{:?}\"/>",
        periods.position as f64 / 1e9
    );
    out.push_str("<ModelVariables>\n");
    for (reference, variable) in variables.iter().enumerate() {
        write_variable(&mut out, reference, variable);
    }
    out.push_str("</ModelVariables>\n<ModelStructure>\n");
    for list in ["Outputs", "InitialUnknowns"] {
        let _ = writeln!(out, "<{list}>");
        for (reference, variable) in variables.iter().enumerate() {
            if variable.causality == Causality::Output {
                let _ = writeln!(out, "<Unknown index=\"{}\"/>", reference + 1);
            }
        }
        let _ = writeln!(out, "</{list}>");
    }
    out.push_str("</ModelStructure>\n</fmiModelDescription>\n");
    Ok(out)
}

fn write_units(out: &mut String, variables: &[FmuVariable]) {
    let units: BTreeSet<&str> =
        variables.iter().map(|variable| variable.unit).filter(|unit| !unit.is_empty()).collect();
    out.push_str("<UnitDefinitions>\n");
    for unit in units {
        let base = base_unit(unit).map(|base| format!("<BaseUnit {base}/>")).unwrap_or_default();
        let display =
            |(name, factor): &(&str, f64)| format!("<DisplayUnit name=\"{name}\" factor=\"{factor:?}\"/>");
        let display: String = display_units(unit).iter().map(display).collect();
        let _ = writeln!(out, "<Unit name=\"{}\">{base}{display}</Unit>", escaped(unit));
    }
    out.push_str("</UnitDefinitions>\n");
}

fn write_variable(out: &mut String, reference: usize, variable: &FmuVariable) {
    let (causality, variability) = causality(variable);
    let initial = match variable.causality {
        Causality::Input => "",
        Causality::Output => " initial=\"calculated\"",
        Causality::FixedParameter | Causality::TunableParameter => " initial=\"exact\"",
    };
    let kind = variable.kind;
    let mut attributes = String::new();
    if !variable.unit.is_empty() && variable.kind == FmuType::Real {
        let _ = write!(attributes, " unit=\"{}\"", escaped(variable.unit));
        if let Some(display) = display_unit(&variable.name, variable.unit) {
            let _ = write!(attributes, " displayUnit=\"{display}\"");
        }
    }
    if let Some((min, max)) = &variable.range {
        let _ = write!(attributes, " min=\"{min}\" max=\"{max}\"");
    }
    if let Some(start) = &variable.start {
        let _ = write!(attributes, " start=\"{}\"", escaped(&start_text(start)));
    }
    let _ = writeln!(
        out,
        "<ScalarVariable name=\"{}\" valueReference=\"{reference}\" causality=\"{causality}\" \
         variability=\"{variability}\"{initial} description=\"{}\"><{kind:?}{attributes}/></ScalarVariable>",
        escaped(&variable.name),
        escaped(&variable.description),
    );
}

/// Returns causality and variability.
pub(crate) fn causality(variable: &FmuVariable) -> (&'static str, &'static str) {
    match (variable.causality, variable.kind) {
        (Causality::Input, _) => ("input", "continuous"),
        (Causality::Output, FmuType::Real) => ("output", "continuous"),
        (Causality::Output, _) => ("output", "discrete"),
        (Causality::FixedParameter, _) => ("parameter", "fixed"),
        (Causality::TunableParameter, _) => ("parameter", "tunable"),
    }
}

/// Returns a start value as text, numbers with all digits.
pub(crate) fn start_text(value: &Value) -> String {
    match value {
        Value::Double(number) => format!("{number:?}"),
        other => text_value(other),
    }
}

/// Returns the text of an attribute; characters that XML does not allow are replaced.
pub(crate) fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\t' | '\n' | '\r' => {
                let _ = write!(out, "&#{};", character as u32);
            }
            '\0'..='\u{1f}' | '\u{fffe}' | '\u{ffff}' => out.push('\u{fffd}'),
            other => out.push(other),
        }
    }
    out
}

/// Returns true for names of FMI's structured naming convention: identifiers with dots and an index.
fn is_structured(name: &str) -> bool {
    name.split('.').all(|part| {
        let part = match part.split_once('[') {
            Some((part, index)) => match index.strip_suffix(']') {
                Some(digits) if !digits.is_empty() && digits.bytes().all(|byte| byte.is_ascii_digit()) => {
                    part
                }
                _ => return false,
            },
            None => part,
        };
        let is_word = |byte: u8| byte.is_ascii_alphanumeric() || byte == b'_';
        !part.is_empty() && !part.as_bytes()[0].is_ascii_digit() && part.bytes().all(is_word)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn structured_names_are_identifiers_with_dots_and_an_index() {
        for name in ["x.position", "x_1.preview[12]", "uses_preview"] {
            assert!(is_structured(name), "{name}");
        }
        for name in ["", "x-1.load", "1x.load", "x..load", "ä.load", "x.preview[]", "x.preview[1", "x y.load"]
        {
            assert!(!is_structured(name), "{name}");
        }
    }

    #[test]
    fn attributes_have_no_character_that_xml_excludes() {
        assert_eq!(escaped("a<b>&\"\n\u{1}"), "a&lt;b&gt;&amp;&quot;&#10;\u{fffd}");
    }
}
