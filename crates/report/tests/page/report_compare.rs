//! Pages of several runs: paths at different positions, long names.

use crate::report_common::{between, column, figure, report_run};
use virtual_axes_core::assess::{SignalRecording, ToolTrace};
use virtual_axes_report::{Report, ReportRun};

const STEPS: u32 = 720;
const TURNS: f64 = 2.0;
const RADIUS: f64 = 0.02;
const RISE: f64 = 0.01;

fn page(runs: Vec<ReportRun>) -> String {
    let mut bytes = Vec::new();
    Report { title: "compared", description: "", runs, ..Report::default() }
        .write(&mut bytes)
        .expect("memory takes it");
    String::from_utf8(bytes).expect("UTF-8")
}

/// Returns a helix of two turns with radius 20 mm and height 10 mm from `start`, 20 µm outside the path.
fn helix(start: [f64; 3]) -> SignalRecording {
    let at = |i: u32, radius: f64| {
        let part = f64::from(i) / f64::from(STEPS);
        let (sin, cos) = (std::f64::consts::TAU * TURNS * part).sin_cos();
        [start[0] + radius * cos, start[1] + radius * sin, start[2] + RISE * part]
    };
    let tool = ToolTrace {
        reference: (0..=STEPS).map(|i| at(i, RADIUS)).collect(),
        position: (0..=STEPS).map(|i| at(i, RADIUS + 2e-5)).collect(),
        contour_error: vec![2e-5; STEPS as usize + 1],
        orientation_error: Vec::new(),
    };
    let time = (0..=STEPS).map(|i| f64::from(i) * 1e-3).collect();
    SignalRecording { time, tool: Some(tool), ..SignalRecording::default() }
}

#[test]
fn paths_of_all_runs_are_in_one_figure_with_their_places() {
    // A tool that is 100 mm shorter lowers the whole path.
    let (high, low) = (helix([0.0; 3]), helix([0.0, 0.0, -0.1]));
    let page = page(vec![report_run("long", &high), report_run("short", &low)]);
    let path = figure(&page, "Path of the tool");
    let starts = [0, 1].map(|run| [0, 1, 2].map(|axis| column(&path["runs"][run]["reference"][axis])[0]));
    assert_eq!(starts, [[20.0, 0.0, 0.0], [20.0, 0.0, -100.0]]);
    // The path over the turns, mm: each turn is longer than its circle.
    let length = column(&path["runs"][0]["path"]).pop().expect("points");
    let expected = (TURNS * std::f64::consts::TAU * RADIUS).hypot(RISE) * 1e3;
    assert!((length / expected - 1.0).abs() < 1e-3, "{length} {expected}");
}

#[test]
fn a_long_name_of_a_run_wraps() {
    let recording = helix([0.0; 3]);
    let page = page(vec![report_run("cascade", &recording), report_run("cascade, x.y=1", &recording)]);
    let style = between(&page, "<style>", "</style>")[0];
    let rules: Vec<&str> = style.split('}').filter(|rule| rule.contains(".figures thead th")).collect();
    assert!(
        rules.iter().any(|rule| rule.contains("overflow-wrap: break-word") && rule.contains("max-width"))
    );
    assert!(!rules.iter().any(|rule| rule.contains("nowrap")), "{rules:?}");
}
