//! The command `virtual_axes bode`.

use std::f64::consts::PI;
use std::fs;

use virtual_axes_verification::fixtures::folder::TestFolder;

use crate::command_common::{assert_rejected, json, printed};

/// X with a table of 1500 kg behind 2000 N/µm.
const ELASTIC: [&str; 6] = [
    "--set",
    "x.transmission.stiffness_n_um=2000",
    "--set",
    "x.transmission.damping_n_s_m=10000",
    "--set",
    "x.transmission.load_mass_kg=1500",
];

#[test]
fn table_has_every_loop_of_every_axis() {
    let table = printed(&["bode"]);
    for axis in ["x", "y", "z", "a", "c"] {
        for name in ["current", "velocity", "position"] {
            let row = |line: &&str| line.split_whitespace().take(2).eq([axis, name]);
            assert_eq!(table.lines().filter(row).count(), 1, "{axis} {name} in {table}");
        }
    }
    assert!(!table.contains("antiresonance"), "{table}");
    assert!(table.lines().all(|line| line.chars().count() <= 80), "{table}");
    let quiet = printed(&["bode", "--quiet"]);
    assert_eq!(table.lines().next(), Some(quiet.trim_end()));
}

#[test]
fn cross_coupled_control_adds_a_loop_of_the_linear_axes() {
    let with = ["bode", "--set", "contour_control.gain=4"];
    let found = json(&[with.as_slice(), &["--json"]].concat());
    for (axis, is_coupled) in [("x", true), ("y", true), ("z", true), ("a", false), ("c", false)] {
        assert_eq!(found["axes"][axis]["loops"]["contour"].is_object(), is_coupled, "{axis}");
    }
    // Across the path the loop has the sum of both gains: that of a position controller with 1.5 + 4 (m/min)/mm.
    let sum =
        json(&["bode", "--json", "--axis", "x", "--loop", "position", "--set", "x.position_loop.gain=5.5"]);
    let modulus = |of: &serde_json::Value, name: &str| {
        of["axes"]["x"]["loops"][name]["margins"]["modulus"].as_f64().expect("a margin")
    };
    let (across, wanted) = (modulus(&found, "contour"), modulus(&sum, "position"));
    assert!((across / wanted - 1.0).abs() < 1e-9, "{across}, expected {wanted}");
    assert_rejected(&["bode", "--loop", "contour"], &["--loop contour", "contour_control.gain"]);
    let only = printed(&[with.as_slice(), &["--loop", "contour", "--axis", "x", "--csv"]].concat());
    assert!(only.lines().skip(1).all(|line| line.contains(",x,contour,")), "{only}");
    // The margins of deviating plants are those across the path, too: of the worst axis, y or x.
    let robust = json(&["robustness", "ballbar", "--json", "--set", "contour_control.gain=4"]);
    let nominal = robust["nominal"]["margins"]["modulus"].as_f64().expect("a margin");
    assert!((nominal / across - 1.0).abs() < 0.05 && nominal <= across, "{nominal}, {across}");
}

#[test]
fn margins_of_the_position_loop_are_those_of_design() {
    let designed = json(&["design", "p", "--json"]);
    let analyzed = json(&["bode", "--json", "--loop", "position"]);
    for axis in ["x", "y", "z", "a", "c"] {
        let found = &analyzed["axes"][axis]["loops"];
        assert_eq!(found["position"]["margins"], designed["axes"][axis]["margins"], "{axis}");
        assert_eq!(found["position"]["stable"], true);
        assert_eq!(found["velocity"], serde_json::Value::Null);
    }
}

#[test]
fn natural_frequencies_of_an_elastic_axis_are_listed() {
    let arguments = [&["bode", "--axis", "x"], &ELASTIC[..]].concat();
    let found = json(&[&arguments[..], &["--json"]].concat());
    let wanted = (2e9_f64 / 1500.0).sqrt() / (2.0 * PI);
    let antiresonance = found["axes"]["x"]["antiresonance_hz"].as_f64().expect("a number");
    assert!((antiresonance / wanted - 1.0).abs() < 1e-9, "{antiresonance}, expected {wanted}");
    let table = printed(&arguments);
    assert!(table.contains(&format!("{wanted:.1}")) && table.contains("antiresonance, Hz"), "{table}");
}

#[test]
fn csv_has_a_row_per_frequency_and_the_margins_of_the_table() {
    let folder = TestFolder::new("bode_csv");
    let path = folder.0.join("x.csv");
    let file = path.to_str().expect("UTF-8");
    let selected = ["bode", "--axis", "x,z", "--loop", "velocity"];
    printed(&[&selected[..], &["--csv", file]].concat());
    let text = fs::read_to_string(&path).expect("a file");
    assert_eq!(text, printed(&[&selected[..], &["--csv"]].concat()));
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some("frequency_hz,axis,loop,open_db,open_deg,closed_db,closed_deg"));
    let found = json(&[&selected[..], &["--json"]].concat());
    for axis in ["x", "z"] {
        let of_axis = text.lines().filter(|line| line.contains(&format!(",{axis},velocity,")));
        let rows: Vec<Vec<f64>> = of_axis
            .map(|line| {
                let numbers = line.split(',').enumerate().filter(|(column, _)| ![1, 2].contains(column));
                numbers.map(|(_, number)| number.parse().expect("a number")).collect()
            })
            .collect();
        // Two integrators at low frequency.
        assert!((rows[0][2] + 180.0).abs() < 1.0 && rows[0][1] > 60.0, "{:?}", rows[0]);
        assert!(rows[0][3].abs() < 0.01 && rows[0][4].abs() < 1.0, "{:?}", rows[0]);
        // Interpolated at 0 dB.
        let pair = rows.windows(2).find(|pair| pair[0][1] > 0.0 && pair[1][1] <= 0.0).expect("a crossover");
        let part = pair[0][1] / (pair[0][1] - pair[1][1]);
        let at = |column: usize| pair[0][column] + part * (pair[1][column] - pair[0][column]);
        let of_loop = &found["axes"][axis]["loops"]["velocity"];
        let crossover = of_loop["gain_crossover_hz"].as_f64().expect("a number");
        let phase = of_loop["margins"]["phase_deg"].as_f64().expect("a number");
        assert!((at(0) / crossover - 1.0).abs() < 1e-3, "{} instead of {crossover}", at(0));
        assert!((at(2) + 180.0 - phase).abs() < 0.05, "{} instead of {phase}", at(2) + 180.0);
    }
}

#[test]
fn report_has_bode_plots_of_each_axis() {
    let folder = TestFolder::new("bode_report");
    let path = folder.0.join("loops.html");
    let file = path.to_str().expect("UTF-8");
    printed(&[&["bode", "--axis", "x,y", "--report", file], &ELASTIC[..]].concat());
    let page = fs::read_to_string(&path).expect("a page");
    for text in [
        "Open loops of x",
        "Closed loops of y",
        "Magnitude (dB)",
        "Phase (°)",
        "Frequency (Hz)",
        "antiresonance 183.8 Hz",
    ] {
        assert!(page.contains(text), "{text}");
    }
    assert_eq!(page.matches("<figure>").count(), 4);
}

#[test]
fn unstable_loops_are_named_and_have_no_margins() {
    let all = ["bode", "--axis", "x", "--set", "x.velocity_loop.gain=500"];
    let arguments = [&all[..], &["--loop", "velocity"]].concat();
    let table = printed(&arguments);
    assert!(table.starts_with("unstable: velocity loop of x"), "{table}");
    assert!(table.contains("no margins of velocity loop of x: the closed loop is unstable"), "{table}");
    let found = json(&[&arguments[..], &["--json"]].concat());
    let velocity = &found["axes"]["x"]["loops"]["velocity"];
    assert_eq!((&velocity["stable"], &velocity["margins"]), (&false.into(), &serde_json::Value::Null));
    // The position loop has no prediction model then.
    assert_rejected(&all, &["axis x", "the inner loops are unstable"]);
}

#[test]
fn invalid_arguments_are_rejected_with_name_value_and_choice() {
    assert_rejected(&["bode", "--axis", "q"], &["--axis q", "x, y, z, a, c"]);
    assert_rejected(&["bode", "--loop", "speed"], &["'speed'", "--loop", "current, velocity, position"]);
    assert_rejected(&["bode", "--report", "loops.txt"], &["loops.txt", ".html"]);
    assert_rejected(&["bode", "--csv", "a.html", "--report", "a.html"], &["a.html", "--csv and --report"]);
    assert_rejected(&["bode", "--json", "--csv"], &["--csv and --json", "give --csv a file"]);
    assert_rejected(&["bode", "--machine", "none.yaml"], &["none.yaml"]);
}
