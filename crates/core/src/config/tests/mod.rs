//! Tests of the configuration: rejected files and values, accepted values, built-in machines.

mod backlash;
mod couplings;
mod machines;
mod presliding;
mod rejected_files;
mod rejected_values;
mod setting;
mod writing;

use super::{ConfigError, Parameters};

/// Machine file of the default machine.
const MIKRON: &str = include_str!("../../../config/mikron_ucp710.yaml");

/// Returns the machine file of the default machine with `from`, which occurs once, replaced by `to`.
fn mikron_with(from: &str, to: &str) -> String {
    assert_eq!(MIKRON.matches(from).count(), 1, "{from:?} occurs once");
    MIKRON.replace(from, to)
}

/// Asserts that `my.yaml` is rejected with the message `expected`, in which `{line}` is the line of `marker`.
fn assert_rejected(text: &str, marker: &str, expected: &str) {
    let line = line_of(text, marker);
    let message = rejection(text);
    assert_eq!(message, expected.replace("{line}", &line.to_string()));
}

/// Returns the line of the first `marker`, from 1; 0 if there is none.
fn line_of(text: &str, marker: &str) -> usize {
    text.find(marker).map_or(0, |start| text[..start].matches('\n').count() + 1)
}

fn rejection(text: &str) -> String {
    let error: ConfigError = Parameters::from_yaml(text, "my.yaml").expect_err("an invalid file");
    error.to_string()
}

fn mikron() -> Parameters {
    Parameters::embedded_default().expect("the built-in machine is valid")
}
