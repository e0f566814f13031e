//! The machine as each run of a command has it.

use std::error::Error;

use virtual_axes_core::config::{Assignment, MachineConfig, Parameters, Source, Value, parse_assignment};
use virtual_axes_core::machine::MachineParameters;

/// Position controllers that a run can be asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Controller {
    /// Proportional, with the feedforward of the machine file.
    Cascade,
    /// Proportional, without feedforward.
    CascadeNoff,
    /// Generalized predictive control, with the tuning of the machine file.
    Gpc,
    /// The polynomials of the machine file.
    Rst,
}

impl Controller {
    /// The value of `position_loop.controller`.
    fn name(self) -> &'static str {
        match self {
            Controller::Cascade | Controller::CascadeNoff => "cascade",
            Controller::Gpc => "gpc",
            Controller::Rst => "rst",
        }
    }

    /// The parameters that it sets on each axis of `parameters`.
    fn assignments(self, parameters: &Parameters) -> Vec<Assignment> {
        let set = |key: String, value| Assignment { key, value, source: Source::named("--controller") };
        let of_key = |(key, _): (String, Value)| {
            if key.ends_with(".position_loop.controller") {
                Some(set(key, Value::Text(self.name().to_owned())))
            } else if self == Controller::CascadeNoff && key.contains(".feedforward.") {
                Some(set(key, Value::Double(0.0)))
            } else {
                None
            }
        };
        parameters.iter().filter_map(of_key).collect()
    }
}

/// Name of the controller that the axes of `parameters` have.
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

/// One machine: the controller, then what `--set` and `--compare` say, over the machine file.
pub fn parameters(
    machine: &Parameters,
    controller: Option<Controller>,
    set: &[String],
    compared: &[String],
) -> Result<Parameters, Box<dyn Error>> {
    let mut parameters = machine.clone();
    if let Some(controller) = controller {
        parameters.set_all(controller.assignments(machine))?;
    }
    for (option, texts) in [("--set", set), ("--compare", compared)] {
        let source = Source::named(option);
        let assignments = texts.iter().map(|text| parse_assignment(text, &source));
        parameters.set_all(assignments.collect::<Result<_, _>>()?)?;
    }
    Ok(parameters)
}

/// The machine that `parameters` make, over those of the machine file `name`; whoever is to blame is named if
/// it cannot be built.
pub fn checked(
    parameters: &Parameters,
    machine: &Parameters,
    name: &str,
) -> Result<MachineConfig, Box<dyn Error>> {
    let config = parameters.machine_config()?;
    MachineParameters::new(&config).map_err(|error| {
        let by_itself = machine.machine_config().is_ok_and(|own| MachineParameters::new(&own).is_err());
        let blamed = if by_itself { name } else { "--controller, --set or --compare" };
        format!("{blamed}: {error}")
    })?;
    Ok(config)
}
