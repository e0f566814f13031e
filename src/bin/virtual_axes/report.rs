//! The `--report` option: a page with tables and plots of the runs of a command.

use std::error::Error;
use std::path::Path;

use virtual_axes_core::assess::SignalRecording;
use virtual_axes_io::files::OutputFile;
use virtual_axes_report::{Report, ReportRun, Scatter};

use crate::input::CommandInput;
use crate::table;
use crate::variant::VariantRun;

/// Rejects a file name with an extension other than `.html` or `.htm`. Devices and pipes have no extension.
pub fn check_name(path: &Path) -> Result<(), String> {
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase());
    match extension.as_deref() {
        None | Some("html" | "htm") => Ok(()),
        Some(_) => Err(format!("{}: a report is HTML; its extension must be .html or .htm", path.display())),
    }
}

/// Writes the page atomically.
pub fn write(
    path: &Path,
    input: &CommandInput,
    machine: &str,
    runs: &[VariantRun],
    scatters: &[Scatter],
) -> Result<(), Box<dyn Error>> {
    let titles: Vec<String> = runs.iter().map(VariantRun::title).collect();
    let empty = SignalRecording::default();
    // The tables of all runs have equal rows, so that they can be compared.
    let overshoots = runs.iter().map(|run| table::overshoots(&run.outcome.figures));
    let ends = overshoots.fold([false; 2], |all, run| [all[0] || run[0], all[1] || run[1]]);
    let runs = runs.iter().zip(&titles).map(|(run, title)| {
        let figures = &run.outcome.figures;
        let mut facts = vec![
            ("machine".to_owned(), machine.to_owned()),
            ("controller".to_owned(), run.controller.clone()),
        ];
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
        facts.extend(run.changes.iter().map(|change| ("set".to_owned(), change.clone())));
        ReportRun {
            title,
            facts,
            tables: vec![table::axes(figures), table::path(figures, ends)],
            recording: run.outcome.recording.as_ref().unwrap_or(&empty),
        }
    });
    let report = Report { title: input.name(), description: input.description(), runs: runs.collect() };
    let mut file = OutputFile::create(path)?;
    report.write_with(scatters, &mut file)?;
    Ok(file.finish()?)
}
