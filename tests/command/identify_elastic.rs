//! The command `virtual_axes identify` on elastic axes and on presliding.

use std::f64::consts::TAU;

use crate::command_common::{assert_near, assert_rejected, json, printed};
use serde_json::Value;
use virtual_axes_verification::fixtures::folder::TestFolder;

/// Sets a transmission of 150 N/µm and 1300 kg on X.
const ELASTIC: [&str; 8] = [
    "--set",
    "x.transmission.stiffness_n_um=150",
    "--set",
    "x.transmission.load_mass_kg=1300",
    "--set",
    "x.transmission.damping_n_s_m=15000",
    "--set",
    "x.transmission.backlash_um=9",
];

/// Returns setpoints of X: a steady motion to and fro with a chirp from 2 to 60 Hz.
fn chirp() -> String {
    let (mut position, mut text) = (0.0, "time,x\n".to_owned());
    for k in 0..1500 {
        let t = f64::from(k) * 0.006 - 0.5;
        if (0.0..8.0).contains(&t) {
            let phase = TAU * 16.0 / 30_f64.ln() * (30_f64.powf(t / 8.0) - 1.0);
            let steady = (10.0 * (std::f64::consts::PI * t).sin()).clamp(-1.0, 1.0);
            position += 0.006 * (t / 0.2).min(1.0) * (0.025 * steady + 0.018 * phase.sin());
        }
        text.push_str(&format!("{:.3},{position:.9}\n", f64::from(k) * 0.006));
    }
    text
}

#[test]
fn both_encoders_identify_the_transmission_of_a_trace() {
    let folder = TestFolder::new("identify_transmission");
    let path = |name: &str| folder.path(name);
    let psec = folder.file("chirp.csv", chirp()).to_string_lossy().into_owned();
    let of = |trace: &str| -> Value {
        let run = ["run", &psec, "--quiet", "--trace", trace, "--trace-period", "500us"];
        printed(&[run.as_slice(), &ELASTIC].concat());
        let out = path("out.yaml");
        let page = path("page.html");
        let output = ["--axis", "x", "--json", "--out", &out, "--report", &page];
        let found = json(&[&["identify", "--transmission", trace], output.as_slice()].concat());
        let page = std::fs::read_to_string(&page).expect("a page");
        assert!(page.contains("Transmission: antiresonance") && page.contains("; motor and load "));
        // The machine file is valid.
        printed(&["run", "ballbar", "--machine", &out, "--quiet"]);
        found
    };
    for trace in ["both.csv", "both.mcap"] {
        let found = of(&path(trace));
        let values = found["values"].as_array().expect("a list");
        let value = |key: &str| {
            let key = format!("x.transmission.{key}");
            values.iter().find(|value| value["key"] == key.as_str()).expect("a value")["value"].clone()
        };
        assert_near(&value("stiffness_n_um"), 150.0, 0.03);
        assert_near(&value("load_mass_kg"), 1300.0, 0.03);
        assert_near(&value("backlash_um"), 9.0, 0.1);
        // √(150e6 / 1300) / 2π.
        assert_near(&found["transmission"]["antiresonance_hz"]["value"], 54.063, 2e-3);
        assert_eq!(found["transmission_recordings"].as_array().map(Vec::len), Some(1));
    }
    // Without the wind-up there is one encoder.
    let text =
        std::fs::read_to_string(path("both.csv")).expect("a trace").replacen("x.wind_up", "x.other", 1);
    let one = folder.file("one.csv", &text).to_string_lossy().into_owned();
    assert_rejected(
        &["identify", "--transmission", &one, "--axis", "x"],
        &["one.csv: no position of the motor", "one encoder does not tell", "motor_position"],
    );
}

#[test]
fn axes_at_rest_in_all_recordings_are_left_out() {
    let folder = TestFolder::new("identify_resting");
    let path = |name: &str| folder.path(name);
    let psec = folder.file("chirp.csv", chirp()).to_string_lossy().into_owned();
    let (trace, out) = (path("both.csv"), path("out.yaml"));
    let run = ["run", &psec, "--quiet", "--trace", &trace, "--trace-period", "500us"];
    printed(&[run.as_slice(), &ELASTIC].concat());
    let listing = printed(&["identify", "--transmission", &trace]);
    assert!(listing.contains("x.wind_up"), "{listing}");
    let row = listing.lines().find(|line| line.contains("x.wind_up")).unwrap_or_default();
    assert_eq!(row.split_whitespace().nth(2), Some("wind_up"), "{listing}");
    let next = format!("next: virtual_axes identify --transmission {trace} --axis all ");
    assert!(listing.contains(&next), "{listing}");
    let all = ["identify", "--transmission", &trace, "--axis", "all"];
    let text = printed(&[all.as_slice(), &["--out", &out]].concat());
    assert!(text.ends_with("\nat rest, not identified: y, z, a, c\n"), "{text}");
    let found = json(&[all.as_slice(), &["--json"]].concat());
    let found = found.as_array().expect("a list");
    assert_eq!(found.iter().map(|axis| &axis["axis"]).collect::<Vec<_>>(), ["x"]);
    let resting = found[0]["findings"].as_array().into_iter().flatten().find(|f| f["code"] == "at-rest");
    assert_eq!(resting.expect("a finding")["text"], "at rest, not identified: y, z, a, c");
    let quiet = printed(&[all.as_slice(), &["--quiet"]].concat());
    assert!(quiet.ends_with("warnings\nat rest, not identified: y, z, a, c\n"), "{quiet}");
    let still = folder.file("still.csv", "time,x\n0,0\n1,0\n").to_string_lossy().into_owned();
    printed(&["run", &still, "--quiet", "--trace", &trace]);
    assert_rejected(&all, &["--axis all: no axis moves in the recordings (x, y, z, a, c)"]);
}

#[test]
fn slow_reversals_identify_the_presliding_of_a_trace() {
    let folder = TestFolder::new("identify_presliding");
    let path = |name: &str| folder.path(name);
    let mut text = "time,x\n".to_owned();
    for k in 0..4200 {
        let t = f64::from(k) * 0.006;
        let at = 0.5e-3 * (1.0 - (TAU * (t - 0.5).clamp(0.0, 24.0) / 4.0).cos());
        text.push_str(&format!("{t:.3},{at:.9}\n"));
    }
    let psec = folder.file("slow.csv", text).to_string_lossy().into_owned();
    let (trace, out) = (path("trace.csv"), path("out.yaml"));
    let stiffness = ["--set", "x.friction.presliding_stiffness_n_um=50"];
    let run = ["run", &psec, "--quiet", "--trace", &trace, "--trace-period", "2ms"];
    printed(&[run.as_slice(), &stiffness].concat());
    let identify = ["identify", &trace, "--axis", "x", "--presliding", "--no-refine", "--out", &out];
    let found = json(&[identify.as_slice(), &["--json"]].concat());
    assert_near(&found["presliding"]["stiffness"], 50.0, 0.05);
    let [low, high] = [0, 1].map(|k| found["presliding"]["interval"][k].as_f64().expect("a bound"));
    assert!(low < 50.0 && 50.0 < high, "{low} … {high}");
    let machine = std::fs::read_to_string(&out).expect("a machine file");
    assert!(machine.contains("presliding_stiffness_n_um: "), "{machine}");
    // Without the option the motion of a fraction of a millimeter shows nothing.
    let without = ["identify", &trace, "--axis", "x", "--no-refine"];
    assert_rejected(&without, &["no parameter of x could be identified", "record the current of a program"]);
}
