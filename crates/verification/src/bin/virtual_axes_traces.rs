//! Generates production traces of a machine with hidden parameters.

use std::error::Error;
use std::fs;
use std::num::NonZero;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::thread;

use clap::Parser;
use virtual_axes_core::config::AxisConfig;
use virtual_axes_core::units::{MILLISECOND_NS, Nanoseconds};
use virtual_axes_verification::print_result;
use virtual_axes_verification::production_traces::{
    AxisGuess, AxisOrientation, HiddenAxis, HiddenMachine, PERIODS, TraceKind, TraceProgram, TraceRecorder,
    machine_file, study, study_table, write_csv,
};

/// Generates production traces of a machine with hidden parameters, or studies their identification.
///
/// Writes trace_1.csv, trace_2.csv, … (one per program, all axes of the machine), hidden.yaml (machine file with the
/// hidden parameters) and guess.yaml (machine file with the knowledge of a user).
#[derive(Debug, Parser)]
#[command(version)]
struct Arguments {
    /// Seed of all random numbers; first seed of a study.
    #[arg(long, default_value_t = 1, allow_negative_numbers = true)]
    seed: u64,
    /// Folder of the files; created if it does not exist.
    #[arg(long, value_name = "DIR", required_unless_present = "study")]
    out: Option<PathBuf>,
    /// Number of programs.
    #[arg(long, default_value_t = 2, allow_negative_numbers = true, value_parser = clap::value_parser!(u64).range(1..=1000))]
    programs: u64,
    /// Duration of each program, s.
    #[arg(long, default_value_t = 20.0, allow_negative_numbers = true)]
    duration: f64,
    /// Period of the samples, ms: 0.5, 1, 2, 4, 6, 10 or 20; recorder and program are drawn [default: the recorder of a
    /// machining center, 20 ms; in a study all periods].
    #[arg(long, value_name = "MS", allow_negative_numbers = true, value_parser = parse_period)]
    period_ms: Option<Nanoseconds>,
    /// Identifies one axis from a drawn recording for each of that many seeds and prints the distribution of the errors.
    #[arg(long, value_name = "SEEDS", conflicts_with_all = ["out", "programs", "duration"],
        value_parser = clap::value_parser!(u64).range(1..=100_000))]
    study: Option<u64>,
}

fn parse_period(text: &str) -> Result<Nanoseconds, String> {
    let period =
        text.parse::<f64>().ok().map(|period| (period * MILLISECOND_NS as f64).round() as Nanoseconds);
    let known = || PERIODS.map(|period| (period as f64 / MILLISECOND_NS as f64).to_string()).join(", ");
    period.filter(|period| PERIODS.contains(period)).ok_or_else(|| format!("must be one of {}", known()))
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    print_result(match (arguments.study, &arguments.out) {
        (Some(count), _) => run_study(&arguments, count),
        (None, Some(out)) => write_files(&arguments, out),
        (None, None) => Ok(String::new()),
    })
}

/// Identifies the axes of `count` seeds, horizontal and vertical in turn, and returns the distribution of the errors.
fn run_study(arguments: &Arguments, count: u64) -> Result<String, Box<dyn Error>> {
    let one = |k: u64| {
        let orientation = [AxisOrientation::Horizontal, AxisOrientation::Vertical][(k % 2) as usize];
        let period = arguments.period_ms.unwrap_or(PERIODS[(k as usize / 2) % PERIODS.len()]);
        study(arguments.seed.wrapping_add(k), orientation, period).map_err(|error| error.to_string())
    };
    let threads = thread::available_parallelism().map_or(1, NonZero::get) as u64;
    let results = thread::scope(|scope| {
        let run = |first| move || (first..count).step_by(threads as usize).map(one).collect::<Vec<_>>();
        let running: Vec<_> = (0..threads.min(count)).map(|first| scope.spawn(run(first))).collect();
        running
            .into_iter()
            .map(|thread| thread.join().map_err(|_| "a study stopped"))
            .collect::<Result<Vec<_>, _>>()
    })?;
    let mut figures = results.into_iter().flatten().collect::<Result<Vec<_>, _>>()?;
    figures.sort_by_key(|figure| figure.seed);
    Ok(study_table(&figures))
}

/// Writes all files and returns the names of the traces.
fn write_files(arguments: &Arguments, out: &Path) -> Result<String, Box<dyn Error>> {
    fs::create_dir_all(out).map_err(|error| format!("{}: {error}", out.display()))?;
    let seed = arguments.seed;
    let mut machine = HiddenMachine::draw(seed);
    let kind = arguments.period_ms.map(|period| TraceKind::draw(seed, period));
    let recorder = kind.as_ref().map_or_else(TraceRecorder::default, |kind| kind.recorder.clone());
    if let Some(kind) = &kind {
        machine.axes = machine.axes.into_iter().map(|axis| kind.applied(axis)).collect();
    }
    let mut text = String::new();
    for number in 1..=arguments.programs {
        let trace_seed = seed.wrapping_mul(1000).wrapping_add(number);
        let program = match kind.as_ref().map(|kind| kind.program) {
            Some(TraceProgram::Rapids(count)) => machine.rapids(trace_seed, count)?,
            _ => machine.program(trace_seed, arguments.duration)?,
        };
        let path = out.join(format!("trace_{number}.csv"));
        write_csv(&path, &machine.record(&program, &recorder, trace_seed)?)?;
        text.push_str(&format!("{}: {:.1} s\n", path.display(), program.duration()));
    }
    write_parameters(out, seed, &machine.axes)?;
    Ok(text)
}

/// Writes the hidden parameters and the guess.
fn write_parameters(out: &Path, seed: u64, axes: &[HiddenAxis]) -> Result<(), Box<dyn Error>> {
    let write = |name: &str, text: String| {
        let path = out.join(name);
        fs::write(&path, text).map_err(|error| format!("{}: {error}", path.display()))
    };
    let Some(first) = axes.first() else { return Ok(()) };
    let hidden: Vec<&AxisConfig> = axes.iter().map(|axis| &axis.config).collect();
    write(
        "hidden.yaml",
        machine_file(&format!("Hidden parameters of seed {seed}."), &hidden, first.periods)?,
    )?;
    let guesses: Vec<AxisGuess> = axes.iter().map(|axis| axis.guess(seed)).collect();
    let known = |is_known: bool| if is_known { "known" } else { "unknown, default" };
    let mut head = format!(
        "Knowledge of a user about the machine of seed {seed}.\nPeriods: {}.",
        known(guesses.first().is_some_and(|guess| guess.is_period_known))
    );
    for guess in &guesses {
        head.push_str(&format!(
            "\n{}: position-loop gain {}.",
            guess.config.name,
            known(guess.is_gain_known)
        ));
    }
    let configs: Vec<&AxisConfig> = guesses.iter().map(|guess| &guess.config).collect();
    let periods = guesses.first().map_or(first.periods, |guess| guess.periods);
    Ok(write("guess.yaml", machine_file(&head, &configs, periods)?)?)
}
