//! Machine file of the identified axes: its text, and the sentence about it on the page.

use std::path::Path;

use virtual_axes_core::config::{ConfigError, Parameters, Value, ValueSource};
use virtual_axes_identify::identify::IdentifiedValue;
use virtual_axes_identify::identify::summary::IdentificationSummary;
use virtual_axes_identify::recording::Severity;

use crate::identify::new_machine;

/// Returns the machine file; `machine` is the name of the initial machine, none for a new one.
pub fn machine_text(
    machine: Option<&str>,
    found: &[IdentificationSummary],
    identified: &Parameters,
) -> String {
    let name = found.first().map_or("", |summary| summary.machine.as_str());
    let mut head = match machine {
        None => format!(
            "{name}, by `virtual_axes identify --new-machine`. Values of the template are neither stated nor identified: \
             replace them by those of the control and of data sheets."
        ),
        Some(machine) => format!(
            "{name}, from the machine {machine} by `virtual_axes identify`; see there for the sources of the other values."
        ),
    };
    for summary in found {
        let recordings = summary.recordings.iter().chain(&summary.transmission_recordings);
        let recordings: Vec<&str> = recordings.map(|r| r.name.as_str()).collect();
        head.push_str(&format!(
            "\n{} was identified from {}; ± is the standard error.",
            summary.axis,
            recordings.join(", ")
        ));
        if !summary.validation.is_empty() {
            let others: Vec<&str> = summary.validation.iter().map(|v| v.recording.name.as_str()).collect();
            head.push_str(&format!("\nValidated on {}.", others.join(", ")));
        }
        for finding in summary.findings.iter().filter(|finding| finding.severity > Severity::Note) {
            head.push_str(&format!("\n{}", finding.line()));
        }
    }
    let comment = |key: &str| {
        let mut values = found.iter().flat_map(|summary| &summary.values);
        let value = values.rfind(|value| value.key == key).map(IdentifiedValue::comment);
        value.or_else(|| new_machine::comment(identified, key).filter(|_| machine.is_none()))
    };
    identified.to_yaml(&head, comment)
}

/// Returns the sentence of the page about the machine file `out`.
pub fn machine_file_sentence(out: Option<&Path>, is_invalid: bool) -> String {
    match (out, is_invalid) {
        (Some(out), false) => format!("The machine file {} is written.", out.display()),
        (Some(out), true) => format!("The machine file {} is not written.", out.display()),
        (None, _) => "No machine file was requested (--out).".to_owned(),
    }
}

/// Returns the machine with the axes `names` only.
///
/// # Errors
/// Returns an error if no axis is left.
pub fn with_axes(machine: &Parameters, names: &[&str]) -> Result<Parameters, ConfigError> {
    let mut kept = machine.clone();
    let names = names.iter().map(|name| (*name).to_owned()).collect();
    kept.set("joints", Value::TextList(names), &ValueSource::named("--axis"))?;
    Ok(kept)
}
