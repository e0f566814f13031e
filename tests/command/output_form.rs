//! Form of the output: verdict, columns of runs, width of tables, `--quiet`, `--csv`.

use std::process::{Command, Output};

use virtual_axes_verification::fixtures::folder::TestFolder;

/// Largest length of a line, characters.
const WIDTH: usize = 80;

fn run(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_virtual_axes")).args(arguments).output().expect("the command starts")
}

#[track_caller]
fn text(arguments: &[&str]) -> String {
    let output = run(arguments);
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).expect("text")
}

#[track_caller]
fn assert_rejected(arguments: &[&str], words: &[&str]) {
    let output = run(arguments);
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(
        !output.status.success() && words.iter().all(|word| message.contains(word)),
        "{arguments:?}: {message}"
    );
}

#[track_caller]
fn assert_fits(arguments: &[&str]) {
    for line in text(arguments).lines() {
        assert!(line.chars().count() <= WIDTH, "{arguments:?}: {line}");
    }
}

/// Writes a machine whose rotary axes have long names, and a scenario of one of them.
fn long_names(folder: &TestFolder) -> (String, String) {
    const LONG: &str = "rotary_table_of_the_machine";
    let of = |texts: &[(&str, &'static str)], name| {
        texts.iter().find(|(known, _)| *known == name).map(|(_, text)| *text).expect("a built-in file")
    };
    let mut machine = of(virtual_axes_builtin::MACHINES, "mikron_ucp710").to_owned();
    for axis in ["a", "c"] {
        machine = machine.replace(&format!("\n    {axis}:\n"), &format!("\n    {LONG}_{axis}:\n"));
        machine = machine.replace(&format!("\"{axis}\""), &format!("\"{LONG}_{axis}\""));
    }
    let scenario =
        of(virtual_axes_builtin::SCENARIOS, "c-constant").replace("c_deg", &format!("{LONG}_c_deg"));
    (folder.text_file("machine.yaml", &machine), folder.text_file("scenario.yaml", &scenario))
}

#[test]
fn tables_fit_a_terminal_of_80_columns() {
    for (scenario, _) in virtual_axes_builtin::SCENARIOS {
        assert_fits(&["run", scenario]);
    }
    assert_fits(&["run", "corner-90", "--controller", "cascade,cascade-noff,gpc"]);
    let changes = "x.velocity_loop.integral_time_ms=5,y.velocity_loop.integral_time_ms=7";
    let runs = ["run", "corner-90", "--controller", "cascade,cascade-noff,gpc", "--compare", changes];
    assert_fits(&runs);
    assert_fits(&["robustness", "corner-90"]);
    assert_fits(&["robustness", "corner-90", "--controller", "gpc"]);
    assert_fits(&["tune", "corner-90", "--controller", "cascade"]);
    assert_fits(&["tune", "x-constant", "--controller", "gpc"]);
    assert_fits(&["design", "gpc"]);
    assert_fits(&["bode"]);
    assert_fits(&["learn", "corner-90", "--iterations", "1"]);
    assert_fits(&["run", "pocket"]);
    assert_fits(&["check", "pocket"]);
    let folder = TestFolder::new("output_width");
    let file = folder.path("psec.csv");
    assert_fits(&["psec", "campaign", "--axis", "x", "--out", &file]);
    text(&["psec", "ballbar", "--out", &file]);
    assert_fits(&["check", &file]);
    assert_fits(&["tune", "corner-90", "--controller", "contour"]);
    let recording = folder.path("recording.csv");
    text(&["run", "x-there-and-back", "--trace", &recording]);
    assert_fits(&["identify", &recording, "--axis", "x"]);
    let (machine, scenario) = long_names(&folder);
    assert_fits(&["check", &machine]);
    assert_fits(&["run", &scenario, "--machine", &machine, "--controller", "cascade,gpc"]);
    assert_fits(&["check", &scenario, "--machine", &machine]);
    assert_fits(&["tune", &scenario, "--machine", &machine, "--controller", "cascade"]);
    assert_fits(&["run", "pocket", "--machine", "vmc", "--controller", "cascade,gpc"]);
    for list in ["scenarios", "machines", "parameters", "interface"] {
        assert_fits(&[list]);
    }
}

#[test]
fn help_fits_a_terminal_of_80_columns() {
    let subcommands = text(&["--help"]);
    let names = subcommands.lines().skip_while(|line| *line != "Commands:").skip(1);
    let names = names.take_while(|line| !line.is_empty()).filter(|line| !line.starts_with("   "));
    let names: Vec<&str> = names.filter_map(|line| line.split_whitespace().next()).collect();
    assert!(names.len() > 15 && names.contains(&"tune"), "{names:?}");
    for name in names.iter().filter(|name| **name != "help") {
        let help = text(&[name, "--help"]);
        assert!(help.lines().all(|line| line.chars().count() <= 80), "{help}");
    }
    assert!(subcommands.lines().all(|line| line.chars().count() <= 80), "{subcommands}");
}

#[test]
fn the_verdict_is_bold_where_colors_are_wanted() {
    let colored = |name: &str, value: &str, arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_virtual_axes"));
        command.args(arguments).env_remove("NO_COLOR").env("CLICOLOR_FORCE", "1").env(name, value);
        String::from_utf8(command.output().expect("the command starts").stdout).expect("text")
    };
    let run = ["run", "x-constant"];
    let plain = text(&run);
    let (verdict, rest) = plain.split_once('\n').expect("lines");
    assert_eq!(colored("CLICOLOR", "1", &run), format!("\x1b[1m{verdict}\x1b[0m\n{rest}"));
    // Standard output of the other commands is no terminal.
    assert!(!plain.contains('\x1b'));
    for (name, value) in [("NO_COLOR", "1"), ("CLICOLOR_FORCE", "0")] {
        assert_eq!(colored(name, value, &run), plain, "{name}={value}");
    }
    for form in ["--json", "--csv"] {
        assert_eq!(
            colored("CLICOLOR", "1", &["run", "x-constant", form]),
            text(&["run", "x-constant", form])
        );
    }
}

#[test]
fn compared_runs_stand_in_columns_below_their_verdict() {
    let text = text(&["run", "ballbar", "--controller", "cascade,gpc"]);
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some("gpc: contour error 68.6 → 13.2 µm, −81 %"));
    let row = lines.find(|line| line.starts_with("contour error, max")).expect("a row");
    assert_eq!(row.split_whitespace().collect::<Vec<_>>()[3..], ["µm", "68.6", "13.2", "(−81", "%)"]);
    // Signed figures are compared by their difference.
    let row = lines.find(|line| line.contains("radial deviation, mean")).expect("a row");
    assert!(row.contains("49.0") && row.contains("−0.4 (−49.4)"), "{row}");
}

#[test]
fn quiet_prints_the_verdict_only() {
    assert_eq!(text(&["run", "ballbar", "--quiet"]), "contour error 68.6 µm max, 42.2 µm RMS\n");
    assert_eq!(text(&["run", "c-constant", "-q"]), "c: delay-compensated following error 35.4 mdeg\n");
    let two = text(&["run", "ballbar", "--controller", "cascade,gpc", "--quiet"]);
    assert_eq!(two, "gpc: contour error 68.6 → 13.2 µm, −81 %\n");
    assert_eq!(text(&["design", "gpc", "--axis", "x", "--quiet"]).lines().count(), 1);
    assert_eq!(text(&["robustness", "x-constant", "--quiet"]).lines().count(), 1);
}

#[test]
fn a_reached_limit_is_part_of_the_verdict() {
    let text = text(&["run", "x-constant", "--set", "x.motor.max_current_a=6", "--quiet"]);
    assert!(text.contains("; x at a limit of speed, current or voltage for "), "{text}");
}

#[test]
fn comma_separated_values_have_all_digits_of_the_json_output() {
    let arguments = ["run", "ballbar", "--controller", "cascade,gpc"];
    let csv = text(&[&arguments[..], &["--csv"]].concat());
    let json: serde_json::Value =
        serde_json::from_str(&text(&[&arguments[..], &["--json"]].concat())).expect("JSON");
    assert_eq!(csv.lines().next(), Some("run,figure,value,unit"));
    let row = csv.lines().find(|line| line.starts_with("gpc,\"contour error, max\",")).expect("a row");
    let value: f64 = row.split(',').nth(3).expect("a value").parse().expect("a number");
    assert_eq!(value, json["runs"][1]["contour_error_um"]["max"].as_f64().expect("a number"));
    let circle = &json["runs"][0]["circles"][0];
    assert_eq!(circle["feed_m_min"].as_f64().map(|feed| (feed * 1e6).round() / 1e6), Some(15.0));
    let spikes: Vec<f64> =
        circle["reversal_spikes_um"].as_object().expect("four").values().filter_map(|v| v.as_f64()).collect();
    // The largest spike reaches the largest radial deviation.
    let deviation = &circle["radial_deviation_um"];
    let height = deviation["max"].as_f64().expect("max") - deviation["mean"].as_f64().expect("mean");
    assert_eq!(spikes.len(), 4);
    assert!((spikes.iter().copied().fold(0.0, f64::max) - height).abs() < 1e-9);
    for list in [vec!["design", "gpc"], vec!["robustness", "x-constant"]] {
        let csv = text(&[&list[..], &["--csv"]].concat());
        let columns = csv.lines().next().expect("a heading").split(", ").count();
        assert!(columns >= 1 && csv.lines().count() > 2, "{csv}");
    }
}

#[test]
fn forms_of_output_exclude_each_other() {
    for pair in [["--json", "--csv"], ["--quiet", "--json"], ["--quiet", "--csv"]] {
        assert_eq!(run(&["run", "x-constant", pair[0], pair[1]]).status.code(), Some(2), "{pair:?}");
    }
}

#[test]
fn compare_takes_lists_as_values() {
    let r = "x.position_loop.rst.r=[1.0, -0.5],x.position_loop.rst.s=[1.0],x.position_loop.rst.t=[0.5]";
    let compared = format!("{r},x.position_loop.rst.t_first=0,x.position_loop.controller=rst");
    let output = run(&["run", "x-constant", "--compare", &compared]);
    let message = String::from_utf8_lossy(&output.stderr);
    // The list is read as a whole: the loop that it closes is stable.
    assert!(output.status.success(), "{message}");
    let verdict = String::from_utf8_lossy(&output.stdout).lines().next().unwrap_or_default().to_owned();
    assert!(verdict.contains("x.position_loop.rst.r=[1.0, -0.5]"), "{verdict}");
}

#[test]
fn a_report_has_verdict_and_provenance_and_equal_bytes_for_equal_dates() {
    let folder = TestFolder::new("report_provenance");
    let page = folder.0.join("page.html");
    let path = page.to_string_lossy().into_owned();
    let arguments = ["run", "ballbar", "--controller", "cascade,gpc", "--report", &path];
    let write = || {
        let status = Command::new(env!("CARGO_BIN_EXE_virtual_axes"))
            .args(arguments)
            .env("SOURCE_DATE_EPOCH", "1790000000")
            .output()
            .expect("the command starts")
            .status;
        assert!(status.success());
        std::fs::read_to_string(&page).expect("a page")
    };
    let first = write();
    assert!(first.contains("<p class=\"verdict\">gpc: contour error 68.6 → 13.2 µm, −81 %</p>"));
    for wanted in [
        "2026-09-21",
        "virtual_axes run ballbar <span class=\"word\">--controller</span> cascade,gpc",
        "mikron_ucp710",
        "ISO 230-4",
    ] {
        assert!(first.contains(wanted), "{wanted}");
    }
    let digest = blake3::hash(include_bytes!("../../config/mikron_ucp710.yaml")).to_hex().to_string();
    assert!(first.contains(&digest));
    assert_eq!(first, write());
}

#[test]
fn a_feed_that_is_not_reached_is_a_remark() {
    let folder = TestFolder::new("unreached_feed");
    let scenario = "description: One line\nfeed_m_min: 6000\nmoves:\n  - line: {x_mm: 50}\n";
    let file = folder.file("feed.yaml", scenario);
    let file = file.to_str().expect("UTF-8");
    assert!(
        text(&["run", file, "--quiet"])
            .contains("; feed 6000.00 m/min not reached, at most 17.79 m/min, limited by")
    );
    assert!(!text(&["run", file, "--feed", "10"]).contains("not reached"));
}

#[test]
fn an_unstable_position_loop_is_part_of_the_verdict() {
    let verdict = |gain: &str| {
        let set = format!("x.position_loop.gain={gain}");
        text(&["run", "x-constant", "--set", &set, "--quiet"])
    };
    assert!(verdict("50").contains("; the position loop of x is unstable"));
    assert!(!verdict("1.5").contains("unstable"));
}

#[test]
fn checked_scenarios_show_path_and_range() {
    let printed = text(&["check", "corner-90"]);
    // Two lines of 50 mm at right angles.
    for line in [
        "highest feed: 10.00 m/min",
        "path: 100.000 mm, open",
        "x: start 0.000 mm, end 50.000 mm, range 0.000 to 50.000 mm\n",
        "y: start 0.000 mm, end 50.000 mm",
    ] {
        assert!(printed.contains(line), "{printed}");
    }
}

#[test]
fn setpoints_in_another_unit_or_with_another_separator_are_suspected() {
    let folder = TestFolder::new("units_of_setpoints");
    let rejected = |content: &str, words: &[&str]| {
        let file = folder.file("setpoints.csv", content);
        assert_rejected(&["run", file.to_str().expect("UTF-8")], words);
    };
    rejected("time,x\n0,0\n1,100\n", &["outside the travel limits", "are these in mm or degrees?"]);
    rejected("time;x;y\n0;0;0\n", &["separated by commas, not by semicolons"]);
}

#[test]
fn the_end_of_a_key_and_a_similar_file_name_are_suggested() {
    let folder = TestFolder::new("similar_names");
    let file = folder.file("slot.yaml", "");
    let other = file.with_extension("yml");
    assert_rejected(&["run", other.to_str().expect("UTF-8")], &["the nearest is", "slot.yaml"]);
    assert_rejected(
        &["run", "ballbar", "--compare", "gain=3"],
        &["x.position_loop.gain or x.velocity_loop.gain"],
    );
}
