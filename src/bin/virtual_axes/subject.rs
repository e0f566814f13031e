//! What the commands that run something are given: setpoints and a machine.

use std::error::Error;
use std::path::Path;

use virtual_axes_core::config::{DEFAULT_MACHINE, Parameters};

use crate::input::{Input, must_not_replace};
use crate::variant;

/// A machine as a command is given it.
#[derive(Debug, clap::Args)]
pub struct MachineChoice {
    /// A shipped machine or a machine file.
    #[arg(long, default_value = DEFAULT_MACHINE)]
    machine: String,
    /// A parameter, as in `kinematics.tool_length_mm=150`; can be given several times.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<String>,
}

impl MachineChoice {
    /// As the user named it.
    pub fn name(&self) -> &str {
        &self.machine
    }

    /// Refuses to write where it is read from.
    pub fn must_not_be(&self, output: &Path) -> Result<(), String> {
        must_not_replace(output, Path::new(&self.machine))
    }

    /// The machine file, with what `--set` says.
    pub fn parameters(&self) -> Result<Parameters, Box<dyn Error>> {
        variant::parameters(&Parameters::load(&self.machine)?, None, &self.set, &[])
    }
}

/// What is run, and on which machine.
#[derive(Debug, clap::Args)]
pub struct Subject {
    /// A shipped scenario, a scenario file, or a file of setpoints: CSV (`time,x,y,…` in s, m, rad),
    /// MCAP with a JointTrajectory, or the YAML that `ros2 topic pub` takes.
    #[arg(value_name = "SCENARIO|FILE")]
    input: String,
    /// A shipped machine or a machine file.
    #[arg(long, default_value = DEFAULT_MACHINE)]
    pub machine: String,
    /// A parameter, as in `x.velocity_loop.gain=4.5`; can be given several times.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// Feed in the place of the scenario's, m/min (rpm for a scenario of rotary moves).
    #[arg(long, allow_negative_numbers = true)]
    pub feed: Option<f64>,
    /// The topic to run, if a recording has several with a JointTrajectory.
    #[arg(long)]
    topic: Option<String>,
}

impl Subject {
    /// The machine file, without what `--set` says.
    pub fn machine(&self) -> Result<Parameters, Box<dyn Error>> {
        Ok(Parameters::load(&self.machine)?)
    }

    /// Refuses to write where the machine is read from.
    pub fn machine_must_not_be(&self, output: &Path) -> Result<(), String> {
        must_not_replace(output, Path::new(&self.machine))
    }

    /// The setpoints.
    pub fn input(&self) -> Result<Input, Box<dyn Error>> {
        Input::open(&self.input, self.topic.as_deref())
    }
}
