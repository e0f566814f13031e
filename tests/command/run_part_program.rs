//! Part programs in `virtual_axes run` and `psec`.

use std::fs;

use virtual_axes_verification::fixtures::folder::TestFolder;

use crate::command_common::{assert_rejected, json, printed};

/// Writes a program and returns its path.
fn program(folder: &TestFolder, text: &str) -> String {
    folder.file("part.nc", text).to_str().expect("UTF-8").to_owned()
}

#[test]
fn the_line_with_a_planted_corner_is_the_worst() {
    let folder = TestFolder::new("part_program_corner");
    // A rounded square with one sharp corner, at the end of line 5.
    let text = "G21 G90 G54 G64 P0.05\nG1 X20 Y0 F3000\nG3 X30 Y10 I0 J10\nG1 Y30\nX10\nY20\nM2\n";
    let result = json(&["run", &program(&folder, text), "--json"]);
    let part_program = &result["runs"][0]["part_program"];
    let worst = part_program["worst_lines"].as_array().expect("lines");
    // The overshoot at the end of the program has its own cause.
    let worst = worst.iter().find(|line| line["cause"] != "stop").expect("a line");
    let line = worst["line"].as_u64().expect("a line");
    assert!((4..=6).contains(&line), "{worst}");
    assert_eq!(worst["cause"], "corner");
    let contour = result["runs"][0]["contour_error_um"]["max_within_ends"].as_f64().expect("contour error");
    let error = worst["contour_error_um"].as_f64().expect("error of the line");
    // Lines are evaluated at position cycles, the contour error at all ticks.
    assert!(error <= contour * 1.001 && error >= 0.8 * contour, "{error} {contour}");
    let (cycle, programmed) = (&part_program["cycle_time_s"], &part_program["programmed_time_s"]);
    assert!(cycle.as_f64() > programmed.as_f64());
    // 20 + 20 + 20 + 10 mm and a quarter of a circle with radius 10 mm at 3 m/min.
    let expected = (0.070 + 0.005 * std::f64::consts::PI) / 0.05;
    assert!((programmed.as_f64().expect("a time") - expected).abs() < 1e-9);
}

#[test]
fn an_override_of_half_doubles_the_time() {
    let folder = TestFolder::new("part_program_override");
    let name = program(&folder, "G21 G90 G61.1\nG1 X30 F3000\nY10\nM2\n");
    let rows = |options: &[&str]| {
        let out = folder.file("out.csv", "");
        let out = out.to_str().expect("UTF-8");
        printed(&[&["psec", name.as_str(), "--out", out], options].concat());
        fs::read_to_string(out).expect("setpoints").lines().count() - 1
    };
    let (full, half) = (rows(&[]), rows(&["--override", "50"]));
    assert!(half.abs_diff(2 * full) <= 2, "{full} {half}");
    let held = rows(&["--override", "0:100,0.2:0,1.2:100"]);
    assert!(held > full + 150, "a second at rest: {full} {held}");
}

#[test]
fn errors_name_file_and_line() {
    let folder = TestFolder::new("part_program_errors");
    let name = program(&folder, "G21 G90\nG1 X10 F1000\nG1 X900\n");
    assert_rejected(&["run", &name], &["part.nc: line 3: x is at", "outside the travel limits"]);
    let name = program(&folder, "G21 G90\nG1 X10 F1000\nG999\n");
    assert_rejected(&["run", &name], &["part.nc:3:"]);
    assert_rejected(&["run", "ballbar", "--override", "50"], &["--override requires a part program"]);
    assert_rejected(&["run", &name, "--override", "300"], &["300 %: must be 0 to 200 %"]);
}
