//! Output of the commands: error messages, tables, pages, files, progress.

pub mod emphasis;
pub mod interrupt;
pub mod machine_file;
pub mod operations;
pub mod progress;
pub mod report;
pub mod text_table;
pub mod unusable;

use std::env;
use std::fmt::Display;
use std::io::{self, Write};

use virtual_axes_core::text::{escaped, escaped_lines};

/// Maximum length of an argument in a message, characters.
const MAX_ARGUMENT: usize = 200;
/// Number of characters of a longer argument that are shown from its start and from its end.
const SHOWN: usize = 80;

/// Prints an error with escaped control characters; a failure of standard error is ignored.
pub fn print_error(error: &(impl Display + ?Sized)) {
    let text = with_shown_arguments(error.to_string());
    let _ = writeln!(io::stderr(), "{}", escaped_lines(&text));
}

/// Returns the output of a command, with escape sequences for the control characters of its arguments.
pub fn with_escaped_arguments(text: String) -> String {
    with_arguments(text, str::to_owned)
}

/// Returns a message with escape sequences in the arguments of the command, and without the middle of long ones.
pub fn with_shown_arguments(text: String) -> String {
    with_arguments(text, shortened_argument)
}

/// Replaces the arguments of this process, such as names of files, and values behind `=`.
fn with_arguments(text: String, shortened: impl Fn(&str) -> String) -> String {
    env::args_os().skip(1).fold(text, |text, argument| {
        let argument = argument.to_string_lossy();
        let value = argument.split_once('=').map_or("", |(_, value)| value);
        [&*argument, value]
            .into_iter()
            .fold(text, |text, found| replaced(text, found, &escaped(&shortened(found))))
    })
}

fn replaced(text: String, found: &str, shown: &str) -> String {
    match text.strip_prefix(found) {
        _ if found == shown => text,
        // White space is not looked for elsewhere.
        Some(rest) if found.trim().is_empty() => shown.to_owned() + rest,
        _ if found.trim().is_empty() => text,
        _ => text.replace(found, shown),
    }
}

/// Returns start and end of a long argument.
fn shortened_argument(argument: &str) -> String {
    let length = argument.chars().count();
    if length <= MAX_ARGUMENT {
        return argument.to_owned();
    }
    let start: String = argument.chars().take(SHOWN).collect();
    let end: String = argument.chars().skip(length - SHOWN).collect();
    format!("{start}…{end}")
}
