//! Command line of the virtual axes; needs no network.

#![forbid(unsafe_code)]

mod run;

use std::error::Error;
use std::fmt::Display;
use std::io::{self, Write};
use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use virtual_axes::config::{AxisKind, ConfigError, Parameters, listing};

/// Exit status of a command that refused its input.
const BAD_INPUT: u8 = 2;

/// Virtual machine-tool axes.
#[derive(Debug, Parser)]
#[command(version, about)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Run set-points through a machine and print its errors.
    Run(run::Arguments),
    /// Check a machine file.
    Check {
        /// Machine file: a ROS 2 parameter file.
        file: PathBuf,
    },
    /// List the machines that come with the program.
    Machines,
    /// List every parameter with its unit, range and default.
    Parameters {
        /// As a Markdown table.
        #[arg(long)]
        markdown: bool,
    },
}

fn main() -> ExitCode {
    let text = match text_of(&Arguments::parse().command) {
        Ok(text) => text,
        Err(error) => {
            complain(&*error);
            return ExitCode::from(BAD_INPUT);
        }
    };
    match io::stdout().write_all(text.as_bytes()) {
        // A reader that has seen enough (`| head`) is no fault.
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            complain(&format!("standard output: {error}"));
            ExitCode::FAILURE
        }
        _ => ExitCode::SUCCESS,
    }
}

/// Says what is wrong; that nobody can read it changes nothing.
fn complain(what: &(impl Display + ?Sized)) {
    let _ = writeln!(io::stderr(), "{what}");
}

/// What the command prints.
fn text_of(command: &Command) -> Result<String, Box<dyn Error>> {
    match command {
        Command::Run(arguments) => run::run(arguments),
        Command::Check { file } => Ok(check(&Parameters::from_file(file)?)?),
        Command::Machines => Parameters::builtin_names()
            .map(|name| {
                let machine = Parameters::builtin(name)?.machine_config()?;
                Ok(format!("{name}: {}\n", machine.name()))
            })
            .collect(),
        Command::Parameters { markdown: true } => Ok(listing::markdown()),
        Command::Parameters { markdown: false } => Ok(listing::text()),
    }
}

fn check(parameters: &Parameters) -> Result<String, ConfigError> {
    let machine = parameters.machine_config()?;
    let joints: Vec<String> = machine
        .axes()
        .iter()
        .map(|axis| match axis.kind() {
            AxisKind::Linear => format!("{} (linear)", axis.name()),
            AxisKind::Rotary => format!("{} (rotary)", axis.name()),
        })
        .collect();
    Ok(format!("machine: {}\njoints: {}\nvalid\n", machine.name(), joints.join(", ")))
}
