//! The ROS 2 node: virtual machine-tool axes.

#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used))]

#[cfg(target_os = "linux")]
mod interrupted;

use std::ffi::OsString;
use std::io::Write;
use std::process::ExitCode;

use virtual_axes::ingress::args::{ArgsError, Command, ParameterSource, RosArgs};
use virtual_axes::ros::environment::Environment;
use virtual_axes::ros::node;
use virtual_axes::ros::security::Security;
use virtual_axes::ros::{log, rosout};
use virtual_axes_core::config::{Parameters, Source, parse_assignment};

/// Messages are made in one thread and freed in another, in waves: the middleware looks every 6 s for what it need not keep.
/// That of the C library gives little of it back, and a node that runs for days holds several times what it uses.
#[global_allocator]
static ALLOCATOR: tikv_jemallocator::Jemalloc = tikv_jemallocator::Jemalloc;

/// Exit status of a wrong command line, environment or machine file.
const USAGE: u8 = 2;

const HELP: &str = "\
virtual_axes_node: the feed drives of a machine tool as a ROS 2 node

    virtual_axes_node [--ros-args ...]

Without arguments it runs the embedded Mikron UCP 710 in real time.
    --ros-args -p NAME:=VALUE        a parameter; `virtual_axes parameters` lists them
               --params-file FILE    a machine, or some of its parameters
               -r FROM:=TO           another name for a topic or service
               -r __ns:=/NAMESPACE   -r __node:=NAME
               --log-level LEVEL     debug, info, warn, error or fatal; NAME:=LEVEL of one logger
               --disable-rosout-logs, --disable-stdout-logs
               --enclave /PATH       of DDS Security
    --help, --version";

fn main() -> ExitCode {
    match arguments().and_then(|arguments| Command::parse(arguments, "virtual_axes")) {
        Ok(Command::Help) => say(HELP),
        Ok(Command::Version) => say(concat!("virtual_axes_node ", env!("CARGO_PKG_VERSION"))),
        Ok(Command::Run(args)) => run(&args),
        Err(error) => refuse(&error),
    }
}

fn arguments() -> Result<Vec<String>, ArgsError> {
    let refused = |found: OsString| ArgsError::NotUtf8 { found: found.to_string_lossy().into_owned() };
    std::env::args_os().skip(1).map(|argument| argument.into_string().map_err(refused)).collect()
}

fn say(text: &str) -> ExitCode {
    // A reader that has gone away is no fault.
    let _ = writeln!(std::io::stdout(), "{text}");
    ExitCode::SUCCESS
}

fn refuse(error: &dyn std::error::Error) -> ExitCode {
    // That nobody can read it changes nothing.
    let _ = writeln!(std::io::stderr(), "{}", complains(&error.to_string()));
    ExitCode::from(USAGE)
}

fn variable(name: &str) -> Option<String> {
    std::env::var_os(name).map(|value| value.to_string_lossy().into_owned())
}

fn complains(error: &str) -> String {
    format!("virtual_axes_node: {error}")
}

fn run(args: &RosArgs) -> ExitCode {
    let environment = match Environment::from_process() {
        Ok(environment) => environment,
        Err(error) => return refuse(&error),
    };
    let security = match Security::from_lookup(variable, args.enclave()) {
        Ok(security) => security,
        Err(error) => return refuse(&error),
    };
    let (log_in, log) = tokio::sync::mpsc::channel(rosout::QUEUE);
    let shown = match log::init(args, Some(log_in)) {
        Ok(shown) => shown,
        Err(error) => return refuse(&error),
    };
    for warning in environment.warnings().iter().chain(args.warnings()) {
        tracing::warn!("{warning}");
    }
    let (status, complaint) = match parameters(args) {
        Ok(parameters) => match node::run(args, &environment, &security, parameters, log) {
            Ok(()) => (ExitCode::SUCCESS, None),
            Err(error) => {
                let status = if error.is_usage() { ExitCode::from(USAGE) } else { ExitCode::FAILURE };
                (status, Some(error.to_string()))
            }
        },
        Err(error) => (ExitCode::from(USAGE), Some(error.to_string())),
    };
    shown.finish(complaint.map(|text| complains(&text)));
    status
}

/// The embedded machine, with what the command line puts in its place, in the order of the command line.
///
/// Values that stand side by side are taken together, so that what fits only together can be set.
fn parameters(args: &RosArgs) -> Result<Parameters, Box<dyn std::error::Error>> {
    let mut parameters = Parameters::embedded_default()?;
    let node = args.node().to_string();
    let mut together = Vec::new();
    for source in args.parameters() {
        match source {
            ParameterSource::Value { name, text, .. } => {
                if name == "machine" && Parameters::builtin_names().any(|shipped| shipped == text) {
                    tracing::warn!(
                        "-p machine:={text} gives the machine a name and changes no drive; its file does, with \
                         --params-file (`virtual_axes machines --show {text}` prints it)"
                    );
                }
                together.push(parse_assignment(&format!("{name}:={text}"), &Source::named("-p"))?);
            }
            ParameterSource::File(path) => {
                parameters.set_all(std::mem::take(&mut together))?;
                let overlay = parameters.overlay_file(path, Some(&node))?;
                if overlay.sections == 0 {
                    tracing::warn!("{} has nothing for {node}", path.display());
                }
            }
        }
    }
    parameters.set_all(together)?;
    Ok(parameters)
}
