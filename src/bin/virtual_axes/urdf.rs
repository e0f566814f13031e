//! `virtual_axes urdf`: a machine for robot_state_publisher and RViz.

use std::error::Error;
use std::io::Write;
use std::path::PathBuf;

use virtual_axes_io::files::OutputFile;
use virtual_axes_io::urdf::urdf;

use crate::subject::MachineChoice;

/// Which machine, and where its URDF goes.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    machine: MachineChoice,
    /// Text before the joint names, as the node's joint_prefix.
    #[arg(long, default_value = "", value_name = "TEXT")]
    joint_prefix: String,
    /// File to write; the standard output when left out.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// The URDF, or nothing when it goes into a file.
pub fn run(arguments: &Arguments) -> Result<String, Box<dyn Error>> {
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
