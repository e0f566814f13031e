//! Machines with further or reordered joints, and scenarios with linear and rotary moves.

use virtual_axes_verification::fixtures::folder::TestFolder;

use crate::command_common::{assert_rejected, printed, run};

const MACHINE: &str = include_str!("../../config/mikron_ucp710.yaml");

/// Returns the file of a machine with some joints of the default machine, in another order; joint `u` is a copy of X.
fn machine(folder: &TestFolder, joints: &[&str]) -> String {
    let begin = |joint: &str| MACHINE.find(&format!("\n    {joint}:\n")).expect("the machine has this joint");
    let block = |joint: &str| {
        let text = &MACHINE[begin(joint) + format!("\n    {joint}:\n").len()..];
        let next = ["x", "y", "z", "a", "c"].map(|next| text.find(&format!("\n    {next}:\n")));
        &text[..next.into_iter().flatten().min().unwrap_or(text.len())]
    };
    let mut text = MACHINE[..begin("x")].replace(r#"["x", "y", "z", "a", "c"]"#, &format!("{joints:?}"));
    for &joint in joints {
        text += &format!("\n    {joint}:\n{}\n", block(if joint == "u" { "x" } else { joint }));
    }
    folder.text_file("own.yaml", &text)
}

/// Returns the result of a run in one line.
fn verdict(input: &str, options: &[&str]) -> String {
    printed(&[&["run", input, "--quiet"], options].concat())
}

#[test]
fn contour_control_acts_on_x_y_and_z() {
    let folder = TestFolder::new("contour_of_own");
    let machine = machine(&folder, &["u", "z", "y", "x", "a", "c"]);
    let gain = ["--set", "contour_control.gain=4"];
    let wanted = verdict("ballbar", &gain);
    assert_eq!(verdict("ballbar", &[&gain[..], &["--machine", &machine]].concat()), wanted);
}

#[test]
fn contour_control_needs_two_of_x_y_and_z() {
    let folder = TestFolder::new("contour_without");
    let machine = machine(&folder, &["u", "x", "a", "c"]);
    let gain = ["--set", "contour_control.gain=4"];
    let command = ["run", "x-constant", "--machine", &machine];
    assert_rejected(&[&command[..], &gain].concat(), &["contour_control.gain = 4: must be 0", "x, y and z"]);
}

#[test]
fn contour_control_and_a_gantry_of_x_are_rejected_together() {
    let folder = TestFolder::new("contour_gantry");
    let machine = machine(&folder, &["x", "u", "y", "z", "a", "c"]);
    let mut words = vec!["run", "ballbar", "--machine", &machine, "--set", "contour_control.gain=4"];
    words.extend(["--set", r#"gantry.axes=["x", "u"]"#, "--set", "gantry.stiffness_n_um=200"]);
    assert_rejected(&words, &["contour_control.gain and gantry.axes"]);
}

#[test]
fn a_moving_axis_without_part_in_the_contour_error_is_named() {
    let folder = TestFolder::new("without_role");
    let machine = machine(&folder, &["x", "u", "y", "z", "a", "c"]);
    let setpoints = folder.text_file("psec.csv", "time,x,u\n0,0,0\n1,0.01,0.02\n2,0.01,0.02\n");
    let found = verdict(&setpoints, &["--machine", &machine]);
    assert!(found.contains("the contour error does not contain u"), "{found}");
    // Only X moves the tool.
    assert!(found.starts_with("u: delay-compensated following error"), "{found}");
    let cost = printed(&["robustness", &setpoints, "--machine", &machine, "--quiet"]);
    assert!(cost.starts_with("cost contour: ") && !cost.starts_with("cost contour: 0.00"), "{cost}");
    assert!(!verdict("ballbar", &["--machine", &machine]).contains("does not contain"));
}

#[test]
fn the_order_of_joints_does_not_turn_an_arc_around() {
    let folder = TestFolder::new("arc_of_own");
    let machine = machine(&folder, &["y", "x", "z", "a", "c"]);
    let [wanted, found] = [("default.csv", "mikron_ucp710"), ("own.csv", &machine)].map(|(name, machine)| {
        let file = folder.path(name);
        printed(&["psec", "ballbar", "--machine", machine, "--out", &file]);
        std::fs::read_to_string(file).expect("the file has been written")
    });
    let rows = |text: &str, columns: [usize; 3]| -> Vec<Vec<String>> {
        let row = |line: &str| {
            let values: Vec<&str> = line.split(',').collect();
            columns.map(|column| values[column].to_owned()).to_vec()
        };
        text.lines().map(row).collect()
    };
    assert!(rows(&found, [0, 2, 1]) == rows(&wanted, [0, 1, 2]), "time, x and y have the same bits");
}

#[test]
fn a_comparison_is_that_of_one_axis() {
    let folder = TestFolder::new("same_axis");
    let machine = machine(&folder, &["a", "c"]);
    let setpoints = folder.text_file("psec.csv", "time,a,c\n0,0,0\n0.5,0.4,0.5\n1.5,0.4,0.5\n");
    let words = ["--machine", &machine, "--compare", "c.position_loop.gain=3"];
    let found = verdict(&setpoints, &words);
    // The error of C is the larger one first, that of A with the comparison, where only C has changed.
    assert!(found.starts_with("cascade, c.position_loop.gain=3: c: "), "{found}");
}

#[test]
fn limits_of_linear_and_rotary_paths_are_independent() {
    let folder = TestFolder::new("path_limits");
    let duration = |limits: &str| {
        let moves = "moves:\n  - line: {x_mm: 100}\n  - line: {c_deg: 90}\n";
        let head = format!("description: d\nfeed_m_min: 18\nfeed_rpm: 10\nlimits: {{{limits}}}\n");
        let file = folder.text_file("s.yaml", &(head + moves));
        let found = printed(&["check", &file]);
        let seconds =
            found.split_once(": ").and_then(|(_, rest)| rest.split_once(" s\n")).expect("a duration").0;
        seconds.parse::<f64>().expect("a number")
    };
    let none = duration("");
    let linear = duration("acceleration_m_s2: 0.5") - none;
    let rotary = duration("acceleration_rev_s2: 0.1") - none;
    let both = duration("acceleration_m_s2: 0.5, acceleration_rev_s2: 0.1") - none;
    assert!(linear > 0.1 && rotary > 0.1, "{linear} s and {rotary} s");
    // Each duration is a multiple of 6 ms.
    assert!((both - linear - rotary).abs() < 12e-3, "{both} s, not {linear} s and {rotary} s");
}

#[test]
fn options_of_another_kind_of_move_are_rejected() {
    let folder = TestFolder::new("foreign_options");
    for (moves, key) in [
        ("  - {line: {x_mm: 1}, feed_rpm: 5}\n", "feed_rpm: does not apply to a move of linear axes"),
        ("  - {line: {x_mm: 1}, corner_rpm: 5}\n", "corner_rpm: does not apply to a move of linear axes"),
        (
            "  - {line: {c_deg: 1}, feed_m_min: 5}\n",
            "feed_m_min: does not apply to a move of rotary axes only",
        ),
        ("  - line: {x_mm: 1}\n  - {dwell_s: 1, ramp_s: 1}\n", "ramp_s: does not apply to a dwell"),
        ("  - {arc: {center: {x_mm: 5, y_mm: 0}, angle_deg: 0}, ramp_s: 0.1}\n", "not 0; found 0 rad"),
        (
            "  - {arc: {center: {x_mm: 0, y_mm: 0}, angle_deg: 9}, ramp_s: 0.1}\n",
            "radius must be larger than 0",
        ),
    ] {
        let text = format!("description: d\nfeed_m_min: 5\nfeed_rpm: 5\nmoves:\n{moves}");
        assert_rejected(&["run", &folder.text_file("s.yaml", &text)], &[key]);
    }
}

#[test]
fn linear_and_rotary_moves_have_their_own_feed_and_length() {
    let folder = TestFolder::new("mixed_moves");
    let head = "description: d\nfeed_m_min: 5\nfeed_rpm: 5\nmoves:\n";
    let text = head.to_owned() + "  - line: {x_mm: 120}\n  - line: {a_deg: 20}\n  - line: {c_deg: 90}\n";
    let found = printed(&["check", &folder.text_file("s.yaml", &text)]);
    assert!(
        found.contains("highest feed: 5.00 m/min, 5.00 rpm\npath: 120.000 mm, 110.000°, open\n"),
        "{found}"
    );
    assert!(found.contains("c: start 0.000 °, end 90.000 °, range 0.000 to 90.000 °"), "{found}");
    let slow = head.replace("5\n", "20\n") + "  - line: {x_mm: 1}\n  - line: {c_deg: 90}\n";
    let output = run(&["check", &folder.text_file("s.yaml", &slow)]);
    let warning = String::from_utf8_lossy(&output.stderr);
    assert!(warning.contains("feed 20.00 m/min not reached"), "{warning}");
}

#[test]
fn a_check_has_the_start_and_the_end_velocity_of_a_run() {
    let folder = TestFolder::new("check_as_run");
    let point =
        |position: f64, time: u32| format!("{{positions: [{position}], time_from_start: {{sec: {time}}}}}");
    let two = ["x", "z"]
        .map(|joint| format!("joint_names: [{joint}]\npoints: [{}, {}]\n", point(0.1, 0), point(0.11, 2)));
    let starts = folder.text_file("starts.yaml", &two.join("---\n"));
    assert_rejected(&["run", &starts], &["z: starts at 0.1 m"]);
    let output = run(&["check", &starts]);
    assert_eq!(output.status.code(), Some(1), "{}", String::from_utf8_lossy(&output.stdout));

    let key = "    joints:";
    let text = MACHINE.replace(key, &format!("    allow_nonzero_velocity_at_trajectory_end: true\n{key}"));
    let machine = folder.text_file("machine.yaml", &text);
    let ramp = "joint_names: [x]\npoints: [{positions: [0], velocities: [0], time_from_start: {sec: 0}}, \
                {positions: [0.01], velocities: [0.02], time_from_start: {sec: 1}}]\n";
    let ramp = folder.text_file("ramp.yaml", ramp);
    assert!(run(&["run", &ramp, "--machine", &machine]).status.success());
    let output = run(&["check", &ramp, "--machine", &machine]);
    assert!(!String::from_utf8_lossy(&output.stderr).contains("must be zero"), "{output:?}");
}

#[test]
fn options_without_effect_are_rejected() {
    let folder = TestFolder::new("no_effect");
    let machine = machine(&folder, &["u"]);
    assert_rejected(&["check", &machine, "--machine", &machine], &["--machine requires a scenario"]);
    assert_rejected(&["pose", "--machine", &machine, "--joints", "u=0.1"], &["there is no tool pose"]);
    let campaign = |weight: &str| {
        let set = format!("x.feedforward.velocity={weight}");
        printed(&["psec", "campaign", "--axis", "x", "--out", &folder.path("c.csv"), "--set", &set])
    };
    assert!(campaign("0").contains("warning: x.feedforward.velocity is 0"));
    assert!(!campaign("1").contains("warning"));
}
