//! Common parts of `tune` and `robustness`: repeated simulation of paths, and figures as table cells.

use std::error::Error;

use virtual_axes_core::config::MachineConfig;
use virtual_axes_core::design::Margins;
use virtual_axes_core::trial::Figures;
use virtual_axes_core::units::{DEGREE, MILLISECOND};
use virtual_axes_identify::tune::{Cost, CostTerm, TuneError, Workload};
use virtual_axes_report::TableColumn;

use crate::input::CommandInput;
use crate::output::interrupt;

/// Cell without a value.
const NONE: &str = "–";

/// Reads all setpoints of `input` for repeated simulation.
pub fn read_workload(
    input: &CommandInput,
    machine: &MachineConfig,
    feed: Option<f64>,
) -> Result<Workload, Box<dyn Error>> {
    let program = input.program(machine, feed)?;
    let setpoints = input.setpoints(machine, program.as_ref())?;
    let workload = Workload::read(input.name(), program.clone(), setpoints, interrupt::check)
        .map_err(|error| -> Box<dyn Error> { error })?;
    input.print_program_notes();
    Ok(workload)
}

/// Adds the name of the path to an error that does not name a file.
pub fn name_error(input: &CommandInput, error: TuneError) -> Box<dyn Error> {
    match error {
        TuneError::Trial(error) => input.name_error(error),
        error => format!("{}: {error}", input.name()).into(),
    }
}

/// Returns the column headings for the results of a tuning on a path with `figures`.
pub fn columns(first: &str, cost: &Cost, figures: &Figures) -> Vec<TableColumn> {
    let rms = CostTerm::ContourRms.unit(figures);
    let columns = [
        (first, ""),
        ("cost", cost.unit(figures)),
        ("RMS error", rms),
        ("modulus margin", ""),
        ("delay margin", "ms"),
        ("phase margin", "°"),
        ("peak current", "of limit"),
        ("activity", "A"),
        ("time at a limit", "s"),
    ];
    columns.map(|(name, unit)| TableColumn::new(name, unit)).to_vec()
}

/// Returns the cells of a row under the headings of [`columns`].
pub fn row(
    name: String,
    cost: f64,
    margins: Option<&Margins>,
    figures: &Figures,
    machine: &MachineConfig,
) -> Vec<String> {
    let margin = |value: fn(&Margins) -> f64, decimals: usize| {
        let value = margins.map(value).filter(|value| value.is_finite());
        value.map_or(NONE.to_owned(), |value| format!("{value:.decimals$}"))
    };
    vec![
        name,
        format!("{cost:.2}"),
        format!("{:.2}", CostTerm::ContourRms.of(figures, machine)),
        margin(|m| m.modulus, 3),
        margin(|m| m.delay / MILLISECOND, 2),
        margin(|m| m.phase / DEGREE, 1),
        format!("{:.3}", CostTerm::Current.of(figures, machine)),
        format!("{:.3}", CostTerm::Activity.of(figures, machine)),
        format!("{:.3}", saturation(figures)),
    ]
}

/// Returns the longest saturation time of an axis, s.
fn saturation(figures: &Figures) -> f64 {
    figures.axes.iter().map(|axis| axis.report.saturation_time).fold(0.0, f64::max)
}
