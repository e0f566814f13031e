//! Variants of a machine: controller and parameters of each run of a command.

use std::error::Error;

use crate::worst_lines::ProgramFigures;
use virtual_axes_core::config::{
    Assignment, ConfigError, MachineConfig, Parameters, Value, ValueSource, parse_assignment,
};
use virtual_axes_core::machine::MachineParameters;
use virtual_axes_core::trial::TrialOutcome;

use crate::{axis_warnings, table};

/// Position controller of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum ControllerName {
    /// Proportional controller with the feedforward of the machine file.
    Cascade,
    /// Proportional controller without feedforward.
    CascadeNoff,
    /// Generalized predictive controller with the tuning of the machine file.
    Gpc,
    /// RST controller with the polynomials of the machine file.
    Rst,
}

impl ControllerName {
    /// Returns the value of `position_loop.controller`.
    fn name(self) -> &'static str {
        match self {
            ControllerName::Cascade | ControllerName::CascadeNoff => "cascade",
            ControllerName::Gpc => "gpc",
            ControllerName::Rst => "rst",
        }
    }

    /// Returns the parameters to set for each axis of `parameters`.
    fn assignments(self, parameters: &Parameters) -> Vec<Assignment> {
        let set = |key: String, value| Assignment { key, value, source: ValueSource::named("--controller") };
        let of_key = |(key, _): (String, Value)| {
            if key.ends_with(".position_loop.controller") {
                Some(set(key, Value::Text(self.name().to_owned())))
            } else if self == ControllerName::CascadeNoff && key.contains(".feedforward.") {
                Some(set(key, Value::Double(0.0)))
            } else {
                None
            }
        };
        parameters.iter().filter_map(of_key).collect()
    }
}

/// Returns the name of the controller of the axes, or several names joined by `+`.
pub fn controller_name(parameters: &Parameters) -> String {
    let mut names: Vec<String> = Vec::new();
    let mut feedforward = false;
    for (key, value) in parameters.iter() {
        match value {
            Value::Text(name) if key.ends_with(".position_loop.controller") && !names.contains(&name) => {
                names.push(name);
            }
            Value::Double(weight) if key.contains(".feedforward.") => feedforward |= weight != 0.0,
            _ => {}
        }
    }
    match names.as_slice() {
        [name] if name == "cascade" && !feedforward => "cascade-noff".to_owned(),
        _ => names.join("+"),
    }
}

/// Returns the machine with the controller and the parameters of `--set` and `--compare`. `--set` has priority over the
/// controller, and `--compare` over both. Controller and `--set` are checked together, because a controller can require
/// parameters.
pub fn parameters(
    machine: &Parameters,
    controller: Option<ControllerName>,
    set: &[String],
    compared: &[String],
) -> Result<Parameters, Box<dyn Error>> {
    let parsed = |option: &str, texts: &[String]| -> Result<Vec<Assignment>, ConfigError> {
        let source = ValueSource::named(option);
        texts.iter().map(|text| parse_assignment(text, &source)).collect()
    };
    let set = parsed("--set", set)?;
    let mut assignments = controller.map_or_else(Vec::new, |controller| controller.assignments(machine));
    if let Some(joints) = set.iter().rev().find(|assignment| assignment.key == "joints") {
        // Removed axes have no controller.
        assignments.retain(|assignment| is_of_joints(&assignment.key, &joints.value));
    }
    assignments.extend(set);
    let mut parameters = machine.clone();
    parameters.set_all(assignments)?;
    parameters.set_all(parsed("--compare", compared)?)?;
    Ok(parameters)
}

/// Splits `KEY=VALUE,KEY=VALUE` at the commas outside brackets, since a value can be a list such as `[1, -0.5]`.
pub fn changes(list: &str) -> Vec<String> {
    let mut depth = 0_i32;
    let parts = list.split(|c| {
        depth += i32::from(c == '[') - i32::from(c == ']');
        c == ',' && depth == 0
    });
    parts.map(|change| change.trim().to_owned()).collect()
}

/// Returns true if the parameter `key` belongs to an axis of the list `joints`.
fn is_of_joints(key: &str, joints: &Value) -> bool {
    let joint = key.split_once('.').map_or("", |(joint, _)| joint);
    matches!(joints, Value::TextList(names) if names.iter().any(|name| name == joint))
}

/// Builds and validates the machine. An error names the source of the invalid parameters: the machine file
/// `name` or the options.
pub fn checked(
    parameters: &Parameters,
    machine: &Parameters,
    name: &str,
) -> Result<MachineConfig, Box<dyn Error>> {
    let config = parameters.machine_config()?;
    MachineParameters::new(&config).map_err(|error| {
        let is_file_invalid = machine.machine_config().is_ok_and(|own| MachineParameters::new(&own).is_err());
        let source = if is_file_invalid { name } else { "--controller, --set or --compare" };
        format!("{source}: {error}")
    })?;
    Ok(config)
}

/// One run of a command with its variant of the machine.
#[derive(Debug)]
pub struct VariantRun {
    /// Name of the controller.
    pub controller: String,
    /// Changed parameters of all runs, then of this run, in the syntax of the command line.
    pub changes: Vec<String>,
    /// Number of changes that all runs share.
    pub shared_changes: usize,
    /// Machine of the run.
    pub machine: MachineConfig,
    /// Warnings on the input, such as a feed that is not reached. The verdict contains them.
    pub input_warnings: Vec<String>,
    /// Notes on the input, such as a limit without effect.
    pub input_notes: Vec<String>,
    /// Times and worst lines of a part program.
    pub part_program: Option<ProgramFigures>,
    /// Result of the run.
    pub outcome: TrialOutcome,
}

impl VariantRun {
    /// Returns the title that distinguishes the run from the others.
    pub fn title(&self) -> String {
        let mut title = self.controller.clone();
        for change in self.changes.iter().skip(self.shared_changes) {
            title.push_str(", ");
            title.push_str(change);
        }
        title
    }
    /// Returns remarks on the run, one per line.
    pub fn remarks(&self) -> Vec<String> {
        let unit = "the unit of position_loop.gain is (m/min)/mm or (1000 °/min)/°, 16.667 1/s";
        let with_unit = |warning: String| match warning.contains("position loop") {
            true => format!("{warning}; {unit}"),
            false => warning,
        };
        let loops = self.axis_warnings().into_iter().map(with_unit);
        loops
            .chain(self.input_warnings.clone())
            .chain(self.input_notes.clone())
            .chain(table::remarks(&self.outcome.figures))
            .collect()
    }

    /// Returns warnings on the loops of the moving axes.
    pub fn axis_warnings(&self) -> Vec<String> {
        let figures = self.outcome.figures.axes.iter();
        let moving = self.machine.axes().iter().zip(figures).filter(|(_, figures)| figures.moves);
        moving.flat_map(|(axis, _)| axis_warnings::loops(axis, &self.machine.periods())).collect()
    }
}
