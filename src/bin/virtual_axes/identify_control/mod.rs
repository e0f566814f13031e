//! `virtual_axes identify-control`: the profile of a control from a part program and its setpoints.

mod control_output;

use std::cell::RefCell;
use std::error::Error;
use std::path::{Path, PathBuf};

use clap::builder::NonEmptyStringValueParser;
use virtual_axes_core::config::{ConfigError, DEFAULT_MACHINE, MachineConfig, Parameters, ValueSource};
use virtual_axes_core::trial::{GridSource, SetpointSource};
use virtual_axes_core::units::seconds;
use virtual_axes_nc::builtin::{open_program, program_folder};
use virtual_axes_nc::identify_control::{ControlIdentification, ControlLog, identify_control};
use virtual_axes_nc::interpret::{Interpreter, InterpreterOptions};
use virtual_axes_nc::offline::{PartProgramOptions, PartProgramSource};

use crate::arguments::log_arguments::LogArguments;
use crate::arguments::output_arguments::{OutputArguments, OutputFormat};
use crate::arguments::variant;
use crate::builtin::PROGRAMS;
use crate::input::part_program::{PartProgramArguments, no_part_program};
use crate::input::{CommandInput, must_not_replace};
use crate::output::unusable::UnusableResult;
use crate::output::{interrupt, machine_file, print_error};
use control_output::ControlOutput;

/// Exit status of a log that shows no parameter.
const NO_PARAMETER: u8 = 1;
/// Value of the last digit of positions without known digits, m or rad.
const RESOLUTION: f64 = 1e-9;

/// Arguments of `virtual_axes identify-control`.
#[derive(Debug, clap::Args)]
pub struct IdentifyControlArguments {
    /// Built-in part program, or part program file.
    #[arg(value_name = "PROGRAM", value_parser = NonEmptyStringValueParser::new())]
    program: String,
    /// Setpoints that the control made of the program: a log of the control (halsampler, Sinumerik Edge or trace, TwinCAT
    /// Scope), or CSV (`time,x,y,…` in s, m, rad).
    #[arg(value_name = "LOG", value_parser = NonEmptyStringValueParser::new())]
    setpoints: String,
    /// Built-in machine or machine file whose axes and work offsets apply.
    #[arg(long, default_value = DEFAULT_MACHINE, value_parser = NonEmptyStringValueParser::new())]
    machine: String,
    /// Set a parameter, for example `control.wait_ms=0`; can be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Write the machine with the identified profile to this file.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// The log has positions of the encoders in place of setpoints, which are estimated with the drives of the machine.
    #[arg(long)]
    recorded_positions: bool,
    #[command(flatten)]
    log: LogArguments,
    #[command(flatten)]
    part_program: PartProgramArguments,
    #[command(flatten)]
    output: OutputArguments,
}

/// Runs the command and returns the profile.
pub fn run(arguments: &IdentifyControlArguments) -> Result<String, Box<dyn Error>> {
    let machine = Parameters::load(&arguments.machine, crate::builtin::MACHINES)?;
    let parameters = variant::parameters(&machine, None, &arguments.set, &[])?;
    let config = variant::checked(&parameters, &machine, &arguments.machine)?;
    let program = CommandInput::open(&arguments.program, None, &LogArguments::default())?;
    if !program.is_part_program() {
        return Err(no_part_program(&arguments.program).into());
    }
    let program = program.with_part_program(&arguments.part_program)?;
    let input = CommandInput::open(&arguments.setpoints, None, &arguments.log)?.with_kept_rows();
    if let Some(out) = &arguments.out {
        machine_file::check_name(out)?;
        must_not_replace(out, Path::new(&arguments.machine))?;
        program.must_not_be(out)?;
        input.must_not_be(out)?;
    }
    // All errors of the program at once.
    program.survey(&config.without_trajectory_limits(), &mut |_| ())?;
    let mut log = read_log(&input, &config)?;
    log.notes.iter().for_each(|note| print_error(&format!("note: {}: {note}", arguments.setpoints)));
    if arguments.recorded_positions {
        log = log.setpoints_of(&config).map_err(|error| format!("{}: {error}", arguments.setpoints))?;
    }
    let options = arguments.part_program.options()?;
    let name = &arguments.program;
    let steps = Interpreter::new(
        open_program(name, PROGRAMS).map_err(|error| format!("{name}: {error}"))?,
        name,
        InterpreterOptions {
            subprogram_folder: program_folder(name, PROGRAMS),
            ..options.interpreter(&config).map_err(|error| format!("{name}: {error}"))?
        },
    );
    let found = identify_control(steps, &config, &log)
        .map_err(|error| format!("{}: {error}", arguments.setpoints))?;
    let mut identified = parameters.clone();
    set_values(&mut identified, &found)?;
    let planned = planned_time(name, &identified.machine_config()?, &options);
    let output = ControlOutput { found: &found, planned };
    let text = match arguments.output.format() {
        OutputFormat::Json => format!("{:#}\n", output.json()),
        OutputFormat::Csv => output.csv(),
        OutputFormat::Quiet => output.verdict(),
        OutputFormat::Text => output.text(),
    };
    for warning in output.warnings() {
        print_error(&format!("warning: {}: {warning}", arguments.setpoints));
    }
    if found.values.is_empty() {
        let cause = found.not_shown.first().map_or("the program has no motion", String::as_str);
        let reason = format!(
            "{}: no parameter is identified, since nothing in the log fits; the first cause: {cause}",
            arguments.setpoints
        );
        return Err(Box::new(UnusableResult { text, reason, status: NO_PARAMETER }));
    }
    if let Some(out) = &arguments.out {
        let head = format!(
            "{}, from the machine {} by `virtual_axes identify-control`: the control profile is that of {} and {}.",
            config.name(),
            arguments.machine,
            arguments.program,
            arguments.setpoints
        );
        let comment = |key: &str| {
            let value = found.values.iter().find(|value| value.key == key)?;
            let text = format!("± {} {}", control_output::significant(value.half_width, 2), value.unit);
            Some(text.trim_end().to_owned())
        };
        machine_file::write(out, &identified.to_yaml(&head, comment))?;
    }
    Ok(text)
}

/// Reads the samples of a log.
fn read_log(input: &CommandInput, machine: &MachineConfig) -> Result<ControlLog, Box<dyn Error>> {
    let machine = machine.without_trajectory_limits();
    let SetpointSource::Grid(mut source) = input.setpoints(&machine, None)? else {
        return Err(format!("{}: a log of a control, or setpoints as CSV, is required", input.name()).into());
    };
    let joints = source.joints().to_vec();
    let mut row = vec![0.0; joints.len()];
    let mut rows: Vec<(f64, Vec<f64>)> = Vec::new();
    let mut line = 0;
    // Programs omit zeros at the end of numbers.
    let mut resolution = f64::INFINITY;
    loop {
        let has_row = source.next(&mut row).map_err(|error| -> Box<dyn Error> { error })?;
        interrupt::check()?;
        let Some(new) = input.take_rows() else {
            return Err(
                format!("{}: a log of a control, or setpoints as CSV, is required", input.name()).into()
            );
        };
        for row in new {
            resolution = row.resolutions.iter().copied().fold(resolution, f64::min);
            // The start positions, which the reader adds before a first row behind time 0, are no sample.
            if std::mem::replace(&mut line, row.line) == row.line {
                rows.clear();
            }
            rows.push((seconds(row.time), row.positions));
        }
        if !has_row {
            break;
        }
    }
    let resolution = if resolution.is_finite() { resolution.max(RESOLUTION) } else { RESOLUTION };
    let log = ControlLog::new(&machine, &joints, &rows, resolution);
    Ok(log.map_err(|error| format!("{}: {error}", input.name()))?)
}

/// Sets the identified parameters.
fn set_values(parameters: &mut Parameters, found: &ControlIdentification) -> Result<(), ConfigError> {
    let source = ValueSource::named("identify-control");
    parameters.set_text("control.profile=linuxcnc", &source)?;
    for (key, value, _) in &found.choices {
        parameters.set_text(&format!("{key}={value}"), &source)?;
    }
    for value in &found.values {
        let text = match value.key.as_str() {
            "control.look_ahead" => format!("{:.0}", value.value),
            _ => format!("{:.9e}", value.value),
        };
        parameters.set_text(&format!("{}={text}", value.key), &source)?;
    }
    Ok(())
}

/// Returns the time of the motions of a program in the profile of a machine, s, or why there is none.
fn planned_time(name: &str, machine: &MachineConfig, options: &PartProgramOptions) -> Result<f64, String> {
    let track = RefCell::default();
    let mut source = PartProgramSource::open(name, PROGRAMS, machine, options, &track)?;
    let mut row = vec![0.0; machine.axes().len()];
    let mut before: Option<Vec<f64>> = None;
    let (mut cycle, mut first, mut last) = (0_i64, None, 0);
    while source.next(&mut row).map_err(|error| error.to_string())? {
        interrupt::check().map_err(|error| error.to_string())?;
        if before.as_ref().is_some_and(|before| *before != row) {
            first.get_or_insert(cycle - 1);
            last = cycle;
        }
        before = Some(row.clone());
        cycle += 1;
    }
    Ok(seconds((last - first.unwrap_or(last)) * machine.periods().position))
}
