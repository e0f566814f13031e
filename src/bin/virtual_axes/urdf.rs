//! `virtual_axes urdf`: URDF of a machine for robot_state_publisher and RViz.

use std::error::Error;
use std::io::Write;
use std::path::PathBuf;

use virtual_axes_io::files::OutputFile;
use virtual_axes_io::urdf::urdf;

use crate::trial_arguments::MachineArguments;

/// Arguments of `virtual_axes urdf`.
#[derive(Debug, clap::Args)]
pub struct UrdfArguments {
    #[command(flatten)]
    machine: MachineArguments,
    /// Prefix of joint names, like the parameter joint_prefix of the node.
    #[arg(long, default_value = "", value_name = "TEXT")]
    joint_prefix: String,
    /// Output file [default: standard output].
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// Returns the URDF, or an empty text if it is written to a file.
pub fn run(arguments: &UrdfArguments) -> Result<String, Box<dyn Error>> {
    let machine = &arguments.machine;
    let config = machine.parameters()?.machine_config()?;
    let text =
        urdf(&config, &arguments.joint_prefix).map_err(|error| format!("{}: {error}", machine.name()))?;
    let Some(path) = &arguments.out else { return Ok(text) };
    machine.must_not_be(path)?;
    let mut file = OutputFile::create(path)?;
    file.write_all(text.as_bytes())?;
    file.finish()?;
    Ok(String::new())
}
