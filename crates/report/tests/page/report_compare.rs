//! Pages of several runs: paths at different positions, long names.

use crate::report_common::{between, picture, points, report_run};
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

/// Returns width and height of a run's path in its plot, pixels.
fn size(page: &str, title: &str) -> [f64; 2] {
    let path = points(between(picture(page, title), "<path class=\"reference\" d=\"", "\"")[0]);
    [0, 1].map(|i| {
        let values = || path.iter().map(|p| p[i]);
        values().fold(f64::MIN, f64::max) - values().fold(f64::MAX, f64::min)
    })
}

#[test]
fn an_offset_path_does_not_change_the_projection_plane() {
    // A tool that is 100 mm shorter lowers the whole path.
    let (high, low) = (helix([0.0; 3]), helix([0.0, 0.0, -0.1]));
    let page = page(vec![report_run("long", &high), report_run("short", &low)]);
    let [long, short] = ["X–Y path, long<", "X–Y path, short<"].map(|title| size(&page, title));
    assert_eq!(long, short);
    assert!(!page.contains("X–Z path"));
}

#[test]
fn distant_paths_have_one_scale_and_separate_ranges() {
    let (near, far) = (helix([0.0; 3]), helix([0.0, 0.5, 0.0]));
    let page = page(vec![report_run("near", &near), report_run("far", &far)]);
    let alone = self::page(vec![report_run("near", &near)]);
    let [near, far] = ["X–Y path, near<", "X–Y path, far<"].map(|title| size(&page, title));
    // Points are written to a tenth of a pixel.
    for i in 0..2 {
        assert!((near[i] - far[i]).abs() < 0.3, "{near:?} {far:?}");
        assert!((near[i] - size(&alone, "X–Y path")[i]).abs() < 0.3, "{near:?}");
    }
    let labels = |title: &str| between(picture(&page, title), "<text class=\"tick", "</text>").join(" ");
    assert!(labels("X–Y path, far<").contains(">500") && !labels("X–Y path, near<").contains(">500"));
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
