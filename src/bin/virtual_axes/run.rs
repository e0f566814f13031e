//! `virtual_axes run`: a trial, offline.

use std::error::Error;
use std::io;
use std::path::{Path, PathBuf};

use virtual_axes_core::config::{MachineConfig, Parameters};
use virtual_axes_core::machine::AxisSample;
use virtual_axes_core::trial::{Outcome, Tick, Trial, TrialError};
use virtual_axes_core::units::{Nanoseconds, seconds};
use virtual_axes_io::files::{TraceWriter, trace_writer};

use crate::input::Input;
use crate::period::Period;
use crate::progress::Progress;
use crate::subject::Subject;
use crate::variant::{self, Controller};
use crate::{interrupt, json, report, table};

/// What to run.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    subject: Subject,
    /// Position controller in the place of the machine's; several are run one after the other.
    #[arg(long, value_enum, value_delimiter = ',')]
    controller: Vec<Controller>,
    /// One more run with these parameters, to be compared; can be given several times.
    #[arg(long, value_name = "KEY=VALUE[,KEY=VALUE]…")]
    compare: Vec<String>,
    /// Where to write signals over time.
    #[arg(long, value_name = "FILE.csv|FILE.mcap")]
    trace: Option<PathBuf>,
    /// Time between two rows of the trace, a multiple of the current loop's period; the position
    /// loop's if it is not given.
    #[arg(long, value_name = "125us", requires = "trace")]
    trace_period: Option<Period>,
    /// Where to write a page with plots.
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// Print the figures as one JSON object.
    #[arg(long)]
    json: bool,
}

/// One run of a command.
#[derive(Debug)]
pub struct Run {
    /// Controller of the axes.
    pub controller: String,
    /// What was set, as on the command line.
    pub changes: Vec<String>,
    /// What came out.
    pub outcome: Outcome,
}

impl Run {
    /// What tells it from the others.
    pub fn title(&self) -> String {
        let mut title = self.controller.clone();
        for change in &self.changes {
            title.push_str(", ");
            title.push_str(change);
        }
        title
    }
}

/// Runs it; the text is the tables of errors, or JSON.
pub fn run(arguments: &Arguments) -> Result<String, Box<dyn Error>> {
    let machine = arguments.subject.machine()?;
    let mut variants = Vec::new();
    for controller in controllers(&arguments.controller) {
        for compared in std::iter::once(None).chain(arguments.compare.iter().map(Some)) {
            let compared: Vec<String> =
                compared.iter().flat_map(|c| c.split(',')).map(|change| change.trim().to_owned()).collect();
            let parameters = variant::parameters(&machine, controller, &arguments.subject.set, &compared)?;
            variants.push((parameters, [arguments.subject.set.clone(), compared].concat()));
        }
    }
    if arguments.trace.is_some() && variants.len() > 1 {
        return Err(format!("--trace takes one run, not {}", variants.len()).into());
    }
    let input = arguments.subject.input()?;
    for output in [&arguments.trace, &arguments.report].into_iter().flatten() {
        input.must_not_be(output)?;
        arguments.subject.machine_must_not_be(output)?;
    }
    if let (Some(trace), Some(report)) = (&arguments.trace, &arguments.report)
        && trace == report
    {
        return Err(format!("{}: given for the trace and for the report", report.display()).into());
    }
    if let Some(report) = &arguments.report {
        report::check_name(report)?;
    }
    let mut runs = Vec::new();
    for (parameters, changes) in variants {
        let config = variant::checked(&parameters, &machine, &arguments.subject.machine)?;
        let outcome = trial(arguments, &input, &parameters, &config)?;
        runs.push(Run { controller: variant::controller_name(&parameters), changes, outcome });
    }
    let name = machine.machine_config()?.name().to_owned();
    if let Some(path) = &arguments.report {
        report::write(path, &input, &name, &runs, &[])?;
    }
    if arguments.json {
        return Ok(format!("{:#}\n", json::object(&input, &name, &runs)));
    }
    Ok(runs.iter().map(|run| text(run, runs.len() > 1)).collect::<Vec<_>>().join("\n"))
}

/// The controllers to run, or that of the machine file.
fn controllers(given: &[Controller]) -> Vec<Option<Controller>> {
    if given.is_empty() { vec![None] } else { given.iter().copied().map(Some).collect() }
}

fn trial(
    arguments: &Arguments,
    input: &Input,
    parameters: &Parameters,
    config: &MachineConfig,
) -> Result<Outcome, Box<dyn Error>> {
    let program = input.program(config, arguments.subject.feed)?;
    let trial = Trial {
        machine: config,
        program: program.clone(),
        allow_nonzero_end_velocity: parameters.node_config().allow_nonzero_velocity_at_trajectory_end,
        record: arguments.report.is_some(),
    };
    let setpoints = input.setpoints(config, program.as_ref())?;
    let mut progress = Progress::new(input.name(), program.as_ref().map(|p| p.duration()));
    let mut trace = match &arguments.trace {
        Some(path) => Some(Trace::new(path, arguments.trace_period, config)?),
        None => None,
    };
    let between_instants = trace.as_ref().is_some_and(|t| t.period % config.periods().position != 0);
    let watch = |tick: Tick<'_>| {
        if tick.position_instant {
            interrupt::check()?;
            progress.reached(seconds(tick.time));
        }
        trace.as_mut().map_or(Ok(()), |trace| trace.observe(tick))
    };
    let result = if between_instants {
        virtual_axes_core::trial::trace(&trial, setpoints, watch)
    } else {
        virtual_axes_core::trial::run(&trial, setpoints, watch)
    };
    progress.finish();
    let outcome = result.map_err(|error| named(input, error))?;
    if let Some(trace) = trace {
        trace.finish()?;
    }
    Ok(outcome)
}

/// The error with the name of the input, where it does not name a file itself.
pub fn named(input: &Input, error: TrialError) -> Box<dyn Error> {
    match error {
        TrialError::Watch(error) => error.into(),
        TrialError::Source(error) => error,
        error => format!("{}: {error}", input.name()).into(),
    }
}

/// A trace that is being written.
struct Trace {
    writer: Box<dyn TraceWriter>,
    period: Nanoseconds,
    samples: Vec<AxisSample>,
}

impl Trace {
    fn new(path: &Path, period: Option<Period>, config: &MachineConfig) -> Result<Self, Box<dyn Error>> {
        let tick = config.periods().current;
        let period = period.map_or(config.periods().position, |period| period.nanoseconds());
        if period % tick != 0 {
            let reason =
                format!("--trace-period {period} ns: must be a multiple of the current loop's {tick} ns");
            return Err(reason.into());
        }
        let names: Vec<String> = config.axes().iter().map(|axis| axis.name().to_owned()).collect();
        Ok(Trace { writer: trace_writer(path, &names)?, period, samples: Vec::new() })
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

/// Tables of one run, under its title if there are several.
fn text(run: &Run, several: bool) -> String {
    let figures = &run.outcome.figures;
    let mut text = String::new();
    if several {
        text.push_str(&format!("{}\n\n", run.title()));
    }
    text.push_str(&table::text(&table::axes(figures)));
    for remark in table::remarks(figures) {
        text.push_str(&remark);
        text.push('\n');
    }
    let path = table::path(figures, table::overshoots(figures));
    if !path.rows.is_empty() {
        text.push('\n');
        text.push_str(&table::text(&path));
    }
    text
}
