//! The command `virtual_axes identify` on production traces.

use std::sync::LazyLock;

use virtual_axes_core::config::AxisConfig;
use virtual_axes_verification::fixtures::folder::TestFolder;
use virtual_axes_verification::production_traces::{
    AxisGuess, HiddenMachine, TraceRecorder, machine_file, write_csv,
};

use crate::command_common::{json, printed, run};

/// Seed of the machine.
const SEED: u64 = 6000;
/// Parameter groups without the position-loop gain, of which several start values take longer.
const REFINE: [&str; 2] = ["--refine", "inertia,friction,gravity,feedforward"];

/// Files of a machine with the axes X and Z.
struct Files {
    trace: String,
    machine: String,
    guesses: Vec<AxisGuess>,
}

/// Trace and machine file, written once.
static FILES: LazyLock<Files> = LazyLock::new(|| {
    // A static is never dropped: the folder remains until the next test run.
    let folder = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("identify_traces");
    std::fs::create_dir_all(&folder).expect("a folder can be made");
    let path = |name: &str| folder.join(name).to_string_lossy().into_owned();
    let mut hidden = HiddenMachine::draw(SEED);
    hidden.axes.retain(|axis| axis.config.name != "y");
    let program = hidden.program(1, 8.0).expect("a program");
    let recordings = hidden.record(&program, &TraceRecorder::default(), 1).expect("recordings");
    let files = Files {
        trace: path("trace.csv"),
        machine: path("guess.yaml"),
        guesses: hidden.axes.iter().map(|axis| axis.guess(SEED)).collect(),
    };
    write_csv(files.trace.as_ref(), &recordings).expect("a trace");
    let axes: Vec<&AxisConfig> = files.guesses.iter().map(|guess| &guess.config).collect();
    let text = machine_file("Guess.", &axes, files.guesses[0].periods).expect("in range");
    std::fs::write(&files.machine, text).expect("a machine file");
    files
});

#[test]
fn without_axis_the_columns_and_the_next_command_are_listed() {
    let files = &*FILES;
    let text = printed(&["identify", &files.trace, "--machine", &files.machine]);
    let row = |header: &str| {
        let line = text.lines().find(|line| line.contains(header));
        line.unwrap_or_else(|| panic!("{header} in {text}")).split_whitespace().collect::<Vec<_>>()
    };
    for (axis, name) in [("X", "x"), ("Z", "z")] {
        for (signal, channel) in [
            ("commanded position", "psec"),
            ("actual position", "position"),
            ("actual velocity", "velocity"),
            ("current [A]", "current"),
        ] {
            let cells = row(&format!("{axis} {signal}"));
            assert!(cells.contains(&channel), "{cells:?}");
            assert!(cells.iter().any(|cell| cell.eq_ignore_ascii_case(name)), "{cells:?}");
        }
    }
    let next = format!(
        "next: virtual_axes identify {} --axis all --machine {} --out identified.yaml --report identified.html\n",
        files.trace, files.machine
    );
    assert!(text.contains(&next), "{text}");
    assert!(text.contains("--axis x, --axis z\n"), "{text}");
}

#[test]
fn all_axes_are_identified_into_one_machine_file() {
    let (files, folder) = (&*FILES, TestFolder::new("identify_all"));
    let out = folder.path("identified.yaml");
    let arguments = ["identify", &files.trace, "--axis", "all", "--machine", &files.machine];
    let found = json(&[arguments.as_slice(), &REFINE, &["--json", "--out", &out]].concat());
    let found = found.as_array().expect("a list");
    let names: Vec<&str> = found.iter().filter_map(|axis| axis["axis"].as_str()).collect();
    assert_eq!(names, ["x", "z"]);
    for axis in found {
        let baseline = &axis["agreement"][0]["baseline"];
        let [command, lag, delayed, model] =
            ["command", "lag_ms", "delayed", "model"].map(|key| baseline[key].as_f64().expect("a number"));
        assert!(model < delayed && delayed < command && lag > 0.0, "{baseline}");
    }
    assert!(printed(&["check", &out]).ends_with("valid\n"));
    let machine = std::fs::read_to_string(&out).expect("it is there");
    let values: usize = found.iter().filter_map(|axis| axis["values"].as_array().map(Vec::len)).sum();
    // An interval that is wider than its value is not called identified.
    let marked = ["# identified: ", "# estimated: "].map(|mark| machine.matches(mark).count());
    assert_eq!(marked.iter().sum::<usize>(), values);
    let uncertain = found.iter().filter_map(|axis| axis["values"].as_array()).flatten();
    let is_uncertain = |value: &&serde_json::Value| {
        value["source"].as_str().is_some_and(|source| source.contains("not identified"))
    };
    assert_eq!(marked[1], uncertain.filter(is_uncertain).count());
    let one = ["identify", &files.trace, "--axis", "x", "--machine", &files.machine];
    // Where a line breaks depends on the length of the path.
    let text = printed(&[one.as_slice(), &REFINE].concat());
    let words: Vec<&str> = text.split_whitespace().collect();
    assert!(words.join(" ").contains("position RMS from PSEC "), "{text}");
}

/// Moves of X and Y with a lag of three and four position cycles of 2 ms.
const TWO_AXES: &str = "description: two axes
frame: joints
moves:
  - line: {x_mm: -116.139, y_mm: -111.114}
    feed_m_min: 12.65
  - dwell_s: 0.3
  - line: {x_mm: -211.28, y_mm: 13.833}
    feed_m_min: 7.52
  - line: {x_mm: -104.843, y_mm: 124.029}
    feed_m_min: 9
  - line: {x_mm: 132.197, y_mm: -85.838}
    feed_m_min: 18.3
  - dwell_s: 0.3
  - line: {x_mm: 75.549, y_mm: 1.667}
    feed_m_min: 5.1
";

/// Moves in which X hardly moves, so that its positions fit cycles of 2 and 6 ms alike.
const HARDLY_MOVED_X: &str = "description: two axes
frame: joints
moves:
  - line: {y_mm: -111.114}
    feed_m_min: 12.65
  - dwell_s: 0.3
  - line: {x_mm: 2}
    feed_m_min: 0.1
  - line: {y_mm: 124.029}
    feed_m_min: 9
  - line: {x_mm: 0}
    feed_m_min: 0.1
  - line: {y_mm: -85.838}
    feed_m_min: 18.3
  - dwell_s: 0.3
  - line: {y_mm: 1.667}
    feed_m_min: 5.1
";

/// Identifies X and Y from `moves` of a control with position cycles of 2 ms, with the lag `alpha` of X in ms, and expects
/// these and the lags. Returns the reason why X was identified again.
fn shared_cycle(folder: &TestFolder, moves: &str, alpha: f64) -> Option<String> {
    let program = folder.text_file("moves.yaml", moves);
    let (trace, out) = (folder.path("trace.csv"), folder.path("identified.yaml"));
    let of_x = format!("x.delays.alpha_ms={alpha}");
    let truth = ["periods.position_ms=2", &of_x, "x.delays.beta_ms=4", "y.delays.alpha_ms=8"];
    let truth: Vec<&str> = truth.iter().flat_map(|set| ["--set", set]).collect();
    let record = ["run", &program, "--trace", &trace, "--trace-period", "20ms", "--quiet"];
    printed(&[record.as_slice(), &truth].concat());
    let identify = ["identify", &trace, "--axis", "all", "--feedforward", "both", "--json", "--out", &out];
    let found = json(&[identify.as_slice(), &REFINE].concat());
    for (axis, alpha) in found.as_array().expect("a list").iter().zip([alpha, 8.0]) {
        let delay = &axis["delays"][0];
        assert_eq!(delay["interval_ms"], serde_json::json!([alpha - 2.0, alpha]), "{delay}");
    }
    let machine = std::fs::read_to_string(&out).expect("it is there");
    assert!(machine.contains("position_ms: 2.0  # identified: "), "{machine}");
    let mut findings = found[0]["findings"].as_array().into_iter().flatten();
    let shared = findings.find(|finding| finding["code"] == "position-cycle-shared");
    shared.and_then(|finding| finding["text"].as_str()).map(str::to_owned)
}

#[test]
fn axes_that_show_their_position_cycle_are_identified_once() {
    // The position cycle of the default machine, 6 ms, divides no lag.
    assert_eq!(shared_cycle(&TestFolder::new("identify_cycle"), TWO_AXES, 4.0), None);
}

#[test]
fn all_axes_are_identified_with_one_position_cycle() {
    let text = shared_cycle(&TestFolder::new("identify_shared_cycle"), HARDLY_MOVED_X, 6.0);
    let expected = "identified again with a position cycle of 2 ms, which y requires and all axes share";
    assert_eq!(text.as_deref(), Some(expected));
}

#[test]
fn traces_without_feedforward_show_neither_its_weights_nor_its_delays() {
    let folder = TestFolder::new("identify_off");
    let program = folder.text_file("moves.yaml", TWO_AXES);
    let (off, both) = (folder.path("off.csv"), folder.path("both.csv"));
    let record = |trace: &str, set: &[&str]| {
        let run = ["run", &program, "--trace", trace, "--trace-period", "20ms", "--quiet"];
        printed(&[run.as_slice(), set].concat());
    };
    record(&off, &["--set", "x.feedforward.velocity=0", "--set", "x.feedforward.torque_kg_m2=0"]);
    record(&both, &[]);
    let two = ["identify", &off, &off, "--axis", "x", "--feedforward", "off,off"];
    let of = |validated: &str| -> serde_json::Value {
        json(&[two.as_slice(), &REFINE, &["--validate", validated, "--json"]].concat())
    };
    let model =
        |found: &serde_json::Value, of: &str| found[of][0]["baseline"]["model"].as_f64().expect("a number");
    let found = of(&off);
    // The machine file has rounded values.
    assert!((model(&found, "validation") / model(&found, "agreement") - 1.0).abs() < 1e-3, "{found}");
    let is_key = |key: &str| {
        let values = found["values"].as_array().into_iter().flatten();
        values.filter_map(|value| value["key"].as_str()).any(|known| known.contains(key))
    };
    assert!(is_key("delays.alpha_ms") && !is_key("feedforward") && !is_key("beta") && !is_key("gamma"));
    let text = printed(&[two.as_slice(), &REFINE].concat());
    assert!(text.contains("note: VFFW, TFFW, β and γ are unchanged"), "{text}");
    for part in ["NaN", "VFFW and α", "with feedforward\n", "β and γ are counted"] {
        assert!(!text.contains(part), "{part:?} in {text}");
    }
    // The feedforward of a validation recording is inferred if the recordings differ in theirs.
    let mixed = ["identify", &off, &both, "--axis", "x", "--feedforward", "off,both"];
    let found = json(&[mixed.as_slice(), &REFINE, &["--validate", &off, "--json"]].concat());
    assert_eq!(found["validation"][0]["feedforward"], serde_json::json!(["off"]));
    assert!(model(&found, "validation") < 1.5 * model(&found, "agreement"), "{found}");
}

#[test]
fn an_invalid_result_is_printed_but_not_written() {
    let (files, folder) = (&*FILES, TestFolder::new("identify_invalid"));
    let out = folder.path("identified.yaml");
    let constant = 10.0 * files.guesses[0].config.motor.torque_constant;
    let set = format!("x.motor.torque_constant_nm_a={constant}");
    let one = ["identify", &files.trace, "--axis", "x", "--machine", &files.machine];
    let output = run(&[one.as_slice(), &REFINE, &["--set", &set, "--out", &out]].concat());
    let [stdout, stderr] = [output.stdout, output.stderr].map(|text| String::from_utf8(text).expect("UTF-8"));
    assert_eq!(output.status.code(), Some(3), "{stderr}");
    assert!(stdout.contains("x.motor.inertia_kg_m2 ") && stdout.contains("\ninvalid: "), "{stdout}");
    assert!(
        stderr.starts_with("invalid result, no machine file is written:\nx: motor inertia: "),
        "{stderr}"
    );
    assert!(stderr.contains("; check torque constant"), "{stderr}");
    assert!(folder.names().is_empty());
}

#[test]
fn intervals_contain_the_drive_if_every_second_position_cycle_is_recorded() {
    let folder = TestFolder::new("identify_thinned");
    let [psec, whole, thinned] = ["psec.csv", "whole.csv", "thinned.csv"].map(|name| folder.path(name));
    let campaign = ["--axis", "x", "--part", "off", "--range=-40,40", "--max-feed", "5"];
    printed(&[&["psec", "campaign", "--out", &psec], &campaign[..]].concat());
    let off = ["--set", "x.feedforward.velocity=0", "--set", "x.feedforward.torque_kg_m2=0"];
    printed(&[&["run", &psec, "--trace", &whole, "--quiet"], &off[..]].concat());
    // The last 24 s, with the highest speeds.
    let text = std::fs::read_to_string(&whole).expect("a trace");
    let rows = text.lines().enumerate();
    let kept = rows.filter(|(k, _)| *k == 0 || (k % 2 == 0 && (10_000..13_200).contains(k)));
    let kept: Vec<&str> = kept.map(|(_, row)| row).collect();
    std::fs::write(&thinned, kept.join("\n") + "\n").expect("a trace");
    let guess = ["--set", "x.motor.inertia_kg_m2=0.033", "--set", "x.velocity_loop.gain=6"];
    let identify = ["identify", &thinned, "--axis", "x", "--feedforward", "off", "--json"];
    let found = json(&[&identify, &guess[..]].concat());
    let values = found["values"].as_array().expect("values");
    let truth = [("x.motor.inertia_kg_m2", 0.028), ("x.velocity_loop.gain", 5.0), ("x.friction.i0", 1.043)];
    for (key, expected) in truth {
        let of =
            values.iter().find(|value| value["key"] == key).unwrap_or_else(|| panic!("{key} in {found}"));
        let [value, error] = [&of["value"], &of["standard_error"]].map(|v| v.as_f64().expect("a number"));
        assert!((value - expected).abs() <= 1.96 * error, "{of}");
        assert!(error < 0.3 * value, "{of}");
    }
    let alpha = values.iter().find(|value| value["key"] == "x.delays.alpha_ms").expect("a delay");
    let [low, high] = [0, 1].map(|k| alpha["interval"][k].as_f64().expect("a number"));
    assert!(low < 9.0 && 9.0 <= high, "{alpha}");
}
