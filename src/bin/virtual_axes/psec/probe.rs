//! `virtual_axes psec --probe`: part program that shows the profile of a control.

use std::error::Error;
use std::io::Write;
use std::path::{Path, PathBuf};

use virtual_axes_core::config::{DEFAULT_MACHINE, Parameters};
use virtual_axes_io::files::OutputFile;
use virtual_axes_nc::identify_control::probe_program;
use virtual_axes_nc::interpret::WorkOffset;

use crate::arguments::variant;
use crate::input::must_not_replace;

/// Extensions of files with setpoints.
const SETPOINTS: [&str; 3] = ["csv", "mcap", "yaml"];

/// Arguments of `virtual_axes psec --probe`.
#[derive(Debug, clap::Args)]
pub struct ProbeArguments {
    /// Output file: a part program in G54.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Built-in machine or machine file whose travel limits, speeds and accelerations apply.
    #[arg(long, default_value = DEFAULT_MACHINE)]
    machine: String,
    /// Set a parameter, for example `x.limits.travel_max_mm=300`; can be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Work offset on the control in place of that of the machine file, as in G54=120,80,-350: X, Y and Z in mm, then A, B
    /// and C in degrees. Repeatable.
    #[arg(long = "work-offset", value_name = "G54=X,Y,Z", allow_hyphen_values = true)]
    work_offset: Vec<WorkOffset>,
}

/// Writes the program and returns an empty text.
pub fn run(arguments: &ProbeArguments) -> Result<String, Box<dyn Error>> {
    if arguments.out.extension().is_some_and(|extension| SETPOINTS.iter().any(|known| extension == *known)) {
        let out = arguments.out.display();
        return Err(format!(
            "--out {out}: --probe writes a part program, no setpoints; for example probe.nc"
        )
        .into());
    }
    must_not_replace(&arguments.out, Path::new(&arguments.machine))?;
    let machine = Parameters::load(&arguments.machine, crate::builtin::MACHINES)?;
    let config = variant::parameters(&machine, None, &arguments.set, &[])?.machine_config()?;
    let text = probe_program(&config, &arguments.work_offset)
        .map_err(|error| format!("{}: {error}", arguments.machine))?;
    let mut file = OutputFile::create(&arguments.out)?;
    file.write_all(text.as_bytes())?;
    file.finish()?;
    Ok(String::new())
}
