//! The `--report` option: a page with tables and plots of the runs of a command.

use std::error::Error;
use std::path::Path;

use time::OffsetDateTime;
use virtual_axes_core::assess::SignalRecording;
use virtual_axes_core::config::{AxisConfig, AxisKind, GpcConfig, Parameters, PositionControllerConfig};
use virtual_axes_core::units::{MILLISECOND, Nanoseconds, POSITION_GAIN, Rounded, seconds};
use virtual_axes_io::files::OutputFile;
use virtual_axes_report::{Report, ReportRun, Scatter, Section};

use crate::input::CommandInput;
use crate::variant::VariantRun;
use crate::{table, verdict};

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

/// Writes the page atomically.
pub fn write(
    path: &Path,
    input: &CommandInput,
    machine: &ReportMachine,
    runs: &[VariantRun],
    scatters: &[Scatter],
) -> Result<(), Box<dyn Error>> {
    let titles: Vec<String> = runs.iter().map(VariantRun::title).collect();
    let empty = SignalRecording::default();
    let report = Report {
        title: input.name(),
        description: input.description(),
        verdict: verdict::lines(runs),
        tables: table::comparison(runs).to_vec(),
        notes: table::comparison_note(runs)
            .into_iter()
            .chain(table::spike_note(runs))
            .chain([table::SAMPLING.to_owned()])
            .collect(),
        runs: runs
            .iter()
            .zip(&titles)
            .map(|(run, title)| ReportRun {
                title,
                facts: facts(&machine.title, run),
                recording: run.outcome.recording.as_ref().unwrap_or(&empty),
            })
            .collect(),
        sections: runs
            .iter()
            .zip(&titles)
            .filter_map(|(run, title)| part_program(run, title, runs.len()))
            .collect(),
        provenance: provenance(machine),
    };
    let mut file = OutputFile::create(path)?;
    report.write_with(scatters, &mut file)?;
    Ok(file.finish()?)
}

/// Returns the section of a part program; its heading has the title of the run if there are several.
fn part_program(run: &VariantRun, title: &str, runs: usize) -> Option<Section> {
    let heading = if runs > 1 { format!("Part program: {title}") } else { "Part program".to_owned() };
    run.part_program.as_ref().map(|program| program.section(&heading))
}

/// Machine of a report.
#[derive(Debug, Clone)]
pub struct ReportMachine {
    /// Name in the machine file.
    pub title: String,
    /// Built-in machine or machine file, as given.
    pub source: String,
}

/// Returns machine, controller and changed parameters of a run, and remarks on it.
fn facts(machine: &str, run: &VariantRun) -> Vec<(String, String)> {
    let figures = &run.outcome.figures;
    let mut facts =
        vec![("machine".to_owned(), machine.to_owned()), ("controller".to_owned(), run.controller.clone())];
    let extrapolated = figures.axes.iter().filter(|axis| axis.friction_extrapolated);
    facts.extend(extrapolated.map(|axis| ("friction law extrapolated".to_owned(), axis.name.clone())));
    for axis in &figures.axes {
        if let Some(time) = table::outside(axis) {
            facts.push(("outside its travel limits".to_owned(), format!("{}, {time} s", axis.name)));
        }
    }
    if figures.contour.is_none() {
        facts.push(("contour error".to_owned(), table::NO_CONTOUR.to_owned()));
    }
    facts.extend(table::more(figures).map(|line| ("without figures".to_owned(), line)));
    let warnings = run.axis_warnings().into_iter().chain(run.input_warnings.clone());
    facts.extend(warnings.map(|warning| ("warning".to_owned(), warning)));
    facts.extend(run.input_notes.iter().map(|note| ("note".to_owned(), note.clone())));
    facts.extend(run.changes.iter().map(|change| ("set".to_owned(), change.clone())));
    let moving = run.machine.axes().iter().zip(&figures.axes).filter(|(_, figures)| figures.moves);
    facts.extend(moving.map(|(axis, _)| (axis.name().to_owned(), values(axis))));
    facts
}

/// Returns the tuning of the position controller of an axis, and its delays.
fn values(axis: &AxisConfig) -> String {
    let unit = match axis.kind() {
        AxisKind::Linear => "(m/min)/mm",
        AxisKind::Rotary => "(1000 °/min)/°",
    };
    let rounded = |value: f64| Rounded(value).to_string();
    let milliseconds = |delay: Nanoseconds| format!("{} ms", Rounded(seconds(delay) / MILLISECOND));
    let delays = &axis.delays;
    let alpha = milliseconds(delays.alpha);
    match &axis.position_loop.controller {
        PositionControllerConfig::Cascade => format!(
            "Kp {} {unit}, VFFW {}, TFFW {} kg·m², α {alpha}, β {}, γ {}",
            rounded(axis.position_loop.gain / POSITION_GAIN),
            rounded(axis.feedforward.velocity),
            rounded(axis.feedforward.torque),
            milliseconds(delays.beta),
            milliseconds(delays.gamma),
        ),
        PositionControllerConfig::Gpc(GpcConfig { n1, n2, nu, lambda_rel, lambda }) => {
            let lambda = match lambda {
                Some(lambda) => format!("λ {} s²", rounded(*lambda)),
                None => format!("λ_rel {}", rounded(*lambda_rel)),
            };
            format!("N1 {n1}, N2 {n2}, Nu {nu}, {lambda}, α {alpha}")
        }
        PositionControllerConfig::Rst(rst) => format!(
            "degrees of R, S, T: {}, {}, {}, α {alpha}",
            rst.r.len().saturating_sub(1),
            rst.s.len().saturating_sub(1),
            rst.t.len().saturating_sub(1),
        ),
    }
}

/// Returns what is needed to repeat the runs.
fn provenance(machine: &ReportMachine) -> Vec<(String, String)> {
    let command: Vec<String> = std::env::args().skip(1).map(|argument| quoted(&argument)).collect();
    let file = match Parameters::builtin_text(&machine.source) {
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
