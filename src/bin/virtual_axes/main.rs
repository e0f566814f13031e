//! Command line of the virtual axes; needs no network.

#![forbid(unsafe_code)]
#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used))]

mod axis;
mod campaign;
mod check;
mod design;
mod design_output;
mod identify;
mod identify_json;
mod identify_text;
mod input;
mod interrupt;
mod json;
mod list;
mod machine_file;
mod period;
mod pose;
mod progress;
mod psec;
mod recordings;
mod report;
mod robustness;
mod run;
mod search;
mod subject;
mod table;
mod tune;
mod tune_output;
mod urdf;
mod variant;

use std::error::Error;
use std::fmt::Display;
use std::io::{self, Write};
use std::process::ExitCode;

use clap::{CommandFactory, Parser, Subcommand};
use clap_complete::Shell;
use virtual_axes_core::config::listing;

/// Exit status of a command that refused its input, or could not write its output.
const BAD_INPUT: u8 = 2;

/// Virtual machine-tool axes.
#[derive(Debug, Parser)]
#[command(version, about, after_help = "`virtual_axes run ballbar` is a good beginning.")]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Run a scenario or setpoints through a machine and print its errors.
    Run(run::Arguments),
    /// Write setpoints to a file: those of a scenario, or of a campaign to identify an axis.
    Psec(psec::Arguments),
    /// Design position controllers: polynomials, closed-loop poles and stability margins.
    Design(design::Arguments),
    /// Find the tuning of the position controllers that suits a path best.
    Tune(Box<tune::Arguments>),
    /// Run one tuning on plants whose inertia, friction and torque constant are off.
    Robustness(Box<robustness::Arguments>),
    /// Find the parameters of an axis from recordings of it, and write a machine file with them.
    Identify(Box<identify::Arguments>),
    /// Check a file: a machine, a scenario, or setpoints.
    Check(check::Arguments),
    /// Print the URDF of a machine, for robot_state_publisher and RViz.
    Urdf(urdf::Arguments),
    /// Print where the tool is in the workpiece frame for positions of the joints.
    Pose(pose::Arguments),
    /// List the machines that come with the program.
    Machines {
        /// As a JSON list.
        #[arg(long)]
        json: bool,
        /// Print the file of this one, to begin another from.
        #[arg(long, value_name = "MACHINE", conflicts_with = "json")]
        show: Option<String>,
    },
    /// List the scenarios that come with the program.
    Scenarios {
        /// As a JSON list.
        #[arg(long)]
        json: bool,
        /// Print the file of this one, to begin another from.
        #[arg(long, value_name = "SCENARIO", conflicts_with = "json")]
        show: Option<String>,
    },
    /// List every parameter with its unit, range and default.
    Parameters {
        /// As a Markdown table.
        #[arg(long)]
        markdown: bool,
    },
    /// Print completions for a shell.
    Completions {
        /// Which shell.
        shell: Shell,
    },
}

fn main() -> ExitCode {
    interrupt::listen();
    let text = match text_of(&Arguments::parse().command) {
        Ok(text) => text,
        Err(error) => {
            complain(&*error);
            return ExitCode::from(if interrupt::raised() { interrupt::INTERRUPTED } else { BAD_INPUT });
        }
    };
    match io::stdout().write_all(text.as_bytes()).and_then(|()| io::stdout().flush()) {
        // A reader that has seen enough (`| head`) is no fault.
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            complain(&format!("standard output: {error}"));
            ExitCode::from(BAD_INPUT)
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
        Command::Psec(arguments) => psec::run(arguments),
        Command::Design(arguments) => design::run(arguments),
        Command::Tune(arguments) => tune::run(arguments),
        Command::Robustness(arguments) => robustness::run(arguments),
        Command::Identify(arguments) => identify::run(arguments),
        Command::Check(arguments) => check::run(arguments),
        Command::Urdf(arguments) => urdf::run(arguments),
        Command::Pose(arguments) => pose::run(arguments),
        Command::Machines { show: Some(name), .. } => list::machine(name),
        Command::Machines { json, show: None } => list::machines(*json),
        Command::Scenarios { show: Some(name), .. } => list::scenario(name),
        Command::Scenarios { json, show: None } => list::scenarios(*json),
        Command::Parameters { markdown: true } => Ok(listing::markdown()),
        Command::Parameters { markdown: false } => Ok(listing::text()),
        Command::Completions { shell } => {
            let mut text = Vec::new();
            let name = Arguments::command().get_name().to_owned();
            clap_complete::generate(*shell, &mut Arguments::command(), name, &mut text);
            Ok(String::from_utf8(text)?)
        }
    }
}
