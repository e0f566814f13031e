//! Tests of the whole room: faults that are refused, values that come out, machines that ship.

mod faults;
mod file_faults;
mod machines;
mod setting;
mod writing;

use super::{ConfigError, Parameters};

/// The default machine's file.
const MIKRON: &str = include_str!("../../../config/mikron_ucp710.yaml");

/// The default machine's file with its one `from` replaced by `to`.
fn mikron_with(from: &str, to: &str) -> String {
    assert_eq!(MIKRON.matches(from).count(), 1, "{from:?} stands once");
    MIKRON.replace(from, to)
}

/// The message with which `my.yaml` is refused; `{line}` in `expected` is the line of `marker`.
fn assert_refused(text: &str, marker: &str, expected: &str) {
    let line = line_of(text, marker);
    let message = refusal(text);
    assert_eq!(message, expected.replace("{line}", &line.to_string()));
}

/// Line, from 1, on which the first `marker` begins; 0 if there is none.
fn line_of(text: &str, marker: &str) -> usize {
    text.find(marker).map_or(0, |start| text[..start].matches('\n').count() + 1)
}

fn refusal(text: &str) -> String {
    let error: ConfigError = Parameters::from_yaml(text, "my.yaml").expect_err("a fault");
    error.to_string()
}

fn mikron() -> Parameters {
    Parameters::embedded_default().expect("the shipped machine is valid")
}
