//! Next command of the list of columns, and new machines from recordings.

use std::fmt::Write;
use std::process::Command;
use std::sync::LazyLock;

use virtual_axes_identify::recording::RawRecording;
use virtual_axes_verification::fixtures::folder::TestFolder;
use virtual_axes_verification::production_traces::{HiddenMachine, TraceRecorder};

use crate::command_common::{assert_rejected, json, printed, run};

/// Recordings of X and Z of a machine at 20 ms.
static RECORDINGS: LazyLock<Vec<RawRecording>> = LazyLock::new(|| {
    let mut hidden = HiddenMachine::draw(6001);
    hidden.axes.retain(|axis| axis.config.name != "y");
    let program = hidden.program(1, 8.0).expect("a program");
    hidden.record(&program, &TraceRecorder::default(), 1).expect("recordings")
});

/// Header of the time with its unit in s; none for a file without time.
type TimeColumn = Option<(&'static str, f64)>;

/// Returns CSV with the signals of each axis: header with `#` for the name of the axis, and unit in SI.
fn csv(time: TimeColumn, names: &[&str], signals: [(&str, f64); 3]) -> String {
    let mut header: Vec<String> = time.iter().map(|(header, _)| (*header).to_owned()).collect();
    let mut columns: Vec<Vec<f64>> = Vec::new();
    if let Some((_, unit)) = time {
        columns.push(RECORDINGS[0].time.iter().map(|t| t / unit).collect());
    }
    for (name, recording) in names.iter().zip(&*RECORDINGS) {
        let values = [&recording.psec, &recording.position, &recording.current];
        for ((signal, unit), values) in signals.iter().zip(values) {
            header.push(signal.replace('#', name));
            columns.push(values.iter().flatten().map(|value| value / unit).collect());
        }
    }
    let mut text = header.join(",") + "\n";
    for k in 0..RECORDINGS[0].time.len() {
        let row: Vec<String> = columns.iter().map(|column| format!("{:.6}", column[k])).collect();
        writeln!(text, "{}", row.join(",")).expect("a text");
    }
    text
}

/// Runs a command line by a shell in `folder`; returns status and output.
fn shell(folder: &TestFolder, line: &str) -> (Option<i32>, String) {
    let program = env!("CARGO_BIN_EXE_virtual_axes");
    let line = line.replacen("virtual_axes", program, 1);
    let output = Command::new("sh").args(["-c", &line]).current_dir(&folder.0).output().expect("a shell");
    let text =
        String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
    (output.status.code(), text)
}

/// Lists the columns of a file in its folder; returns the list and the next command.
fn listed(folder: &TestFolder, file: &str, more: &str) -> (String, String) {
    let (status, text) = shell(folder, &format!("virtual_axes identify '{file}' {more}"));
    assert_eq!(status, Some(0), "{text}");
    let next = text.lines().find_map(|line| line.strip_prefix("next: "));
    let next = next.unwrap_or_else(|| panic!("no next command in {text}")).to_owned();
    (text, next)
}

#[test]
fn the_next_command_runs_as_printed_for_every_set_of_columns() {
    let mm = 1e-3;
    let cases: [(&str, String, &str, &str); 7] = [
        // Units in the headers.
        (
            "units.csv",
            csv(
                Some(("time [ms]", 1e-3)),
                &["X1", "Z1"],
                [("# set position [mm]", mm), ("# actual position [mm]", mm), ("# current [A]", 1.0)],
            ),
            "",
            "--axis all",
        ),
        // Millimeters and milliseconds without units, and a name with a blank.
        (
            "no units.csv",
            csv(Some(("time", 1e-3)), &["x", "z"], [("cmd_#", mm), ("pos_#", mm), ("current_#", 1.0)]),
            "",
            "--axis all --column 'time=[ms]' --column 'position=[mm]' --column 'psec=[mm]'",
        ),
        // Machine axes, and no time.
        (
            "rate.csv",
            csv(None, &["MX1", "MZ1"], [("cmd_pos_#_mm", mm), ("pos_#_mm", mm), ("current_#", 1.0)]),
            "--rate-hz 50",
            "--axis all --rate-hz 50",
        ),
        // Numbers of axes.
        (
            "numbers.csv",
            csv(
                Some(("t_ms", 1e-3)),
                &["1", "3"],
                [("DES_POS|#", mm), ("ENC_POS|#", mm), ("CURRENT|#", 1.0)],
            ),
            "",
            "--axis x --joint 1",
        ),
        // One axis without a name.
        (
            "one.csv",
            csv(Some(("time", 1.0)), &["x"], [("psec", 1.0), ("position", 1.0), ("current", 1.0)]),
            "",
            "--axis x",
        ),
        // Columns between blanks.
        (
            "blanks.txt",
            csv(Some(("time", 1.0)), &["x", "z"], [("psec_#_mm", mm), ("pos_#_mm", mm), ("current_#", 1.0)])
                .replace(',', "  "),
            "",
            "--axis all",
        ),
        // Currents in mA.
        (
            "milliampere.csv",
            csv(
                Some(("time [s]", 1.0)),
                &["x", "z"],
                [("# psec [m]", 1.0), ("# position [m]", 1.0), ("# current", 1e-3)],
            ),
            "",
            "--axis all --column 'current=[mA]'",
        ),
    ];
    let folder = TestFolder::new("identify_next");
    for (file, text, more, part) in cases {
        folder.file(file, text);
        let (list, next) = listed(&folder, file, more);
        assert!(next.contains(&format!(" {part} ")), "{file}: {part} in {next}");
        assert!(next.ends_with(" --out identified.yaml --report identified.html"), "{file}: {next}");
        // A result can be invalid; that the recording or an option is rejected must not be.
        let (status, text) = shell(&folder, &format!("{next} --no-refine --quiet"));
        assert!(matches!(status, Some(0 | 3)), "{file}: {list}\n{next}\n{text}");
        let page = std::fs::read_to_string(folder.0.join("identified.html")).expect("a page");
        let written = folder.0.join("identified.yaml").exists();
        let sentence =
            if written { "identified.yaml is written." } else { "identified.yaml is not written." };
        assert!(page.contains(sentence), "{file}: {text}");
        let _ = std::fs::remove_file(folder.0.join("identified.yaml"));
    }
}

#[test]
fn a_rate_that_the_file_does_not_state_is_an_example() {
    let folder = TestFolder::new("identify_next_rate");
    folder.file(
        "rate.csv",
        csv(None, &["x", "z"], [("psec_#_mm", 1e-3), ("pos_#_mm", 1e-3), ("current_#", 1.0)]),
    );
    let (list, next) = listed(&folder, "rate.csv", "");
    assert!(list.contains("250 Hz is an example"), "{list}");
    assert!(next.contains(" --rate-hz 250 "), "{next}");
}

#[test]
fn a_new_machine_has_the_recorded_axes_and_runs_a_part_program() {
    let folder = TestFolder::new("identify_new_machine");
    let signals = [("cmd_pos_#_mm", 1e-3), ("pos_#_mm", 1e-3), ("current_#", 1.0)];
    let trace = folder.file("trace.csv", csv(Some(("time", 1.0)), &["MX1", "AZ1"], signals));
    let (trace, out) = (trace.to_string_lossy().into_owned(), folder.path("machine.yaml"));
    let new = ["identify", &trace, "--new-machine", "DMC 60", "--axis", "all"];
    let lead = ["--set", "x.transmission.screw_lead_mm=25"];
    let found = json(&[new.as_slice(), &lead, &["--json", "--out", &out]].concat());
    let found = found.as_array().expect("a list");
    assert_eq!(found.iter().map(|axis| &axis["axis"]).collect::<Vec<_>>(), ["x", "z"]);
    let checked = printed(&["check", &out]);
    assert!(checked.contains("machine: DMC 60\njoints: x (linear), z (linear)\n"), "{checked}");
    let text = std::fs::read_to_string(&out).expect("a file");
    for part in [
        "screw_lead_mm: 25.0\n",
        "  # template: neither stated nor identified\n",
        "  # largest in the recordings, with home\n",
        "  # identified: ",
    ] {
        assert!(text.contains(part), "{part} in {text}");
    }
    // Travel: the recorded positions, rounded up to mm.
    let largest = |of: &RawRecording| {
        let all = of.psec.iter().chain(&of.position).flatten();
        all.fold(0.0_f64, |most, x| most.max(*x))
    };
    let wanted = format!("travel_max_mm: {:.1}", (largest(&RECORDINGS[0]) * 1e3).ceil());
    assert!(text.contains(&wanted), "{wanted} in {text}");
    let program = folder.file("part.nc", "G21 G90 G64\nG1 X1 Z-1 F500\nX0 Z0\nM30\n");
    let program = program.to_string_lossy().into_owned();
    let ran = json(&["run", &program, "--machine", &out, "--json"]);
    assert_eq!(ran["runs"][0]["axes"]["z"]["moves"], true, "{ran}");
}

#[test]
fn names_of_axes_and_of_the_file_belong_together() {
    let folder = TestFolder::new("identify_axes_joints");
    let signals = [("DES_POS|#", 1e-3), ("ENC_POS|#", 1e-3), ("CURRENT|#", 1.0)];
    let trace = folder.file("trace.csv", csv(Some(("time", 1.0)), &["1", "6"], signals));
    let trace = trace.to_string_lossy().into_owned();
    let two = ["identify", &trace, "--axis", "x,z", "--joint", "1,6", "--no-refine"];
    let output = run(&[two.as_slice(), &["--json"]].concat());
    let found: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(found.as_array().map(Vec::len), Some(2), "{found}");
    let one = ["identify", &trace, "--axis", "x,z"];
    assert_rejected(&[one.as_slice(), &["--joint", "1"]].concat(), &["--joint: 1 names for the 2 axes"]);
    assert_rejected(&["identify", &trace, "--axis", "x,x"], &["--axis: x is given twice"]);
}

#[test]
fn axes_without_the_letter_of_an_axis_are_named() {
    let folder = TestFolder::new("identify_unnamed");
    let signals = [("DES_POS|#", 1e-3), ("ENC_POS|#", 1e-3), ("CURRENT|#", 1.0)];
    let trace = folder.file("trace.csv", csv(Some(("time", 1.0)), &["1", "6"], signals));
    let trace = trace.to_string_lossy().into_owned();
    let new = ["identify", &trace, "--new-machine", "New", "--no-refine", "--json"];
    let without = run(&new).stdout;
    // A new machine without names of its axes has all of them.
    assert_eq!(without, run(&[new.as_slice(), &["--axis", "all"]].concat()).stdout);
    let found: serde_json::Value = serde_json::from_slice(&without).expect("JSON");
    let found = found.as_array().expect("a list");
    assert_eq!(found.iter().map(|axis| &axis["axis"]).collect::<Vec<_>>(), ["x"]);
    let mut findings = found[0]["findings"].as_array().into_iter().flatten();
    let unnamed = findings.find(|finding| finding["code"] == "unnamed-axes").expect("a finding");
    let text = unnamed["text"].as_str().expect("a text");
    assert!(text.starts_with("not identified: 6 of the recordings"), "{text}");
    assert!(text.ends_with("--axis x,NAME --joint 1,6"), "{text}");
}

#[test]
fn all_axes_of_a_file_that_names_none_are_rejected_with_the_remedy() {
    let folder = TestFolder::new("identify_no_name");
    for (text, reason) in [
        (
            "time,psec,position,current\n0,1,1,2\n",
            "the columns name no axis; give its name, for example --axis x",
        ),
        ("1.5,0.3,2\n1.6,0.4,2\n", "no column is recognized as a position; list the columns without --axis"),
    ] {
        let trace = folder.file("trace.csv", text).to_string_lossy().into_owned();
        for new in [&["--new-machine", "New"][..], &[]] {
            assert_rejected(&[&["identify", &trace, "--axis", "all"], new].concat(), &[reason]);
        }
    }
}

#[test]
fn plausibility_is_measured_against_stated_values() {
    let folder = TestFolder::new("identify_stated");
    let trace = folder.file(
        "trace.csv",
        csv(Some(("time", 1.0)), &["x", "z"], [("psec_#", 1.0), ("pos_#", 1.0), ("current_#", 1.0)]),
    );
    let trace = trace.to_string_lossy().into_owned();
    let x = ["identify", &trace, "--axis", "x", "--feedforward", "both"];
    let far = ["--set", "x.motor.inertia_kg_m2=0.5", "--set", "x.motor.torque_constant_nm_a=1"];
    let text = |arguments: &[&str]| {
        let output = run(arguments);
        let [out, error] =
            [output.stdout, output.stderr].map(|text| String::from_utf8_lossy(&text).into_owned());
        out + &error
    };
    // The built-in machine states nothing.
    assert!(!text(&x).contains("motor inertia"), "{}", text(&x));
    assert!(
        text(&[x.as_slice(), &far].concat()).contains("x: motor inertia: 0.5 of the initial machine became ")
    );
    // Limits that are stated, and those of machine tools.
    let limit = ["--set", "x.limits.travel_min_mm=-1", "--set", "x.limits.travel_max_mm=1"];
    assert_rejected(&[x.as_slice(), &limit].concat(), &["the travel limits of the axis 0.002 m"]);
    let mm = ["--column", "position=pos_x[1000 m]"];
    assert_rejected(&[x.as_slice(), &mm].concat(), &["that of a machine tool at most 20 m"]);
}
