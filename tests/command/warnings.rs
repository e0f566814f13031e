//! Warnings of `virtual_axes run` and `check` on values that are valid but implausible.

use std::fs;

use virtual_axes_verification::fixtures::folder::TestFolder;

use crate::command_common::{printed, run};

const MACHINE: &str = include_str!("../../config/mikron_ucp710.yaml");

fn verdict(input: &str, set: &str) -> String {
    printed(&["run", input, "--quiet", "--set", set])
}

/// Returns the warnings of `virtual_axes check`.
fn warnings(folder: &TestFolder, name: &str, content: &str) -> String {
    let file = folder.file(name, content);
    let output = run(&["check", file.to_str().expect("UTF-8")]);
    assert!(output.status.success() && String::from_utf8_lossy(&output.stdout).ends_with("valid\n"));
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn unstable_inner_loops_are_part_of_the_verdict() {
    for set in ["x.velocity_loop.gain=200", "x.velocity_loop.gain=5e6", "x.current_loop.gain=1300"] {
        assert!(verdict("x-constant", set).contains("; the inner loops of x are unstable"), "{set}");
    }
    assert!(!verdict("x-constant", "x.velocity_loop.gain=4.5").contains("unstable"));
}

#[test]
fn a_gain_without_poles_is_part_of_the_verdict() {
    for gain in ["1e6", "1e8", "1e9"] {
        let text = verdict("x-constant", &format!("x.position_loop.gain={gain}"));
        assert!(text.contains("the position loop of x"), "{text}");
    }
}

#[test]
fn without_motion_no_axis_has_an_error() {
    let folder = TestFolder::new("no_motion");
    for (name, text) in [("one.csv", "time,x\n0,0\n"), ("dwell.nc", "G4 P0.5\nM2\n"), ("end.nc", "M2\n")] {
        let file = folder.file(name, text);
        let output = run(&["run", file.to_str().expect("UTF-8"), "--quiet"]);
        assert_eq!(String::from_utf8_lossy(&output.stdout), "no axis moves\n", "{name}");
    }
}

#[test]
fn a_slow_part_program_has_no_doubtful_time() {
    let folder = TestFolder::new("slow_program");
    let file = folder.file("slow.nc", "G21 G90\nG1 X1 F20\nM2\n");
    let text = printed(&["run", file.to_str().expect("UTF-8"), "--quiet"]);
    assert!(!text.contains("time"), "{text}");
}

#[test]
fn the_name_of_a_machine_as_a_parameter_selects_no_machine() {
    for name in ["linear_motor_center", "linear_motor_centr", "my_machine.yaml", "folder/machine"] {
        let output = run(&["run", "x-constant", "--quiet", "--set", &format!("machine={name}")]);
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success() && text.contains("--machine selects a machine"), "{name}: {text}");
    }
    let output = run(&["run", "x-constant", "--quiet", "--set", "machine=Shop floor 3"]);
    assert!(output.stderr.is_empty());
}

#[test]
fn a_tiny_linear_move_has_a_feed_in_meters_per_minute() {
    let folder = TestFolder::new("tiny_move");
    let file = folder.file("tiny.yaml", "description: d\nfeed_m_min: 6\nmoves:\n  - line: {x_mm: 1e-6}\n");
    let file = file.to_str().expect("UTF-8");
    assert!(printed(&["run", file, "--quiet"]).contains("feed 6.00 m/min not reached"));
    let output = run(&["check", file]);
    assert!(String::from_utf8_lossy(&output.stdout).contains("path: 0.000 mm"));
}

#[test]
fn gains_of_0_are_part_of_the_verdict() {
    for name in ["position", "velocity", "current"] {
        let text = verdict("x-constant", &format!("x.{name}_loop.gain=0"));
        assert!(text.contains(&format!("; {name}_loop.gain of x is 0: no {name} control")), "{text}");
    }
}

#[test]
fn a_gantry_of_which_one_axis_rests_is_part_of_the_verdict() {
    let beam = ["--set", "gantry.axes=[x, y]", "--set", "gantry.stiffness_n_um=2"];
    let verdict = |input: &str| printed(&[&["run", input, "--quiet"], &beam[..]].concat());
    let warning = "; the setpoints move x of gantry.axes and not y: the beam pulls at both";
    assert!(verdict("x-constant").contains(warning), "{}", verdict("x-constant"));
    assert!(!verdict("ballbar").contains("gantry"));
}

#[test]
fn implausible_machine_files_give_warnings() {
    let folder = TestFolder::new("implausible_machines");
    assert_eq!(warnings(&folder, "machine.yaml", MACHINE), "");
    let changed = |from: &str, to: &str| MACHINE.replacen(from, to, 1);
    let unstable = warnings(&folder, "machine.yaml", &changed("gain: 5.0", "gain: 500.0"));
    assert!(unstable.contains("machine.yaml: the inner loops of x are unstable\n"), "{unstable}");
    let fast = warnings(&folder, "machine.yaml", &changed("velocity_m_min: 30.0", "velocity_m_min: 3000.0"));
    assert!(
        fast.contains("x.limits.velocity_m_min = 3000 m/min exceeds 40 m/min, the maximum speed"),
        "{fast}"
    );
}

#[test]
fn a_time_in_milliseconds_and_gaps_are_suspected() {
    let folder = TestFolder::new("suspected_times");
    let slow = warnings(&folder, "slow.csv", "time,x\n0,0\n1000,0.01\n");
    assert!(slow.contains("setpoints reach at most 0.0006 m/min (x)") && slow.contains("in ms?"), "{slow}");
    let rows: String = (1..50).map(|k| format!("{},0.00{k:02}\n", f64::from(k) * 0.006)).collect();
    let gap = warnings(&folder, "gap.csv", &format!("time,x\n0,0\n{rows}1,0.01\n"));
    assert!(gap.contains("gap.csv:52: the time step to this row is 0.706 s, the median 0.006 s"), "{gap}");
    let file = folder.file("moves.csv", "time,x\n0,0.01\n0.6,0\n1.2,0.04\n");
    let text = printed(&["check", file.to_str().expect("UTF-8")]);
    assert!(
        text.contains("x: start 10.000 mm, end 40.000 mm, range 0.000 to 40.000 mm, at most 4.00 m/min\n"),
        "{text}"
    );
}

#[test]
fn the_highest_feed_does_not_depend_on_the_rest() {
    let folder = TestFolder::new("long_rest");
    let file = folder
        .file("rest.yaml", "description: d\nfeed_m_min: 6\nrest_s: 5000\nmoves:\n  - line: {x_mm: 40}\n");
    assert!(printed(&["check", file.to_str().expect("UTF-8")]).contains("highest feed: 6.00 m/min\n"));
}

#[test]
fn limits_above_those_of_the_axes_are_noted() {
    let folder = TestFolder::new("high_limits");
    let scenario = "description: d\nfeed_m_min: 6\nlimits: {acceleration_m_s2: 25, jerk_m_s3: 50}\nmoves:\n  - line: {x_mm: 40}\n";
    let note = "limits.acceleration_m_s2: 25 exceeds that of the axes, 3, which keep their own";
    assert!(warnings(&folder, "high.yaml", scenario).ends_with(&format!("high.yaml: {note}\n")));
    let file = folder.path("high.yaml");
    let text = printed(&["run", &file]);
    assert!(text.contains(note) && !text.contains("jerk_m_s3"), "{text}");
}

#[test]
fn a_current_above_its_limit_is_explained() {
    let text = printed(&["run", "x-constant", "--set", "x.motor.max_current_a=2"]);
    assert!(text.contains("the current limit bounds the setpoint of the current loop"), "{text}");
}

#[test]
fn a_report_lists_the_tuning_of_its_controllers() {
    let folder = TestFolder::new("report_tuning");
    let page = folder.0.join("page.html");
    printed(&["run", "x-constant", "--controller", "gpc", "--report", page.to_str().expect("UTF-8")]);
    let text = fs::read_to_string(page).expect("readable");
    assert!(text.contains("N1 1, N2 14, Nu 12, λ_rel 0.005, α 9 ms") && !text.contains("VFFW"));
}
