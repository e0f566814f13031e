//! Names of files and values that a terminal or a log cannot show, and outputs that cannot be written.

use std::ffi::OsStr;
use std::fs::File;
use std::os::unix::ffi::OsStrExt;
use std::path::Path;
use std::process::{Command, Output};

use virtual_axes_verification::fixtures::folder::TestFolder;

use crate::command_common::assert_rejected;

fn run(arguments: &[&OsStr]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_virtual_axes")).args(arguments).output().expect("the command starts")
}

#[track_caller]
fn error(arguments: &[&OsStr]) -> String {
    let output = run(arguments);
    assert_eq!(output.status.code(), Some(2));
    String::from_utf8(output.stderr).expect("UTF-8")
}

#[test]
fn outputs_to_a_full_device_are_errors() {
    for arguments in
        [&["--help"][..], &["--version"], &["run", "--help"], &["machines"], &["completions", "bash"]]
    {
        let full = File::options().write(true).open("/dev/full").expect("a device");
        let mut command = Command::new(env!("CARGO_BIN_EXE_virtual_axes"));
        let output = command.args(arguments).stdout(full).output().expect("the command starts");
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?} {message}");
        assert!(message.starts_with("standard output: No space left on device"), "{message}");
    }
}

#[test]
fn names_of_files_are_escaped_and_shortened() {
    let folder = TestFolder::new("hostile_names");
    let file = folder.file("two\nlines\u{1b}[31m.csv", "time,y\n0,1e9\n");
    for command in ["run", "tune", "learn"] {
        let message = error(&[OsStr::new(command), file.as_os_str()]);
        assert!(message.contains("two\\nlines\\u{1b}[31m.csv"), "{message}");
        assert_eq!(message.lines().count(), 1, "{message}");
    }
    for (command, status) in [("check", 1), ("identify", 0)] {
        let output = run(&[OsStr::new(command), file.as_os_str()]);
        assert_eq!(output.status.code(), Some(status));
        let text = String::from_utf8([output.stdout, output.stderr].concat()).expect("UTF-8");
        assert!(text.contains("two\\nlines\\u{1b}[31m.csv") && !text.contains('\u{1b}'), "{text}");
    }
    let missing = "no\nfile".to_owned() + &"a".repeat(100_000) + "z";
    for arguments in [vec!["run", &missing], vec!["check", &missing], vec!["design", &missing]] {
        let arguments: Vec<&OsStr> = arguments.into_iter().map(OsStr::new).collect();
        let message = error(&arguments);
        assert!(
            message.contains("no\\nfileaaa") && message.contains("…") && message.contains("aaaz"),
            "{message}"
        );
        assert!(message.len() < 1500, "{message}");
    }
    // The value of an option.
    let message = error(&[OsStr::new("run"), OsStr::new("ballbar"), OsStr::new("--machine=a\nb.yaml")]);
    assert!(message.contains("a\\nb.yaml") && message.lines().count() == 1, "{message}");
}

#[test]
fn names_that_are_not_utf_8_are_named() {
    let folder = TestFolder::new("hostile_bytes");
    let name = OsStr::from_bytes(b"part\xff.csv");
    let file = folder.0.join(Path::new(name));
    std::fs::write(&file, "time,x\n0,0\n0.006,0.0001\n").expect("written");
    let message = error(&[OsStr::new("run"), file.as_os_str()]);
    assert!(message.contains("part\\xFF.csv\" is not UTF-8; rename the file"), "{message}");
    // A page names the command that wrote it.
    let page = folder.0.join(Path::new(OsStr::from_bytes(b"page\xff.html")));
    let output = run(&["run", "x-constant", "--quiet", "--report"]
        .map(OsStr::new)
        .into_iter()
        .chain([page.as_os_str()])
        .collect::<Vec<_>>());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(page.exists());
}

#[test]
fn a_file_that_cannot_be_read_is_not_the_nearest_of_its_name() {
    let folder = TestFolder::new("hostile_folder");
    let scenario = folder.0.join("motion.yaml");
    std::fs::create_dir(&scenario).expect("a folder");
    let name = scenario.to_str().expect("UTF-8");
    let message = String::from_utf8(run(&[OsStr::new("run"), OsStr::new(name)]).stderr).expect("UTF-8");
    assert!(message.contains("Is a directory") && !message.contains("nearest"), "{message}");
    let file = folder.file("two\nlines.yaml", "").to_string_lossy().into_owned();
    let message = error(&["scenarios", "--show", &file].map(OsStr::new));
    assert!(message.contains("unknown scenario") && !message.contains("nearest"), "{message}");
}

#[test]
fn values_that_are_not_numbers_name_what_is_required() {
    for (arguments, required) in [
        (["run", "ballbar", "--feed=fast"], "must be a number, for example 2.5"),
        (["run", "ballbar", "--feed="], "must be a number, for example 2.5"),
        (["learn", "ballbar", "--iterations=-1"], "must be a whole number of at least 0"),
    ] {
        assert_rejected(&arguments, &["invalid value", required]);
    }
}

#[test]
fn feeds_and_limits_beyond_any_machine_are_rejected() {
    assert_rejected(&["run", "ballbar", "--feed", "1e300"], &["--feed", "1e300", "at most 1e6"]);
    let folder = TestFolder::new("hostile_feed");
    let limits = "description: d\nfeed_m_min: 1\nlimits: {jerk_m_s3: 1.0e+300}\nmoves:\n- line: {x_mm: 1}\n";
    let file = folder.file("limits.yaml", limits);
    assert_rejected(&["run", &file.to_string_lossy()], &["jerk_m_s3", "1e300", "at most 1e9"]);
}
