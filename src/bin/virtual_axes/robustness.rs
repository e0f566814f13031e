//! `virtual_axes robustness`: one tuning on plants that deviate from what it was designed for.

use std::error::Error;

use serde_json::{Value, json};
use virtual_axes_core::config::MachineConfig;
use virtual_axes_identify::tune::{Cost, DeviatingRun, PlantDeviation, Robustness, robustness};
use virtual_axes_report::Table;

use crate::progress::Runs;
use crate::search::{columns, course, named, object, row};
use crate::subject::Subject;
use crate::table;
use crate::variant::{self, Controller};

/// What to run.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    subject: Subject,
    /// Position controller in the place of the machine's.
    #[arg(long, value_enum)]
    controller: Option<Controller>,
    /// By what part inertia, friction and torque constant are off.
    #[arg(long, default_value_t = 0.3, allow_negative_numbers = true, value_parser = part)]
    by: f64,
    /// What to compare, as for `tune`.
    #[arg(long, default_value = "contour", value_name = "TERM=WEIGHT[,…]")]
    cost: Cost,
    /// Print the figures as one JSON object.
    #[arg(long)]
    json: bool,
}

fn part(text: &str) -> Result<f64, String> {
    /// Below nothing there is no plant; with nearly nothing of its inertia none that can be stepped.
    const MOST: f64 = 0.8;
    let refused = || format!("must lie in 0 … {MOST}, a part of the value");
    let value: f64 = text.parse().map_err(|_| refused())?;
    if (0.0..=MOST).contains(&value) { Ok(value) } else { Err(refused()) }
}

/// Runs it; the text is a table, or JSON.
pub fn run(arguments: &Arguments) -> Result<String, Box<dyn Error>> {
    let machine = arguments.subject.machine()?;
    let parameters = variant::parameters(&machine, arguments.controller, &arguments.subject.set, &[])?;
    let input = arguments.subject.input()?;
    let config = variant::checked(&parameters, &machine, &arguments.subject.machine)?;
    let path = course(&input, &config, arguments.subject.feed)?;
    let progress = Runs::new();
    let found = robustness(&parameters, &path, &arguments.cost, arguments.by, &progress);
    progress.finish();
    let found = found.map_err(|error| named(&input, error))?;
    let controller = variant::controller_name(&parameters);
    if arguments.json {
        let plain = |one: &DeviatingRun| json_of(one, &config);
        let object = json!({
            "input": input.name(),
            "description": input.description(),
            "machine": config.name(),
            "controller": controller,
            "by": arguments.by,
            "cost_unit": arguments.cost.unit(&found.nominal.figures),
            "nominal": plain(&found.nominal),
            "single": found.single.iter().map(plain).collect::<Vec<_>>(),
            "worst_combination": plain(&found.worst),
        });
        return Ok(format!("{object:#}\n"));
    }
    let head = format!("{}: {}, {controller}, cost {}", input.name(), config.name(), arguments.cost);
    Ok(format!("{head}\n\n{}", table::text(&rows(arguments, &config, &found))))
}

fn rows(arguments: &Arguments, config: &MachineConfig, found: &Robustness) -> Table {
    let cells =
        |name: String, one: &DeviatingRun| row(name, one.cost, one.margins.as_ref(), &one.figures, config);
    let nominal = cells("nominal".to_owned(), &found.nominal);
    let single = found.single.iter().map(|one| cells(name(&one.deviation), one));
    let worst = cells(format!("worst together: {}", name(&found.worst.deviation)), &found.worst);
    let rows = std::iter::once(nominal).chain(single).chain([worst]).collect();
    Table { columns: columns("plant", &arguments.cost, &found.nominal.figures), rows, ..Table::default() }
}

/// "inertia × 0.7, friction × 1.3"
fn name(deviation: &PlantDeviation) -> String {
    let factors =
        [("inertia", deviation.inertia), ("friction", deviation.friction), ("Kt", deviation.torque_constant)];
    let told = factors.iter().filter(|(_, factor)| *factor != 1.0);
    let told: Vec<String> = told.map(|(name, factor)| format!("{name} × {factor}")).collect();
    if told.is_empty() { "nominal".to_owned() } else { told.join(", ") }
}

fn json_of(one: &DeviatingRun, config: &MachineConfig) -> Value {
    let deviation = json!({
        "inertia": one.deviation.inertia,
        "friction": one.deviation.friction,
        "torque_constant": one.deviation.torque_constant,
    });
    object(vec![("deviation", deviation)], one.cost, one.margins.as_ref(), &one.figures, config).into()
}
