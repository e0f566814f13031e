//! The command `virtual_axes compile`, and `run --reference` on its output.

use serde_json::Value;
use virtual_axes_verification::fixtures::folder::TestFolder;

use crate::command_common::{assert_rejected, json, printed, run};

/// Square with a rest before the first cut.
const SQUARE: &str = "G21 G90 G17 G94 G64 P0.01
G0 X-30 Y-30
G0 Z0
G4 P0.5
N10 G1 Z-1 F600 (plunge)
G1 F3000 X-60
Y-60
X-30
Y-30
G1 Z0 F600
M2
";
/// Plants that are not among those of the search: factors of X, Y and Z.
const PLANTS: [[f64; 9]; 3] = [
    [1.27, 0.78, 1.23, 0.74, 1.21, 0.79, 1.25, 0.75, 0.8],
    [0.76, 1.24, 0.79, 1.28, 0.73, 1.22, 0.8, 1.2, 1.3],
    [1.22, 1.29, 0.77, 0.78, 0.71, 1.2, 0.72, 1.26, 0.79],
];

fn max(run: &Value) -> f64 {
    let cuts = &run["runs"][0]["part_program"]["contour_error_um"]["cuts"];
    cuts["max"].as_f64().expect("a number")
}

fn figure(report: &Value, when: &str, key: &str) -> f64 {
    report[when]["contour_error_um"][key].as_f64().expect("a number")
}

fn lines(text: &str, start: &str) -> Vec<String> {
    text.lines().filter(|line| line.starts_with(start)).map(str::to_owned).collect()
}

/// The axes, not the feed of 3 m/min, limit the speed of the contour; its rotary words have five decimals.
#[test]
fn a_contour_with_rotary_axes_has_few_extra_points_and_half_the_error() {
    let folder = TestFolder::new("compile_five_axes");
    let contour = (1..9).map(|k| {
        let angle = f64::from(k) / 4.0;
        let [x, y, z] = [f64::from(2 * k) - 16.0, 12.0 * angle.sin(), 1.5 * angle.cos() - 2.5];
        format!("G1 X{x} Y{y:.4} Z{z:.4} A{:.5} C{:.5}\n", 14.0 * angle.sin(), 3.3 * f64::from(k))
    });
    let contour: String = contour.collect();
    let head = "G21 G90 G17 G94 G64 P0.01\nG43.4\nG0 X-16 Y0 A0 C0\nG0 Z0\nG4 P0.5\nG1 Z-1 F600\nF3000\n";
    let part = folder.file("part.nc", format!("{head}{contour}G1 Z0 F600\nG49\nM2\n"));
    let (part, out) = (part.to_string_lossy().into_owned(), folder.path("better.nc"));
    let mut arguments = vec!["compile", &part, "--same-time", "--more-time", "3", "--out", &out, "--json"];
    for set in ["periods.position_ms=1", "control.profile=linuxcnc", "control.path_velocity_m_min=30"] {
        arguments.extend(["--set", set]);
    }
    let report = json(&arguments);
    let [before, after] = ["before", "after"].map(|when| figure(&report, when, "all_plants"));
    assert!(after <= 0.5 * before, "{before} to {after} µm");
    let text = std::fs::read_to_string(&out).expect("the program");
    // G0 with A and C, and the contour: one line is divided, where Y nearly stands and A reverses.
    assert_eq!(text.lines().filter(|line| line.contains('A')).count(), 10, "{text}");
    // Every line at feed can be changed.
    assert_eq!(report["lines_left"], serde_json::json!({}), "{report}");
}

#[test]
fn a_compiled_program_has_the_stated_errors_and_half_of_them_on_other_plants() {
    let folder = TestFolder::new("compile_square");
    let part = folder.file("part.nc", SQUARE).to_string_lossy().into_owned();
    let out = folder.path("better.nc");
    let report = json(&["compile", &part, "--same-time", "--more-time", "3", "--out", &out, "--json"]);
    assert_eq!(report["is_changed"], true);
    let times = ["before", "after"].map(|when| report[when]["cycle_time_s"].as_f64().expect("a time"));
    assert!(times[1] <= 1.03 * 1.002 * times[0], "{times:?}");
    // The figures of the report are those of runs of both programs.
    for (program, when) in [(&part, "before"), (&out, "after")] {
        let run = json(&["run", program, "--reference", &part, "--json"]);
        assert_eq!(max(&run), figure(&report, when, "nominal"), "{when}");
        assert_eq!(run["runs"][0]["part_program"]["cycle_time_s"], report[when]["cycle_time_s"]);
    }
    assert!(figure(&report, "after", "all_plants") <= 0.5 * figure(&report, "before", "all_plants"));
    let factors = ["x", "y", "z"].iter().flat_map(|axis| {
        ["inertia", "friction", "torque_constant"].map(|name| format!("{axis}.deviation.{name}"))
    });
    let factors: Vec<String> = factors.collect();
    for plant in PLANTS {
        let sets: Vec<String> =
            factors.iter().zip(plant).map(|(key, value)| format!("{key}={value}")).collect();
        let on = |program: &str| {
            let mut arguments = vec!["run", program, "--reference", &part, "--json"];
            sets.iter().for_each(|set| arguments.extend(["--set", set]));
            max(&json(&arguments))
        };
        let [before, after] = [on(&part), on(&out)];
        assert!(after <= 0.5 * before, "{plant:?}: {before} to {after} µm");
    }
    // Rapid traverse, dwell, comments and block numbers remain, and feeds are restored.
    let text = std::fs::read_to_string(&out).expect("the program");
    assert_eq!(lines(&text, "G0"), lines(SQUARE, "G0"));
    for kept in ["G4 P0.5", "(plunge)", "N10 G1", "M2"] {
        assert_eq!(text.matches(kept).count(), 1, "{kept}");
    }
    // Equal arguments give equal bytes.
    let again = folder.path("again.nc");
    printed(&["compile", &part, "--same-time", "--more-time", "3", "--out", &again, "--quiet"]);
    assert_eq!(std::fs::read_to_string(&again).expect("the program"), text);
}

#[test]
fn increments_inches_and_arcs_by_radius_keep_their_path() {
    let folder = TestFolder::new("compile_inches");
    let text = "G20 G91 G18 G94 G64 P0.0005
G0 X1. Z1.
G4 P0.5
G1 X1. F120.
G3 X.4 Z-.4 R.4
G1 Z-.5
Z-.5 X-.5
G38.2 X-.1 F20.
G0 X-1. Z0.
M2
";
    let part = folder.file("part.nc", text).to_string_lossy().into_owned();
    let out = folder.path("better.nc");
    let output = run(&["compile", &part, "--same-time", "--more-time", "3", "--out", &out, "--json"]);
    let report: Value = serde_json::from_slice(&output.stdout).expect("one JSON object");
    let notes = String::from_utf8_lossy(&output.stderr);
    assert!(notes.contains("part.nc:1: G20: lengths and feeds are in inches"), "{notes}");
    assert_eq!(report["is_changed"], true, "{report}");
    assert!(figure(&report, "after", "nominal") < figure(&report, "before", "nominal"));
    let better = std::fs::read_to_string(&out).expect("the program");
    for kept in ["G38.2 X-.1 F20.", "G0 X1. Z1.", "G0 X-1. Z0."] {
        assert!(better.lines().any(|line| line == kept), "{kept}\n{better}");
    }
    // Increments of a control that resolves 0.0001 in add up as they are written.
    let decimals =
        better.split(|c: char| !c.is_ascii_digit() && c != '.').filter_map(|number| number.split_once('.'));
    assert!(decimals.into_iter().all(|(_, digits)| digits.len() <= 4), "{better}");
    // Notes on inches and probing are on standard error.
    let output = run(&["run", &out, "--reference", &part, "--json"]);
    let found: Value = serde_json::from_slice(&output.stdout).expect("one JSON object");
    assert_eq!(max(&found), figure(&report, "after", "nominal"));
    let warning = |output: &std::process::Output| {
        String::from_utf8_lossy(&output.stderr).contains("is it the program that this one was compiled from")
    };
    assert!(!warning(&output));
    let other = folder.file("other.nc", SQUARE).to_string_lossy().into_owned();
    assert!(warning(&run(&["run", &out, "--reference", &other, "--json"])));
}

#[test]
fn a_tolerance_is_held_in_less_time_than_the_least_error_or_reported_as_not_held() {
    let folder = TestFolder::new("compile_tolerance");
    let part = folder.file("part.nc", SQUARE).to_string_lossy().into_owned();
    let report = json(&["compile", &part, "--tolerance-um", "35", "--json"]);
    assert!(figure(&report, "before", "all_plants") > 35.0);
    assert!(figure(&report, "after", "all_plants") <= 35.0);
    let corner = "G21 G90 G64 P0.01\nG1 X-30 F3000\nY-20\nM2\n";
    let corner = folder.file("corner.nc", corner).to_string_lossy().into_owned();
    let output = run(&["compile", &corner, "--tolerance-um", "0.1", "--quiet"]);
    let [verdict, error] =
        [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).expect("UTF-8"));
    assert!(verdict.ends_with("; tolerance 0.1 µm not held\n"), "{verdict}");
    assert_eq!(output.status.code(), Some(1));
    // The tool follows its setpoints: behind the corner.
    assert!(error.contains("µm on line 3 is beyond the tolerance 0.1 µm"), "{error}");
    // A program within the tolerance needs no change.
    let out = folder.path("same.nc");
    let verdict = printed(&["compile", &part, "--tolerance-um", "500", "--quiet", "--out", &out]);
    assert!(
        verdict.starts_with("program unchanged") && verdict.ends_with("; tolerance 500.0 µm held\n"),
        "{verdict}"
    );
    assert_eq!(std::fs::read_to_string(&out).expect("the program"), SQUARE);
    // With a higher feed it takes less time, within the tolerance.
    let report = json(&["compile", &part, "--tolerance-um", "500", "--feed-limit", "150", "--json"]);
    assert!(report["after"]["cycle_time_s"].as_f64() < report["before"]["cycle_time_s"].as_f64());
}

/// The touch point of a probe, the length of a tool, work offsets and optional lines are those of the machine.
#[test]
fn no_word_is_added_for_an_axis_whose_position_the_program_does_not_give() {
    let folder = TestFolder::new("compile_unknown");
    let text = "G21 G90 G17 G94 G64 P0.01
G0 X-30 Y-30 Z0
G4 P0.5
G38.2 Z-5 F200
G1 X-50 F3000
Y-50
/ X-60
G1 X-40 Y-40
Y-20
G43 H1
X-20
G55
G1 X-40 F2900
Y-40
X-20
Y-20
G41 D7 X-25
Y-30
G40 Y-40 X-30
M2
";
    let part = folder.file("part.nc", text).to_string_lossy().into_owned();
    let out = folder.path("better.nc");
    run(&["compile", &part, "--same-time", "--more-time", "3", "--out", &out]);
    let better = std::fs::read_to_string(&out).expect("the program");
    assert_ne!(better, text);
    let (_, after) = better.split_once("G38.2 Z-5 F200\n").expect("the probing move");
    assert!(!after.contains('Z'), "{better}");
    assert!(after.contains("G41 D7 X-25\nY-30\nG40 Y-40 X-30\nM2\n"), "{better}");
    // No point lies before the end of the first line that gives an axis.
    let following =
        |line: &str| after.split_once(line).and_then(|(_, rest)| rest.lines().next()).expect("a line");
    let ends =
        [following("/ X-60\n"), following("G55\n")].map(|line| line.split(['X', ' ']).nth(2).expect("X"));
    for end in ends {
        let end: f64 = end.parse().expect("a number");
        assert!((end + 40.0).abs() < 0.1, "{better}");
    }
}

#[test]
fn programs_that_cannot_be_improved_return_with_all_bytes() {
    let folder = TestFolder::new("compile_unchanged");
    // A line of one axis has no contour error but at its end; a loop is executed more than once; Latin-1 and CRLF remain.
    let loops = "G21 G90 G64 P0.01\r\n#1=0\r\no1 repeat [2]\r\nG1 X[20+#1] F2000\r\nY20\r\nX0\r\nY0\r\n#1=1\r\no1 endrepeat\r\nM2\r\n";
    let bytes = [b"(Fr\xe4sen)\r\n".as_slice(), loops.as_bytes()].concat();
    let part = folder.path("part.nc");
    std::fs::write(&part, &bytes).expect("the program");
    let out = folder.path("same.nc");
    let report = json(&["compile", &part, "--same-time", "--out", &out, "--json"]);
    assert_eq!(report["is_changed"], false);
    assert_eq!(report["lines_changeable"], 0);
    assert_eq!(report["lines_left"]["executed more than once, or several motions"], 4);
    assert_eq!(report["before"], report["after"]);
    assert_eq!(std::fs::read(&out).expect("the program"), bytes);
    assert!(
        printed(&["compile", &part, "--same-time", "-q"]).starts_with("program unchanged: no better one")
    );
}

#[test]
fn invalid_arguments_are_rejected() {
    let folder = TestFolder::new("compile_rejected");
    let part = folder.file("part.nc", SQUARE).to_string_lossy().into_owned();
    assert_rejected(&["compile", &part], &["--tolerance-um <UM>|--same-time"]);
    assert_rejected(&["compile", &part, "--same-time", "--tolerance-um", "5"], &["cannot be used with"]);
    assert_rejected(&["compile", &part, "--tolerance-um", "0"], &["must be in 0.1 … 10000"]);
    assert_rejected(&["compile", &part, "--same-time", "--feed-limit", "50"], &["must be in 100 … 1000"]);
    assert_rejected(&["compile", &part, "--same-time", "--out", &part], &["would replace an input file"]);
    let named = "ballbar: a part program is required; built-in ones are circle-diamond-square, ";
    assert_rejected(&["compile", "ballbar", "--same-time"], &[named]);
    assert_rejected(&["run", "ballbar", "--reference", &part], &["--reference requires a part program"]);
}
