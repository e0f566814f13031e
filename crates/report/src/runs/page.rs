//! Page of simulated runs: verdict, tables of figures, and plots.

use std::io::{self, Write};

use virtual_axes_core::assess::SignalRecording;
use virtual_axes_core::config::{AxisConfig, AxisKind, GpcConfig, PositionControllerConfig};
use virtual_axes_core::units::{MILLISECOND, Nanoseconds, POSITION_GAIN, Rounded, seconds};

use super::{SimulatedRun, comparison, operations_table, table, time_shares, tools_table, verdict};
use crate::text::capital;
use crate::{Report, ReportRun, Section, Table};

/// Contents of the page of one or several simulated runs of one trial.
#[derive(Debug)]
pub struct SimulationPage<'a> {
    /// Name of the trial.
    pub title: &'a str,
    /// Description of the trial; can be empty.
    pub description: &'a str,
    /// Name of the machine.
    pub machine: &'a str,
    /// Runs, the first of which the others are compared with.
    pub runs: &'a [SimulatedRun],
    /// Sections above the figures, such as that of a search.
    pub sections: Vec<Section>,
    /// Names and values that allow the runs to be repeated.
    pub provenance: Vec<(String, String)>,
}

impl SimulationPage<'_> {
    /// Writes the page as HTML. Equal runs give equal bytes.
    ///
    /// # Errors
    /// Returns the errors of the output.
    pub fn write(&self, output: &mut impl Write) -> io::Result<()> {
        let titles: Vec<String> = self.runs.iter().map(SimulatedRun::title).collect();
        let empty = SignalRecording::default();
        let run = |(run, title): (&SimulatedRun, &'_ String)| (facts(self.machine, run), title.clone());
        let described: Vec<(Vec<(String, String)>, String)> =
            self.runs.iter().zip(&titles).map(run).collect();
        let report = Report {
            title: self.title,
            description: self.description,
            verdict: verdict::lines(self.runs),
            tables: comparison::tables(self.runs)
                .into_iter()
                .chain([comparison::energy(self.runs)])
                .collect(),
            notes: comparison::note(self.runs)
                .into_iter()
                .chain(comparison::spike_note(self.runs))
                .chain([table::SAMPLING.to_owned()])
                .collect(),
            runs: described
                .iter()
                .zip(self.runs)
                .map(|((facts, title), run)| ReportRun {
                    title,
                    facts: facts.clone(),
                    recording: run.outcome.recording.as_ref().unwrap_or(&empty),
                    program: run.part_program.as_ref().map(|program| &program.path),
                })
                .collect(),
            overview: self.overview(),
            sections: std::iter::once(self.operations()).chain(self.sections.iter().cloned()).collect(),
            provenance: self.provenance.clone(),
        };
        report.write(output)
    }

    /// Returns a text with the title of the run if there are several runs, else with a capital letter.
    fn of_run(&self, run: &SimulatedRun, text: &str) -> String {
        if self.runs.len() > 1 { format!("{}: {text}", run.title()) } else { capital(text) }
    }

    /// Returns times and worst lines of part programs, with the titles of the runs if there are several.
    fn overview(&self) -> Section {
        let mut section = Section::default();
        for (index, run) in self.runs.iter().enumerate() {
            let Some(program) = &run.part_program else { continue };
            section.paragraphs.push(self.of_run(run, &format!("{}.", program.times())));
            section
                .paragraphs
                .push(self.of_run(run, &format!("{}.", time_shares(&program.figures.operations))));
            let caption = self.of_run(run, "lines with the largest contour errors");
            section.tables.push(program.page_table(caption, index));
        }
        section
    }

    /// Returns times and energy of part programs by operation, tool and line.
    fn operations(&self) -> Section {
        let mut section = Section::new("Times and energy of the program");
        for run in self.runs {
            let Some(program) = &run.part_program else { continue };
            let parts = [
                (
                    "times by operation",
                    operations_table(&program.figures.operations, usize::MAX, str::to_owned),
                ),
                ("times by tool", tools_table(&program.figures.operations)),
                ("lines with the largest electrical input", program.energy_table(str::to_owned)),
            ];
            let captioned =
                parts.map(|(caption, table)| Table { caption: self.of_run(run, caption), ..table });
            section.tables.extend(captioned);
        }
        section
    }
}

/// Returns machine, controller and changed parameters of a run, and remarks on it.
fn facts(machine: &str, run: &SimulatedRun) -> Vec<(String, String)> {
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
    let program = run.part_program.iter().flat_map(|program| &program.figures.notes);
    facts.extend(program.map(|(line, note)| ("note".to_owned(), format!("line {line}: {note}"))));
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
