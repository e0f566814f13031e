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

/// A folder for one test, gone when the test is over.
struct Folder(std::path::PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("virtual_axes_{name}_{}", std::process::id()));
        std::fs::create_dir_all(&path).expect("a folder can be made");
        Folder(path)
    }

    fn file(&self, name: &str, text: &str) -> String {
        let path = self.0.join(name);
        std::fs::write(&path, text).expect("a file can be written");
        path.to_string_lossy().into_owned()
    }

    fn names(&self) -> Vec<String> {
        let entries = std::fs::read_dir(&self.0).expect("readable");
        let mut names: Vec<String> =
            entries.map(|e| e.expect("readable").file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

#[track_caller]
fn assert_refused(output: &Output, words: &[&str]) {
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert!(output.stdout.is_empty());
    assert_eq!(message.lines().count(), 1, "{message}");
    for word in words {
        assert!(message.contains(word), "{word} is missing in: {message}");
    }
}

#[test]
fn set_points_are_run_and_traced() {
    let folder = Folder::new("run");
    let psec = folder.file("psec.csv", "time,x\n0,0\n0.6,0.01\n");
    let trace = folder.0.join("trace.csv").to_string_lossy().into_owned();
    let output = run(&["run", &psec, "--trace", &trace]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(folder.names(), ["psec.csv", "trace.csv"]);
    let text = std::fs::read_to_string(&trace).expect("readable");
    assert!(text.starts_with("time,x.psec,x.position,x.velocity,x.current,"), "{text:.80}");
    assert!(text.lines().nth(101).expect("a row per position period").starts_with("0.6,0.01,"));
}

#[test]
fn bad_set_points_are_refused_with_file_and_line() {
    let folder = Folder::new("refused");
    for (name, text, words) in [
        ("nan.csv", "time,x\n0,0\n0.006,NaN\n", &["nan.csv:3", "x", "NaN"][..]),
        ("far.csv", "time,x\n0,0\n1,2.5\n", &["far.csv", "x", "2.5", "0.355"]),
        ("eternal.csv", "time,x\n0,0\n1e300,0\n", &["eternal.csv:3", "time"]),
        ("joint.csv", "time,q\n0,0\n", &["joint.csv", "q"]),
    ] {
        let psec = folder.file(name, text);
        let trace = folder.0.join("trace.csv").to_string_lossy().into_owned();
        assert_refused(&run(&["run", &psec, "--trace", &trace]), words);
        std::fs::remove_file(psec).expect("can be removed");
        assert!(folder.names().is_empty(), "{name} leaves {:?}", folder.names());
    }
}

#[test]
fn a_trace_never_replaces_its_own_set_points_nor_other_files() {
    let folder = Folder::new("replaced");
    let text = "time,x\n0,0\n0.06,0.001\n";
    let psec = folder.file("psec.csv", text);
    let other = folder.file("trace.partial", "keep");
    assert_refused(&run(&["run", &psec, "--trace", &psec]), &["psec.csv", "replace"]);
    let trace = folder.0.join("trace.csv").to_string_lossy().into_owned();
    assert!(run(&["run", &psec, "--trace", &trace]).status.success());
    assert_eq!(std::fs::read_to_string(psec).expect("readable"), text);
    assert_eq!(std::fs::read_to_string(other).expect("readable"), "keep");
}

#[test]
fn a_full_disk_is_said() {
    let folder = Folder::new("full");
    let psec = folder.file("psec.csv", "time,x\n0,0\n0.06,0.001\n");
    assert_refused(&run(&["run", &psec, "--trace", "/dev/full"]), &["/dev/full"]);
}
