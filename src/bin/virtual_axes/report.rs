//! `--report`: the runs of a command as a page with plots.

use std::error::Error;
use std::path::Path;

use virtual_axes_core::assess::Recording;
use virtual_axes_io::files::OutputFile;
use virtual_axes_report::{Report, ReportRun, Scatter};

use crate::input::Input;
use crate::run::Run;
use crate::table;

/// Refuses a name that says that it is something else; devices and pipes have no extension.
pub fn check_name(path: &Path) -> Result<(), String> {
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase());
    match extension.as_deref() {
        None | Some("html" | "htm") => Ok(()),
        Some(_) => Err(format!("{}: a report is a page: .html", path.display())),
    }
}

/// Writes the page; it stands under its name only when it is whole.
pub fn write(
    path: &Path,
    input: &Input,
    machine: &str,
    runs: &[Run],
    scatters: &[Scatter],
) -> Result<(), Box<dyn Error>> {
    let titles: Vec<String> = runs.iter().map(Run::title).collect();
    let empty = Recording::default();
    // All runs alike, so that their tables can be compared row by row.
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
                facts.push(("outside of its stroke".to_owned(), format!("{}, {time} s", axis.name)));
            }
        }
        if figures.contour.is_none() {
            facts.push(("contour error".to_owned(), table::NO_CONTOUR.to_owned()));
        }
        facts.extend(table::more(figures).map(|line| ("not shown".to_owned(), line)));
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
