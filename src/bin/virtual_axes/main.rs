//! Command line `virtual_axes`: offline simulation, controller design, tuning and identification without ROS
//! 2.

#![forbid(unsafe_code)]
#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used))]

mod arguments;
mod bode;
// A module, not a dependency, which would recompile the library of this package with each new scenario.
#[path = "../../../crates/builtin/src/lib.rs"]
mod builtin;
mod check;
mod compile;
mod design;
mod export;
mod identify;
mod identify_control;
mod input;
mod learn;
mod list;
mod output;
mod pose;
mod psec;
mod run;
mod tune;

use std::error::Error;
use std::io::{self, Write};
use std::path::PathBuf;
use std::process::ExitCode;

use clap::error::{ContextKind, ErrorKind};
use clap::{CommandFactory, Parser, Subcommand};
use clap_complete::{CompleteEnv, Shell};
use virtual_axes_core::config::listing;
use virtual_axes_core::text::is_control;

use crate::arguments::output_arguments::OutputFormat;
use crate::list::completion;
use crate::output::unusable::UnusableResult;
use crate::output::{emphasis, interrupt, print_error, with_escaped_arguments, with_shown_arguments};

/// Exit status of a command that rejected its input or could not write its output.
const BAD_INPUT: u8 = 2;
/// Errors of the standard library about a number, and what is required instead.
const NUMBER_ERRORS: [(&str, &str); 4] = [
    ("invalid float literal", "must be a number, for example 2.5"),
    ("cannot parse float from empty string", "must be a number, for example 2.5"),
    ("invalid digit found in string", "must be a whole number of at least 0"),
    ("cannot parse integer from empty string", "must be a whole number of at least 0"),
];

/// Simulate virtual machine-tool axes offline.
#[derive(Debug, Parser)]
#[command(version, about, term_width = 80, after_help = "Example: virtual_axes run ballbar")]
struct CommandLine {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Simulate a scenario or setpoints on a machine and print its errors.
    Run(run::RunArguments),
    /// Write the setpoints of a scenario or of an identification campaign to a file.
    Psec(psec::PsecArguments),
    /// Design position controllers and print polynomials, closed-loop poles and stability margins.
    Design(design::DesignArguments),
    /// Print the margins of the current, velocity and position loops, and write their frequency responses.
    Bode(bode::BodeArguments),
    /// Optimize the tuning of the position controllers for a path.
    Tune(Box<tune::TuneArguments>),
    /// Learn setpoints that compensate the repeatable errors of a motion, run after run.
    Learn(Box<learn::LearnArguments>),
    /// Change points and feeds of a part program so that the simulated tool stays near the programmed path.
    Compile(Box<compile::CompileArguments>),
    /// Simulate one tuning on plants with deviating inertia, friction and torque constant.
    Robustness(Box<tune::robustness::RobustnessArguments>),
    /// Identify the parameters of an axis from recordings and write a machine file.
    Identify(Box<identify::IdentifyArguments>),
    /// Identify the profile of a control from a part program and the setpoints that it made of it.
    IdentifyControl(Box<identify_control::IdentifyControlArguments>),
    /// Validate a machine file, a scenario, setpoints, or a part program, and compare setpoints with the limits.
    Check(check::CheckArguments),
    /// Print the URDF of a machine, for robot_state_publisher and RViz.
    Urdf(export::UrdfArguments),
    /// Write a machine as an FMU (FMI 2.0 co-simulation), for Simulink, OpenModelica and other importers.
    Fmu(export::FmuArguments),
    /// Print the tool pose in the workpiece frame for joint positions (forward kinematics).
    Pose(pose::PoseArguments),
    /// List the built-in machines.
    Machines {
        /// Print a JSON list.
        #[arg(long)]
        json: bool,
        /// Print the file of this machine or scenario, as a template.
        #[arg(long, visible_alias = "new", value_name = "MACHINE", conflicts_with = "json")]
        show: Option<String>,
    },
    /// List the built-in scenarios and part programs.
    Scenarios {
        /// Print a JSON list.
        #[arg(long)]
        json: bool,
        /// Print the file of this machine or scenario, as a template.
        #[arg(long, value_name = "SCENARIO", conflicts_with = "json")]
        show: Option<String>,
    },
    /// List all parameters with unit, range and default.
    Parameters {
        /// Print a Markdown table.
        #[arg(long)]
        markdown: bool,
        /// Print a JSON list.
        #[arg(long, conflicts_with = "markdown")]
        json: bool,
    },
    /// List topics, services and actions of the node, rejection codes and keys of /diagnostics.
    Interface {
        /// Print a JSON object.
        #[arg(long)]
        json: bool,
    },
    /// Print the script for the completion of commands, scenarios, machines and parameters in a shell.
    Completions {
        /// Shell.
        shell: Shell,
    },
    /// Write the man pages of the commands.
    Man {
        /// Folder, such as ~/.local/share/man/man1; created if it does not exist.
        #[arg(value_name = "FOLDER")]
        folder: PathBuf,
    },
}

impl Command {
    /// Returns true if the first line of the output is a verdict.
    fn prints_verdict(&self) -> bool {
        let output = match self {
            Command::Run(arguments) => arguments.output(),
            Command::Tune(arguments) => arguments.output(),
            Command::Learn(arguments) => arguments.output(),
            Command::Compile(arguments) => arguments.output(),
            Command::Robustness(arguments) => arguments.output(),
            _ => return false,
        };
        matches!(output.format(), OutputFormat::Text | OutputFormat::Quiet)
    }
}

fn main() -> ExitCode {
    CompleteEnv::with_factory(|| completion::with_names(CommandLine::command()))
        .var(completion::VARIABLE)
        .complete();
    interrupt::install_handler();
    let command = command_line().command;
    let text = match run_command(&command) {
        Ok(text) if command.prints_verdict() => emphasis::with_bold_verdict(text),
        Ok(text) => text,
        Err(error) => {
            if let Some(unusable) = error.downcast_ref::<UnusableResult>() {
                let text = match command.prints_verdict() {
                    true => emphasis::with_bold_verdict(unusable.text.clone()),
                    false => unusable.text.clone(),
                };
                let _ = io::stdout().write_all(with_escaped_arguments(text).as_bytes());
                print_error(unusable);
                return ExitCode::from(unusable.status);
            }
            print_error(&*error);
            return ExitCode::from(if interrupt::is_raised() { interrupt::INTERRUPTED } else { BAD_INPUT });
        }
    };
    let text = with_escaped_arguments(text);
    ExitCode::from(status(io::stdout().write_all(text.as_bytes()).and_then(|()| io::stdout().flush())))
}

/// Returns the exit status after the output is written, and prints the error if it is not.
fn status(written: io::Result<()>) -> u8 {
    match written {
        // A closed pipe (`| head`) is no error.
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            print_error(&format!("standard output: {error}"));
            BAD_INPUT
        }
        _ => 0,
    }
}

/// Parses the command line; ends the process for `--help`, `--version` and invalid arguments.
fn command_line() -> CommandLine {
    CommandLine::try_parse().unwrap_or_else(|mut error| {
        // No name of a file or a scenario begins with a dash.
        if error.render().to_string().contains("as a value, use '-- --") {
            error.remove(ContextKind::Suggested);
        }
        if !error.use_stderr() {
            let written = error.print().and_then(|()| io::stdout().flush());
            std::process::exit(i32::from(status(written)));
        }
        if error.kind() == ErrorKind::InvalidUtf8
            && let Some(argument) = std::env::args_os().find(|argument| argument.to_str().is_none())
        {
            print_error(&format!("argument {argument:?} is not UTF-8; rename the file"));
            std::process::exit(i32::from(BAD_INPUT));
        }
        let found = error.render().to_string();
        let text =
            NUMBER_ERRORS.iter().fold(found.clone(), |text, (found, remedy)| text.replace(found, remedy));
        if with_shown_arguments(text.clone()) != found || text.chars().any(|c| c != '\n' && is_control(c)) {
            print_error(text.trim_end());
            std::process::exit(i32::from(BAD_INPUT));
        }
        error.exit()
    })
}

/// Runs a command and returns its output.
fn run_command(command: &Command) -> Result<String, Box<dyn Error>> {
    match command {
        Command::Run(arguments) => run::run(arguments),
        Command::Psec(arguments) => psec::run(arguments),
        Command::Design(arguments) => design::run(arguments),
        Command::Bode(arguments) => bode::run(arguments),
        Command::Tune(arguments) => tune::run(arguments),
        Command::Learn(arguments) => learn::run(arguments),
        Command::Compile(arguments) => compile::run(arguments),
        Command::Robustness(arguments) => tune::robustness::run(arguments),
        Command::Identify(arguments) => identify::run(arguments),
        Command::IdentifyControl(arguments) => identify_control::run(arguments),
        Command::Check(arguments) => check::run(arguments),
        Command::Urdf(arguments) => export::write_urdf(arguments),
        Command::Fmu(arguments) => export::write_fmu(arguments),
        Command::Pose(arguments) => pose::run(arguments),
        Command::Machines { show: Some(name), .. } => list::machine(name),
        Command::Machines { json, show: None } => list::machines(*json),
        Command::Scenarios { show: Some(name), .. } => list::scenario(name),
        Command::Scenarios { json, show: None } => list::scenarios(*json),
        Command::Parameters { markdown: true, .. } => Ok(listing::markdown()),
        Command::Parameters { json: true, .. } => Ok(list::parameters()),
        Command::Parameters { .. } => Ok(listing::text()),
        Command::Interface { json: true } => Ok(list::interface::json()),
        Command::Interface { json: false } => Ok(list::interface::text()),
        Command::Completions { shell } => completion::script(&CommandLine::command(), &shell.to_string()),
        Command::Man { folder } => {
            completion::write_man_pages(CommandLine::command(), folder).map(|()| String::new())
        }
    }
}
