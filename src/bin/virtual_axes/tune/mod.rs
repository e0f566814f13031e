//! `virtual_axes tune`: optimization of controller tunings for a path.

pub mod robustness;
pub mod search;
pub mod tune_output;

use std::error::Error;
use std::path::{Path, PathBuf};

use virtual_axes_core::config::Parameters;
use virtual_axes_core::units::MILLISECOND;
use virtual_axes_identify::tune::{
    Cost, MarginLimits, TuneError, Tuning, TuningProblem, TuningResult, TuningSearch, Workload,
};
use virtual_axes_io::files::tuning_json;
use virtual_axes_report::runs::SimulatedRun;

use crate::arguments::log_arguments::LogArguments;
use crate::arguments::output_arguments::{OutputArguments, OutputFormat};
use crate::arguments::trial_arguments::TrialArguments;
use crate::arguments::variant;
use crate::input::{CommandInput, must_not_replace, program_text};
use crate::output::machine_file;
use crate::output::progress::SearchProgress;
use crate::output::report::{self, ReportMachine};
use search::{name_error, read_workload};
use tune_output as output;

/// Maximum of `--designs`, about an hour of computation.
const MOST_DESIGNS: u64 = 1_000_000;

/// Controller that can be tuned.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum TunableController {
    /// N1, N2, Nu and λ of the predictive controller.
    Gpc,
    /// Kp and feedforward weights of the cascade.
    Cascade,
    /// Gain of cross-coupled control, with the position controllers as they are.
    Contour,
}

/// Arguments of `virtual_axes tune`.
#[derive(Debug, clap::Args)]
pub struct TuneArguments {
    #[command(flatten)]
    trial: TrialArguments,
    /// Controller to tune [default: controller of the machine].
    #[arg(long, value_enum)]
    controller: Option<TunableController>,
    /// Cost function: weighted sum of contour, contour-rms, following, rms, current, activity.
    #[arg(long, default_value = "contour", value_name = "TERM=WEIGHT[,…]")]
    cost: Cost,
    /// Smallest modulus margin of all axes [default: 0.5; 0 with --contrast].
    #[arg(long, allow_negative_numbers = true, value_parser = modulus_margin)]
    modulus_margin: Option<f64>,
    /// Smallest delay margin of all axes, ms [default: 5; 0 with --contrast].
    #[arg(long, allow_negative_numbers = true, value_parser = delay_margin)]
    delay_margin_ms: Option<f64>,
    /// Seed of the starting points of the cascade search [default: 1].
    #[arg(long, allow_negative_numbers = true)]
    seed: Option<u64>,
    /// Minimum number of predictive controllers in the first grid. The default grid has 1968; a larger N
    /// refines its λ, a smaller N does not change it.
    #[arg(long, allow_negative_numbers = true, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=MOST_DESIGNS))]
    designs: Option<u64>,
    /// Evaluate the best tuning on this path as well; can be repeated.
    #[arg(long, value_name = "SCENARIO|FILE")]
    also: Vec<String>,
    /// Search predictive controllers that are better than the initial tuning on SCENARIO and worse on the
    /// --also path, and select the worst of them.
    #[arg(long, requires = "also")]
    contrast: bool,
    /// Write the machine with the best tuning to this file.
    #[arg(long, value_name = "FILE.yaml")]
    out: Option<PathBuf>,
    /// Write a page with the results of the search and plots of best and initial tuning (with --contrast on
    /// the --also path).
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    #[command(flatten)]
    output: OutputArguments,
}

impl TuneArguments {
    /// Returns the form of the output.
    pub fn output(&self) -> OutputArguments {
        self.output
    }

    fn seed(&self) -> u64 {
        self.seed.unwrap_or(1)
    }
}

fn modulus_margin(text: &str) -> Result<f64, String> {
    within(text, 1.0)
}

fn delay_margin(text: &str) -> Result<f64, String> {
    /// Larger than the delay margin of any position loop, ms.
    const MOST: f64 = 1000.0;
    within(text, MOST)
}

fn within(text: &str, most: f64) -> Result<f64, String> {
    let error = || format!("must be in 0 … {most}");
    let value: f64 = text.parse().map_err(|_| error())?;
    if (0.0..=most).contains(&value) { Ok(value) } else { Err(error()) }
}

/// Runs the command and returns tables or JSON.
pub fn run(arguments: &TuneArguments) -> Result<String, Box<dyn Error>> {
    let machine = arguments.trial.machine()?;
    let parameters = variant::parameters(&machine, None, &arguments.trial.set, &[])?;
    let tunable = arguments.controller.map_or_else(|| tunable_controller(&parameters), Ok)?;
    if arguments.contrast && tunable != TunableController::Gpc {
        return Err("--contrast requires --controller gpc".into());
    }
    if arguments.designs.is_some() && (arguments.contrast || tunable != TunableController::Gpc) {
        return Err("--designs requires --controller gpc without --contrast".into());
    }
    if arguments.seed.is_some() && tunable != TunableController::Cascade {
        return Err("--seed requires --controller cascade; the other searches have no seed".into());
    }
    if arguments.contrast && arguments.also.len() > 1 {
        return Err(format!("--contrast requires a single --also path, not {}", arguments.also.len()).into());
    }
    let input = arguments.trial.input()?;
    check_outputs(arguments, &input)?;
    let config = variant::checked(&parameters, &machine, &arguments.trial.machine)?;
    let path = read_workload(&input, &config, arguments.trial.feed)?;
    let program = input.program(&config, arguments.trial.feed)?;
    let warning = program.and_then(|program| program_text::unreached_feed(&program, config.axes()));
    let others = arguments
        .also
        .iter()
        .map(|name| CommandInput::open(name, None, &LogArguments::default()))
        .collect::<Result<Vec<_>, _>>()?;
    let paths =
        others.iter().map(|other| read_workload(other, &config, None)).collect::<Result<Vec<_>, _>>()?;
    let limits = limits(arguments);
    let search = search(arguments, tunable);

    let progress = SearchProgress::new(arguments.output.is_quiet());
    let found = TuningProblem::new(&parameters, &path, &arguments.cost, &progress)
        .and_then(|problem| Ok((TuningResult::find(&problem, search, &paths, &limits)?, problem)));
    progress.finish();
    let (found, problem) = found.map_err(|error| name_error(&input, error))?;
    let Some(found) = found else {
        return Err(format!(
            "{}: no tuning of the grid is better than the initial tuning here and worse on {}",
            input.name(),
            arguments.also.join(", ")
        )
        .into());
    };
    if let Some(out) = &arguments.out {
        write_machine(out, arguments, &problem, &found)?;
    }
    if let Some(page) = &arguments.report {
        // With --contrast the page shows the path on which the tuning is worse.
        let (shown, workload) = match (others.first(), paths.first()) {
            (Some(other), Some(workload)) if arguments.contrast => (other, workload),
            _ => (&input, &path),
        };
        let runs = record(workload, &problem, &found).map_err(|error| name_error(shown, error))?;
        let machine = ReportMachine {
            title: problem.config().name().to_owned(),
            source: arguments.trial.machine.clone(),
        };
        report::write(page, shown, &machine, &runs, output::search_section(&problem, &found))?;
    }
    Ok(match arguments.output.format() {
        OutputFormat::Json => {
            let input = (input.name(), input.description());
            let object = tuning_json(input, search, &limits, arguments.seed(), &problem, &found);
            format!("{:#}\n", serde_json::Value::Object(object))
        }
        OutputFormat::Csv => output::csv(&problem, &found),
        OutputFormat::Quiet => output::verdict(&problem, &found, warning.as_deref()),
        OutputFormat::Text => output::text(&problem, &found, warning.as_deref()),
    })
}

/// Returns the controller of the machine if it can be tuned.
fn tunable_controller(parameters: &Parameters) -> Result<TunableController, String> {
    match variant::controller_name(parameters).as_str() {
        "gpc" => Ok(TunableController::Gpc),
        "cascade" | "cascade-noff" => Ok(TunableController::Cascade),
        other => Err(format!(
            "--controller: must be gpc or cascade; the machine has {other}, which cannot be tuned"
        )),
    }
}

/// Returns the search of the options.
fn search(arguments: &TuneArguments, tunable: TunableController) -> TuningSearch {
    match tunable {
        _ if arguments.contrast => TuningSearch::Contrast,
        TunableController::Gpc => {
            TuningSearch::Gpc(arguments.designs.and_then(|designs| usize::try_from(designs).ok()))
        }
        TunableController::Cascade => TuningSearch::Cascade(arguments.seed()),
        TunableController::Contour => TuningSearch::ContourGain,
    }
}

fn limits(arguments: &TuneArguments) -> MarginLimits {
    let default = if arguments.contrast { MarginLimits::STABLE } else { MarginLimits::default() };
    MarginLimits {
        modulus: arguments.modulus_margin.unwrap_or(default.modulus),
        delay: arguments.delay_margin_ms.map_or(default.delay, |ms| ms * MILLISECOND),
    }
}

/// Rejects invalid output files before the search starts.
fn check_outputs(arguments: &TuneArguments, input: &CommandInput) -> Result<(), Box<dyn Error>> {
    for output in [&arguments.out, &arguments.report].into_iter().flatten() {
        input.must_not_be(output)?;
        arguments.trial.machine_must_not_be(output)?;
        arguments.also.iter().try_for_each(|path| must_not_replace(output, Path::new(path)))?;
    }
    report::check_page(arguments.report.as_deref(), ("--out", arguments.out.as_deref()))?;
    Ok(arguments.out.as_deref().map_or(Ok(()), machine_file::check_name)?)
}

/// Writes the machine file with the best tuning atomically.
fn write_machine(
    path: &Path,
    arguments: &TuneArguments,
    problem: &TuningProblem<'_>,
    found: &TuningResult,
) -> Result<(), Box<dyn Error>> {
    let best = &found.best;
    let tuned = best.tuning.apply(problem.parameters(), problem.joints())?;
    let unit = problem.cost().unit(&best.figures);
    let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
    let feed = arguments.trial.feed.map_or(String::new(), |feed| format!(" at feed {feed}"));
    let margins = best.margins.map_or(String::new(), |m| {
        format!(", modulus margin {:.3}, delay margin {:.2} ms", m.modulus, m.delay / MILLISECOND)
    });
    let tuning = format!(
        "{}{feed}, {} = {:.2}{unit} (initial {:.2}){margins}",
        problem.workload().name(),
        problem.cost(),
        best.cost,
        problem.present().cost
    );
    let head = format!(
        "{}, from the machine {} by `virtual_axes tune`; see there for the sources of the other values.\n\
         Tuned for {tuning}.",
        problem.config().name(),
        arguments.trial.machine,
    );
    let keys: Vec<String> =
        best.tuning.values(problem.joints(), problem.parameters()).into_iter().map(|(key, _)| key).collect();
    let text =
        tuned.to_yaml(&head, |key| keys.iter().any(|k| k == key).then(|| format!("tuned for {tuning}")));
    Ok(machine_file::write(path, &text)?)
}

/// Runs the initial and the best tuning on a path and records the signals.
fn record(
    workload: &Workload,
    problem: &TuningProblem<'_>,
    found: &TuningResult,
) -> Result<[SimulatedRun; 2], TuneError> {
    let run = |tuning: &Tuning| -> Result<SimulatedRun, TuneError> {
        // Controller of the tuned axes.
        let controller = match tuning {
            Tuning::Present | Tuning::ContourGain(_) => variant::controller_name(problem.parameters()),
            Tuning::Gpc { .. } => "gpc".to_owned(),
            Tuning::Cascade(_) => "cascade".to_owned(),
        };
        let outcome = problem.record_on(workload, tuning)?;
        Ok(SimulatedRun {
            controller,
            changes: vec![match tuning {
                Tuning::Present => "initial".to_owned(),
                tuning => tuning.to_string(),
            }],
            shared_changes: 0,
            machine: tuning.apply(problem.parameters(), problem.joints())?.machine_config()?,
            input_warnings: Vec::new(),
            input_notes: Vec::new(),
            part_program: None,
            outcome,
        })
    };
    Ok([run(&Tuning::Present)?, run(&found.best.tuning)?])
}
