//! Runs random trajectories and checks every tick of them: limits, energy, errors against model.

use std::error::Error;
use std::fmt::Write;
use std::num::NonZeroUsize;
use std::process::ExitCode;
use std::thread;

use clap::Parser;
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::{Value, json};
use virtual_axes_core::config::Parameters;
use virtual_axes_core::machine::SimdWidth;
use virtual_axes_verification::stress::{
    self, StressOptions, StressSummary, TestMachines, TestPlan, TrajectoryTest,
};

/// Largest number of trajectories and largest number of the first one.
const MAX_COUNT: u64 = 1 << 62;

/// Runs random trajectories and checks every tick of them: limits, energy, errors against model.
#[derive(Debug, Parser)]
#[command(version)]
struct Arguments {
    /// Seed of all random numbers.
    #[arg(long, default_value_t = 1, allow_negative_numbers = true)]
    seed: u64,
    /// Number of trajectories.
    #[arg(long, default_value_t = 10_000, allow_negative_numbers = true, value_parser = clap::value_parser!(u64).range(1..=MAX_COUNT))]
    count: u64,
    /// Number of the first trajectory.
    #[arg(long, default_value_t = 0, allow_negative_numbers = true, value_parser = clap::value_parser!(u64).range(..=MAX_COUNT))]
    first: u64,
    /// Number of threads; default: all cores. The result does not depend on it.
    #[arg(long, allow_negative_numbers = true, value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// SIMD width. The result does not depend on it.
    #[arg(long, value_enum, default_value_t = WidthName::Widest)]
    width: WidthName,
    /// Shipped machine or machine file, tested with each kind of controller; default: all shipped machines. Can be given
    /// several times.
    #[arg(long)]
    machine: Vec<String>,
    /// Run only this trajectory and print its plan and figures.
    #[arg(long, value_name = "NUMBER", allow_negative_numbers = true, conflicts_with_all = ["count", "first", "threads", "json"])]
    only: Option<u64>,
    /// Print the figures as one JSON object.
    #[arg(long)]
    json: bool,
}

/// SIMD width on the command line.
#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum WidthName {
    /// Widest vectors of this processor.
    Widest,
    /// Widest vectors of this processor, at most four numbers.
    Four,
    /// Vectors of the baseline instruction set; slow.
    Baseline,
}

impl From<WidthName> for SimdWidth {
    fn from(name: WidthName) -> Self {
        match name {
            WidthName::Widest => SimdWidth::Widest,
            WidthName::Four => SimdWidth::Four,
            WidthName::Baseline => SimdWidth::Baseline,
        }
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

/// Runs the trajectories and returns the summary. The error lists the violations.
fn run(arguments: &Arguments) -> Result<String, Box<dyn Error>> {
    let machines = if arguments.machine.is_empty() {
        TestMachines::shipped()?
    } else {
        let machines: Result<Vec<_>, _> =
            arguments.machine.iter().map(|machine| Parameters::load(machine)).collect();
        TestMachines::new(&machines?)?
    };
    if let Some(number) = arguments.only {
        return only(&machines, arguments, number);
    }
    let cores = || thread::available_parallelism().map_or(1, NonZeroUsize::get);
    let options = StressOptions {
        seed: arguments.seed,
        first: arguments.first,
        count: arguments.count,
        threads: arguments.threads.map_or_else(cores, usize::from),
        width: arguments.width.into(),
    };
    let progress = ProgressBar::new(options.count);
    progress.set_style(ProgressStyle::with_template("{wide_bar} {pos} of {len} trajectories, {eta} left")?);
    let summary = stress::run(&machines, &options, |run| {
        progress.set_position(run);
        Ok(())
    });
    progress.finish_and_clear();
    let summary = summary?;
    if !summary.violations.is_empty() {
        let mut text = format!("{} trajectories with violations, seed {}", summary.violating, options.seed);
        for violation in &summary.violations {
            write!(text, "\n{violation}")?;
        }
        return Err(text.into());
    }
    Ok(if arguments.json {
        format!("{:#}\n", object(&machines, &options, &summary))
    } else {
        text(&machines, &options, &summary)
    })
}

/// Runs one trajectory and returns its plan and figures as text.
fn only(machines: &TestMachines, arguments: &Arguments, number: u64) -> Result<String, Box<dyn Error>> {
    let plan = TestPlan::new(machines, arguments.seed, number)?;
    let variant = &machines.variants()[plan.variant];
    let record = TrajectoryTest::new(machines, arguments.seed, arguments.width.into()).run(number)?;
    let mut text = format!("{}, {}\n{plan:#?}\n{:#?}\n", variant.machine, variant.controllers, record.axes);
    for violation in &record.violations {
        writeln!(text, "{violation}")?;
    }
    if record.violations.is_empty() { Ok(text) } else { Err(text.trim_end().into()) }
}

fn text(machines: &TestMachines, options: &StressOptions, summary: &StressSummary) -> String {
    let mut text = String::new();
    for (kind, count) in &summary.kinds {
        text.push_str(&format!("{}: {count}\n", kind.name()));
    }
    for (variant, count) in machines.variants().iter().zip(&summary.variants) {
        text.push_str(&format!("{}, {}: {count}\n", variant.machine, variant.controllers));
    }
    let StressSummary { run, time, ticks, loaded, limited, axes, bounded, .. } = summary;
    let rows = [
        ("seed", options.seed.to_string()),
        ("trajectories", run.to_string()),
        ("simulated time", format!("{time:.1} s, {ticks} axis ticks")),
        ("with a load", loaded.to_string()),
        ("reached a limit", limited.to_string()),
        ("axes with an error bound", format!("{bounded} of {axes}")),
        ("largest error / bound", worst(summary.error)),
        ("largest difference from the linear loop / allowed rounding error", worst(summary.mismatch)),
        ("largest energy imbalance of a tick / allowed rounding error", worst(summary.imbalance)),
        ("energy supplied, without copper losses", format!("{:.1} J", summary.supplied)),
        ("dissipated by friction", format!("{:.1} J", summary.dissipated)),
        ("returned by friction at standstill", format!("{:.6} J", summary.returned)),
        ("trajectories with violations", summary.violating.to_string()),
        ("digest", summary.digest()),
    ];
    for (name, value) in rows {
        text.push_str(&format!("{name}: {value}\n"));
    }
    text
}

fn worst((value, number): (f64, u64)) -> String {
    format!("{value:.3e} (trajectory {number})")
}

fn object(machines: &TestMachines, options: &StressOptions, summary: &StressSummary) -> Value {
    let worst = |(value, number): (f64, u64)| json!({ "value": value, "trajectory": number });
    let variants = machines.variants().iter().zip(&summary.variants).map(|(variant, count)| {
        json!({ "machine": variant.machine, "controllers": variant.controllers, "trajectories": count })
    });
    let kinds = summary.kinds.iter().map(|(kind, count)| (kind.name().to_owned(), json!(count)));
    json!({
        "seed": options.seed,
        "first": options.first,
        "count": options.count,
        "run": summary.run,
        "kinds": kinds.collect::<serde_json::Map<_, _>>(),
        "machines": variants.collect::<Vec<_>>(),
        "simulated_s": summary.time,
        "ticks": summary.ticks,
        "loaded": summary.loaded,
        "limited": summary.limited,
        "axes": summary.axes,
        "bounded_axes": summary.bounded,
        "error_of_bound": worst(summary.error),
        "mismatch": worst(summary.mismatch),
        "imbalance": worst(summary.imbalance),
        "supplied_j": summary.supplied,
        "dissipated_j": summary.dissipated,
        "returned_j": summary.returned,
        "faulty": summary.violating,
        "digest": summary.digest(),
    })
}
