//! Errors of the command `virtual_axes` that name the probable cause or the remedy.

use virtual_axes_verification::fixtures::folder::TestFolder;

use crate::command_common::{assert_rejected, printed, run};

/// Checks that `virtual_axes check` rejects a file with these words.
#[track_caller]
fn assert_file_rejected(name: &str, content: &str, words: &[&str]) {
    let folder = TestFolder::new(&format!("hints_{name}"));
    let file = folder.file(name, content);
    assert_rejected(&["check", file.to_str().expect("UTF-8")], words);
}

#[test]
fn limits_are_given_in_the_units_and_with_the_keys_of_a_machine_file() {
    // `check` reports such setpoints in its limit audit.
    let assert_run_rejected = |name: &str, content: &str, words: &[&str]| {
        let folder = TestFolder::new(&format!("hints_{name}"));
        assert_rejected(&["run", folder.file(name, content).to_str().expect("UTF-8")], words);
    };
    let speed = "x, point 1: speed 3 m/s (180 m/min) exceeds limits.velocity_m_min, 0.5 m/s (30 m/min)";
    assert_run_rejected("speed.csv", "time,x\n0,0\n0.1,0.3\n", &[speed]);
    let travel =
        "position 2.5 m (2500 mm) is outside the travel limits, -0.355 m (-355 mm) to 0.355 m (355 mm)";
    assert_run_rejected("travel.csv", "time,x\n0,0\n10,2.5\n", &[travel]);
}

#[test]
fn the_largest_speed_of_a_move_is_reported() {
    let words =
        ["x reaches 10 m/s (600 m/min); limits.velocity_m_min is 0.5 m/s (30 m/min); reduce the feed"];
    assert_rejected(&["run", "ballbar", "--feed", "600"], &words.map(|text| text.trim_start_matches("x ")));
}

#[test]
fn headers_and_separators_of_setpoints_are_explained() {
    let units = "the header has no units: the time is in s, positions are in m or rad";
    assert_file_rejected("units.csv", "time [s],x [m]\n0,0\n", &[units]);
    assert_file_rejected("unit.csv", "time,x [m]\n0,0\n", &["no joint \"x [m]\"", units]);
    assert_file_rejected("upper.csv", "Time,X\n0,0\n", &["names are in lower case, as in `time,x`"]);
    assert_file_rejected("joint.csv", "time,X\n0,0\n", &["no joint \"X\"", "; the nearest is x"]);
    let semicolons =
        "1 values, the header names 2 columns; columns must be separated by commas, not by semicolons";
    assert_file_rejected("semicolons.csv", "time,x\n0;0\n", &[semicolons]);
    let decimals = "4 values, the header names 2 columns; decimals must be separated by a point";
    assert_file_rejected("decimals.csv", "time,x\n0,0,0,0\n", &[decimals]);
}

#[test]
fn commas_in_assignments_are_explained() {
    let rejected = |set: &str, word: &str| assert_rejected(&["run", "ballbar", "--set", set], &[word]);
    rejected(
        "x.position_loop.gain=1,y.position_loop.gain=2",
        "expected number; repeat --set for each parameter",
    );
    rejected("x.motor.max_current_a=16,0", "expected number; the decimal separator is a point");
    assert_rejected(
        &["run", "ballbar", "--compare", "x.position_loop.gain=4,5"],
        &["found 5; the decimal separator is a point"],
    );
}

#[test]
fn an_unknown_option_is_not_suggested_as_a_value() {
    for arguments in [["psec", "ballbar", "--axis", "x"], ["robustness", "ballbar", "--deviation", "0.1"]] {
        let output = run(&arguments);
        let message = String::from_utf8_lossy(&output.stderr);
        assert!(message.contains("unexpected argument '--") && !message.contains("tip"), "{message}");
    }
}

#[test]
fn a_syntax_error_of_yaml_has_no_list_of_formats() {
    let folder = TestFolder::new("syntax_error");
    let file = folder.file("a.yaml", "moves:\n- {x: 1}\nmoves: 2\n");
    let output = run(&["check", file.to_str().expect("UTF-8")]);
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(message.ends_with("a.yaml:3: invalid YAML: duplicate key moves\n"), "{message}");
}

#[test]
fn a_file_that_differs_in_its_extension_is_the_nearest() {
    let folder = TestFolder::new("nearest_stem");
    let path = |name: &str| folder.path(name);
    folder.file("s.csv", "");
    folder.file("slot.yaml", "");
    for command in ["run", "check"] {
        assert_rejected(&[command, &path("slot")], &[&format!("; the nearest is {}", path("slot.yaml"))]);
        let missing = String::from_utf8(run(&[command, &path("missing.csv")]).stderr).expect("UTF-8");
        assert!(!missing.contains("ballbar"), "{missing}");
    }
}

#[test]
fn a_report_has_the_extension_of_a_page_or_is_a_stream() {
    let folder = TestFolder::new("report_name");
    let page = folder.0.join("report");
    let page = page.to_str().expect("UTF-8");
    assert_rejected(&["run", "x-constant", "--report", page], &["its extension must be .html or .htm"]);
    assert!(printed(&["run", "x-constant", "--quiet", "--report", "/dev/stdout"]).contains("</html>"));
}

#[test]
fn an_arc_with_one_coordinate_of_its_center_is_rejected() {
    let scenario = "description: d\nfeed_m_min: 1\nmoves:\n  - arc: {center: {x_mm: 1}, turns: 1}\n";
    assert_file_rejected(
        "center.yaml",
        scenario,
        &["center.yaml:4: center must have two coordinates, found 1"],
    );
}

#[test]
fn a_file_of_no_known_kind_names_the_extensions_of_part_programs() {
    let words = ["the first line is \"some notes\"", "part programs have the extension nc, ngc, tap, "];
    assert_file_rejected("notes.txt", "some notes\nabout the part\n", &words);
}
