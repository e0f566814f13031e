//! The limit audit of `virtual_axes check`.

use std::fs;

use serde_json::Value;
use virtual_axes_verification::fixtures::folder::TestFolder;

use crate::command_common::{printed, run};

/// Exit status of setpoints beyond a limit.
const BEYOND: i32 = 1;

/// Writes the setpoints of a rapid traverse on a machine with other limits to a file of this kind.
fn setpoints(folder: &TestFolder, kind: &str, options: &[&str]) -> String {
    let program = folder.file("traverse.nc", "G61.1 G0 X300\nM2\n");
    let file = folder.0.join(format!("setpoints.{kind}")).to_str().expect("UTF-8").to_owned();
    printed(&[&["psec", program.to_str().expect("UTF-8"), "--out", &file], options].concat());
    file
}

/// Returns the exit status, the audit and standard error.
fn audit(file: &str) -> (i32, Value, String) {
    let output = run(&["check", file, "--json"]);
    let audit = serde_json::from_slice(&output.stdout).expect("one JSON object");
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    (output.status.code().expect("an exit status"), audit, text)
}

fn number(value: &Value) -> f64 {
    value.as_f64().expect("a number")
}

/// Changes the positions of x in a CSV file, and writes them with a number of decimals.
fn changed(file: &str, decimals: usize, change: impl Fn(usize, f64) -> f64) {
    let text = fs::read_to_string(file).expect("setpoints");
    let rows = text.lines().skip(1).enumerate().map(|(k, row)| {
        let mut fields = row.split(',');
        let (time, x) = fields.next().zip(fields.next()).expect("two columns");
        format!("{time},{:.decimals$}\n", change(k, x.parse().expect("a number")))
    });
    let rows: String = rows.collect();
    fs::write(file, format!("time,x\n{rows}")).expect("written");
}

#[test]
fn planned_setpoints_are_within_the_limits_in_every_format() {
    let folder = TestFolder::new("audit_planned");
    for kind in ["csv", "mcap", "yaml"] {
        let file = setpoints(&folder, kind, &[]);
        let (status, audit, error) = audit(&file);
        assert_eq!((status, &audit["within_limits"]), (0, &Value::Bool(true)), "{kind}: {audit}");
        assert!(error.is_empty(), "{error}");
        for quantity in ["velocity", "acceleration", "jerk"] {
            let value = &audit["axes"]["x"][quantity];
            assert_eq!(value["setpoints_beyond"], 0);
            assert!(
                (number(&value["largest"]) / number(&value["limit"]) - number(&value["ratio"])).abs() < 1e-12
            );
        }
        assert!((number(&audit["axes"]["x"]["acceleration"]["ratio"]) - 1.0).abs() < 1e-6, "{kind}");
        assert!(printed(&["check", &file]).ends_with("valid\n"));
    }
}

#[test]
fn jerk_is_not_checked_for_a_control_that_does_not_limit_it() {
    let folder = TestFolder::new("audit_control");
    let machine = |name: &str, is_limited: bool| {
        let control = format!("    control: {{profile: linuxcnc, jerk_limited: {is_limited}}}\n");
        let text = printed(&["machines", "--new", "vmc"]) + &control;
        folder.file(name, text).to_str().expect("UTF-8").to_owned()
    };
    let program = folder.file("square.nc", "G21 G90 G61\nG0 X100\nG1 Y50 F3000\nX0\nY0\nM2\n");
    let program = program.to_str().expect("UTF-8");
    for is_limited in [false, true] {
        let machine = machine(&format!("{is_limited}.yaml"), is_limited);
        let output = run(&["check", program, "--machine", &machine, "--json"]);
        let audit: Value = serde_json::from_slice(&output.stdout).expect("one JSON object");
        assert_eq!(output.status.code(), Some(0), "{audit}");
        let axis = &audit["axes"]["x"];
        assert!(axis["acceleration"].is_object());
        assert_eq!(axis["jerk"].is_object(), is_limited, "{audit}");
        assert_eq!(audit["notes"].as_array().expect("notes").len(), usize::from(!is_limited));
        let text = printed(&["check", program, "--machine", &machine]);
        assert!(text.ends_with("valid\n"), "{text}");
        assert_eq!(text.contains("jerk is not checked"), !is_limited, "{text}");
        // Setpoints that exceed the acceleration are beyond limits with either.
        let faster = ["--set", "x.limits.acceleration_m_s2=6"];
        let setpoints = folder.0.join("setpoints.csv").to_str().expect("UTF-8").to_owned();
        printed(&[&["psec", program, "--machine", &machine, "--out", &setpoints], &faster[..]].concat());
        let output = run(&["check", &setpoints, "--machine", &machine]);
        assert_eq!(output.status.code(), Some(BEYOND));
    }
}

#[test]
fn each_limit_that_the_planner_did_not_know_is_found() {
    let folder = TestFolder::new("audit_planted");
    let options: [(&str, &[&str], f64); 3] = [
        ("velocity", &["--set", "x.limits.velocity_m_min=36"], 36.0 / 30.0),
        ("acceleration", &["--set", "x.limits.acceleration_m_s2=3.5"], 3.5 / 2.5),
        ("jerk", &["--set", "x.limits.jerk_m_s3=80"], 80.0 / 50.0),
    ];
    for kind in ["csv", "mcap"] {
        for (quantity, options, ratio) in options {
            let file = setpoints(&folder, kind, options);
            let (status, audit, error) = audit(&file);
            assert_eq!((status, &audit["within_limits"]), (BEYOND, &Value::Bool(false)), "{kind} {quantity}");
            for name in ["velocity", "acceleration", "jerk"] {
                let beyond = audit["axes"]["x"][name]["setpoints_beyond"].as_u64().expect("a count");
                assert_eq!(beyond > 0, name == quantity, "{kind} {quantity}: {audit}");
            }
            let found = &audit["axes"]["x"][quantity];
            assert!((number(&found["ratio"]) - ratio).abs() < 1e-6 * ratio, "{kind}: {found}");
            assert!(error.contains(&format!(": {quantity} of x, ")), "{error}");
            // `run` rejects velocities beyond the limit and simulates the others.
            assert_eq!(run(&["run", &file, "--quiet"]).status.success(), quantity != "velocity");
        }
    }
}

#[test]
fn the_line_of_a_shifted_row_is_found() {
    let folder = TestFolder::new("audit_shifted");
    let file = setpoints(&folder, "csv", &[]);
    changed(&file, 12, |k, x| if k == 60 { x + 1e-4 } else { x });
    let (status, audit, error) = audit(&file);
    assert_eq!(status, BEYOND);
    let acceleration = &audit["axes"]["x"]["acceleration"];
    // The row is at line 62; the second difference around it ends at the next row.
    assert_eq!((&acceleration["line"], &acceleration["time_s"]), (&63.into(), &0.366.into()), "{audit}");
    let planted = 2e-4 / 0.006_f64.powi(2);
    assert!((number(&acceleration["largest"]) - planted).abs() <= 2.5, "{acceleration}");
    assert!((1..=3).contains(&acceleration["setpoints_beyond"].as_u64().expect("a count")));
    assert!(error.contains("setpoints.csv: line 6") && error.contains("jerk of x"), "{error}");
    let text = String::from_utf8(run(&["check", &file]).stdout).expect("UTF-8");
    assert!(text.ends_with("beyond limits\n"), "{text}");
}

#[test]
fn positions_and_speeds_beyond_the_limits_have_their_line() {
    let folder = TestFolder::new("audit_travel");
    let file = folder.file("travel.csv", "time,x\n0,0\n10,0.5\n20,-2.5\n30,0\n");
    let (status, audit, error) = audit(file.to_str().expect("UTF-8"));
    assert_eq!(status, BEYOND);
    let (lowest, highest) = (&audit["axes"]["x"]["lowest_position"], &audit["axes"]["x"]["highest_position"]);
    assert_eq!((&lowest["line"], &lowest["setpoints_beyond"]), (&4.into(), &1.into()));
    assert_eq!((&highest["line"], &highest["setpoints_beyond"]), (&3.into(), &1.into()));
    assert_eq!([&lowest["value"], &highest["value"]].map(number), [-2500.0, 500.0]);
    assert!(
        error.ends_with("lowest position of x, -2500 mm, is beyond its travel limit -355 mm\n"),
        "{error}"
    );
    let file = folder.file("speed.csv", "time,x\n0,0\n0.1,0.3\n");
    let (status, audit, _) = self::audit(file.to_str().expect("UTF-8"));
    assert_eq!((status, &audit["axes"]["x"]["velocity"]["line"]), (BEYOND, &3.into()));
    assert!((number(&audit["axes"]["x"]["velocity"]["ratio"]) - 6.0).abs() < 1e-9);
}

#[test]
fn rounded_positions_prove_nothing_that_the_exact_ones_do_not() {
    let folder = TestFolder::new("audit_rounded");
    for decimals in [4, 5, 6, 8] {
        let file = setpoints(&folder, "csv", &[]);
        changed(&file, decimals, |_, x| x);
        let (status, audit, _) = audit(&file);
        assert_eq!(status, 0, "{decimals} decimals: {audit}");
        let notes = audit["notes"].as_array().expect("notes").len();
        // Jerk: 4 times the last digit over the cube of 6 ms, with a limit of 50 m/s³; acceleration: 2 times over the
        // square, with a limit of 2.5 m/s².
        let digit = 0.1_f64.powi(i32::try_from(decimals).expect("small"));
        let expected = [4.0 * digit / 0.006_f64.powi(3) > 50.0, 2.0 * digit / 0.006_f64.powi(2) > 2.5];
        assert_eq!(
            notes,
            expected.into_iter().filter(|is_unchecked| *is_unchecked).count(),
            "{decimals}: {audit}"
        );
    }
    // A fault larger than the rounding is found.
    let file = setpoints(&folder, "csv", &[]);
    changed(&file, 6, |k, x| if k == 60 { x + 1e-4 } else { x });
    assert_eq!(audit(&file).0, BEYOND);
}

#[test]
fn inputs_without_setpoints_have_no_audit() {
    for input in ["mikron_ucp710", "ballbar"] {
        let output = run(&["check", input, "--json"]);
        assert_eq!(output.status.code(), Some(2));
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(text.ends_with("--json requires setpoints or a part program\n"), "{text}");
    }
}
