//! Shell completions that contain the names of scenarios, part programs, machines and parameters, and man pages.

use std::collections::BTreeSet;
use std::error::Error;
use std::ffi::OsStr;
use std::path::Path;

use clap::{Arg, Command};
use clap_complete::engine::{ArgValueCompleter, CompletionCandidate, PathCompleter, ValueCompleter};
use clap_complete::env::Shells;
use virtual_axes_core::config::{DEFINITIONS, listing};

use crate::builtin::{MACHINES, PROGRAMS, SCENARIOS};

/// Environment variable with which the script of a shell calls this program for candidates.
pub const VARIABLE: &str = "VIRTUAL_AXES_COMPLETE";

/// Joints offered in names of parameters: those of the built-in machines.
const JOINTS: [&str; 6] = ["x", "y", "z", "a", "b", "c"];

/// Returns `command` with the completion of names in the arguments of all subcommands.
pub fn with_names(command: Command) -> Command {
    command.mut_args(with_completer).mut_subcommands(with_names)
}

fn with_completer(argument: Arg) -> Arg {
    let value = argument.get_value_names().and_then(<[_]>::first).map_or("", |name| name.as_str());
    let completer = match (argument.get_id().as_str(), value) {
        ("machine", _) | (_, "MACHINE") => ArgValueCompleter::new(machine),
        (_, "MACHINE|SCENARIO|FILE") => ArgValueCompleter::new(any),
        (_, "SCENARIO|FILE" | "SCENARIO") => ArgValueCompleter::new(scenario),
        (_, value) if value.starts_with("KEY=VALUE") => ArgValueCompleter::new(parameter),
        _ => return argument,
    };
    argument.add(completer)
}

fn machine(begin: &OsStr) -> Vec<CompletionCandidate> {
    or_files(MACHINES.iter().map(|(name, _)| *name), begin)
}

fn scenario(begin: &OsStr) -> Vec<CompletionCandidate> {
    or_files(SCENARIOS.iter().chain(PROGRAMS).map(|(name, _)| *name), begin)
}

fn any(begin: &OsStr) -> Vec<CompletionCandidate> {
    or_files(MACHINES.iter().chain(SCENARIOS).chain(PROGRAMS).map(|(name, _)| *name), begin)
}

/// Returns the names and files that start with `begin`.
fn or_files<'a>(names: impl Iterator<Item = &'a str>, begin: &OsStr) -> Vec<CompletionCandidate> {
    let start = begin.to_string_lossy();
    let names = names.filter(|name| name.starts_with(&*start)).map(CompletionCandidate::new);
    names.chain(PathCompleter::file().complete(begin)).collect()
}

/// Returns the keys of parameters that start with `begin`, each with `=`.
fn parameter(begin: &OsStr) -> Vec<CompletionCandidate> {
    let start = begin.to_string_lossy();
    // Some keys have one definition for linear and another for rotary axes.
    let keys: BTreeSet<String> = DEFINITIONS
        .iter()
        .flat_map(|definition| {
            let key = listing::key(definition);
            let joints = if key.starts_with("<joint>") { &JOINTS[..] } else { &JOINTS[..1] };
            joints.iter().map(move |joint| key.replace("<joint>", joint) + "=").collect::<Vec<_>>()
        })
        .collect();
    keys.into_iter().filter(|key| key.starts_with(&*start)).map(CompletionCandidate::new).collect()
}

/// Returns the script that registers the completion of `command` at a shell.
pub fn script(command: &Command, shell: &str) -> Result<String, Box<dyn Error>> {
    let completer = Shells::builtins();
    let completer = completer.completer(shell).ok_or_else(|| format!("shell {shell} has no completions"))?;
    let name = command.get_name();
    let mut text = Vec::new();
    completer.write_registration(VARIABLE, name, name, name, &mut text)?;
    Ok(String::from_utf8(text)?)
}

/// Writes a man page for `command` and for each subcommand into a folder.
pub fn write_man_pages(command: Command, folder: &Path) -> Result<(), Box<dyn Error>> {
    let written = std::fs::create_dir_all(folder).and_then(|()| clap_mangen::generate_to(command, folder));
    Ok(written
        .map_err(|error| format!("{}: {error}; name a folder that can be written", folder.display()))?)
}
