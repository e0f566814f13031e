//! `virtual_axes check`: validation of machine files, scenarios, setpoints and part programs.

pub mod limit_audit_output;
pub mod program_check;

pub mod row_audit;

use std::error::Error;
use std::path::PathBuf;
use std::sync::Arc;

use virtual_axes_core::assess::LimitAudit;
use virtual_axes_core::config::{AxisKind, DEFAULT_MACHINE, MachineConfig, Parameters};
use virtual_axes_core::machine::MachineParameters;
use virtual_axes_core::path::Program;
use virtual_axes_core::scenario::{is_file_name, nearest_input};
use virtual_axes_core::text::{builtin_names, escaped, nearest_hint};
use virtual_axes_core::trajectory::limits::TRAVEL_TOLERANCE;
use virtual_axes_core::trial::{self, Measures, SetpointSource, Tick, Trial};
use virtual_axes_core::units::Nanoseconds;
use virtual_axes_io::files::FileKind;
use virtual_axes_nc::offline::OperationMeter;

use crate::arguments::log_arguments::LogArguments;
use crate::builtin::{PROGRAMS, SCENARIOS};
use crate::input::part_program::{self, PartProgramArguments};
use crate::input::setpoint_summary::SetpointSummary;
use crate::input::{CommandInput, program_text};
use crate::output::operations::operations_text;
use crate::output::progress::TrialProgress;
use crate::output::unusable::{BEYOND_LIMITS, UnusableResult};
use crate::output::{interrupt, print_error, text_table};
use row_audit::RowAudit;
use virtual_axes_report::limit_audit;
use virtual_axes_report::runs::{axis_warnings, time_shares};

/// Arguments of `virtual_axes check`.
#[derive(Debug, clap::Args)]
pub struct CheckArguments {
    /// Machine file (ROS 2 parameter file), scenario file, setpoints (CSV, MCAP, YAML, logs of controls), part program (.nc, .ngc,
    /// .tap, .cnc, .mpf, .gcode, .iso, .eia), or name of a built-in machine or scenario.
    #[arg(value_name = "MACHINE|SCENARIO|FILE")]
    file: PathBuf,
    /// Machine for a scenario, setpoints or a part program: built-in machine or machine file.
    #[arg(long, default_value = DEFAULT_MACHINE)]
    machine: String,
    #[command(flatten)]
    part_program: PartProgramArguments,
    #[command(flatten)]
    log: LogArguments,
    /// Print the limit audit of setpoints or of a part program as one JSON object.
    #[arg(long)]
    json: bool,
}

/// Validates the file and returns its kind and contents.
pub fn run(arguments: &CheckArguments) -> Result<String, Box<dyn Error>> {
    let name = arguments.file.to_string_lossy();
    let is_log = arguments.log.applies_to(&name);
    if !is_log && part_program::is_part_program(&name) {
        let config = Parameters::load(&arguments.machine, crate::builtin::MACHINES)?.machine_config()?;
        return part_program(arguments, &name, &config);
    }
    let is_machine = match arguments.file.exists() {
        true if is_log => false,
        true => part_program::open_other(&arguments.file)?.kind() == FileKind::Machine,
        false => is_shipped_machine(&name)?,
    };
    let no_audit = || format!("{name}: --json requires setpoints or a part program");
    if is_machine {
        if arguments.machine != DEFAULT_MACHINE {
            return Err(format!("{name}: --machine requires a scenario, setpoints or a part program").into());
        }
        if let Some(option) = arguments.part_program.given() {
            return Err(format!("{name}: {option} requires a part program").into());
        }
        if let Some(option) = arguments.log.given() {
            return Err(format!("{name}: {option} requires a log of a control, or setpoints as CSV").into());
        }
        if arguments.json {
            return Err(no_audit().into());
        }
        let config = Parameters::load(&name, crate::builtin::MACHINES)?.machine_config()?;
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
    let parameters = Parameters::load(&arguments.machine, crate::builtin::MACHINES)?;
    let config = parameters.machine_config()?;
    let input = CommandInput::open(&name, None, &arguments.log)?
        .with_part_program(&arguments.part_program)?
        .with_kept_rows();
    match input.program(&config, None)? {
        Some(_) if arguments.json => Err(no_audit().into()),
        Some(program) => scenario(&input, &config, &program),
        None => setpoints(arguments, &input, &parameters, &config),
    }
}

/// Validates a scenario by a simulation.
fn scenario(
    input: &CommandInput,
    machine: &MachineConfig,
    program: &Arc<Program>,
) -> Result<String, Box<dyn Error>> {
    let trial = Trial {
        machine,
        program: Some(Arc::clone(program)),
        allow_nonzero_end_velocity: false,
        record: false,
        measures: Measures::AXES,
    };
    let setpoints = input.setpoints(machine, Some(program))?;
    let outcome = trial::run(&trial, setpoints, |_| interrupt::check());
    let duration = outcome.map_err(|error| input.name_error(error))?.figures.duration;
    print_warnings(input, machine, program_text::unreached_feed(program, machine.axes()));
    let description = program_text::description(program, machine.axes());
    Ok(format!("scenario for {}: {duration:.3} s\n{description}valid\n", escaped(machine.name())))
}

/// Adds the positions before the first setpoints, in which the first trajectory starts, if another one starts elsewhere.
fn add_start(audit: &mut LimitAudit, tick: &Tick<'_>, period: Nanoseconds) {
    let samples: Vec<_> = tick.machine.axes().iter().map(|axis| axis.sample()).collect();
    if samples.iter().any(|sample| (sample.psec - sample.position).abs() > TRAVEL_TOLERANCE) {
        audit.add(-period, None, samples.iter().map(|sample| sample.position));
    }
}

/// Validates setpoints by a simulation and audits them: rows of a CSV file, or setpoints of position cycles.
fn setpoints(
    arguments: &CheckArguments,
    input: &CommandInput,
    parameters: &Parameters,
    config: &MachineConfig,
) -> Result<String, Box<dyn Error>> {
    // Values beyond limits are results of the audit, not errors.
    let machine = &config.without_trajectory_limits();
    let trial = Trial {
        machine,
        program: None,
        allow_nonzero_end_velocity: parameters.node_config().allow_nonzero_velocity_at_trajectory_end,
        record: false,
        measures: Measures::AXES,
    };
    let setpoints = input.setpoints(machine, None)?;
    let mut rows = match &setpoints {
        SetpointSource::Grid(source) => Some(RowAudit::new(config, source.joints())),
        SetpointSource::Requests(_) => None,
    };
    let mut summary = SetpointSummary::default();
    let mut audit = LimitAudit::new(config);
    let on_tick = |tick: Tick<'_>| {
        summary.add(&tick);
        match &mut rows {
            Some(audit) => input.take_rows().into_iter().flatten().for_each(|row| audit.add(row)),
            None if tick.position_instant => {
                if tick.time == 0 {
                    add_start(&mut audit, &tick, config.periods().position);
                }
                audit.add(tick.time, None, tick.machine.axes().iter().map(|axis| axis.sample().psec));
            }
            None => {}
        }
        interrupt::check()
    };
    let outcome = trial::run(&trial, setpoints, on_tick).map_err(|error| input.name_error(error))?;
    let audit = rows.map_or(audit, RowAudit::finish);
    print_warnings(input, config, summary.slow_warning(config.axes()));
    let duration = outcome.figures.duration;
    let text =
        format!("setpoints for {}: {duration:.3} s\n{}", escaped(config.name()), summary.text(config.axes()));
    AuditedInput { name: input.name(), machine: config.name(), duration, summary: text }
        .result(audit, arguments.json)
}

fn print_warnings(input: &CommandInput, machine: &MachineConfig, warning: Option<String>) {
    let warnings = warning.into_iter().chain(input.notes_on_limits(machine));
    let warnings = warnings.map(|warning| format!("{}: {warning}", input.name())).chain(input.gap_warning());
    warnings.for_each(|warning| print_error(&format!("warning: {warning}")));
}

/// Validates and plans a part program, and audits its setpoints.
fn part_program(
    arguments: &CheckArguments,
    name: &str,
    machine: &MachineConfig,
) -> Result<String, Box<dyn Error>> {
    let lines = part_program::count_lines(name).map_err(|error| format!("{name}: {error}"))?;
    let mut progress = TrialProgress::with_lines(name, lines, arguments.json);
    let input = CommandInput::open(name, None, &arguments.log)?.with_part_program(&arguments.part_program)?;
    let survey = input.survey(machine, &mut |line| progress.set_line(line))?;
    let mut summary = program_check::summary(&survey, machine);
    let SetpointSource::Grid(mut source) = input.setpoints(machine, None)? else {
        return Err(format!("{name}: a part program without setpoints").into());
    };
    let joints = source.joints().to_vec();
    let mut audit = LimitAudit::new(machine);
    let (mut row, mut psec) = (vec![0.0; joints.len()], vec![0.0; machine.axes().len()]);
    progress = TrialProgress::with_lines(name, lines, arguments.json);
    let (mut time, mut operations) = (0, OperationMeter::new(machine));
    while source.next(&mut row).map_err(|error| -> Box<dyn Error> { error })? {
        interrupt::check()?;
        progress.set_line(input.track().borrow().lines_read);
        for (&joint, &position) in joints.iter().zip(&row) {
            if let Some(psec) = psec.get_mut(joint) {
                *psec = position;
            }
        }
        // The first setpoint is the start, of line 0.
        let point = input.track().borrow_mut().setpoints.pop_front();
        if let Some((_, activity)) = point {
            operations.add_time(&input.track().borrow().comments, activity);
        }
        let line = point.map(|point| point.0.line).filter(|line| *line > 0);
        audit.add(time, line, psec.iter().copied());
        time += machine.periods().position;
    }
    progress.finish();
    input.print_program_notes();
    let duration = input.track().borrow().cycle_time;
    let operations = operations.finish(&input.track().borrow().comments);
    summary += &format!("cycle time {duration:.3} s\n");
    summary += &text_table::wrapped_line(&time_shares(&operations));
    let table = operations_text(&operations);
    summary += &(table + if operations.operations.len() > 1 { "\n" } else { "" });
    AuditedInput { name, machine: machine.name(), duration, summary }.result(audit, arguments.json)
}

/// Input with audited setpoints.
struct AuditedInput<'a> {
    name: &'a str,
    machine: &'a str,
    /// Duration, s.
    duration: f64,
    /// Summary as text.
    summary: String,
}

impl AuditedInput<'_> {
    /// Returns the output of the command, in [`UnusableResult`] if a limit is exceeded.
    fn result(&self, mut audit: LimitAudit, as_json: bool) -> Result<String, Box<dyn Error>> {
        audit.finish();
        let excess = limit_audit::excess(&audit);
        let text = if as_json {
            let object = limit_audit::json(&audit, self.name, self.machine, self.duration);
            format!("{object:#}\n")
        } else {
            let verdict = if excess.is_none() { "valid" } else { "beyond limits" };
            format!("{}{}{verdict}\n", self.summary, limit_audit_output::text(&audit))
        };
        match excess {
            None => Ok(text),
            Some(excess) => {
                let reason = format!("{}: {excess}", self.name);
                Err(Box::new(UnusableResult { text, reason, status: BEYOND_LIMITS }))
            }
        }
    }
}

/// Returns true for a built-in machine, false for a built-in scenario.
fn is_shipped_machine(name: &str) -> Result<bool, String> {
    let machines: Vec<&str> = crate::builtin::MACHINES.iter().map(|(name, _)| *name).collect();
    let scenarios: Vec<&str> = builtin_names(SCENARIOS).chain(builtin_names(PROGRAMS)).collect();
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
    let joints = text_table::wrapped_line(&format!("joints: {}", joints.join(", ")));
    format!("machine: {}\n{joints}valid\n", escaped(machine.name()))
}
