//! Part programs in `virtual_axes run` and `psec`.

use std::fs;

use virtual_axes_verification::fixtures::folder::TestFolder;

use crate::command_common::{assert_rejected, json, printed, run};

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
fn a_program_that_takes_days_is_rejected_at_once() {
    let folder = TestFolder::new("part_program_days");
    for text in ["G21\nG1 X10 F0.0001\nM2\n", "G21\nG4 P99999999\nG1 X1 F100\nM2\n"] {
        let name = program(&folder, text);
        for command in ["run", "check"] {
            assert_rejected(
                &[command, &name],
                &["part.nc:", "takes longer than 100 h", "check feed and dwell"],
            );
        }
    }
}

#[test]
fn errors_name_file_and_line() {
    let folder = TestFolder::new("part_program_errors");
    let name = program(&folder, "G21 G90\nG1 X10 F1000\nG1 X900\n");
    assert_rejected(&["run", &name], &["part.nc:3: x at 0.9 m", "outside of its travel limits"]);
    let name = program(&folder, "G21 G90\nG1 X10 F1000\nG999\n");
    assert_rejected(&["run", &name], &["part.nc:3:"]);
    assert_rejected(&["run", "ballbar", "--override", "50"], &["--override requires a part program"]);
    assert_rejected(&["run", &name, "--override", "300"], &["300 %: must be 0 to 200 %"]);
}

/// Returns the setpoints of x and y, m, of a program with options.
fn path(folder: &TestFolder, text: &str, options: &[&str]) -> Vec<[f64; 2]> {
    let out = folder.file("path.csv", "");
    let out = out.to_str().expect("UTF-8");
    printed(&[&["psec", program(folder, text).as_str(), "--out", out], options].concat());
    let number = |text: &str| text.parse::<f64>().expect("a number");
    let row = |row: &str| row.split(',').skip(1).map(number).collect::<Vec<_>>();
    let text = fs::read_to_string(out).expect("setpoints");
    text.lines().skip(1).map(row).map(|row| [row[0], row[1]]).collect()
}

#[test]
fn ignored_codes_are_noted_by_each_command() {
    let folder = TestFolder::new("part_program_ignored");
    let name = program(&folder, "M250 P1\nG1 X1 F3000\nM7\nM110 Q2\nX2\nM250\nM2\n");
    let out = folder.file("out.csv", "");
    let out = out.to_str().expect("UTF-8");
    let commands: [&[&str]; 4] = [
        &["run", &name, "--quiet"],
        &["psec", &name, "--out", out],
        &["check", &name],
        &["robustness", &name],
    ];
    for command in commands {
        let command = [command, &["--dialect", "linuxcnc"]].concat();
        assert_rejected(&command, &["part.nc:1: M250 is not supported in the dialect linuxcnc"]);
        let output = run(&[&command, ["--ignore", "M2xx,7"].as_slice()].concat());
        let notes = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success(), "{notes}");
        let expected = [
            format!("note: {name}:1: M250 is ignored, 2 in all\n"),
            format!("note: {name}:3: M7 is ignored, 1 in all\n"),
            format!("note: {name}:4: M110 is ignored, 1 in all\n"),
        ];
        assert_eq!(notes, expected.concat(), "{command:?}");
    }
    assert_rejected(&["run", "ballbar", "--ignore", "7"], &["--ignore requires a part program"]);
    assert_eq!(run(&["run", &name, "--ignore", "X41"]).status.code(), Some(2));
}

#[test]
fn chord_error_and_centripetal_acceleration_have_their_bounds() {
    let folder = TestFolder::new("part_program_chord");
    let circle = "G61 G1 X10 F6000\nG3 I-10 F6000\nM2\n";
    let (radius, period) = (0.01_f64, 0.006);
    let fastest = |options: &[&str]| {
        let path = path(&folder, circle, options);
        let on_circle = |point: &&[f64; 2]| (point[0].hypot(point[1]) - radius).abs() < 1e-9;
        let points: Vec<_> = path.iter().filter(on_circle).collect();
        let steps = points.windows(2).map(|pair| (pair[1][0] - pair[0][0]).hypot(pair[1][1] - pair[0][1]));
        let chord = steps.fold(0.0, f64::max);
        (
            2.0 * radius / period * (0.5 * chord / radius).asin(),
            radius - (radius.powi(2) - 0.25 * chord.powi(2)).sqrt(),
        )
    };
    let (speed, free_error) = fastest(&[]);
    assert!((speed - 0.1).abs() < 1e-4, "{speed}");
    let (_, error) = fastest(&["--chord-error-um", "2"]);
    assert!(error <= 2.001e-6 && error > 1.9e-6 && free_error > 4e-6, "{error} {free_error}");
    let (speed, _) = fastest(&["--centripetal-m-s2", "0.25"]);
    assert!((speed * speed / radius - 0.25).abs() < 0.0025, "{speed}");
    for value in ["0", "-1", "nan", "inf"] {
        let output = run(&["psec", "part.nc", "--out", "x.csv", "--chord-error-um", value]);
        assert_eq!(output.status.code(), Some(2), "{value}");
        assert!(String::from_utf8_lossy(&output.stderr).contains("must be a positive number"));
    }
    assert_rejected(
        &["run", "ballbar", "--chord-error-um", "1"],
        &["--chord-error-um requires a part program"],
    );
}

#[test]
fn words_without_effect_are_noted() {
    let folder = TestFolder::new("part_program_notes");
    let notes = |text: &str| {
        let name = program(&folder, text);
        let output = run(&["check", &name]);
        let text = String::from_utf8_lossy(&output.stderr).replace(&name, "part.nc");
        assert!(output.status.success(), "{text}");
        text
    };
    let stop = "M0 and M1 stop the axes and do not wait\n";
    assert_eq!(notes("G1 X1 F3000\nM0\nX2\nM1\nM2\n"), format!("note: part.nc:2: {stop}"));
    assert_eq!(notes("G1 X1 F3000\nM1\nX2\nM2\n"), format!("note: part.nc:2: {stop}"));
    let merging = "G64 Q has no effect: short lines are joined within P\n";
    assert_eq!(notes("G64 P0.01 Q0.02\nG1 X1 F3000\nX2\nM2\n"), format!("note: part.nc:2: {merging}"));
    assert_eq!(notes("G64 P0.01\nG1 X1 F3000\nX2\nM2\n"), "");
}

#[test]
fn the_page_has_the_worst_line_and_the_feed_along_the_path() {
    let folder = TestFolder::new("part_program_page");
    // A corner without tolerance at line 3, with a text that a page must escape, in an otherwise smooth path.
    let text = "G61.1 F3000\nG64 P0.05 G1 X20\nX30 (a < b & \"c\")\nG1 X31 Y10\nG61 X10 Y10.5\nM2\n";
    let name = program(&folder, text);
    let page = folder.0.join("page.html");
    let result = json(&["run", &name, "--json", "--report", page.to_str().expect("UTF-8")]);
    let worst = &result["runs"][0]["part_program"]["worst_lines"];
    let page = fs::read_to_string(page).expect("a page");
    for part in ["Cycle time", "Lines with the largest contour errors", "Path of the tool", "Feed (m/min)"] {
        assert!(page.contains(part), "{part}");
    }
    for line in worst.as_array().expect("lines") {
        let text = line["text"].as_str().expect("a text").replace('&', "&amp;").replace('<', "&lt;");
        let (number, cause) =
            (line["line"].as_u64().expect("a line"), line["cause"].as_str().expect("a cause"));
        let error = line["contour_error_um"].as_f64().expect("an error");
        let row = page.split("<tr>").find(|row| row.contains(&format!(">{number}<")) && row.contains(cause));
        let row = row.unwrap_or_else(|| panic!("no row of line {number}"));
        assert!(row.contains(&text.replace('"', "&quot;")) || row.contains(&text), "{text}: {row}");
        assert!(row.contains(&format!("{error:.2}")), "{row}");
    }
    // The path has each line with its text.
    assert!(page.contains("\"2\":\"G64 P0.05 G1 X20\""));
    // The page grows less than the program.
    let longer: String = (0..10).map(|_| "G61 X20 Y0\nX30\nX31 Y10\nX10 Y10.5\n").collect();
    let name = program(&folder, &format!("G1 F3000\n{longer}M2\n"));
    let long_page = folder.0.join("long.html");
    json(&["run", &name, "--json", "--report", long_page.to_str().expect("UTF-8")]);
    let size = fs::metadata(long_page).expect("a page").len();
    assert!(size < 4 * page.len() as u64, "{size} {}", page.len());
}

#[test]
fn the_page_has_the_notes_of_the_program() {
    let folder = TestFolder::new("part_program_page_notes");
    let name = program(&folder, "G1 X1 F3000\nM1\nX2\nM2\n");
    let page = folder.0.join("page.html");
    let output = run(&["run", &name, "--report", page.to_str().expect("UTF-8")]);
    assert!(output.status.success(), "{output:?}");
    let page = fs::read_to_string(page).expect("a page");
    assert!(page.contains("line 2: M0 and M1 stop the axes and do not wait"));
}

#[test]
fn orientation_errors_of_lines_are_those_of_the_run() {
    let folder = TestFolder::new("part_program_orientation");
    let name = program(&folder, "G43.4 H1 G64 P0.05\nG1 X20 A5 F3000\nX40 A15 C30\nX60 A5 C90\nG49\nM2\n");
    let result = json(&["run", &name, "--json"]);
    let run = &result["runs"][0];
    let whole = run["orientation_error_mdeg"]["max"].as_f64().expect("an orientation error");
    let lines = run["part_program"]["worst_lines"].as_array().expect("lines");
    let of_lines = lines.iter().map(|line| line["orientation_error_mdeg"].as_f64().expect("an error"));
    let largest = of_lines.fold(0.0, f64::max);
    // Lines are evaluated at position cycles, the run at all ticks.
    assert!(largest <= whole * 1.001 && largest > 0.9 * whole, "{largest} {whole}");
    assert!(printed(&["run", &name]).contains("error, mdeg"));
    let name = program(&folder, "G1 X20 F3000\nM2\n");
    assert!(!printed(&["run", &name]).contains("error, mdeg"));
}
