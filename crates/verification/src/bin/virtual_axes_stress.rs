//! Runs random trajectories and checks every tick of them: limits, energy, errors against model.

use std::error::Error;
use std::fmt::Write;
use std::num::NonZeroUsize;
use std::process::ExitCode;
use std::thread;

use clap::Parser;
use serde_json::{Value, json};
use virtual_axes_core::config::Parameters;
use virtual_axes_core::machine::SimdWidth;
use virtual_axes_verification::print_result;
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

fn main() -> ExitCode {
    print_result(run(&Arguments::parse()))
}

/// Runs the trajectories and returns the summary. The error lists the violations.
fn run(arguments: &Arguments) -> Result<String, Box<dyn Error + Send + Sync>> {
    let load = |machine: &String| Parameters::load(machine, virtual_axes_builtin::MACHINES);
    let given = arguments.machine.iter().map(load).collect::<Result<Vec<_>, _>>()?;
    let machines = if given.is_empty() { TestMachines::shipped()? } else { TestMachines::new(&given)? };
    if let Some(number) = arguments.only {
        return only(&machines, arguments, number);
    }
    let cores = || thread::available_parallelism().map_or(1, NonZeroUsize::get);
    let options = StressOptions {
        seed: arguments.seed,
        first: arguments.first,
        count: arguments.count,
        threads: arguments.threads.map_or_else(cores, usize::from),
        width: SimdWidth::Widest,
    };
    let summary = stress::run(&machines, &options)?;
    if !summary.violations.is_empty() {
        let mut text = format!("{} trajectories with violations, seed {}", summary.violating, options.seed);
        for violation in &summary.violations {
            write!(text, "\n{violation}")?;
        }
        return Err(text.into());
    }
    Ok(if arguments.json { format!("{:#}\n", object(&machines, &options, &summary)) } else { text(&summary) })
}

/// Runs one trajectory and returns its plan and figures as text.
fn only(
    machines: &TestMachines,
    arguments: &Arguments,
    number: u64,
) -> Result<String, Box<dyn Error + Send + Sync>> {
    let plan = TestPlan::new(machines, arguments.seed, number)?;
    let variant = &machines.variants()[plan.variant];
    let record = TrajectoryTest::new(machines, arguments.seed, SimdWidth::Widest).run(number)?;
    let mut text = format!("{}, {}\n{plan:#?}\n{:#?}\n", variant.machine, variant.controllers, record.axes);
    for violation in &record.violations {
        writeln!(text, "{violation}")?;
    }
    if record.violations.is_empty() { Ok(text) } else { Err(text.trim_end().into()) }
}

fn text(summary: &StressSummary) -> String {
    let StressSummary { run, ticks, bounded, axes, .. } = summary;
    format!(
        "{run} trajectories without violation, {ticks} ticks of axes\n\
         axes with an error bound: {bounded} of {axes}\n\
         largest error / bound: {}\n\
         largest difference from the linear loop / allowed rounding error: {}\n\
         largest energy imbalance of a tick / allowed rounding error: {}\n\
         digest: {}\n",
        worst(summary.error),
        worst(summary.mismatch),
        worst(summary.imbalance),
        summary.digest()
    )
}

fn worst((value, number): (f64, u64)) -> String {
    format!("{value:.3e} (trajectory {number})")
}

fn object(machines: &TestMachines, options: &StressOptions, summary: &StressSummary) -> Value {
    let worst = |(value, number): (f64, u64)| json!({ "value": value, "trajectory": number });
    let variants = machines.variants().iter().zip(&summary.variants).map(|(variant, count)| {
        json!({ "machine": variant.machine, "controllers": variant.controllers, "trajectories": count })
    });
    let kinds = summary.kinds.iter().map(|(kind, count)| (kind.to_string(), json!(count)));
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
