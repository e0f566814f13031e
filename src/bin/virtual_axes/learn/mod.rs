//! `virtual_axes learn`: setpoints that compensate the repeatable errors of a motion.

pub mod learn_output;

use std::error::Error;
use std::path::{Path, PathBuf};

use virtual_axes_core::config::{MachineConfig, Parameters};
use virtual_axes_core::design::{LEARNING_GAIN, LearningTuning};
use virtual_axes_core::trial::TrialOutcome;
use virtual_axes_identify::learn::{LearningError, LearningOptions, LearningResult, MAX_ITERATIONS, learn};
use virtual_axes_io::files::psec_writer;
use virtual_axes_report::runs::SimulatedRun;

use crate::arguments::output_arguments::{OutputArguments, OutputFormat};
use crate::arguments::trial_arguments::TrialArguments;
use crate::arguments::variant::{self, RunController};
use crate::input::{CommandInput, program_text};
use crate::output::interrupt;
use crate::output::progress::SearchProgress;
use crate::output::report::{self, ReportMachine};
use crate::tune::search::read_workload;
use learn_output as output;

/// One micrometer or microradian.
const MICRO: f64 = 1e-6;

/// Arguments of `virtual_axes learn`.
#[derive(Debug, clap::Args)]
pub struct LearnArguments {
    #[command(flatten)]
    trial: TrialArguments,
    /// Override the position controller of the machine.
    #[arg(long, value_enum)]
    controller: Option<RunController>,
    /// Number of iterations after the run of the programmed setpoints.
    #[arg(long, default_value_t = 8, allow_negative_numbers = true, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=MAX_ITERATIONS as u64))]
    iterations: u64,
    /// Bandwidth of the low-pass filter Q, Hz [default: the highest one that converges for all plants].
    #[arg(long, allow_negative_numbers = true, value_name = "HZ")]
    bandwidth: Option<f64>,
    /// Learning gain: part of the error that an iteration compensates.
    #[arg(long, default_value_t = LEARNING_GAIN, allow_negative_numbers = true, value_parser = learning_gain)]
    gain: f64,
    /// Encoder step of the axes, by which measured positions are rounded, µm or µrad; 0 is the exact position.
    #[arg(long, default_value_t = 1.0, allow_negative_numbers = true, value_name = "UM", value_parser = encoder_step)]
    encoder_step: f64,
    /// Acceleration of the compensated setpoints beyond the limit of an axis, relative to it.
    #[arg(long, default_value_t = 0.5, allow_negative_numbers = true, value_parser = acceleration_excess)]
    acceleration_excess: f64,
    /// Run the programmed and the learned setpoints on the machine with these parameters as well; can be repeated.
    #[arg(long, value_name = "KEY=VALUE[,KEY=VALUE]…")]
    on: Vec<String>,
    /// Write the compensated setpoints of the best run to this file: .csv, .mcap or .yaml.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Write a page with plots to this file.
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    #[command(flatten)]
    output: OutputArguments,
}

impl LearnArguments {
    /// Returns the form of the output.
    pub fn output(&self) -> OutputArguments {
        self.output
    }
}

fn learning_gain(text: &str) -> Result<f64, String> {
    let value = text.parse().ok().filter(|gain| *gain > 0.0 && *gain <= 2.0);
    value.ok_or_else(|| "must be above 0 and at most 2".to_owned())
}

fn encoder_step(text: &str) -> Result<f64, String> {
    /// Larger than the step of any position encoder, µm or µrad.
    const MOST: f64 = 1000.0;
    let value = text.parse().ok().filter(|step| (0.0..=MOST).contains(step));
    value.ok_or_else(|| format!("must be in 0 … {MOST}"))
}

fn acceleration_excess(text: &str) -> Result<f64, String> {
    /// Far beyond what a drive can follow.
    const MOST: f64 = 10.0;
    let value = text.parse().ok().filter(|excess| (0.0..=MOST).contains(excess));
    value.ok_or_else(|| format!("must be in 0 … {MOST}"))
}

/// Runs the command and returns tables or JSON.
pub fn run(arguments: &LearnArguments) -> Result<String, Box<dyn Error>> {
    let machine = arguments.trial.machine()?;
    let parameters = variant::parameters(&machine, arguments.controller, &arguments.trial.set, &[])?;
    let input = arguments.trial.input()?;
    check_outputs(arguments, &input)?;
    let config = variant::checked(&parameters, &machine, &arguments.trial.machine)?;
    let path = read_workload(&input, &config, arguments.trial.feed)?;
    let program = input.program(&config, arguments.trial.feed)?;
    let feed = program.and_then(|program| program_text::unreached_feed(&program, config.axes()));
    let options = LearningOptions {
        iterations: usize::try_from(arguments.iterations).unwrap_or(MAX_ITERATIONS),
        tuning: LearningTuning { gain: arguments.gain, bandwidth: arguments.bandwidth },
        encoder_step: arguments.encoder_step * MICRO,
        acceleration_excess: arguments.acceleration_excess,
        deviation: output::DEVIATION,
    };
    let on = |list: &String| -> Result<(String, MachineConfig), Box<dyn Error>> {
        let changes = variant::changes(list);
        let changed = variant::changed_parameters(
            &machine,
            arguments.controller,
            &arguments.trial.set,
            ("--on", &changes),
        )?;
        let options = "--controller, --set or --on";
        let config = variant::checked_with(options, &changed, &machine, &arguments.trial.machine)?;
        Ok((changes.join(", "), config))
    };
    let others = arguments.on.iter().map(on).collect::<Result<Vec<_>, _>>()?;
    let is_other = |(_, other): &&(String, MachineConfig)| {
        other.periods() != config.periods() || other.axes().len() != config.axes().len()
    };
    if let Some((changes, _)) = others.iter().find(is_other) {
        return Err(format!("--on {changes}: must not change joints or periods").into());
    }
    let allow = parameters.node_config().allow_nonzero_velocity_at_trajectory_end;
    let progress = SearchProgress::new(arguments.output.is_quiet());
    let found =
        learn(&config, &path, &options, allow, arguments.report.is_some(), &progress).and_then(|found| {
            let on = |(name, machine): &(String, MachineConfig)| {
                Ok((name.clone(), found.run_on(machine, &path, allow, &progress)?))
            };
            Ok((others.iter().map(on).collect::<Result<Vec<_>, LearningError>>()?, found))
        });
    progress.finish();
    let (others, found) = found.map_err(|error| -> Box<dyn Error> {
        match error {
            LearningError::Trial(error) => input.name_error(error),
            error => format!("{}: {error}", input.name()).into(),
        }
    })?;
    if let Some(out) = &arguments.out {
        write_psec(out, &config, &found)?;
    }
    let learned = output::Learned {
        input: &input,
        config: &config,
        controller: variant::controller_name(&parameters),
        options: &options,
        found: &found,
        others,
        warning: feed,
    };
    if let Some(page) = &arguments.report {
        write_report(page, arguments, &parameters, &learned)?;
    }
    Ok(match arguments.output.format() {
        OutputFormat::Json => format!("{:#}\n", learned.json()),
        OutputFormat::Csv => learned.csv(),
        OutputFormat::Quiet => learned.verdict(),
        OutputFormat::Text => learned.text(),
    })
}

/// Rejects invalid output files before the first run.
fn check_outputs(arguments: &LearnArguments, input: &CommandInput) -> Result<(), Box<dyn Error>> {
    for output in [&arguments.out, &arguments.report].into_iter().flatten() {
        input.must_not_be(output)?;
        arguments.trial.machine_must_not_be(output)?;
    }
    Ok(report::check_page(arguments.report.as_deref(), ("--out", arguments.out.as_deref()))?)
}

/// Writes the setpoints of the best run atomically.
fn write_psec(path: &Path, config: &MachineConfig, found: &LearningResult) -> Result<(), Box<dyn Error>> {
    let names: Vec<String> = config.axes().iter().map(|axis| axis.name().to_owned()).collect();
    let mut writer = psec_writer(path, &names)?;
    for (row, k) in found.psec.chunks_exact(names.len().max(1)).zip(0..) {
        interrupt::check()?;
        writer.row(k * config.periods().position, row)?;
    }
    Ok(writer.finish()?)
}

/// Writes the page with the runs of the programmed and of the best setpoints.
fn write_report(
    page: &Path,
    arguments: &LearnArguments,
    parameters: &Parameters,
    learned: &output::Learned<'_>,
) -> Result<(), Box<dyn Error>> {
    let run = |name: String, outcome: &TrialOutcome| SimulatedRun {
        controller: variant::controller_name(parameters),
        changes: vec![name],
        shared_changes: 0,
        machine: learned.config.clone(),
        input_warnings: Vec::new(),
        input_notes: Vec::new(),
        part_program: None,
        outcome: outcome.clone(),
    };
    let [programmed, best] = &learned.found.outcomes;
    let runs = [
        run("programmed setpoints".to_owned(), programmed),
        run(format!("iteration {}", learned.found.best), best),
    ];
    let machine =
        ReportMachine { title: learned.config.name().to_owned(), source: arguments.trial.machine.clone() };
    report::write(page, learned.input, &machine, &runs, learned.sections())
}
