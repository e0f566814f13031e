//! Runs random trajectories and checks every tick of them: limits, energy, errors against theory.

use std::error::Error;
use std::fmt::Write;
use std::num::NonZeroUsize;
use std::process::ExitCode;
use std::thread;

use clap::Parser;
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::{Value, json};
use virtual_axes_core::config::Parameters;
use virtual_axes_core::machine::Width;
use virtual_axes_verification::stress::{self, Bench, Fleet, Options, Plan, Summary};

/// Trajectories, and the number of the first, at most: nobody waits for more.
const MOST: u64 = 1 << 62;

/// Runs random trajectories and checks every tick of them: limits, energy, errors against theory.
#[derive(Debug, Parser)]
#[command(version)]
struct Arguments {
    /// What everything random follows from.
    #[arg(long, default_value_t = 1, allow_negative_numbers = true)]
    seed: u64,
    /// How many trajectories.
    #[arg(long, default_value_t = 10_000, allow_negative_numbers = true, value_parser = clap::value_parser!(u64).range(1..=MOST))]
    count: u64,
    /// Number of the first one.
    #[arg(long, default_value_t = 0, allow_negative_numbers = true, value_parser = clap::value_parser!(u64).range(..=MOST))]
    first: u64,
    /// Threads; all cores if left out. The result does not depend on it.
    #[arg(long, allow_negative_numbers = true, value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// How wide vectors of the processor are used. The result does not depend on it.
    #[arg(long, value_enum, default_value_t = WidthName::Widest)]
    width: WidthName,
    /// A shipped machine or a machine file, with each kind of controller; all shipped ones if left out. Can be given
    /// several times.
    #[arg(long)]
    machine: Vec<String>,
    /// Run this trajectory alone, and print what it is.
    #[arg(long, value_name = "NUMBER", allow_negative_numbers = true, conflicts_with_all = ["count", "first", "threads", "json"])]
    only: Option<u64>,
    /// Print the figures as one JSON object.
    #[arg(long)]
    json: bool,
}

/// Widths of vectors.
#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum WidthName {
    /// As wide as this processor has them.
    Widest,
    /// As wide as this processor has them, but four numbers at most.
    Four,
    /// As every processor of its kind has them; slow.
    Baseline,
}

impl From<WidthName> for Width {
    fn from(name: WidthName) -> Self {
        match name {
            WidthName::Widest => Width::Widest,
            WidthName::Four => Width::Four,
            WidthName::Baseline => Width::Baseline,
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

/// Runs the trajectories. The error lists the faults found.
fn run(arguments: &Arguments) -> Result<String, Box<dyn Error>> {
    let fleet = if arguments.machine.is_empty() {
        Fleet::shipped()?
    } else {
        let machines: Result<Vec<_>, _> =
            arguments.machine.iter().map(|machine| Parameters::load(machine)).collect();
        Fleet::new(&machines?)?
    };
    if let Some(number) = arguments.only {
        return only(&fleet, arguments, number);
    }
    let cores = || thread::available_parallelism().map_or(1, NonZeroUsize::get);
    let options = Options {
        seed: arguments.seed,
        first: arguments.first,
        count: arguments.count,
        threads: arguments.threads.map_or_else(cores, usize::from),
        width: arguments.width.into(),
    };
    let progress = ProgressBar::new(options.count);
    progress.set_style(ProgressStyle::with_template("{wide_bar} {pos} of {len} trajectories, {eta} left")?);
    let summary = stress::run(&fleet, &options, |run| {
        progress.set_position(run);
        Ok(())
    });
    progress.finish_and_clear();
    let summary = summary?;
    if !summary.faults.is_empty() {
        let mut text = format!("{} trajectories with faults, seed {}", summary.faulty, options.seed);
        for fault in &summary.faults {
            write!(text, "\n{fault}")?;
        }
        return Err(text.into());
    }
    Ok(if arguments.json {
        format!("{:#}\n", object(&fleet, &options, &summary))
    } else {
        text(&fleet, &options, &summary)
    })
}

/// What one trajectory is and came to.
fn only(fleet: &Fleet, arguments: &Arguments, number: u64) -> Result<String, Box<dyn Error>> {
    let plan = Plan::new(fleet, arguments.seed, number)?;
    let variant = &fleet.variants()[plan.variant];
    let record = Bench::new(fleet, arguments.seed, arguments.width.into()).run(number)?;
    let mut text = format!("{}, {}\n{plan:#?}\n{:#?}\n", variant.machine, variant.controllers, record.axes);
    for fault in &record.faults {
        writeln!(text, "{fault}")?;
    }
    if record.faults.is_empty() { Ok(text) } else { Err(text.trim_end().into()) }
}

fn text(fleet: &Fleet, options: &Options, summary: &Summary) -> String {
    let mut text = String::new();
    for (kind, count) in &summary.kinds {
        text.push_str(&format!("{}: {count}\n", kind.name()));
    }
    for (variant, count) in fleet.variants().iter().zip(&summary.variants) {
        text.push_str(&format!("{}, {}: {count}\n", variant.machine, variant.controllers));
    }
    let Summary { run, time, ticks, loaded, limited, axes, bounded, .. } = summary;
    let rows = [
        ("seed", options.seed.to_string()),
        ("trajectories", run.to_string()),
        ("simulated time", format!("{time:.1} s, {ticks} ticks of axes")),
        ("with a load", loaded.to_string()),
        ("reached a limit", limited.to_string()),
        ("axes whose error has a bound", format!("{bounded} of {axes}")),
        ("largest error, of its bound", worst(summary.error)),
        ("largest difference from the linear loop, of what rounding is allowed", worst(summary.mismatch)),
        ("largest imbalance of energy in a tick, of what rounding is allowed", worst(summary.imbalance)),
        ("energy supplied, less copper", format!("{:.1} J", summary.supplied)),
        ("taken by friction", format!("{:.1} J", summary.dissipated)),
        ("given back by friction in ticks of a standstill", format!("{:.6} J", summary.returned)),
        ("faults", summary.faulty.to_string()),
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

fn object(fleet: &Fleet, options: &Options, summary: &Summary) -> Value {
    let worst = |(value, number): (f64, u64)| json!({ "value": value, "trajectory": number });
    let variants = fleet.variants().iter().zip(&summary.variants).map(|(variant, count)| {
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
        "faulty": summary.faulty,
        "digest": summary.digest(),
    })
}
