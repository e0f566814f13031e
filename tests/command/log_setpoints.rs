//! Logs of a control as setpoints of `run`, `check` and `psec`.

use std::fs;

use virtual_axes_verification::fixtures::folder::TestFolder;

use crate::command_common::{assert_rejected, printed};

/// Period of the log, s.
const PERIOD: f64 = 0.001;
/// Options of a log with the sample number, X and Y.
const COLUMNS: [&str; 6] = ["--column", "x=#2[mm]", "--column", "y=#3[mm]", "--rate-hz", "1000"];

/// Writes a motion as a log of halsampler in mm, and its numbers as CSV in m.
fn log_and_csv(folder: &TestFolder) -> (String, String) {
    let (mut log, mut csv) = (String::new(), "time,x,y\n".to_owned());
    for row in 0..=1200_u32 {
        let time = f64::from(row) * PERIOD;
        let phase = (3.0 * time).min(std::f64::consts::PI);
        let [x, y] =
            [10.0 + 5.0 * (1.0 - phase.cos()), -3.0 * (1.0 - phase.cos())].map(|mm| format!("{mm:.6}"));
        log += &format!("{} {x} {y} \n", row + 17);
        let [x, y] = [x, y].map(|mm| 1e-3 * mm.parse::<f64>().expect("a number"));
        csv += &format!("{},{x},{y}\n", f64::from(row) / 1000.0);
    }
    (folder.text_file("log.txt", &log), folder.text_file("same.csv", &csv))
}

/// Returns the bytes of the trace of a run.
fn trace(folder: &TestFolder, arguments: &[&str]) -> Vec<u8> {
    let file = folder.path("trace.csv");
    printed(&[&["run", "--set", "periods.position_ms=1", "--quiet", "--trace", &file], arguments].concat());
    fs::read(file).expect("a trace")
}

#[test]
fn a_log_of_commands_runs_with_the_bits_of_the_same_setpoints_as_csv() {
    let folder = TestFolder::new("log_setpoints");
    let (log, csv) = log_and_csv(&folder);
    let of_csv = trace(&folder, &[&csv]);
    assert!(of_csv.len() > 100_000, "{} bytes", of_csv.len());
    assert!(of_csv == trace(&folder, &[&[log.as_str()], &COLUMNS[..]].concat()), "other bits");
    // Written by psec for the node and for recordings.
    for kind in ["mcap", "yaml", "csv"] {
        let out = folder.path(&format!("out.{kind}"));
        let psec = ["psec", &log, "--set", "periods.position_ms=1", "--out", &out];
        printed(&[&psec[..], &COLUMNS[..]].concat());
        assert!(of_csv == trace(&folder, &[&out]), "{kind}: other bits");
    }
}

#[test]
fn the_audit_of_a_log_knows_its_decimals() {
    let folder = TestFolder::new("log_audit");
    let (log, _) = log_and_csv(&folder);
    let text = printed(&[&["check", log.as_str()], &COLUMNS[..]].concat());
    assert!(text.ends_with("valid\n") && text.contains("x: start 10.000 mm, end 20.000 mm"), "{text}");
    let scaled = COLUMNS.map(|word| word.replace("x=#2[mm]", "x=#2[100 mm]"));
    let scaled: Vec<&str> = scaled.iter().map(String::as_str).collect();
    assert_rejected(
        &[&["run", log.as_str()], &scaled[..]].concat(),
        &["log.txt: sample 1: x, point 0: ", "1000 mm"],
    );
}

#[test]
fn a_log_without_its_columns_is_rejected() {
    let folder = TestFolder::new("log_columns");
    let (log, csv) = log_and_csv(&folder);
    assert_rejected(&["run", &log], &["name the column of each axis, for example by --column 'x=#2[mm]'"]);
    assert_rejected(&["run", &csv, "--rate-hz", "1000"], &["--rate-hz requires a log of a control"]);
    assert_rejected(&["check", "vmc", "--column", "x=#2"], &["--column requires a log of a control"]);
    assert_rejected(
        &["psec", &log, "--out", &folder.path("o.csv"), "--column", "q=#2"],
        &["\"q\" is no axis"],
    );
}

#[test]
fn the_extension_of_a_part_program_excludes_a_log() {
    let folder = TestFolder::new("log_extension");
    let program = folder.text_file(
        "zref.ngc",
        "o<auto_zref> sub\nG21 G1 X1 F100\no<auto_zref> endsub\no<auto_zref> call\nM2\n",
    );
    assert!(printed(&["check", &program]).starts_with("part program for "));
}
