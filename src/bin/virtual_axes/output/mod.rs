//! Output of the commands: error messages, tables, pages, files, progress.

pub mod emphasis;
pub mod interrupt;
pub mod machine_file;
pub mod progress;
pub mod report;
pub mod text_table;

use std::fmt::Display;
use std::io::{self, Write};

use virtual_axes_core::text::escaped_lines;

/// Prints an error with escaped control characters; a failure of standard error is ignored.
pub fn print_error(error: &(impl Display + ?Sized)) {
    let _ = writeln!(io::stderr(), "{}", escaped_lines(&error.to_string()));
}
