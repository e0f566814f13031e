//! FMI functions under random calls, and the variables of the built-in machines.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;

use virtual_axes_core::config::Parameters;
use virtual_axes_fmu::{FmuVariables, MACHINE_FILE, guid, model_description};

/// Returns the library that cargo builds with this test.
fn library() -> PathBuf {
    let exe = std::env::current_exe().expect("the path of the test");
    let name = format!("{}virtual_axes_fmu{}", std::env::consts::DLL_PREFIX, std::env::consts::DLL_SUFFIX);
    exe.with_file_name(name)
}

fn machine_file(name: &str) -> String {
    Parameters::load(name, virtual_axes_builtin::MACHINES).expect("a built-in machine").to_yaml("", |_| None)
}

/// Options of gcc that make leaks, invalid accesses and undefined behavior an error.
const SANITIZERS: [&str; 3] = ["-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"];

#[test]
#[ignore = "compiles with sanitizers: ./test.sh --all"]
fn random_calls_in_any_order_return_a_status_without_leak_or_invalid_access() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("resources");
    std::fs::create_dir_all(&folder).expect("a folder");
    let machine = machine_file("mikron_ucp710");
    std::fs::write(folder.join(MACHINE_FILE), &machine).expect("writable");
    let program = Path::new(env!("CARGO_TARGET_TMPDIR")).join("random_fmu_calls");
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/random_calls.c");
    let mut gcc = Command::new("gcc");
    gcc.args(["-std=gnu11", "-Wall", "-Wextra", "-Werror", "-O1"]).args(SANITIZERS).arg("-o").arg(&program);
    assert!(gcc.arg(source).args(["-ldl", "-lm"]).status().expect("gcc is installed").success());
    for seed in ["1", "2", "3"] {
        let output = Command::new(&program)
            .arg(library())
            .arg(guid(&machine).expect("valid"))
            .arg(format!("file://{}", folder.display()))
            .args([seed, "10000"])
            .output()
            .expect("it runs");
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        assert!(
            output.status.success(),
            "seed {seed}, {}: {}",
            output.status,
            String::from_utf8_lossy(&output.stderr)
        );
        // The calls reach the machines: many steps are done.
        let steps: u32 = text.split(' ').next().and_then(|word| word.parse().ok()).expect("a number");
        assert!(steps > 300, "seed {seed}: {text}");
    }
}

#[test]
fn names_of_variables_are_unique_and_inputs_come_first() {
    for name in virtual_axes_builtin::MACHINES.iter().map(|(name, _)| *name) {
        let parameters = Parameters::load(name, virtual_axes_builtin::MACHINES).expect("a built-in machine");
        let variables = FmuVariables::new(&parameters).expect("valid");
        let names: BTreeSet<&str> = variables.list().iter().map(|variable| variable.name.as_str()).collect();
        assert_eq!(names.len(), variables.list().len(), "{name}");
        assert!(variables.list()[0].name.ends_with(".setpoint"));
    }
}

#[test]
fn every_unit_is_given_in_base_units() {
    for name in virtual_axes_builtin::MACHINES.iter().map(|(name, _)| *name) {
        let description = model_description(&machine_file(name)).expect("valid");
        let units: Vec<&str> = description.lines().filter(|line| line.starts_with("<Unit name")).collect();
        assert!(units.len() > 10);
        assert!(units.iter().all(|line| line.contains("<BaseUnit ")), "{name}: {units:?}");
    }
}

#[test]
fn an_invalid_machine_file_is_rejected_with_its_reason() {
    let text = machine_file("mikron_ucp710").replace("current_us: 125", "current_us: -1");
    let error = model_description(&text).expect_err("invalid");
    assert!(error.contains("periods.current_us"), "{error}");
}
