//! The command `virtual_axes`: `run`, `check`, `pose`, `psec` and lists.

use std::io::{BufWriter, Write};
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;
use virtual_axes_verification::fixtures::folder::TestFolder;

fn run(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_virtual_axes")).args(arguments).output().expect("the command starts")
}

fn shipped(file: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("config").join(file);
    path.to_string_lossy().into_owned()
}

#[test]
fn a_valid_machine_file_is_accepted() {
    let output = run(&["check", &shipped("mikron_ucp710.yaml")]);
    assert!(output.status.success());
    assert_eq!(
        String::from_utf8_lossy(&output.stdout),
        "machine: Mikron UCP 710\n\
         joints: x (linear), y (linear), z (linear), a (rotary), c (rotary)\n\
         valid\n"
    );
}

#[test]
fn a_missing_machine_file_gives_one_message_and_status_2() {
    let output = run(&["check", "no/such.yaml"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(output.stdout.is_empty());
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(message.starts_with("no/such.yaml: "), "{message}");
    assert_eq!(message.lines().count(), 1);
}

#[test]
fn machines_and_parameters_are_listed() {
    let machines = run(&["machines"]);
    let text = String::from_utf8_lossy(&machines.stdout);
    assert!(text.starts_with("mikron_ucp710: Mikron UCP 710\n"), "{text}");
    let file = run(&["machines", "--show", "linear_motor_center"]).stdout;
    assert_eq!(String::from_utf8_lossy(&file), include_str!("../../config/linear_motor_center.yaml"));
    let table = run(&["parameters", "--markdown"]);
    let text = String::from_utf8_lossy(&table.stdout);
    assert!(text.contains("| `<joint>.motor.inertia_kg_m2` | 1e-9 … 1e3 kg·m² |"), "{text}");
}

#[track_caller]
fn assert_rejected(output: &Output, words: &[&str]) {
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert!(output.stdout.is_empty());
    assert_eq!(message.lines().count(), 1, "{message}");
    for word in words {
        assert!(message.contains(word), "{word} is missing in: {message}");
    }
}

#[track_caller]
fn assert_runs(arguments: &[&str]) -> String {
    let output = run(arguments);
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).expect("text")
}

/// Returns the figures of `virtual_axes run … --json`.
#[track_caller]
fn figures(arguments: &[&str]) -> Value {
    let arguments: Vec<&str> = ["run"].iter().chain(arguments).chain(&["--json"]).copied().collect();
    serde_json::from_str(&assert_runs(&arguments)).expect("one JSON object")
}

#[test]
fn setpoints_are_simulated_and_traced() {
    let folder = TestFolder::new("run");
    let psec = folder.text_file("psec.csv", "time,x\n0,0\n0.6,0.01\n");
    let trace = folder.path("trace.csv");
    assert_runs(&["run", &psec, "--trace", &trace]);
    assert_eq!(folder.names(), ["psec.csv", "trace.csv"]);
    let text = std::fs::read_to_string(&trace).expect("readable");
    assert!(text.starts_with("time,x.psec,x.position,x.velocity,x.current,"), "{text:.80}");
    assert!(text.lines().nth(101).expect("a row per position cycle").starts_with("0.6,0.01,"));
}

#[test]
fn an_axis_outside_its_travel_limits_is_reported() {
    let folder = TestFolder::new("travel_limits");
    // To the stroke's end at nearly full speed, which no axis can end at once.
    let psec = folder.text_file("psec.csv", "time,x\n0,0\n0.726,0.355\n");
    let trace = folder.path("trace.csv");
    let found = figures(&[&psec, "--trace", &trace]);
    let text = std::fs::read_to_string(&trace).expect("readable");
    let positions = text.lines().skip(1).filter_map(|line| line.split(',').nth(2)?.parse::<f64>().ok());
    let outside = positions.filter(|position| *position > 0.356).count();
    assert!(outside > 0);
    let axes = &found["runs"][0]["axes"];
    assert_eq!(axes["x"]["outside_travel_limits_s"], outside as f64 * 0.006);
    assert_eq!(axes["y"]["outside_travel_limits_s"], 0.0);
    let line = format!("x was outside its travel limits for {:.3} s", outside as f64 * 0.006);
    assert!(assert_runs(&["run", &psec]).contains(&line), "{line}");
}

#[test]
fn trajectories_without_points_are_rejected() {
    let folder = TestFolder::new("no_points");
    let file = folder.text_file("psec.yaml", "joint_names: [x]\n---\njoint_names: [y]\npoints: []\n");
    assert_rejected(&run(&["run", &file]), &["psec.yaml: no setpoints: no trajectory has points"]);
}

#[test]
fn a_pose_outside_the_travel_limits_is_reported() {
    assert!(!assert_runs(&["pose", "--joints", "x=0.1,z=-0.2"]).contains("travel"));
    assert_rejected(
        &run(&["pose", "--joints", "x=1e300"]),
        &["x is '1e300'", "from -1000000 to 1000000 m or rad"],
    );
    let beyond = assert_runs(&["pose", "--joints", "x=5,y=0.1,z=9"]);
    assert!(beyond.ends_with("; outside the travel limits: x, z\n"), "{beyond}");
    let json: Value =
        serde_json::from_str(&assert_runs(&["pose", "--json", "--joints", "c=9"])).expect("JSON");
    assert_eq!(json[0]["outside_travel_limits"], serde_json::json!([]));
}

#[test]
fn a_trace_has_one_row_per_trace_period() {
    let folder = TestFolder::new("period");
    let psec = folder.text_file("psec.csv", "time,x\n0,0\n0.6,0.01\n");
    let trace = folder.path("trace.csv");
    assert_runs(&["run", &psec, "--trace", &trace, "--trace-period", "125us"]);
    let text = std::fs::read_to_string(&trace).expect("readable");
    let times: Vec<&str> = text.lines().skip(1).take(3).filter_map(|line| line.split(',').next()).collect();
    assert_eq!(times, ["0", "0.000125", "0.00025"]);
    assert_rejected(
        &run(&["run", &psec, "--trace", &trace, "--trace-period", "130us"]),
        &["--trace-period", "130000 ns", "125000 ns"],
    );
    for (period, reason) in [("130", "must be a number with a unit"), ("-1ms", "must be greater than 0")] {
        let wrong = run(&["run", &psec, "--trace", &trace, "--trace-period", period]);
        assert_eq!(wrong.status.code(), Some(2));
        let message = String::from_utf8_lossy(&wrong.stderr);
        assert!(message.contains(&format!("'{period}' for '--trace-period <125us>': {reason}")), "{message}");
    }
}

#[test]
fn invalid_setpoints_are_rejected_with_file_and_line() {
    let folder = TestFolder::new("rejected");
    let mut long = String::from("time,x\n");
    for line in 2..5000 {
        let x = if line == 4711 { "NaN" } else { "0.1" };
        long.push_str(&format!("{},{x}\n", f64::from(line - 2) * 0.006));
    }
    for (name, text, words) in [
        ("nan.csv", "time,x\n0,0\n0.006,NaN\n", &["nan.csv:3", "x", "NaN"][..]),
        ("long.csv", &long, &["long.csv:4711", "x", "NaN"]),
        ("far.csv", "time,x\n0,0\n10,2.5\n", &["far.csv", "x", "0.355", "travel limits"]),
        ("fast.csv", "time,x\n0,0\n0.1,0.3\n", &["fast.csv", "x", "0.5"]),
        ("endless.csv", "time,x\n0,0\n1e300,0\n", &["endless.csv:3", "time is 1e300 s"]),
        ("joint.csv", "time,q\n0,0\n", &["joint.csv", "q"]),
        ("columns.csv", "time,x,y\n0,0,0\n0.006,0\n", &["columns.csv", "3"]),
        ("notime.csv", "x,y\n0,0\n", &["notime.csv", "time"]),
        ("back.csv", "time,x\n0,0\n0.1,0\n0.05,0\n", &["back.csv", "0.05", "0.1"]),
    ] {
        let psec = folder.text_file(name, text);
        for (option, output) in [("--trace", "t.csv"), ("--trace", "t.mcap"), ("--report", "r.html")] {
            assert_rejected(&run(&["run", &psec, option, &folder.path(output)]), words);
        }
        std::fs::remove_file(psec).expect("can be removed");
        assert!(folder.names().is_empty(), "{name} leaves {:?}", folder.names());
    }
}

#[test]
fn invalid_scenarios_are_rejected_with_file_and_line() {
    let folder = TestFolder::new("scenarios");
    let moves = "moves:\n  - line: {x_mm: 50}\n";
    let of = |head: &str| format!("description: d\n{head}{moves}");
    for (name, text, words) in [
        ("typo.yaml", of("fed_m_min: 10\n"), &["typo.yaml:2", "fed_m_min", "feed_m_min"][..]),
        ("nofeed.yaml", of(""), &["nofeed.yaml:3", "feed_m_min"]),
        ("nan.yaml", of("feed_m_min: .nan\n"), &["nan.yaml", "feed_m_min", "NaN"]),
        ("negative.yaml", of("feed_m_min: -1\n"), &["negative.yaml", "feed_m_min", "-1"]),
        ("rest.yaml", of("feed_m_min: 1\nrest_s: -2\n"), &["rest.yaml", "rest_s", "-2"]),
        ("text.yaml", of("feed_m_min: fast\n"), &["text.yaml:2", "fast"]),
        ("slow.yaml", of("feed_m_min: 1e-300\n"), &["slow.yaml", "86400 s"]),
        ("jerk.yaml", of("feed_m_min: 1\nlimits: {jerk_m_s3: 1e-300}\n"), &["jerk.yaml", "86400 s"]),
        (
            "ramp.yaml",
            "description: d\nfeed_m_min: 6\nmoves:\n  - {line: {x_mm: 10}, ramp_s: 10}\n".to_owned(),
            &["ramp.yaml:4", "ramp_s", "10", "at most 0.1 s"],
        ),
        (
            "turns.yaml",
            "description: d\nfeed_m_min: 1\nmoves:\n  - arc: {center: {x_mm: 1, y_mm: 0}, turns: 1e9}\n"
                .to_owned(),
            &["turns.yaml", "86400 s"],
        ),
        (
            "plane.yaml",
            "description: d\nfeed_m_min: 1\nmoves:\n  - arc: {center: {x_mm: 1, c_deg: 0}, turns: 1}\n"
                .to_owned(),
            &["plane.yaml:4", "c", "rotary"],
        ),
        (
            "joint.yaml",
            "description: d\nfeed_m_min: 1\nmoves:\n  - line: {xx_mm: 5}\n".to_owned(),
            &["joint.yaml:4", "xx_mm", "x_mm"],
        ),
        (
            "two.yaml",
            "description: d\nfeed_m_min: 1\nmoves:\n  - {line: {x_mm: 5}, dwell_s: 1}\n".to_owned(),
            &["two.yaml:4", "exactly one"],
        ),
        (
            "far.yaml",
            "description: d\nfeed_m_min: 1\nmoves:\n  - line: {x_mm: 5000}\n".to_owned(),
            &["far.yaml", "move 1", "x", "0.355", "travel limits"],
        ),
        ("empty.yaml", "description: d\nmoves: []\n".to_owned(), &["empty.yaml", "0 moves"]),
        (
            "still.yaml",
            "description: d\nfeed_m_min: 1\nmoves:\n  - line: {x_mm: 0}\n".to_owned(),
            &["still.yaml:4"],
        ),
    ] {
        let file = folder.text_file(name, &text);
        for (option, output) in [("--trace", "t.csv"), ("--report", "r.html")] {
            assert_rejected(&run(&["run", &file, option, &folder.path(output)]), words);
        }
        assert_rejected(&run(&["psec", &file, "--out", &folder.path("p.csv")]), words);
        assert_rejected(&run(&["check", &file]), words);
        std::fs::remove_file(file).expect("can be removed");
        assert!(folder.names().is_empty(), "{name} leaves {:?}", folder.names());
    }
    assert_rejected(&run(&["run", "balbar"]), &["balbar", "ballbar", "corner-90"]);
}

#[test]
fn a_trace_does_not_replace_its_input_or_other_files() {
    let folder = TestFolder::new("replaced");
    let text = "time,x\n0,0\n0.06,0.001\n";
    let psec = folder.text_file("psec.csv", text);
    let other = folder.text_file("trace.partial", "keep");
    assert_rejected(&run(&["run", &psec, "--trace", &psec]), &["psec.csv", "replace"]);
    assert_rejected(&run(&["run", &psec, "--report", &psec]), &["psec.csv", "replace"]);
    assert_runs(&["run", &psec, "--trace", &folder.path("trace.csv")]);
    assert_eq!(std::fs::read_to_string(psec).expect("readable"), text);
    assert_eq!(std::fs::read_to_string(other).expect("readable"), "keep");
}

#[test]
fn a_full_disk_is_reported() {
    let folder = TestFolder::new("full");
    let psec = folder.text_file("psec.csv", "time,x\n0,0\n0.06,0.001\n");
    for (command, option) in [("run", "--trace"), ("run", "--report")] {
        for extension in ["csv", "mcap"] {
            if (option, extension) == ("--report", "mcap") {
                continue;
            }
            // The file name selects the format, the link the destination.
            let link = folder.0.join(format!("full.{extension}"));
            std::os::unix::fs::symlink("/dev/full", &link).expect("a link can be made");
            let link = link.to_string_lossy().into_owned();
            assert_rejected(&run(&[command, &psec, option, &link]), &["full."]);
            std::fs::remove_file(link).expect("can be removed");
        }
    }
    for extension in ["csv", "mcap", "yaml"] {
        let link = folder.0.join(format!("full.{extension}"));
        std::os::unix::fs::symlink("/dev/full", &link).expect("a link can be made");
        assert_rejected(&run(&["psec", "corner-90", "--out", &link.to_string_lossy()]), &["full."]);
        std::fs::remove_file(link).expect("can be removed");
    }
    assert_eq!(folder.names(), ["psec.csv"]);
}

#[test]
fn setpoints_of_a_scenario_give_the_figures_of_the_scenario() {
    let folder = TestFolder::new("psec");
    let scenario = figures(&["corner-90"]);
    for extension in ["csv", "mcap", "yaml"] {
        let file = folder.path(&format!("corner.{extension}"));
        assert_runs(&["psec", "corner-90", "--out", &file]);
        let found = figures(&[&file]);
        // Equal setpoints give bit-identical figures of the axes.
        let (expected, found) = (&scenario["runs"][0]["axes"], &found["runs"][0]["axes"]);
        assert_eq!(found, expected, "{extension}");
    }
}

#[test]
fn several_runs_are_compared() {
    let runs = figures(&["x-constant", "--controller", "cascade,cascade-noff"]);
    let error = |run: usize| {
        let axis = &runs["runs"][run]["axes"]["x"];
        axis["delay_compensated_following_error"]["max"].as_f64().expect("a number")
    };
    // Prévost's feedforward against none: 218.9 and 6666.7 µm.
    assert!((error(0) - 218.9).abs() < 2.189, "{}", error(0));
    assert!((error(1) - 6666.7).abs() < 66.67, "{}", error(1));
    assert_eq!(runs["runs"][1]["controller"], "cascade-noff");
    let compared = figures(&["x-constant", "--compare", "x.position_loop.gain=3,x.feedforward.velocity=0"]);
    assert_eq!(compared["runs"].as_array().map(Vec::len), Some(2));
    assert_eq!(compared["runs"][1]["changes"][0], "x.position_loop.gain=3");
    assert_rejected(
        &run(&["run", "x-constant", "--controller", "cascade,cascade-noff", "--trace", "t.csv"]),
        &["--trace", "2"],
    );
}

#[test]
fn the_feed_of_a_scenario_can_be_overridden() {
    let lag = |feed: &[&str]| {
        let arguments: Vec<&str> =
            ["x-constant", "--controller", "cascade-noff"].iter().chain(feed).copied().collect();
        let found = figures(&arguments);
        found["runs"][0]["axes"]["x"]["delay_compensated_following_error"]["max"].as_f64().expect("a number")
    };
    // The lag is V/Kp with Kp = 25 s⁻¹: half the feed gives half the lag.
    assert!((lag(&["--feed", "5"]) - 5e6 / 60.0 / 25.0).abs() < 33.3);
    assert_rejected(&run(&["run", "c-two-speeds", "--feed", "5"]), &["--feed", "c-two-speeds"]);
    assert_rejected(&run(&["run", "x-constant", "--feed", "-5"]), &["--feed", "-5"]);
    assert_rejected(&run(&["run", "x-constant", "--feed", "nan"]), &["--feed", "NaN"]);
}

#[test]
fn table_and_json_contain_the_same_figures() {
    let table = assert_runs(&["run", "corner-90"]);
    let found = figures(&["corner-90"]);
    let corner = found["runs"][0]["corners"][0]["max_contour_error_um"].as_f64().expect("a number");
    let row = |begin: &str| -> Vec<&str> {
        let line = table.lines().find(|line| line.starts_with(begin));
        line.unwrap_or_else(|| panic!("no {begin} in {table}")).split_whitespace().collect()
    };
    assert!(row("corner after move 1, 90°").contains(&format!("{corner:.1}").as_str()), "{table}");
    let x = found["runs"][0]["axes"]["x"]["peak_current_a"].as_f64().expect("a number");
    assert!(row("x ").contains(&format!("{x:.2}").as_str()), "{table}");
}

#[test]
fn completions_contain_subcommands_scenarios_machines_programs_parameters_and_files() {
    let folder = TestFolder::new("completions");
    let file = folder.file("ball.csv", "time,x\n");
    let candidates = |words: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_virtual_axes"));
        command.env("VIRTUAL_AXES_COMPLETE", "fish").args(["--", "virtual_axes"]).args(words);
        command.current_dir(file.parent().expect("a folder"));
        let text = String::from_utf8(command.output().expect("the command starts").stdout).expect("text");
        text.lines().map(|line| line.split('\t').next().unwrap_or_default().to_owned()).collect::<Vec<_>>()
    };
    for (words, expected) in [
        (&["rob"][..], &["robustness"][..]),
        (&["run", "ball"], &["ballbar", "ballbar-both", "ball.csv"]),
        (&["check", "circle-d"], &["circle-diamond-square"]),
        (&["tune", "corner-90", "--also", "corner-4"], &["corner-45"]),
        (&["run", "ballbar", "--machine", "gan"], &["gantry_router"]),
        (&["machines", "--new", "vm"], &["vmc", "vmc_a"]),
        (&["run", "ballbar", "--set", "y.velocity_loop.g"], &["y.velocity_loop.gain="]),
        (&["run", "ballbar", "--trace-pe"], &["--trace-period"]),
    ] {
        assert_eq!(candidates(words), expected, "{words:?}");
    }
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        assert!(assert_runs(&["completions", shell]).contains("VIRTUAL_AXES_COMPLETE"), "{shell}");
    }
}

#[test]
fn man_pages_have_the_options_of_each_command() {
    let folder = TestFolder::new("man");
    let pages = folder.path("man1");
    assert_eq!(assert_runs(&["man", &pages]), "");
    let page = |name: &str| std::fs::read_to_string(Path::new(&pages).join(name)).expect(name);
    assert!(page("virtual_axes.1").contains("Virtual machine\\-tool axes"));
    let tune = page("virtual_axes-tune.1");
    assert!(tune.contains("\\-\\-modulus\\-margin") && tune.contains("Smallest modulus margin"), "{tune}");
    let output = run(&["man", &folder.text_file("file", "")]);
    assert_rejected(&output, &["name a folder that can be written"]);
}

/// Returns the peak resident memory of a run over a generated file of `seconds`, kB.
fn peak_memory(folder: &TestFolder, seconds: u32) -> u64 {
    let path = folder.path("long.csv");
    {
        let mut file = BufWriter::new(std::fs::File::create(&path).expect("a file can be made"));
        writeln!(file, "time,x").expect("writable");
        for k in 0..seconds * 100 {
            let time = f64::from(k) * 0.01;
            writeln!(file, "{time},{}", 0.1 * (1.0 - (0.5 * time).cos())).expect("writable");
        }
    }
    let program = env!("CARGO_BIN_EXE_virtual_axes");
    // /proc is available everywhere, `ulimit` and `/usr/bin/time` are not.
    let mut child = Command::new(program)
        .args(["run", &path, "--json"])
        .stdout(Stdio::null())
        .spawn()
        .expect("the command starts");
    let status = format!("/proc/{}/status", child.id());
    let mut peak = 0;
    while child.try_wait().expect("it can be waited for").is_none() {
        let text = std::fs::read_to_string(&status).unwrap_or_default();
        let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        let now = line.and_then(|line| line.trim().trim_end_matches(" kB").parse().ok()).unwrap_or(0);
        peak = peak.max(now);
        std::thread::sleep(std::time::Duration::from_millis(2));
    }
    assert!(child.wait().expect("it has ended").success());
    peak
}

#[test]
fn memory_is_independent_of_the_number_of_setpoints() {
    let folder = TestFolder::new("memory");
    // A run can end after the last sample of its peak, so that a single short run appears smaller.
    let short = (0..5).map(|_| peak_memory(&folder, 60)).max().unwrap_or_default();
    let long = peak_memory(&folder, 600);
    println!("{short} kB for a minute, {long} kB for ten");
    assert!(short > 0, "memory can be read");
    // In memory, ten minutes of five axes are 4 MB of setpoints.
    assert!(long < short + 1024, "{short} kB for a minute, {long} kB for ten");
}

#[test]
fn an_interrupted_command_leaves_no_file() {
    for signal in ["INT", "TERM"] {
        let folder = TestFolder::new(&format!("interrupted_{signal}"));
        let psec = folder.text_file("psec.csv", "time,x\n0,0\n350000,0.3\n");
        let mut child = Command::new(env!("CARGO_BIN_EXE_virtual_axes"))
            .args(["run", &psec, "--trace", &folder.path("trace.csv")])
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .expect("the command starts");
        let until = Instant::now() + Duration::from_secs(60);
        while folder.names().len() < 2 {
            assert!(Instant::now() < until, "no trace was started");
            assert_eq!(child.try_wait().expect("it is a child"), None, "it ended before a trace was started");
            std::thread::sleep(Duration::from_millis(10));
        }
        let id = child.id().to_string();
        assert!(Command::new("kill").args(["-s", signal, &id]).status().expect("kill runs").success());
        let status = child.wait().expect("it ends");
        assert_eq!(status.code(), Some(130), "{signal}");
        assert_eq!(folder.names(), ["psec.csv"], "{signal}");
    }
}

#[test]
fn outputs_do_not_replace_each_other() {
    let folder = TestFolder::new("outputs");
    let (csv, page) = (folder.path("o.csv"), folder.path("o.html"));
    assert_rejected(
        &run(&["run", "corner-90", "--trace", &csv, "--report", &csv]),
        &["o.csv", "trace", "report"],
    );
    assert_rejected(&run(&["run", "corner-90", "--report", &csv]), &["o.csv", ".html"]);
    assert_rejected(&run(&["run", "corner-90", "--trace", &page]), &["o.html", ".csv", ".mcap"]);
    assert!(folder.names().is_empty(), "{:?}", folder.names());
}

#[test]
fn a_full_standard_output_is_reported() {
    let full = std::fs::File::options().write(true).open("/dev/full").expect("it is there");
    let mut command = Command::new(env!("CARGO_BIN_EXE_virtual_axes"));
    let output = command.args(["run", "corner-90", "--json"]).stdout(full).output().expect("it runs");
    assert_rejected(&output, &["standard output"]);
}

#[test]
fn a_machine_without_a_tool_has_no_contour_error() {
    let folder = TestFolder::new("names");
    let text = std::fs::read_to_string(shipped("mikron_ucp710.yaml")).expect("it is there");
    // The joints are named u, v and w: none is x, y or z.
    let mut renamed = text.replace("\"x\", \"y\", \"z\"", "\"u\", \"v\", \"w\"");
    for (from, to) in [("\n    x:", "\n    u:"), ("\n    y:", "\n    v:"), ("\n    z:", "\n    w:")] {
        renamed = renamed.replace(from, to);
    }
    let machine = folder.text_file("machine.yaml", &renamed);
    let psec = folder.text_file("psec.csv", "time,u\n0,0\n0.6,0.01\n");
    let printed = assert_runs(&["run", &psec, "--machine", &machine]);
    assert!(printed.contains("no contour error: no linear joint is named x, y or z"), "{printed}");
}

#[test]
fn shipped_machines_and_scenarios_are_checked_by_name() {
    assert!(assert_runs(&["check", "linear_motor_center"]).contains("valid"));
    assert!(assert_runs(&["check", "corner-90"]).contains("valid"));
    assert_rejected(&run(&["check", "corner-91"]), &["corner-91", "corner-90", "linear_motor_center"]);
}

#[test]
fn an_unknown_scenario_suggests_the_nearest_name() {
    for arguments in
        [["run", "balbar"], ["check", "balbar"], ["tune", "balbar"], ["scenarios", "--show=balbar"]]
    {
        assert_rejected(&run(&arguments), &["balbar: ", "; the nearest is ballbar"]);
    }
    for arguments in [
        &["check", "linear_moter_center"][..],
        &["machines", "--show", "linear_moter_center"],
        &["run", "ballbar", "--machine", "linear_moter_center"],
    ] {
        assert_rejected(&run(arguments), &["; the nearest is linear_motor_center"]);
    }
    let unrelated = run(&["run", "no/such.yaml"]);
    assert!(!String::from_utf8_lossy(&unrelated.stderr).contains("nearest"));
}

#[test]
fn a_controller_uses_its_parameters_of_the_command_line() {
    let folder = TestFolder::new("rst_options");
    let psec = folder.text_file("psec.csv", "time,x\n0,0\n0.6,0.01\n");
    let polynomials = ["r=[132.0]", "s=[1.0]", "t=[132.0]"];
    let set: Vec<String> = ["x", "y", "z", "a", "c"]
        .iter()
        .flat_map(|axis| polynomials.map(|value| format!("--set={axis}.position_loop.rst.{value}")))
        .collect();
    let mut arguments = vec!["run", &psec, "--controller", "rst"];
    assert_rejected(&run(&arguments), &["--controller: x.position_loop.rst.r is missing"]);
    arguments.extend(set.iter().map(String::as_str));
    assert_runs(&arguments);
    // The controller of a removed axis is not set.
    let joints = ["run", &psec, "--controller", "gpc", "--set=joints=[x,y,z]"];
    assert_runs(&joints);
}

#[test]
fn control_characters_are_escaped() {
    let folder = TestFolder::new("control_characters");
    let text = include_str!("../../config/mikron_ucp710.yaml");
    let renamed = text.replace("machine: Mikron UCP 710", "machine: \"Mill \\e[31m\\u202e\"");
    assert_ne!(renamed, text);
    let machine = folder.text_file("machine.yaml", &renamed);
    assert!(assert_runs(&["check", &machine]).starts_with("machine: Mill \\u{1b}[31m\\u{202e}\n"));
    let psec = folder.text_file("psec.csv", "time,x\n0,0\n0.6,0.01\n");
    assert!(assert_runs(&["check", &psec, "--machine", &machine]).contains("Mill \\u{1b}[31m\\u{202e}: "));
    assert_rejected(&run(&["run", "a\u{1b}[31m.csv"]), &["a\\u{1b}[31m.csv: "]);
    let unexpected = run(&["check", &psec, "a\u{9b}31m"]);
    assert_eq!(unexpected.status.code(), Some(2));
    let message = String::from_utf8_lossy(&unexpected.stderr);
    assert!(message.contains("a\\u{9b}31m"), "{message}");
    assert!(!message.contains('\u{9b}'), "{message}");
}

#[test]
fn a_machine_file_for_another_node_gives_a_warning() {
    let folder = TestFolder::new("node_key");
    let text = include_str!("../../config/mikron_ucp710.yaml");
    assert!(text.contains("\n/**:\n"));
    for (key, is_foreign) in
        [("foo", true), ("/**", false), ("virtual_axes", false), ("/cell/virtual_axes", false)]
    {
        let file = folder.text_file("machine.yaml", &text.replace("\n/**:\n", &format!("\n{key}:\n")));
        let output = run(&["check", &file]);
        assert!(output.status.success());
        assert!(String::from_utf8_lossy(&output.stdout).ends_with("valid\n"));
        let message = String::from_utf8_lossy(&output.stderr);
        let warning = "machine.yaml: the node key foo does not match the node virtual_axes";
        assert_eq!(message.contains(warning), is_foreign, "{message}");
        assert_eq!(message.lines().count(), usize::from(is_foreign), "{message}");
    }
}
