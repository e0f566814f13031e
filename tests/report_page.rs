//! The report as a whole: what stands in it, and what must never.

mod common;
mod report_common;

use std::sync::LazyLock;

use report_common::{NO_FEEDFORWARD, PERIOD, ballbar, five_axes, report_run};
use virtual_axes::assess::Recording;
use virtual_axes::report::{Report, ReportRun};

static BALLBAR: LazyLock<[Recording; 2]> =
    LazyLock::new(|| [ballbar(&[], PERIOD, false), ballbar(&NO_FEEDFORWARD, PERIOD, false)]);

fn page(title: &str, runs: Vec<ReportRun>) -> String {
    let mut bytes = Vec::new();
    Report { title, description: "", runs }.write(&mut bytes).expect("memory takes it");
    String::from_utf8(bytes).expect("UTF-8")
}

fn two_runs() -> Vec<ReportRun<'static>> {
    let [with, without] = &*BALLBAR;
    vec![report_run("cascade", with), report_run("cascade-noff", without)]
}

/// Writes pages to look at into a folder: `VIRTUAL_AXES_REPORTS=folder cargo test --test report_page -- --ignored`.
#[test]
#[ignore = "writes files for a person to look at"]
fn pages_to_look_at() {
    let folder = std::env::var("VIRTUAL_AXES_REPORTS").expect("VIRTUAL_AXES_REPORTS names a folder");
    let write = |name: &str, runs: Vec<ReportRun>, description: &str| {
        let report = Report { title: name, description, runs };
        let mut bytes = Vec::new();
        report.write(&mut bytes).expect("memory takes it");
        println!("{name}: {} bytes", bytes.len());
        std::fs::write(format!("{folder}/{name}.html"), bytes).expect("the folder is there");
    };
    let circle = "A circle of 150 mm radius in X–Y at 15 m/min, two turns in each direction.";
    write("ballbar", vec![report_run("cascade", &BALLBAR[0])], circle);
    write("ballbar-2", two_runs(), circle);
    let [soft, stiff] = [0.75, 3.0].map(|gain| ballbar(&[("x.position_loop.gain", gain)], PERIOD, true));
    let mut runs = two_runs();
    runs.push(report_run("cascade x.position_loop.gain=0.75", &soft));
    write("ballbar-3", runs.clone(), circle);
    runs.push(report_run("cascade x.position_loop.gain=3", &stiff));
    write("ballbar-4", runs, circle);
    let five = five_axes(PERIOD);
    write("five-axes", vec![report_run("cascade", &five)], "All five axes swing.");
    let every_tick = five_axes(1);
    write("five-axes-every-tick", vec![report_run("cascade", &every_tick)], "All five axes swing.");
}
