//! `virtual_axes check`: validation of machine files, scenarios, setpoints and part programs.

use std::error::Error;
use std::path::PathBuf;

use virtual_axes_core::config::{AxisKind, DEFAULT_MACHINE, MachineConfig, Parameters};
use virtual_axes_core::machine::MachineParameters;
use virtual_axes_core::scenario::{Scenario, is_file_name, nearest_input};
use virtual_axes_core::text::{escaped, nearest_hint};
use virtual_axes_core::trial::{Measures, Tick, Trial};
use virtual_axes_io::files::{self, FileKind};

use crate::input::CommandInput;
use crate::setpoint_summary::SetpointSummary;
use crate::{axis_warnings, interrupt, part_program, print_error, program_text};

/// Arguments of `virtual_axes check`.
#[derive(Debug, clap::Args)]
pub struct CheckArguments {
    /// Machine file (ROS 2 parameter file), scenario file, setpoints (CSV, MCAP, YAML), part program (.nc, .ngc,
    /// .tap, .cnc, .mpf, .gcode, .iso, .eia), or name of a built-in machine or scenario.
    file: PathBuf,
    /// Machine for a scenario, setpoints or a part program: built-in machine or machine file.
    #[arg(long, default_value = DEFAULT_MACHINE)]
    machine: String,
    /// M codes that a part program may contain without effect: 100,M110.
    #[arg(long, value_name = "M_CODES", value_delimiter = ',', value_parser = part_program::m_code)]
    ignore: Vec<u32>,
}

/// Validates the file and returns its kind and contents.
pub fn run(arguments: &CheckArguments) -> Result<String, Box<dyn Error>> {
    let name = arguments.file.to_string_lossy();
    if part_program::is_part_program(&arguments.file) {
        let config = Parameters::load(&arguments.machine)?.machine_config()?;
        return part_program::check(&arguments.file, &config, &arguments.ignore);
    }
    let is_machine = match arguments.file.exists() {
        true => files::Input::open(&arguments.file)?.kind() == FileKind::Machine,
        false => is_shipped_machine(&name)?,
    };
    if is_machine {
        let config = Parameters::load(&name)?.machine_config()?;
        MachineParameters::new(&config).map_err(|error| format!("{name}: {error}"))?;
        if let Some(key) = foreign_node_key(arguments)? {
            print_error(&format!(
                "warning: {name}: the node key {key} does not match the node virtual_axes, which ignores these \
                 parameters; use /** or virtual_axes"
            ));
        }
        for axis in config.axes() {
            for warning in axis_warnings::all(axis, &config.periods()) {
                print_error(&format!("warning: {name}: {warning}"));
            }
        }
        return Ok(machine(&config));
    }
    let config = Parameters::load(&arguments.machine)?.machine_config()?;
    let input = CommandInput::open(&name, None)?;
    let program = input.program(&config, None)?;
    let kind = if program.is_some() { "scenario" } else { "setpoints" };
    let trial = Trial {
        machine: &config,
        program: program.clone(),
        allow_nonzero_end_velocity: false,
        record: false,
        measures: Measures::ALL,
    };
    // The setpoints are validated by a simulation.
    let setpoints = input.setpoints(&config, program.as_ref())?;
    let mut summary = SetpointSummary::default();
    let on_tick = |tick: Tick<'_>| {
        summary.add(&tick);
        interrupt::check()
    };
    let outcome =
        virtual_axes_core::trial::run(&trial, setpoints, on_tick).map_err(|error| input.name_error(error))?;
    let axes = config.axes();
    let (text, warning) = match &program {
        Some(program) => {
            (program_text::description(program, axes), program_text::unreached_feed(program, axes))
        }
        None => (summary.text(axes), summary.slow_warning(axes)),
    };
    let warnings = warning.into_iter().chain(input.notes_on_limits(&config));
    let warnings = warnings.map(|warning| format!("{name}: {warning}")).chain(input.gap_warning());
    warnings.for_each(|warning| print_error(&format!("warning: {warning}")));
    let (machine, duration) = (escaped(config.name()), outcome.figures.duration);
    Ok(format!("{kind} for {machine}: {duration:.3} s\n{text}valid\n"))
}

/// Returns true for a built-in machine, false for a built-in scenario.
fn is_shipped_machine(name: &str) -> Result<bool, String> {
    let machines: Vec<&str> = Parameters::builtin_names().collect();
    let scenarios: Vec<&str> = Scenario::builtin_names().collect();
    let machine = machines.contains(&name);
    match machine || scenarios.contains(&name) {
        true => Ok(machine),
        false => {
            let known = match is_file_name(name) {
                true => String::new(),
                false => format!(
                    ", no built-in machine ({}) and no built-in scenario ({})",
                    machines.join(", "),
                    scenarios.join(", ")
                ),
            };
            let nearest = nearest_input(name, machines.into_iter().chain(scenarios));
            Err(format!("{name}: no such file{known}{}", nearest_hint(&nearest)))
        }
    }
}

/// Returns the node key of a machine file, if it is of a node with another name than `virtual_axes`, in any namespace.
fn foreign_node_key(arguments: &CheckArguments) -> Result<Option<String>, Box<dyn Error>> {
    if !arguments.file.exists() {
        return Ok(None);
    }
    let report = Parameters::embedded_default()?.overlay_file(&arguments.file, Some("/virtual_axes"))?;
    let is_foreign = |key: &&String| !matches!(key.rsplit('/').next(), Some("virtual_axes" | "*" | "**"));
    let key = report.skipped.iter().find(is_foreign).filter(|_| report.sections == 0);
    Ok(key.map(|key| key.trim_start_matches('/').to_owned()))
}

fn machine(machine: &MachineConfig) -> String {
    let joints: Vec<String> = machine
        .axes()
        .iter()
        .map(|axis| match axis.kind() {
            AxisKind::Linear => format!("{} (linear)", axis.name()),
            AxisKind::Rotary => format!("{} (rotary)", axis.name()),
        })
        .collect();
    format!("machine: {}\njoints: {}\nvalid\n", escaped(machine.name()), joints.join(", "))
}
