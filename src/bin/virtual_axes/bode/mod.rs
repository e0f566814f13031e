//! `virtual_axes bode`: frequency responses and margins of the current, velocity and position loops.

pub mod bode_output;
pub mod bode_report;
pub mod loops;

use std::error::Error;
use std::path::PathBuf;

use virtual_axes_core::config::AxisConfig;
use virtual_axes_core::machine::contour_axes;

use crate::arguments::axis::selected_axes;
use crate::arguments::trial_arguments::MachineArguments;
use crate::output::machine_file;
use crate::output::report::{self, ReportMachine};
use loops::{LoopName, analyze};

/// File name of the standard output.
const STANDARD_OUTPUT: &str = "-";

/// Arguments of `virtual_axes bode`.
#[derive(Debug, clap::Args)]
pub struct BodeArguments {
    #[command(flatten)]
    machine: MachineArguments,
    /// Axes to analyze [default: all].
    #[arg(long, value_name = "AXIS[,AXIS]…", value_delimiter = ',')]
    axis: Vec<String>,
    /// Loops to analyze [default: all].
    #[arg(long = "loop", value_enum, value_name = "LOOP[,LOOP]…", value_delimiter = ',')]
    loops: Vec<LoopName>,
    /// Print only the verdict.
    #[arg(long, short, conflicts_with = "json")]
    quiet: bool,
    /// Print the figures as one JSON object.
    #[arg(long)]
    json: bool,
    /// Write the frequency responses as comma-separated values; without FILE to standard output, instead of the table.
    #[arg(long, value_name = "FILE", num_args = 0..=1, default_missing_value = STANDARD_OUTPUT)]
    csv: Option<PathBuf>,
    /// Write a report with Bode plots (.html).
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
}

/// Runs the command and returns a table, JSON or comma-separated values.
pub fn run(arguments: &BodeArguments) -> Result<String, Box<dyn Error>> {
    check_outputs(arguments)?;
    let config = arguments.machine.parameters()?.machine_config()?;
    let gain = config.contour_gain();
    let coupled: Vec<&str> = contour_axes(gain, config.axes().iter())
        .into_iter()
        .filter_map(|index| config.axes().get(index).map(AxisConfig::name))
        .collect();
    let selected = selected_axes(config.axes(), &arguments.axis)?;
    let has_contour = selected.iter().any(|axis| coupled.contains(&axis.name()));
    if arguments.loops == [LoopName::Contour] && !has_contour {
        return Err(match coupled.is_empty() {
            true => "--loop contour: cross-coupled control is off; set contour_control.gain above 0".into(),
            false => format!("--loop contour: only {} have this loop", coupled.join(", ")).into(),
        });
    }
    let mut axes = Vec::new();
    for axis in selected {
        let gain = coupled.contains(&axis.name()).then_some(gain);
        let loops = analyze((axis, gain), &config.periods(), &arguments.loops)
            .map_err(|error| format!("axis {}: {error}", axis.name()))?;
        axes.push(loops);
    }
    if let Some(page) = &arguments.report {
        let machine =
            ReportMachine { title: config.name().to_owned(), source: arguments.machine.name().to_owned() };
        bode_report::write(page, &machine, &axes)?;
    }
    match &arguments.csv {
        Some(path) if path.as_os_str() == STANDARD_OUTPUT => return Ok(bode_output::csv(&axes)),
        Some(path) => machine_file::write(path, &bode_output::csv(&axes))?,
        None => {}
    }
    Ok(if arguments.json {
        format!("{:#}\n", bode_output::object(config.name(), &axes))
    } else if arguments.quiet {
        bode_output::verdict(&axes)
    } else {
        bode_output::text(&axes)
    })
}

/// Rejects output files that cannot be written beside each other or that are the machine file.
fn check_outputs(arguments: &BodeArguments) -> Result<(), String> {
    for output in [&arguments.csv, &arguments.report].into_iter().flatten() {
        arguments.machine.must_not_be(output)?;
    }
    report::check_page(arguments.report.as_deref(), ("--csv", arguments.csv.as_deref()))?;
    match &arguments.csv {
        Some(csv) if csv.as_os_str() == STANDARD_OUTPUT && (arguments.json || arguments.quiet) => {
            let other = if arguments.json { "--json" } else { "--quiet" };
            Err(format!("--csv and {other} both print to standard output; give --csv a file"))
        }
        _ => Ok(()),
    }
}
