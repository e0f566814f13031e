//! Verdict of a command in bold on a terminal.

use std::env;
use std::io::{self, IsTerminal};

const BOLD: &str = "\x1b[1m";
const PLAIN: &str = "\x1b[0m";

/// Returns `text` with its first line in bold, if standard output is a terminal with colors.
pub fn with_bold_verdict(text: String) -> String {
    if !has_colors() {
        return text;
    }
    let (verdict, rest) = text.split_at(text.find('\n').unwrap_or(text.len()));
    format!("{BOLD}{verdict}{PLAIN}{rest}")
}

/// Returns true if colors are wanted: `NO_COLOR` forbids them, `CLICOLOR_FORCE` demands them, `CLICOLOR=0` and
/// `TERM=dumb` switch them off on a terminal.
fn has_colors() -> bool {
    let is_set = |name: &str| env::var_os(name).is_some_and(|value| !value.is_empty());
    let is = |name: &str, value: &str| env::var_os(name).is_some_and(|found| found == value);
    if is_set("NO_COLOR") {
        return false;
    }
    if is_set("CLICOLOR_FORCE") && !is("CLICOLOR_FORCE", "0") {
        return true;
    }
    io::stdout().is_terminal() && !is("CLICOLOR", "0") && !is("TERM", "dumb")
}
