//! Options of the command `virtual_axes identify` that contradict each other or have no effect.

use std::fmt::Write;

use crate::command_common::{assert_rejected, run};
use virtual_axes_verification::fixtures::folder::TestFolder;

/// Returns a recording of X and Y at 1 ms, both at rest but for X, which moves by 10 mm and back.
fn two_axes() -> String {
    let mut text = "time,x.psec,x.position,y.psec,y.position\n".to_owned();
    for k in 0..2000 {
        let x = 0.005 * (1.0 - (std::f64::consts::TAU * f64::from(k) / 2000.0).cos());
        writeln!(text, "{:.3},{x},{x},0,0", 0.001 * f64::from(k)).expect("a text");
    }
    text
}

#[test]
fn the_signals_of_one_axis_are_rejected_for_all_axes() {
    let folder = TestFolder::new("identify_all_signals");
    let file = |name: &str, text: &str| folder.file(name, text).to_string_lossy().into_owned();
    let recording = file("two.csv", &two_axes());
    let map = file("map.yaml", "position: x.position\n");
    let all = ["identify", &recording, "--axis", "all"];
    let rejected = |more: &[&str], option: &str| {
        let expected =
            format!("--axis all: {option} names the signals of one axis; give the name of that axis");
        assert_rejected(&[all.as_slice(), more].concat(), &[&expected]);
    };
    rejected(&["--joint", "x"], "--joint x");
    rejected(&["--column", "position=x.position[m]"], "--column position=x.position[m]");
    rejected(&["--columns", &map], &format!("{map}: position=x.position"));
    // A format and the column of time belong to all axes.
    let output = run(&[all.as_slice(), &["--column", "delimiter=,", "--column", "time=time[s]"]].concat());
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(!message.contains("names the signals of one axis"), "{message}");
}

#[test]
fn options_without_effect_on_the_list_of_columns_are_rejected() {
    let folder = TestFolder::new("identify_list");
    let recording = folder.file("two.csv", two_axes()).to_string_lossy().into_owned();
    let rejected = |more: &[&str], options: &str| {
        let expected = format!("{options}: no effect without --axis");
        assert_rejected(&[&["identify", recording.as_str()], more].concat(), &[&expected]);
    };
    rejected(&["--json", "--out", "new.yaml"], "--json, --out");
    rejected(&["--csv"], "--csv");
    rejected(&["--quiet", "--report", "page.html"], "--quiet, --report");
    rejected(&["--feedforward", "off", "--no-refine"], "--feedforward, --no-refine");
    rejected(&["--validate", &recording, "--presliding", "--free-i0"], "--free-i0, --presliding, --validate");
    rejected(&["--refine", "inertia"], "--refine");
    assert!(run(&["identify", &recording]).status.success());
}
