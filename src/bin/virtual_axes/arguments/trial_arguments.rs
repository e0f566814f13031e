//! Arguments that several commands share: machine, parameters and setpoints.

use std::error::Error;
use std::path::Path;

use clap::builder::NonEmptyStringValueParser;
use virtual_axes_core::config::{DEFAULT_MACHINE, Parameters};

use crate::arguments::log_arguments::LogArguments;
use crate::arguments::variant;
use crate::input::part_program::PartProgramArguments;
use crate::input::{CommandInput, must_not_replace};
use crate::output::print_error;

/// Machine and parameters.
#[derive(Debug, clap::Args)]
pub struct MachineArguments {
    /// Built-in machine or machine file.
    #[arg(long, default_value = DEFAULT_MACHINE, value_parser = NonEmptyStringValueParser::new())]
    machine: String,
    /// Set a parameter, for example `kinematics.tool_length_mm=150`; can be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<String>,
}

impl MachineArguments {
    /// Returns the name or path of the machine.
    pub fn name(&self) -> &str {
        &self.machine
    }

    /// Rejects an output file that is the machine file.
    pub fn must_not_be(&self, output: &Path) -> Result<(), String> {
        must_not_replace(output, Path::new(&self.machine))
    }

    /// Loads the machine with the parameters of `--set`.
    pub fn parameters(&self) -> Result<Parameters, Box<dyn Error>> {
        warn_of_machine_names(&self.set);
        variant::parameters(&Parameters::load(&self.machine, crate::builtin::MACHINES)?, None, &self.set, &[])
    }
}

/// Setpoints, machine and parameters.
#[derive(Debug, clap::Args)]
pub struct TrialArguments {
    /// Built-in scenario or part program, scenario file, part program file (`.nc`, `.ngc`, …), or file with setpoints:
    /// CSV (`time,x,y,…` in s, m, rad), MCAP with a JointTrajectory, YAML for `ros2 topic pub`, or a log of a control
    /// (halsampler, Sinumerik Edge or trace, TwinCAT Scope).
    #[arg(value_name = "SCENARIO|FILE", value_parser = NonEmptyStringValueParser::new())]
    input: String,
    /// Built-in machine or machine file.
    #[arg(long, default_value = DEFAULT_MACHINE, value_parser = NonEmptyStringValueParser::new())]
    pub machine: String,
    /// Set a parameter, for example `x.velocity_loop.gain=4.5`; can be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// Override the feed of the scenario, m/min (rpm for a scenario of rotary moves).
    #[arg(long, allow_negative_numbers = true)]
    pub feed: Option<f64>,
    #[command(flatten)]
    part_program: PartProgramArguments,
    #[command(flatten)]
    log: LogArguments,
    /// Topic to run, if a recording has several topics with a JointTrajectory.
    #[arg(long)]
    topic: Option<String>,
}

impl TrialArguments {
    /// Loads the machine without the parameters of `--set`.
    pub fn machine(&self) -> Result<Parameters, Box<dyn Error>> {
        warn_of_machine_names(&self.set);
        Ok(Parameters::load(&self.machine, crate::builtin::MACHINES)?)
    }

    /// Rejects an output file that is the machine file.
    pub fn machine_must_not_be(&self, output: &Path) -> Result<(), String> {
        must_not_replace(output, Path::new(&self.machine))
    }

    /// Opens the scenario, the part program or the file with setpoints.
    pub fn input(&self) -> Result<CommandInput, Box<dyn Error>> {
        CommandInput::open(&self.input, self.topic.as_deref(), &self.log)?
            .with_part_program(&self.part_program)
    }
}

/// Warns of a parameter `machine` that is probably meant to select a machine.
fn warn_of_machine_names(set: &[String]) {
    let names = set.iter().filter_map(|text| text.split_once('=')).filter(|(key, _)| key.trim() == "machine");
    for (_, name) in names.filter(|(_, name)| Parameters::names_machine(name, crate::builtin::MACHINES)) {
        print_error(&format!(
            "warning: --set machine={name} sets the name only and changes no drive; --machine selects a machine"
        ));
    }
}
