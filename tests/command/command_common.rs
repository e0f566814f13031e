//! Helpers to run the command `virtual_axes`.

use std::process::{Command, Output};

use serde_json::Value;

pub fn run(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_virtual_axes")).args(arguments).output().expect("the command starts")
}

/// Returns the standard output of a successful run.
#[track_caller]
pub fn printed(arguments: &[&str]) -> String {
    let output = run(arguments);
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    // No progress bar if standard error is no terminal.
    assert!(output.stderr.is_empty(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).expect("UTF-8")
}

#[track_caller]
pub fn json(arguments: &[&str]) -> Value {
    serde_json::from_str(&printed(arguments)).expect("one JSON object")
}

#[track_caller]
pub fn assert_rejected(arguments: &[&str], parts: &[&str]) {
    let output = run(arguments);
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert!(output.stdout.is_empty());
    for part in parts {
        assert!(message.contains(part), "{part:?} in {message}");
    }
}

/// Checks that a number is within a part of the expected one.
#[track_caller]
pub fn assert_near(found: &Value, expected: f64, part: f64) {
    let found = found.as_f64().expect("a number");
    assert!((found / expected - 1.0).abs() <= part, "{found}, not {expected}");
}
