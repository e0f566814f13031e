//! The `--report` option: a page with tables and plots of the runs of a command.

use std::error::Error;
use std::path::Path;

use time::OffsetDateTime;
use virtual_axes_core::config::Parameters;
use virtual_axes_io::files::OutputFile;
use virtual_axes_report::Section;
use virtual_axes_report::runs::{SimulatedRun, SimulationPage};

use crate::input::CommandInput;

/// Rejects a file name with another extension than `.html` or `.htm`. Devices and pipes have no extension.
pub fn check_name(path: &Path) -> Result<(), String> {
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase());
    let is_stream = || {
        path.starts_with("/dev")
            || std::fs::metadata(path).is_ok_and(|found| !found.is_file() && !found.is_dir())
    };
    match extension.as_deref() {
        Some("html" | "htm") => Ok(()),
        None if is_stream() => Ok(()),
        _ => Err(format!("{}: a report is HTML; its extension must be .html or .htm", path.display())),
    }
}

/// Rejects the name of a page as [`check_name`] does, or if it is also given for another option.
pub fn check_page(page: Option<&Path>, (option, other): (&str, Option<&Path>)) -> Result<(), String> {
    let Some(page) = page else { return Ok(()) };
    if other == Some(page) {
        return Err(format!(
            "{}: is given for both {option} and --report; use different files",
            page.display()
        ));
    }
    check_name(page)
}

/// Writes the page atomically, with `sections` above the figures.
pub fn write(
    path: &Path,
    input: &CommandInput,
    machine: &ReportMachine,
    runs: &[SimulatedRun],
    sections: Vec<Section>,
) -> Result<(), Box<dyn Error>> {
    let page = SimulationPage {
        title: input.name(),
        description: input.description(),
        machine: &machine.title,
        runs,
        sections,
        provenance: provenance(machine),
    };
    let mut file = OutputFile::create(path)?;
    page.write(&mut file)?;
    Ok(file.finish()?)
}

/// Machine of a report.
#[derive(Debug, Clone)]
pub struct ReportMachine {
    /// Name in the machine file.
    pub title: String,
    /// Built-in machine or machine file, as given.
    pub source: String,
}

/// Returns what is needed to repeat the runs.
pub fn provenance(machine: &ReportMachine) -> Vec<(String, String)> {
    let command: Vec<String> =
        std::env::args_os().skip(1).map(|argument| quoted(&argument.to_string_lossy())).collect();
    let file = match Parameters::builtin_text(&machine.source, crate::builtin::MACHINES) {
        Ok(text) => Some(blake3::hash(text.as_bytes())),
        Err(_) => std::fs::read(&machine.source).ok().map(|bytes| blake3::hash(&bytes)),
    };
    let facts = [
        ("date", Some(date())),
        ("program", Some(format!("virtual_axes {}", env!("CARGO_PKG_VERSION")))),
        ("command", Some(format!("virtual_axes {}", command.join(" ")))),
        ("machine file", Some(machine.source.clone())),
        ("BLAKE3 digest of the machine file", file.map(|digest| digest.to_hex().to_string())),
    ];
    facts.into_iter().filter_map(|(name, value)| Some((name.to_owned(), value?))).collect()
}

/// Returns an argument as a shell accepts it.
fn quoted(argument: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_=.,/:+%@".contains(c);
    if !argument.is_empty() && argument.chars().all(is_plain) {
        argument.to_owned()
    } else {
        format!("'{}'", argument.replace('\'', "'\\''"))
    }
}

/// Returns the date in UTC: that of `SOURCE_DATE_EPOCH` if it is set, for pages that are equal in every byte.
fn date() -> String {
    let epoch = std::env::var("SOURCE_DATE_EPOCH").ok().and_then(|seconds| seconds.parse::<i64>().ok());
    let time = match epoch {
        Some(seconds) => OffsetDateTime::from_unix_timestamp(seconds).unwrap_or(OffsetDateTime::UNIX_EPOCH),
        None => OffsetDateTime::now_utc(),
    };
    let [date, clock] = [time.date().to_string(), format!("{:02}:{:02}", time.hour(), time.minute())];
    format!("{date} {clock} UTC")
}
