//! `virtual_axes run`: offline simulation of a trial.

pub mod period;

use std::error::Error;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde_json::{Map, Value, json};
use virtual_axes_core::config::{MachineConfig, Parameters};
use virtual_axes_core::machine::AxisSample;
use virtual_axes_core::path::Program;
use virtual_axes_core::text::escaped;
use virtual_axes_core::trial::{Measures, Tick, Trial, TrialOutcome};
use virtual_axes_core::units::{Nanoseconds, seconds};
use virtual_axes_io::files::{RowWriter, figures_json, part_program_json, trace_writer};
use virtual_axes_nc::offline::{LineErrors, line_texts};
use virtual_axes_report::ToolPath;
use virtual_axes_report::runs::{
    ProgramReport, SimulatedRun, comparison, figure, table, time_shares, verdict,
};

use crate::arguments::output_arguments::{OutputArguments, OutputFormat};
use crate::arguments::trial_arguments::TrialArguments;
use crate::arguments::variant::{self, RunController};
use crate::builtin::PROGRAMS;
use crate::input::setpoint_summary::SetpointSummary;
use crate::input::{CommandInput, program_text};
use crate::output::operations::operations_text;
use crate::output::report::{self, ReportMachine};
use crate::output::{interrupt, print_error, text_table};
use period::PeriodArgument;

/// Distance from the path of `--reference` above which it is another one, m.
const OTHER_REFERENCE: f64 = 2e-3;

/// Arguments of `virtual_axes run`.
#[derive(Debug, clap::Args)]
pub struct RunArguments {
    #[command(flatten)]
    trial: TrialArguments,
    /// Override the position controller of the machine; several controllers are compared.
    #[arg(long, value_enum, value_delimiter = ',')]
    controller: Vec<RunController>,
    /// Compare with a run with these parameters; can be repeated.
    #[arg(long, value_name = "KEY=VALUE[,KEY=VALUE]…")]
    compare: Vec<String>,
    /// Measure the contour errors of a part program by line against the path of this program, of which it is a variant with
    /// moved points, such as one of `compile`.
    #[arg(long, value_name = "PROGRAM")]
    reference: Option<String>,
    /// Write signals over time to this file.
    #[arg(long, value_name = "FILE.csv|FILE.mcap")]
    trace: Option<PathBuf>,
    /// Sampling period of the trace, a multiple of the current cycle [default: position cycle].
    #[arg(long, value_name = "125us", requires = "trace", allow_hyphen_values = true)]
    trace_period: Option<PeriodArgument>,
    /// Write a page with plots to this file.
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    #[command(flatten)]
    output: OutputArguments,
}

impl RunArguments {
    /// Returns the form of the output.
    pub fn output(&self) -> OutputArguments {
        self.output
    }
}

/// Runs the command and returns tables of errors or JSON.
pub fn run(arguments: &RunArguments) -> Result<String, Box<dyn Error>> {
    let machine = arguments.trial.machine()?;
    let mut variants = Vec::new();
    for controller in controllers(&arguments.controller) {
        for compared in std::iter::once(None).chain(arguments.compare.iter().map(Some)) {
            let compared: Vec<String> = compared.iter().flat_map(|list| variant::changes(list)).collect();
            let parameters = variant::parameters(&machine, controller, &arguments.trial.set, &compared)?;
            variants.push((parameters, [arguments.trial.set.clone(), compared].concat()));
        }
    }
    if arguments.trace.is_some() && variants.len() > 1 {
        return Err(format!("--trace requires a single run, not {}", variants.len()).into());
    }
    let input = arguments.trial.input()?;
    for output in [&arguments.trace, &arguments.report].into_iter().flatten() {
        input.must_not_be(output)?;
        arguments.trial.machine_must_not_be(output)?;
    }
    report::check_page(arguments.report.as_deref(), ("--trace", arguments.trace.as_deref()))?;
    let mut runs = Vec::new();
    for (parameters, changes) in variants {
        let config = variant::checked(&parameters, &machine, &arguments.trial.machine)?;
        let program = input.program(&config, arguments.trial.feed)?;
        let (outcome, setpoints, part_program) =
            trial(arguments, &input, program.as_ref(), &parameters, &config)?;
        let feed =
            program.as_deref().and_then(|program| program_text::unreached_feed(program, config.axes()));
        // A part program has no column of times.
        let has_times = program.is_none() && !input.is_part_program();
        let slow = setpoints.slow_warning(config.axes()).filter(|_| has_times);
        let input_notes = input.notes_on_limits(&config).into_iter().chain(input.gap_warning());
        runs.push(SimulatedRun {
            controller: variant::controller_name(&parameters),
            changes,
            shared_changes: arguments.trial.set.len(),
            input_warnings: feed.into_iter().chain(slow).collect(),
            input_notes: input_notes.collect(),
            machine: config,
            part_program,
            outcome,
        });
    }
    input.print_program_notes();
    let name = machine.machine_config()?.name().to_owned();
    if let Some(path) = &arguments.report {
        let machine = ReportMachine { title: name.clone(), source: arguments.trial.machine.clone() };
        report::write(path, &input, &machine, &runs, Vec::new())?;
    }
    Ok(match arguments.output.format() {
        OutputFormat::Json => format!("{:#}\n", json_object(&input, &name, &runs)),
        OutputFormat::Csv => csv(&runs),
        OutputFormat::Quiet => verdict::lines(&runs).into_iter().map(|line| escaped(&line) + "\n").collect(),
        OutputFormat::Text => text(&runs),
    })
}

/// Returns the controllers to run; `None` is the controller of the machine file.
fn controllers(given: &[RunController]) -> Vec<Option<RunController>> {
    if given.is_empty() { vec![None] } else { given.iter().copied().map(Some).collect() }
}

/// Simulates a run; returns its outcome, a summary of its setpoints, and the figures of a part program.
fn trial(
    arguments: &RunArguments,
    input: &CommandInput,
    program: Option<&Arc<Program>>,
    parameters: &Parameters,
    config: &MachineConfig,
) -> Result<(TrialOutcome, SetpointSummary, Option<ProgramReport>), Box<dyn Error>> {
    let trial = Trial {
        machine: config,
        program: program.cloned(),
        allow_nonzero_end_velocity: parameters.node_config().allow_nonzero_velocity_at_trajectory_end,
        record: arguments.report.is_some(),
        measures: Measures::ALL,
    };
    let setpoints = input.setpoints(config, program)?;
    let mut progress =
        input.progress(program.map(|program| program.duration()), arguments.output.is_quiet())?;
    let mut trace = match &arguments.trace {
        Some(path) => Some(TraceRecorder::new(path, arguments.trace_period, config)?),
        None => None,
    };
    let is_subsampled = trace.as_ref().is_some_and(|t| t.period % config.periods().position != 0);
    let mut summary = SetpointSummary::default();
    let mut lines = input.is_part_program().then(|| LineErrors::new(config));
    if let Some(reference) = &arguments.reference {
        let path = input.path_of(reference, config)?;
        lines = lines.map(|lines| lines.with_reference(path));
    }
    let mut path = ToolPath::default();
    let on_tick = |tick: Tick<'_>| {
        summary.add(&tick);
        if let Some(lines) = &mut lines {
            lines.add(&tick, &mut input.track().borrow_mut()).iter().for_each(|cycle| path.add(cycle));
        }
        if tick.position_instant {
            interrupt::check()?;
            input.report_progress(&mut progress, seconds(tick.time));
        }
        trace.as_mut().map_or(Ok(()), |trace| trace.observe(tick))
    };
    let result = if is_subsampled {
        virtual_axes_core::trial::trace(&trial, setpoints, on_tick)
    } else {
        virtual_axes_core::trial::run(&trial, setpoints, on_tick)
    };
    progress.finish();
    let outcome = result.map_err(|error| input.name_error(error))?;
    if let Some(trace) = trace {
        trace.finish()?;
    }
    let part_program = match lines {
        Some(lines) => {
            let track = input.track().borrow();
            let figures = lines.finish(input.name(), PROGRAMS, &track, |cycle| path.add(cycle))?;
            path.texts = line_texts(input.name(), PROGRAMS, &path.lines())?;
            if let (Some(reference), Some(cuts)) = (&arguments.reference, &figures.cuts) {
                warn_of_other_reference(reference, cuts.blending);
            }
            Some(ProgramReport::new(figures, path))
        }
        None => None,
    };
    Ok((outcome, summary, part_program))
}

/// Warns of a reference whose path is not that of the program; `distance` is the largest one of the planned path, m.
fn warn_of_other_reference(reference: &str, distance: f64) {
    if distance > OTHER_REFERENCE {
        print_error(&format!(
            "warning: --reference {reference}: the cuts are planned up to {:.1} mm away from its path; is it the program that this \
             one was compiled from, with the same work offset?",
            1e3 * distance
        ));
    }
}

/// Writer of signals at the trace period.
struct TraceRecorder {
    writer: Box<dyn RowWriter<AxisSample>>,
    period: Nanoseconds,
    samples: Vec<AxisSample>,
}

impl TraceRecorder {
    fn new(
        path: &Path,
        period: Option<PeriodArgument>,
        config: &MachineConfig,
    ) -> Result<Self, Box<dyn Error>> {
        let tick = config.periods().current;
        let period = period.map_or(config.periods().position, |period| period.nanoseconds());
        if period % tick != 0 {
            let reason =
                format!("--trace-period {period} ns: must be a multiple of the current cycle, {tick} ns");
            return Err(reason.into());
        }
        let names: Vec<String> = config.axes().iter().map(|axis| axis.name().to_owned()).collect();
        Ok(TraceRecorder { writer: trace_writer(path, &names)?, period, samples: Vec::new() })
    }

    fn observe(&mut self, tick: Tick<'_>) -> io::Result<()> {
        if tick.time % self.period != 0 {
            return Ok(());
        }
        self.samples.clear();
        self.samples.extend(tick.machine.axes().iter().map(|axis| *axis.sample()));
        self.writer.row(tick.time, &self.samples)
    }

    fn finish(self) -> Result<(), Box<dyn Error>> {
        Ok(self.writer.finish()?)
    }
}

/// Returns the verdict and the tables of the runs: a row per axis of a single run, a column per run of several.
fn text(runs: &[SimulatedRun]) -> String {
    let verdict = verdict::lines(runs).into_iter().map(|line| text_table::wrapped_line(&escaped(&line)));
    let mut parts = vec![verdict.collect::<String>()];
    match runs {
        [run] => parts.extend(single(run)),
        _ => parts.extend(several(runs)),
    }
    parts.join("\n")
}

fn single(run: &SimulatedRun) -> Vec<String> {
    let figures = &run.outcome.figures;
    let mut axes = text_table::text(&table::axes(figures));
    let verdict = verdict::lines(std::slice::from_ref(run)).concat();
    let remarks = run.remarks().into_iter().filter(|remark| !verdict.contains(remark.as_str()));
    axes.extend(remarks.map(|remark| text_table::wrapped_line(&remark)));
    let path = run.path_table();
    let path =
        (!path.rows.is_empty()).then(|| text_table::text(&path) + &text_table::wrapped_line(table::SAMPLING));
    let energy = table::energy(figures);
    let energy = (!energy.rows.is_empty()).then(|| text_table::text(&energy));
    let program = run.part_program.as_ref().map(part_program_text);
    std::iter::once(axes).chain(path).chain(energy).chain(program).collect()
}

/// Returns the times of a part program, a table of its worst lines, and its operations and tools if there are several.
fn part_program_text(program: &ProgramReport) -> String {
    let operations = &program.figures.operations;
    let mut text = text_table::wrapped_line(&program.times());
    text += &text_table::wrapped_line(&time_shares(operations));
    text += &text_table::aligned(&program.worst_table(escaped), &[1, 2, 3]);
    text + &operations_text(operations)
}

fn several(runs: &[SimulatedRun]) -> Vec<String> {
    let mut parts = Vec::new();
    for mut table in comparison::tables(runs).into_iter().filter(|table| !table.rows.is_empty()) {
        let (head, values) = (2, table.columns.split_off(2));
        let most = text_table::columns_beside_text(runs.iter().map(SimulatedRun::title));
        for (index, columns) in values.chunks(most).enumerate() {
            let first = head + index * most;
            let mut part = table.clone();
            part.columns.extend_from_slice(columns);
            for row in &mut part.rows {
                row.drain(head.min(row.len())..first.min(row.len()));
                row.truncate(head + columns.len());
            }
            parts.push(text_table::aligned(&part, &[0, 1]));
        }
    }
    let all: Vec<Vec<String>> = runs.iter().map(SimulatedRun::remarks).collect();
    let remarks: Vec<String> = match all.split_first() {
        Some((first, others)) if others.iter().all(|other| other == first) => first.clone(),
        _ => runs
            .iter()
            .zip(all)
            .flat_map(|(run, remarks)| {
                let title = run.title();
                remarks.into_iter().map(move |remark| format!("{title}: {remark}"))
            })
            .collect(),
    };
    let notes = comparison::note(runs).into_iter().chain([table::SAMPLING.to_owned()]);
    parts.push(remarks.into_iter().chain(notes).map(|line| text_table::wrapped_line(&line)).collect());
    parts
}

/// Returns all figures as CSV, a row per run and figure.
fn csv(runs: &[SimulatedRun]) -> String {
    let mut text = "run,figure,value,unit\n".to_owned();
    for run in runs {
        let figures = &run.outcome.figures;
        let parts = [
            figure::of_axes(figures),
            run.path_figures(true),
            figure::of_circles(figures),
            figure::of_energy(figures),
        ];
        for figure in parts.concat().iter().filter(|figure| !figure.value.is_nan()) {
            let cells = [run.title(), figure.title(), figure.value.to_string(), figure.unit.to_owned()];
            text.push_str(&text_table::csv_row(&cells));
        }
    }
    text
}

/// Returns the runs of a command as a JSON object.
fn json_object(input: &CommandInput, machine: &str, runs: &[SimulatedRun]) -> Value {
    json!({
        "input": input.name(),
        "description": input.description(),
        "machine": machine,
        "runs": runs.iter().map(run_object).collect::<Vec<_>>(),
    })
}

fn run_object(run: &SimulatedRun) -> Value {
    let mut object = Map::new();
    object.insert("controller".to_owned(), json!(run.controller));
    object.insert("changes".to_owned(), json!(run.changes));
    object.extend(figures_json(&run.outcome.figures));
    if let Some(program) = &run.part_program {
        object.insert("part_program".to_owned(), part_program_json(&program.figures));
    }
    Value::Object(object)
}
