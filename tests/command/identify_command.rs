//! The command `virtual_axes identify`.

use std::process::{Command, Stdio};
use std::sync::LazyLock;
use std::time::Duration;

use crate::command_common::{assert_near, assert_rejected, json, printed, run};
use serde_json::Value;
use virtual_axes_verification::fixtures::folder::TestFolder;

/// Traces of an identification campaign of X of the default machine, with feedforward off, velocity, both,
/// and one as MCAP.
struct Recordings {
    off: String,
    velocity: String,
    both: String,
    mcap: String,
}

/// Recordings of a campaign of a minute and a half, simulated once.
static RECORDINGS: LazyLock<Recordings> = LazyLock::new(|| {
    // A static is never dropped: the folder remains until the next test run.
    let folder = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("identify_recordings");
    std::fs::create_dir_all(&folder).expect("a folder can be made");
    let path = |name: &str| folder.join(name).to_string_lossy().into_owned();
    let record = |part: &str, trace: &str, set: &[&str]| {
        let (psec, trace) = (path(&format!("psec_{part}.csv")), path(trace));
        let range = ["--range=-60,60", "--max-feed", "7.7"];
        let campaign = ["psec", "campaign", "--axis", "x", "--part", part, "--out", &psec];
        printed(&[campaign.as_slice(), &range].concat());
        let set: Vec<&str> = set.iter().flat_map(|set| ["--set", set]).collect();
        printed(&[&["run", &psec, "--trace", &trace], set.as_slice()].concat());
        trace
    };
    let no_torque = "x.feedforward.torque_kg_m2=0";
    Recordings {
        off: record("off", "off.csv", &["x.feedforward.velocity=0", no_torque]),
        velocity: record("velocity", "velocity.csv", &[no_torque]),
        both: record("both", "both.csv", &[]),
        mcap: record("velocity", "velocity.mcap", &[no_torque]),
    }
});

/// Parameters of an initial machine that differs from the recorded one.
const OTHER: [&str; 8] = [
    "--set",
    "x.motor.inertia_kg_m2=0.02",
    "--set",
    "x.friction.a=2",
    "--set",
    "x.delays.alpha_ms=20",
    "--set",
    "x.delays.beta_ms=15",
];

/// Returns the friction current of X at `v` m/min (model.md, table of axes), A.
fn friction(a: f64, b: f64, c: f64, d: f64, v: f64) -> f64 {
    a * (b * v).exp() + c * (d * v).exp()
}

#[test]
fn a_campaign_identifies_the_recorded_machine() {
    let folder = TestFolder::new("identify_out");
    let recordings = &*RECORDINGS;
    let out = folder.path("new.yaml");
    let page = folder.path("page.html");
    let mut arguments = vec!["identify", &recordings.off, &recordings.velocity, &recordings.both];
    arguments.extend(["--report", &page]);
    arguments.extend(["--axis", "x", "--feedforward", "off,velocity,both", "--json", "--out", &out]);
    arguments.extend(["--validate", &recordings.mcap, "--set", "y.velocity_loop.gain=4.25"]);
    // The MCAP contains VFFWS and TFFWS, which override the wrong option.
    arguments.extend(["--validate-feedforward", "off"]);
    arguments.extend(OTHER);
    let found = json(&arguments);

    let value = |key: &str| -> &Value {
        let values = found["values"].as_array().expect("a list");
        let key = format!("x.{key}");
        values
            .iter()
            .find(|value| value["key"] == key.as_str())
            .unwrap_or_else(|| panic!("{key} in {found:#}"))
    };
    // Values of model.md.
    assert_near(&value("motor.inertia_kg_m2")["value"], 0.028, 0.01);
    assert_eq!(value("motor.inertia_kg_m2")["before"], 0.02);
    assert_eq!(value("motor.inertia_kg_m2")["unit"], "kg·m²");
    assert!(value("motor.inertia_kg_m2")["standard_error"].as_f64() >= Some(0.0));
    assert_near(&value("friction.i0")["value"], 1.0428, 0.03);
    let of = |name: &str| value(name)["value"].as_f64().expect("a number");
    let [a, b, c, d] = ["friction.a", "friction.b", "friction.c", "friction.d"].map(of);
    for v in [0.5, 1.0, 2.0, 5.0, 7.7] {
        let expected = friction(1.576, 0.01965, -0.5332, -0.2801, v);
        assert!((friction(a, b, c, d, v) / expected - 1.0).abs() < 0.02, "{v} m/min");
    }
    assert_near(&value("feedforward.velocity")["value"], 1.0, 0.005);
    assert_near(&value("feedforward.torque_kg_m2")["value"], 0.002034, 0.005);
    for name in ["alpha", "beta", "gamma"] {
        let delay = value(&format!("delays.{name}_ms"));
        let [low, high] = [0, 1].map(|end| delay["interval"][end].as_f64().expect("a number"));
        assert!(low < 9.0 && 9.0 <= high, "{name}: {low} … {high}");
        assert!((low..=high).contains(&delay["value"].as_f64().expect("a number")), "{name}");
        assert!(delay["standard_error"].is_null());
    }
    assert_near(&found["inertia"]["refined"], 0.028, 0.01);
    assert!(found["friction"]["r_squared"].as_f64() > Some(0.999));
    assert!(found["friction"]["speeds"].as_u64() >= Some(6));
    assert_eq!(found["friction"]["law"], "double-exponential");
    assert_eq!(found["delays"].as_array().map(Vec::len), Some(3));
    assert!(found["refinement"]["parameters"].as_array().is_some_and(|all| all.len() > 4));

    let modes: Vec<&Value> =
        found["recordings"].as_array().into_iter().flatten().map(|r| &r["feedforward"]).collect();
    assert_eq!(
        modes,
        [&serde_json::json!(["off"]), &serde_json::json!(["velocity"]), &serde_json::json!(["both"])]
    );
    assert_eq!(found["recordings"][0]["name"], recordings.off.as_str());
    assert_near(&found["recordings"][0]["period_ms"], 6.0, 1e-9);
    let agreement = found["agreement"].as_array().expect("a list");
    let validation = found["validation"].as_array().expect("a list");
    assert_eq!((agreement.len(), validation.len()), (3, 1));
    assert_eq!(validation[0]["feedforward"], serde_json::json!(["velocity"]));
    for part in agreement.iter().chain(validation).map(|recording| &recording["parts"][0]) {
        // [P]: 4 µm at constant velocity, 6 µm elsewhere.
        assert!(part["constant_velocity"]["max"].as_f64().is_some_and(|max| max < 4.0), "{part}");
        assert!(part["elsewhere"]["max"].as_f64().is_some_and(|max| max < 6.0), "{part}");
        assert!(part["current_r_squared"].as_f64() > Some(0.99), "{part}");
    }
    let severities: Vec<&str> =
        found["findings"].as_array().into_iter().flatten().filter_map(|f| f["severity"].as_str()).collect();
    let rank = |name: &&str| ["missing", "warning", "note"].iter().position(|known| known == name);
    assert!(severities.iter().all(|name| rank(name).is_some()));
    assert!(severities.is_sorted_by_key(rank), "{severities:?}");

    // The machine file contains the values and is valid.
    assert!(printed(&["check", &out]).ends_with("valid\n"));
    let machine = std::fs::read_to_string(&out).expect("it is there");
    assert!(machine.starts_with(
        "# Mikron UCP 710, from the machine mikron_ucp710 by `virtual_axes identify`; see there"
    ));
    assert!(machine.contains(&format!("# x was identified from {}, ", recordings.off)), "{machine}");
    assert_eq!(machine.matches("# identified: ").count(), found["values"].as_array().map_or(0, Vec::len));
    assert!(machine.contains("gain: 4.25\n"), "{machine}");
    let inertia = value("motor.inertia_kg_m2")["value"].to_string();
    assert!(machine.contains(&format!("        inertia_kg_m2: {inertia}  # identified: ± ")), "{machine}");
    let ran = json(&["run", "x-constant", "--machine", &out, "--json"]);
    let shipped = json(&["run", "x-constant", "--json"]);
    let error =
        |run: &Value| run["runs"][0]["axes"]["x"]["following_error"]["max"].as_f64().expect("a number");
    assert!((error(&ran) - error(&shipped)).abs() < 1.0, "{} and {} µm", error(&ran), error(&shipped));
    let page = std::fs::read_to_string(&page).expect("it is there");
    assert!(page.starts_with("<!DOCTYPE html>") && page.contains("Identification of the x axis"));
    assert!(page.contains("velocity.mcap") && page.contains("x.motor.inertia_kg_m2"));
    assert!(!page.split("<script>").next().unwrap_or_default().contains("NaN"));
    assert_eq!(folder.names(), ["new.yaml", "page.html"]);
}

#[test]
fn the_text_contains_results_and_missing_parameters() {
    let recordings = &*RECORDINGS;
    let text = printed(&[
        "identify",
        &recordings.mcap,
        "--axis",
        "x",
        "--no-refine",
        "--validate",
        &recordings.mcap,
    ]);
    for part in [
        "Mikron UCP 710: x\n",
        "recording ",
        " feedforward\n",
        "parameter ",
        "x.motor.inertia_kg_m2 ",
        "friction: a e^(bV) + c e^(dV) (Prévost eq. 3), regression of the current, ",
        "inertia: ",
        "by regression of the current over 10 moves",
        "constant",
        "simulated",
        "(validation)",
        "\nwarning: ",
    ] {
        assert!(text.contains(part), "{part:?} in {text}");
    }
    for part in ["refined in closed loop", "NaN", "inf "] {
        assert!(!text.contains(part), "{part:?} in {text}");
    }
    let last_warning = text.rfind("\nwarning: ").expect("a warning");
    assert!(text.find("\nnote: ").is_none_or(|note| note > last_warning), "{text}");
}

#[test]
fn recordings_without_information_on_the_axis_are_rejected() {
    let folder = TestFolder::new("identify_nothing");
    let out = folder.path("new.yaml");
    // Y is stationary.
    let arguments =
        ["identify", &RECORDINGS.off, "--axis", "y", "--feedforward", "off", "--no-refine", "--out", &out];
    assert_rejected(
        &arguments,
        &["no parameter of y could be identified\n", "missing: the axis does not move", "; record "],
    );
    assert!(folder.names().is_empty());
}

#[test]
fn active_feedforward_is_found() {
    let found = json(&["identify", &RECORDINGS.both, "--axis", "x", "--no-refine", "--json"]);
    assert_eq!(found["recordings"][0]["feedforward"], serde_json::json!(["both"]));
}

#[test]
fn invalid_input_is_rejected_with_its_name() {
    let folder = TestFolder::new("identify_bad");
    let file = |name: &str, text: &str| folder.file(name, text).to_string_lossy().into_owned();
    let recordings = &*RECORDINGS;
    let out = |name: &str| folder.path(name);
    let machine = file("machine.yaml", "");
    let (empty, header) = (file("empty.csv", ""), file("header.csv", "time,x.position,x.current\n"));
    let scenario = file("scenario.yaml", &printed(&["scenarios", "--show", "ballbar"]));
    let map = file("map.yaml", "position: x.position[mm]\nvelocity: x.velocity[mm/s]\n");
    // A motion of 1 m/s, in millimeters without a unit.
    let rows = (0..2000).map(|i| format!("{},{i},{i}\n", f64::from(i) * 1e-3));
    let millimeters =
        file("millimeters.csv", &("time,x.position,x.psec\n".to_owned() + &rows.collect::<String>()));
    let names = folder.names();
    let of = |more: &[&str]| -> Vec<String> {
        let all = [&["identify", &recordings.off, "--axis", "x", "--feedforward", "off"], more].concat();
        all.into_iter().map(str::to_owned).collect()
    };
    let rejected = |more: &[&str], parts: &[&str]| {
        let arguments = of(more);
        assert_rejected(&arguments.iter().map(String::as_str).collect::<Vec<_>>(), parts);
    };
    assert_rejected(&["identify", "--axis", "x"], &["RECORDING"]);
    assert_rejected(
        &["identify", &recordings.off, "--axis", "X1"],
        &["--axis X1", "x, y, z, a, c", "nearest is x"],
    );
    let missing = out("missing.csv");
    assert_rejected(&["identify", &missing, "--axis", "x"], &["missing.csv: "]);
    assert_rejected(&["identify", &empty, "--axis", "x"], &["empty.csv: the file is empty"]);
    assert_rejected(&["identify", &header, "--axis", "x"], &["header.csv"]);
    assert_rejected(
        &["identify", &scenario, "--axis", "x"],
        &["scenario.yaml: the file is a scenario, must be a recording"],
    );
    // Wrong units and columns.
    rejected(&["--column", "time=time[ms]"], &["off.csv: sampling period 6e-6 s", "time=COLUMN[s]"]);
    assert_rejected(
        &["identify", &millimeters, "--axis", "x"],
        &["position=COLUMN[mm]", "without --axis, the command with all such units is printed"],
    );
    let new = run(&["identify", &millimeters, "--new-machine", "M"]);
    let error = String::from_utf8_lossy(&new.stderr).into_owned();
    assert!(error.contains("likely in mm") && !error.contains("without --axis"), "{error}");
    rejected(
        &["--column", "position=x.position[deg]"],
        &["--column: the unit of position is [deg]", "linear axis x"],
    );
    rejected(&["--column", "position=x.positon"], &["off.csv:1: ", "x.positon", "nearest is x.position"]);
    rejected(&["--column", "velocity=y.velocity"], &["off.csv: the velocity "]);
    rejected(&["--column", "positon=x"], &["--column: unknown key \"positon\"", "nearest is position"]);
    rejected(&["--columns", &map], &["off.csv: "]);
    rejected(&["--cutoff-hz", "1000"], &["off.csv: cut-off 1000 Hz"]);
    rejected(&["--current-lag-ms", "50"], &["off.csv: --current-lag-ms is 50, must be -10 … 20"]);
    // Lists.
    let (validate, two) = (["--validate", recordings.both.as_str()], ["--validate-feedforward", "off,both"]);
    rejected(&[validate, two].concat(), &["--validate-feedforward: 2 values for 1 recording;"]);
    assert_rejected(
        &["identify", &recordings.off, "--axis", "x", "--feedforward", "off,both"],
        &["--feedforward: 2 values for 1 recording; give one value for all, or one for each"],
    );
    rejected(&["--feedforward", "torque"], &["off, velocity, both"]);
    rejected(&["--validate-feedforward", "off"], &["--validate"]);
    // Outputs.
    rejected(
        &["--report", &out("page.yaml")],
        &["page.yaml: a report is HTML; its extension must be .html or .htm"],
    );
    rejected(
        &["--out", &out("new"), "--report", &out("new")],
        &["new: is given for both --out and --report"],
    );
    rejected(&["--out", &out("new.csv")], &["new.csv: a machine file is YAML"]);
    rejected(
        &["--machine", &machine, "--out", &machine],
        &["machine.yaml: the output would replace an input file"],
    );
    rejected(&["--columns", &map, "--out", &map], &["map.yaml: the output would replace an input file"]);
    rejected(&["--set", "x.friction.a=two"], &["--set", "x.friction.a"]);
    assert_eq!(folder.names(), names);
}

#[test]
fn an_interrupted_identification_leaves_no_file() {
    let folder = TestFolder::new("identify_interrupted");
    let out = folder.path("new.yaml");
    let recordings = &*RECORDINGS;
    let mut arguments =
        vec!["identify", &recordings.off, "--axis", "x", "--feedforward", "off", "--out", &out];
    arguments.extend(OTHER);
    let mut child = Command::new(env!("CARGO_BIN_EXE_virtual_axes"))
        .args(arguments)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("the command starts");
    // The identification takes longer than this.
    std::thread::sleep(Duration::from_millis(500));
    let id = child.id().to_string();
    assert!(Command::new("kill").args(["-s", "INT", &id]).status().expect("kill runs").success());
    assert_eq!(child.wait().expect("it ends").code(), Some(130));
    assert!(folder.names().is_empty(), "{:?}", folder.names());
}
