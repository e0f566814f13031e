//! Set-up for part programs in the machine file, and the options in its place.

use std::fs;

use virtual_axes_verification::fixtures::folder::TestFolder;

use crate::command_common::{assert_rejected, json, run};

/// Returns the path of the vertical mill with parameters for part programs.
fn mill(folder: &TestFolder, parameters: &str) -> String {
    let head = "    machine: Vertical mill (representative)\n";
    let text = include_str!("../../config/vmc.yaml");
    assert!(text.contains(head));
    let text = text.replacen(head, &format!("{head}    part_program:\n{parameters}"), 1);
    folder.file("mill.yaml", &text).to_str().expect("UTF-8").to_owned()
}

/// Returns X, Y and Z at the end of a program, mm, and the notes of the command.
fn end(folder: &TestFolder, machine: &str, program: &str, options: &[&str]) -> ([f64; 3], String) {
    let program = folder.file("part.nc", program);
    let out = folder.file("out.csv", "");
    let (program, out) = (program.to_str().expect("UTF-8"), out.to_str().expect("UTF-8"));
    let output = run(&[&["psec", program, "--machine", machine, "--out", out], options].concat());
    let notes = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{notes}");
    let text = fs::read_to_string(out).expect("setpoints");
    let last = text.lines().last().expect("a row").split(',').skip(1);
    let last: Vec<f64> = last.map(|value| value.parse::<f64>().expect("a number") * 1e3).collect();
    ([last[0], last[1], last[2]], notes)
}

#[track_caller]
fn assert_at(found: [f64; 3], expected: [f64; 3]) {
    let is_near = found.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 1e-9);
    assert!(is_near, "{found:?}, not {expected:?}");
}

#[test]
fn work_offsets_and_tools_of_the_machine_file_shift_the_part_by_their_values() {
    let folder = TestFolder::new("program_setup_offsets");
    folder.file("shop.csv", "number,length_mm,radius_mm\n1,50,5\n2,75.5,3\n");
    let setup = "      work_offsets: [\"G54=-400,-250,-420\", \"G55=-300,-200,-410\"]\n\
                 \x20     tool_table: shop.csv\n      tools: [\"T2 Z80 D6 ; drill\"]\n";
    let machine = mill(&folder, setup);
    let end = |program: &str, options: &[&str]| end(&folder, &machine, program, options);
    // The axis position is the sum of offset, tool length and coordinate.
    let (found, notes) = end("G54 G43 H1 G0 X10 Y20 Z30\nM2\n", &[]);
    assert_at(found, [-390.0, -230.0, -340.0]);
    assert_eq!(notes, "", "everything is given");
    assert_at(end("G55 G43 H2 G0 X10 Y20 Z30\nM2\n", &[]).0, [-290.0, -180.0, -300.0]);
    // An option replaces one offset, or the table.
    let program = "G55 G43 H1 G0 X10 Y20 Z30\nM2\n";
    assert_at(end(program, &["--work-offset", "G54=-1,-1,-1"]).0, [-290.0, -180.0, -330.0]);
    assert_at(end(program, &["--work-offset", "G55=-350,-250,-415"]).0, [-340.0, -230.0, -335.0]);
    let tools = folder.file("other.tbl", "T1 P1 Z60.25 D4\n");
    let (found, _) = end(program, &["--tools", tools.to_str().expect("UTF-8")]);
    assert_at(found, [-290.0, -180.0, -319.75]);
    // What the program assumes is noted.
    let notes = end("G56 G43 H3 G0 X10 Y20 Z30\nM2\n", &[]).1;
    for part in
        ["work offset G56 is not given: the workpiece frame", "tool 3 is not in the tool table: length 0"]
    {
        assert!(notes.contains(part), "{part:?} in {notes}");
    }
}

#[test]
fn tool_changes_and_spindle_add_their_times() {
    let folder = TestFolder::new("program_setup_times");
    let machine = mill(&folder, "      tool_change_s: 4.5\n      spindle_s: 1.25\n");
    let program = folder.file("part.nc", "T1 M6\nM3 S1000\nG1 X-10 F1000\nM5\nT2 M6\nX-20\nM2\n");
    let program = program.to_str().expect("UTF-8");
    let time = |options: &[&str]| {
        let output = json(&[&["run", program, "--machine", &machine, "--json"], options].concat());
        output["runs"][0]["part_program"]["cycle_time_s"].as_f64().expect("a time")
    };
    let none = time(&["--tool-change-s", "0", "--spindle-s", "0"]);
    // Two tool changes, and two changes of the spindle speed.
    for (options, expected) in [
        (vec![], 2.0 * 4.5 + 2.0 * 1.25),
        (vec!["--tool-change-s", "3"], 2.0 * 3.0 + 2.0 * 1.25),
        (vec!["--spindle-s", "0"], 2.0 * 4.5),
    ] {
        let found = time(&options) - none;
        assert!((found - expected).abs() < 1e-9, "{options:?}: {found}, not {expected}");
    }
}

#[test]
fn the_dialect_of_the_machine_file_is_taken_without_an_option() {
    let folder = TestFolder::new("program_setup_dialect");
    let machine = mill(&folder, "      dialect: fanuc\n");
    let program = folder.file("part.nc", "G54 G1 X1 F1000\nG4 P500\nX2\nM30\n");
    let program = program.to_str().expect("UTF-8");
    let dwell = |options: &[&str]| {
        let time = |program: &str| {
            let output = run(&[&["run", program, "--machine", &machine, "--json"], options].concat());
            let json: serde_json::Value = serde_json::from_slice(&output.stdout).expect("a run");
            json["runs"][0]["part_program"]["cycle_time_s"].as_f64().expect("a time")
        };
        let without = folder.file("without.nc", "G54 G61 G1 X1 F1000\nX2\nM30\n");
        time(program) - time(without.to_str().expect("UTF-8"))
    };
    assert!((dwell(&[]) - 0.5).abs() < 0.01, "milliseconds");
    assert!((dwell(&["--dialect", "linuxcnc"]) - 500.0).abs() < 0.01, "seconds");
}

#[test]
fn invalid_setups_name_the_parameter_and_the_remedy() {
    let folder = TestFolder::new("program_setup_invalid");
    let program = folder.file("part.nc", "G0 X-1\nM2\n");
    let program = program.to_str().expect("UTF-8");
    for (setup, part) in [
        ("dialect: heidenhain", "part_program.dialect = heidenhain: must be linuxcnc or fanuc or haas"),
        ("tool_change_s: -1.0", "part_program.tool_change_s = -1: must lie in 0 … 3600 s"),
        (
            "work_offsets: [\"G54=1,2\"]",
            "part_program.work_offsets: G54=1,2: must be a work coordinate system",
        ),
        ("tools: [\"Z50\"]", "part_program.tools: line 1: Z50: neither a tool of LinuxCNC"),
        ("tool_table: nowhere.tbl", "nowhere.tbl: No such file"),
    ] {
        let machine = mill(&folder, &format!("      {setup}\n"));
        for command in ["run", "check"] {
            assert_rejected(&[command, program, "--machine", &machine], &[part]);
        }
    }
}

#[test]
fn an_axis_that_the_machine_lacks_names_a_template_with_it() {
    let folder = TestFolder::new("program_setup_axis");
    let check = |program: &str, machine: &str| {
        let program = folder.file("part.nc", program);
        let output = run(&["check", program.to_str().expect("UTF-8"), "--machine", machine]);
        assert!(!output.status.success());
        String::from_utf8_lossy(&output.stderr).split_whitespace().collect::<Vec<_>>().join(" ")
    };
    let text = check("G21 G0 A90\nM2\n", "vmc");
    assert!(text.contains("the machine has no axis A"), "{text}");
    assert!(text.ends_with("virtual_axes machines --new vmc_a > mine.yaml"), "{text}");
    let text = check("G21 G0 A10 C90\nM2\n", "vmc");
    assert!(text.ends_with("virtual_axes machines --new mikron_ucp710 > mine.yaml"), "{text}");
    // No built-in machine has U.
    let text = check("G21 G0 U10\nM2\n", "vmc");
    assert!(text.contains("no axis U") && !text.contains("--new"), "{text}");
}
