//! The command `virtual_axes` as a user runs it.

use std::path::Path;
use std::process::{Command, Output};

fn run(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_virtual_axes")).args(arguments).output().expect("the command starts")
}

fn shipped(file: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("config").join(file);
    path.to_string_lossy().into_owned()
}

#[test]
fn a_good_machine_file_is_valid() {
    let output = run(&["check", &shipped("mikron_ucp710.yaml")]);
    assert!(output.status.success());
    assert_eq!(
        String::from_utf8_lossy(&output.stdout),
        "machine: Mikron UCP 710\n\
         joints: x (linear), y (linear), z (linear), a (rotary), c (rotary)\n\
         valid\n"
    );
}

#[test]
fn a_bad_machine_file_gives_one_message_and_status_2() {
    let output = run(&["check", "no/such.yaml"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(output.stdout.is_empty());
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(message.starts_with("no/such.yaml: cannot be read: "), "{message}");
    assert_eq!(message.lines().count(), 1);
}

#[test]
fn machines_and_parameters_are_listed() {
    let machines = run(&["machines"]);
    let text = String::from_utf8_lossy(&machines.stdout);
    assert!(text.starts_with("mikron_ucp710: Mikron UCP 710\n"), "{text}");
    let table = run(&["parameters", "--markdown"]);
    let text = String::from_utf8_lossy(&table.stdout);
    assert!(text.contains("| `<joint>.motor.inertia_kg_m2` | 1e-9 … 1e3 kg·m² |"), "{text}");
}
