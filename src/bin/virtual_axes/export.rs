//! `virtual_axes fmu` and `virtual_axes urdf`: a machine as an FMU, for importers of FMI 2.0 co-simulation, and as URDF,
//! for robot_state_publisher and RViz.

use std::error::Error;
use std::io::Write;
use std::path::{Path, PathBuf};

use virtual_axes_fmu::{MODEL_IDENTIFIER, fmu_archive};
use virtual_axes_io::files::OutputFile;
use virtual_axes_io::urdf::urdf;

use crate::arguments::trial_arguments::MachineArguments;
use crate::input::must_not_replace;
use crate::output::machine_file;

/// Arguments of `virtual_axes fmu`.
#[derive(Debug, clap::Args)]
pub struct FmuArguments {
    #[command(flatten)]
    machine: MachineArguments,
    /// Output file, for example `axes.fmu`.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Library of the FMU, built by `cargo build --release -p virtual_axes_fmu`; can be repeated for several platforms
    /// [default: the one beside this program].
    #[arg(long, value_name = "FILE")]
    library: Vec<PathBuf>,
}

/// Writes the archive and returns an empty text.
pub fn write_fmu(arguments: &FmuArguments) -> Result<String, Box<dyn Error>> {
    let machine = &arguments.machine;
    let text = machine.parameters()?.to_yaml("", |_| None);
    machine.must_not_be(&arguments.out)?;
    let found = if arguments.library.is_empty() { vec![own_library()?] } else { arguments.library.clone() };
    for path in &found {
        must_not_replace(&arguments.out, path)?;
    }
    let archive = fmu_archive(&text, &found).map_err(|error| -> Box<dyn Error> { error })?;
    let mut file = OutputFile::create(&arguments.out)?;
    file.write_all(&archive)?;
    file.finish()?;
    Ok(String::new())
}

/// Returns the library beside this program, where cargo builds or a package installs it.
fn own_library() -> Result<PathBuf, String> {
    let (prefix, suffix) = (std::env::consts::DLL_PREFIX, std::env::consts::DLL_SUFFIX);
    let name = format!("{prefix}{MODEL_IDENTIFIER}{suffix}");
    let program = std::env::current_exe().map_err(|error| format!("path of this program: {error}"))?;
    let folder = program.parent().unwrap_or(Path::new("."));
    // Cargo keeps the one in deps up to date with the program.
    [folder.join("deps").join(&name), folder.join(&name)].into_iter().find(|path| path.is_file()).ok_or_else(
        || {
            format!(
                "{name} is not beside this program in {}; build it by `cargo build --release -p virtual_axes_fmu` \
                 or name it by --library",
                folder.display()
            )
        },
    )
}

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
pub fn write_urdf(arguments: &UrdfArguments) -> Result<String, Box<dyn Error>> {
    let machine = &arguments.machine;
    let config = machine.parameters()?.machine_config()?;
    let text =
        urdf(&config, &arguments.joint_prefix).map_err(|error| format!("{}: {error}", machine.name()))?;
    let Some(path) = &arguments.out else { return Ok(text) };
    machine.must_not_be(path)?;
    machine_file::write(path, &text)?;
    Ok(String::new())
}
