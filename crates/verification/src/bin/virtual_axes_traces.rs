//! Generates production traces of a machine with hidden parameters.

use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Parser;
use virtual_axes_core::config::AxisConfig;
use virtual_axes_core::units::MILLIMETER;
use virtual_axes_verification::production_traces::{
    AxisGuess, HiddenAxis, HiddenMachine, TraceError, TraceRecorder, machine_file, truth_file, write_csv,
};

/// Largest backlash, µm.
const MAX_BACKLASH: f64 = 1000.0;
/// Largest Stribeck friction, A.
const MAX_STRIBECK: f64 = 100.0;

/// Generates production traces of a machine with hidden parameters.
///
/// Writes trace_1.csv, trace_2.csv, … (one per program, all axes of the machine), truth.yaml and hidden.yaml (hidden
/// parameters, the latter as machine file) and guess.yaml (machine file with the knowledge of a user).
#[derive(Debug, Parser)]
#[command(version)]
struct Arguments {
    /// Seed of all random numbers.
    #[arg(long, default_value_t = 1, allow_negative_numbers = true)]
    seed: u64,
    /// Folder of the files; created if it does not exist.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Axes of the machine: X and Y, Z, or all three.
    #[arg(long, value_enum, default_value_t = AxisSelection::All)]
    axes: AxisSelection,
    /// Number of programs.
    #[arg(long, default_value_t = 2, allow_negative_numbers = true, value_parser = clap::value_parser!(u64).range(1..=1000))]
    programs: u64,
    /// Duration of each program, s.
    #[arg(long, default_value_t = 20.0, allow_negative_numbers = true, value_parser = |text: &str| number_in(text, [3.0, 60.0]))]
    duration: f64,
    /// Backlash between motor and recorded position, µm.
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true, value_parser = |text: &str| number_in(text, [0.0, MAX_BACKLASH]))]
    backlash_um: f64,
    /// Peak of the additional friction near standstill, A.
    #[arg(long, value_name = "A", default_value_t = 0.0, allow_negative_numbers = true, value_parser = |text: &str| number_in(text, [0.0, MAX_STRIBECK]))]
    stribeck: f64,
    /// Record without noise, quantization, gaps and jitter.
    #[arg(long)]
    ideal: bool,
}

/// Selection of axes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum AxisSelection {
    /// X and Y, without weight.
    Horizontal,
    /// Z, with weight.
    Vertical,
    /// X, Y and Z.
    All,
}

fn number_in(text: &str, [low, high]: [f64; 2]) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(number) if (low..=high).contains(&number) => Ok(number),
        _ => Err(format!("must be a number from {low} to {high}")),
    }
}

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(text) => {
            print!("{text}");
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("{error}");
            ExitCode::from(2)
        }
    }
}

/// Writes all files and returns the names of the traces.
fn run(arguments: &Arguments) -> Result<String, Box<dyn Error>> {
    let out = &arguments.out;
    fs::create_dir_all(out).map_err(|source| TraceError::Io { path: out.display().to_string(), source })?;
    let seed = arguments.seed;
    let mut machine = HiddenMachine::draw(seed);
    machine.axes.retain(|axis| match arguments.axes {
        AxisSelection::Horizontal => axis.joint < 2,
        AxisSelection::Vertical => axis.joint == 2,
        AxisSelection::All => true,
    });
    for axis in &mut machine.axes {
        axis.backlash = arguments.backlash_um * 1e-3 * MILLIMETER;
        axis.stribeck = arguments.stribeck;
    }
    let recorder = if arguments.ideal { TraceRecorder::ideal() } else { TraceRecorder::default() };
    let mut text = String::new();
    for number in 1..=arguments.programs {
        let trace_seed = seed.wrapping_mul(1000).wrapping_add(number);
        let program = machine.program(trace_seed, arguments.duration)?;
        let path = out.join(format!("trace_{number}.csv"));
        write_csv(&path, &machine.record(&program, &recorder, trace_seed)?)?;
        text.push_str(&format!("{}: {:.1} s\n", path.display(), program.duration()));
    }
    write_parameters(out, seed, &machine.axes)?;
    Ok(text)
}

/// Writes the hidden parameters and the guess.
fn write_parameters(out: &Path, seed: u64, axes: &[HiddenAxis]) -> Result<(), TraceError> {
    let write = |name: &str, text: String| {
        let path = out.join(name);
        fs::write(&path, text).map_err(|source| TraceError::Io { path: path.display().to_string(), source })
    };
    let Some(first) = axes.first() else { return Ok(()) };
    write("truth.yaml", truth_file(&format!("Hidden parameters of seed {seed}."), axes))?;
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
    write("guess.yaml", machine_file(&head, &configs, periods)?)
}
