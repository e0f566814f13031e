//! Variants of a machine: controller and parameters of each run of a command.

use std::error::Error;
use std::sync::LazyLock;

use clap::ValueEnum;
use clap::builder::PossibleValue;
use virtual_axes_core::config::{
    Assignment, ConfigError, ControllerName, MachineConfig, Parameters, Value, ValueSource, parse_assignment,
};
use virtual_axes_core::machine::MachineParameters;
pub use virtual_axes_report::runs::controller_name;

/// Position controller of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RunController {
    controller: ControllerName,
    has_feedforward: bool,
}

/// Controllers of the option `--controller`.
static CONTROLLERS: LazyLock<Vec<RunController>> = LazyLock::new(|| {
    let of = |controller, has_feedforward| RunController { controller, has_feedforward };
    let all = ControllerName::ALL.iter().flat_map(|&controller| match controller {
        ControllerName::Cascade => vec![of(controller, true), of(controller, false)],
        _ => vec![of(controller, true)],
    });
    all.collect()
});

impl ValueEnum for RunController {
    fn value_variants<'a>() -> &'a [Self] {
        &CONTROLLERS
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        let name = match self.has_feedforward {
            true => self.controller.name(),
            false => ControllerName::CASCADE_WITHOUT_FEEDFORWARD,
        };
        Some(PossibleValue::new(name).help(match self.controller {
            ControllerName::Cascade if self.has_feedforward => {
                "Proportional controller with the feedforward of the machine file"
            }
            ControllerName::Cascade => "Proportional controller without feedforward",
            ControllerName::Gpc => "Generalized predictive controller with the tuning of the machine file",
            ControllerName::Rst => "RST controller with the polynomials of the machine file",
        }))
    }
}

impl RunController {
    /// Returns the parameters to set for each axis of `parameters`.
    fn assignments(self, parameters: &Parameters) -> Vec<Assignment> {
        let set = |key: String, value| Assignment { key, value, source: ValueSource::named("--controller") };
        let of_key = |(key, _): (String, Value)| {
            if key.ends_with(".position_loop.controller") {
                Some(set(key, Value::Text(self.controller.name().to_owned())))
            } else if !self.has_feedforward && key.contains(".feedforward.") {
                Some(set(key, Value::Double(0.0)))
            } else {
                None
            }
        };
        parameters.iter().filter_map(of_key).collect()
    }
}

/// Returns the machine with the controller and the parameters of `--set` and `--compare`. `--set` has priority over the
/// controller, and `--compare` over both. Controller and `--set` are checked together, because a controller can require
/// parameters.
pub fn parameters(
    machine: &Parameters,
    controller: Option<RunController>,
    set: &[String],
    compared: &[String],
) -> Result<Parameters, Box<dyn Error>> {
    changed_parameters(machine, controller, set, ("--compare", compared))
}

/// Returns the machine as [`parameters`] does, with the changes of another option, which errors name, in place of
/// `--compare`.
pub fn changed_parameters(
    machine: &Parameters,
    controller: Option<RunController>,
    set: &[String],
    (option, changes): (&str, &[String]),
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
    parameters.set_all(parsed(option, changes)?)?;
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
    checked_with("--controller, --set or --compare", parameters, machine, name)
}

/// Builds and validates the machine as [`checked`] does; `options` are the names of the options in errors.
pub fn checked_with(
    options: &str,
    parameters: &Parameters,
    machine: &Parameters,
    name: &str,
) -> Result<MachineConfig, Box<dyn Error>> {
    let config = parameters.machine_config()?;
    MachineParameters::new(&config).map_err(|error| {
        let is_file_invalid = machine.machine_config().is_ok_and(|own| MachineParameters::new(&own).is_err());
        let source = if is_file_invalid { name } else { options };
        format!("{source}: {error}")
    })?;
    Ok(config)
}
