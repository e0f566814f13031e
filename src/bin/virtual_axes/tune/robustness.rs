//! `virtual_axes robustness`: one tuning on plants that deviate from the nominal plant of its design.

use std::error::Error;

use virtual_axes_core::config::MachineConfig;
use virtual_axes_core::text::escaped;
use virtual_axes_identify::tune::{Cost, DeviatingRun, PlantDeviation, Robustness, analyze_robustness};
use virtual_axes_io::files::robustness_json;
use virtual_axes_report::Table;

use crate::arguments::output_arguments::{OutputArguments, OutputFormat};
use crate::arguments::trial_arguments::TrialArguments;
use crate::arguments::variant::{self, RunController};
use crate::output::progress::SearchProgress;
use crate::output::text_table;
use crate::tune::search::{columns, name_error, read_workload, row};

/// Arguments of `virtual_axes robustness`.
#[derive(Debug, clap::Args)]
pub struct RobustnessArguments {
    #[command(flatten)]
    trial: TrialArguments,
    /// Override the position controller of the machine.
    #[arg(long, value_enum)]
    controller: Option<RunController>,
    /// Relative deviation of inertia, friction and torque constant.
    #[arg(long, default_value_t = 0.3, allow_negative_numbers = true, value_parser = relative_deviation)]
    by: f64,
    /// Cost function to compare, see `tune`.
    #[arg(long, default_value = "contour", value_name = "TERM=WEIGHT[,…]")]
    cost: Cost,
    #[command(flatten)]
    output: OutputArguments,
}

impl RobustnessArguments {
    /// Returns the form of the output.
    pub fn output(&self) -> OutputArguments {
        self.output
    }
}

fn relative_deviation(text: &str) -> Result<f64, String> {
    /// Larger deviations would reduce the inertia to a value that cannot be simulated.
    const MOST: f64 = 0.8;
    let error = || format!("must be in 0 … {MOST}, relative to the nominal value");
    let value: f64 = text.parse().map_err(|_| error())?;
    if (0.0..=MOST).contains(&value) { Ok(value) } else { Err(error()) }
}

/// Runs the command and returns a table or JSON.
pub fn run(arguments: &RobustnessArguments) -> Result<String, Box<dyn Error>> {
    let machine = arguments.trial.machine()?;
    let parameters = variant::parameters(&machine, arguments.controller, &arguments.trial.set, &[])?;
    let input = arguments.trial.input()?;
    let config = variant::checked(&parameters, &machine, &arguments.trial.machine)?;
    let path = read_workload(&input, &config, arguments.trial.feed)?;
    let progress = SearchProgress::new(arguments.output.is_quiet());
    let found = analyze_robustness(&parameters, &path, &arguments.cost, arguments.by, &progress);
    progress.finish();
    let found = found.map_err(|error| name_error(&input, error))?;
    let controller = variant::controller_name(&parameters);
    Ok(match arguments.output.format() {
        OutputFormat::Json => {
            let names = (input.name(), input.description());
            let options = (&arguments.cost, arguments.by);
            format!("{:#}\n", robustness_json(names, (&config, &controller), options, &found))
        }
        OutputFormat::Csv => text_table::csv(&rows(arguments, &config, &found)),
        OutputFormat::Quiet => verdict(arguments, &found),
        OutputFormat::Text => {
            let (path, machine) = (escaped(input.name()), escaped(config.name()));
            let verdict = text_table::wrapped_line(verdict(arguments, &found).trim_end());
            let table = text_table::text(&rows(arguments, &config, &found));
            format!("{verdict}\n{path}: {machine}, {controller}, cost {}\n\n{table}", arguments.cost)
        }
    })
}

/// Returns the nominal result and the worst one in one line.
fn verdict(arguments: &RobustnessArguments, found: &Robustness) -> String {
    let unit = arguments.cost.unit(&found.nominal.figures);
    let margin =
        |one: &DeviatingRun| one.margins.as_ref().map_or("none".to_owned(), |m| format!("{:.3}", m.modulus));
    format!(
        "cost {}: {:.2} {unit} nominal, {:.2} {unit} at worst; modulus margin {} → {}\n",
        arguments.cost,
        found.nominal.cost,
        found.worst.cost,
        margin(&found.nominal),
        margin(&found.worst)
    )
}

fn rows(arguments: &RobustnessArguments, config: &MachineConfig, found: &Robustness) -> Table {
    let cells =
        |name: String, one: &DeviatingRun| row(name, one.cost, one.margins.as_ref(), &one.figures, config);
    let nominal = cells("nominal".to_owned(), &found.nominal);
    let single = found.single.iter().map(|one| cells(name(&one.deviation), one));
    let worst = cells(format!("worst combination: {}", name(&found.worst.deviation)), &found.worst);
    let rows = std::iter::once(nominal).chain(single).chain([worst]).collect();
    Table { columns: columns("plant", &arguments.cost, &found.nominal.figures), rows, ..Table::default() }
}

/// Returns a name such as "inertia × 0.7, friction × 1.3".
fn name(deviation: &PlantDeviation) -> String {
    let factors =
        [("inertia", deviation.inertia), ("friction", deviation.friction), ("Kt", deviation.torque_constant)];
    let deviating = factors.iter().filter(|(_, factor)| *factor != 1.0);
    let names: Vec<String> = deviating.map(|(name, factor)| format!("{name} × {factor}")).collect();
    if names.is_empty() { "nominal".to_owned() } else { names.join(", ") }
}
