//! ROS 2 node that simulates the axes of a machine tool.

#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used))]

// A module, not a dependency, which would recompile the library of this package with each new scenario.
#[path = "../../../crates/builtin/src/lib.rs"]
#[allow(dead_code)]
mod builtin;
#[cfg(target_os = "linux")]
mod datagrams;
#[cfg(target_os = "linux")]
mod epoll_wait;
#[cfg(all(target_os = "linux", target_env = "gnu"))]
mod free_memory;

use std::ffi::OsString;
use std::io::{ErrorKind, Write};
use std::process::ExitCode;

use virtual_axes::ros::{ROSOUT_QUEUE, log, node};
use virtual_axes::validation::args::{ArgsError, Command, ParameterSource, RosArgs};
use virtual_axes_core::config::{Parameters, TimeMode, ValueSource, parse_assignment};
use virtual_axes_core::text::escaped;
use virtual_axes_dds::{Environment, Security};

/// Number of characters of a long error that are shown from its start and from its end.
const SHOWN_CHARACTERS: usize = 500;

/// Exit status for an invalid command line, environment or machine file.
const USAGE_ERROR: u8 = 2;

const HELP: &str = "\
virtual_axes_node: ROS 2 node that simulates the feed drives of a machine tool

    virtual_axes_node [--lifecycle] [--ros-args ...]

Without arguments, the embedded Mikron UCP 710 runs in real time.
    --lifecycle                      managed node: configure and activate it with `ros2 lifecycle`
    --ros-args -p NAME:=VALUE        set a parameter; `virtual_axes parameters` lists them
               --params-file FILE    load a machine, or some of its parameters
               -r FROM:=TO           remap a topic or service
               -r __ns:=/NAMESPACE   set the namespace
               -r __node:=NAME       set the node name
               --log-level LEVEL     debug, info, warn, error or fatal; NAME:=LEVEL for one logger
               --disable-rosout-logs, --disable-stdout-logs
               --enclave /PATH       DDS Security enclave
    --help, --version";

fn main() -> ExitCode {
    match arguments().and_then(|arguments| Command::parse(arguments, "virtual_axes")) {
        Ok(Command::Help) => print_line(HELP),
        Ok(Command::Version) => print_line(concat!("virtual_axes_node ", env!("CARGO_PKG_VERSION"))),
        Ok(Command::Run(args)) => run(&args),
        Err(error) => fail(&error),
    }
}

fn arguments() -> Result<Vec<String>, ArgsError> {
    let not_utf8 = |found: OsString| ArgsError::NotUtf8 { found: found.to_string_lossy().into_owned() };
    std::env::args_os().skip(1).map(|argument| argument.into_string().map_err(not_utf8)).collect()
}

fn print_line(text: &str) -> ExitCode {
    match writeln!(std::io::stdout(), "{text}") {
        // A closed stdout is not an error.
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            fail(&std::io::Error::other(format!("standard output: {error}")))
        }
        _ => ExitCode::SUCCESS,
    }
}

fn fail(error: &dyn std::error::Error) -> ExitCode {
    // A closed stderr does not change the exit status.
    let _ = writeln!(std::io::stderr(), "{}", error_line(&error.to_string()));
    ExitCode::from(USAGE_ERROR)
}

fn variable(name: &str) -> Option<String> {
    std::env::var_os(name).map(|value| value.to_string_lossy().into_owned())
}

/// Returns the line of an error, with escaped control characters, and without the middle of a long one.
fn error_line(error: &str) -> String {
    let shown = match error.chars().count() {
        length if length > 2 * SHOWN_CHARACTERS => {
            let start: String = error.chars().take(SHOWN_CHARACTERS).collect();
            let end: String = error.chars().skip(length - SHOWN_CHARACTERS).collect();
            format!("{start}…{end}")
        }
        _ => error.to_owned(),
    };
    format!("virtual_axes_node: {}", escaped(&shown))
}

fn run(args: &RosArgs) -> ExitCode {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    if let Err(error) = free_memory::start_return() {
        return fail(&error);
    }
    let environment = match Environment::from_process() {
        Ok(environment) => environment,
        Err(error) => return fail(&error),
    };
    let security = match Security::from_lookup(variable, args.enclave()) {
        Ok(security) => security,
        Err(error) => return fail(&error),
    };
    let (records_in, records) = tokio::sync::mpsc::channel(ROSOUT_QUEUE);
    let log = match log::init(args, Some(records_in)) {
        Ok(log) => log,
        Err(error) => return fail(&error),
    };
    for warning in environment.warnings().iter().chain(args.warnings()) {
        tracing::warn!("{warning}");
    }
    let read = || parameters(args).map_err(|error| error.to_string());
    let (status, error) = match parameters(args) {
        Ok(parameters) => {
            match node::run(args, &environment, &security, &read, parameters, builtin::PROGRAMS, records) {
                Ok(()) => (ExitCode::SUCCESS, None),
                Err(error) => {
                    let status =
                        if error.is_usage() { ExitCode::from(USAGE_ERROR) } else { ExitCode::FAILURE };
                    (status, Some(error.to_string()))
                }
            }
        }
        Err(error) => (ExitCode::from(USAGE_ERROR), Some(error.to_string())),
    };
    log.finish(error.map(|text| error_line(&text)));
    status
}

/// Returns the parameters of the embedded machine, overridden by the command line in its order.
///
/// Adjacent values are applied together, so that values which are valid only in combination can be set.
fn parameters(args: &RosArgs) -> Result<Parameters, Box<dyn std::error::Error>> {
    let mut parameters = Parameters::embedded_default()?;
    let node = args.node().to_string();
    let mut pending = Vec::new();
    let mut follows_clock = false;
    for source in args.parameters() {
        match source {
            ParameterSource::Value { name, text, .. } => {
                if name == "machine" && Parameters::names_machine(text, builtin::MACHINES) {
                    tracing::warn!(
                        "-p machine:={text} sets the name only and changes no drive; to simulate another machine, \
                         pass its file with --params-file (`virtual_axes machines --show NAME` prints a built-in one)"
                    );
                }
                // Not set, as in a parameter file.
                if matches!(text.trim(), "null" | "Null" | "NULL" | "~") {
                    continue;
                }
                let assignment = parse_assignment(&format!("{name}:={text}"), &ValueSource::named("-p"))?;
                match parameters.ignored(&assignment) {
                    Some(reason) => tracing::warn!("{reason}; ignored"),
                    None => pending.push(assignment),
                }
            }
            ParameterSource::File(path) => {
                parameters.set_all(std::mem::take(&mut pending))?;
                let overlay = parameters.overlay_file(path, Some(&node))?;
                follows_clock |= parameters.node_config().use_sim_time;
                for reason in overlay.ignored {
                    tracing::warn!("{reason}; ignored");
                }
                for reason in overlay.repeated {
                    tracing::warn!("{reason}; the last value applies");
                }
                if overlay.sections == 0 {
                    let file = path.display();
                    match overlay.skipped.join(", ").as_str() {
                        "" => tracing::warn!("{file} contains no parameters"),
                        others => tracing::warn!(
                            "{file} contains no parameters for {node}, only for {others}; a section for a node in \
                             any namespace is named `/**/NAME`, and -r __node:=NAME changes the name of the node"
                        ),
                    }
                }
            }
        }
    }
    parameters.set_all(pending)?;
    let config = parameters.node_config();
    if follows_clock && !config.use_sim_time && config.time == TimeMode::Fast {
        tracing::warn!("use_sim_time = true of a parameter file is ignored: time = fast publishes /clock");
    }
    Ok(parameters)
}
