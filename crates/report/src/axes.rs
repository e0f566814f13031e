//! Sections of the axes: positions, errors, velocities, currents.

use virtual_axes_core::assess::AxisTrace;

use super::html::{Caption, run_class};
use super::page::Page;
use super::scale::Extent;
use super::strip::{Strip, error_strip, legend, peak, run_series, strip, time};
use super::text::{capital, listed};
use super::time_plot::{TimePlot, TimeSeries};
use super::unit::DisplayUnit;

/// A part of the current below this is none, A.
const NO_CURRENT: f64 = 1e-3;

/// Signals of an axis over time.
type Signal = fn(&AxisTrace) -> &[f64];

/// One axis in the runs that have it.
struct Axis<'a> {
    name: String,
    /// Number of the run, its times, its signals.
    traces: Vec<(usize, &'a [f64], &'a AxisTrace)>,
}

/// A section for each axis that moves in any run, a sentence about the others.
pub(super) fn sections(page: &mut Page) {
    let axes = axes(page);
    let Some(time) = time(page) else {
        page.html.paragraph("Nothing was recorded.");
        return;
    };
    let (moving, standing): (Vec<_>, Vec<_>) =
        axes.into_iter().partition(|axis| axis.traces.iter().any(|(_, _, trace)| trace.moves));
    for axis in &moving {
        page.html.open_section("axis", &format!("{} axis", axis.name));
        position(page, axis, time);
        let kind = axis.traces[0].2.kind;
        let of = format!("{} axis", axis.name);
        let series = |page: &Page, signal: Signal| -> Vec<TimeSeries> {
            axis.traces.iter().map(|&(run, time, trace)| run_series(page, run, time, signal(trace))).collect()
        };
        let velocity =
            Strip { title: "Velocity", note: "", quantity: "Velocity", unit: DisplayUnit::velocity(kind) };
        let lines = series(page, |t| &t.velocity);
        strip(page, &of, time, velocity, lines);
        let note = "PSEC − SP, with the pure delay";
        let tracking =
            Strip { title: "Tracking error", note, quantity: "Error", unit: DisplayUnit::error(kind) };
        let lines = series(page, |t| &t.following_error);
        error_strip(page, &of, time, tracking, lines);
        let note = "PSEC delayed by α − SP, what the controller is asked to follow";
        let synchronized = Strip { title: "Synchronized tracking error", note, ..tracking };
        let lines = series(page, |t| &t.delay_compensated_following_error);
        error_strip(page, &of, time, synchronized, lines);
        currents(page, axis, time);
        page.html.close_section();
    }
    if !standing.is_empty() {
        let held: Vec<String> = standing.iter().enumerate().map(|(i, axis)| held(axis, i == 0)).collect();
        let verb = if held.len() == 1 { "stands" } else { "stand" };
        page.html.open_section("standing", "Axes that stand still");
        page.html.paragraph(&format!("{} {verb} still.", listed(&held)));
        page.html.close_section();
    }
}

/// An axis that stands still, and how far it is from its setpoint at most.
fn held(axis: &Axis, explained: bool) -> String {
    let errors = axis.traces.iter().flat_map(|(_, _, t)| t.following_error.iter().copied());
    let error = DisplayUnit::error(axis.traces[0].2.kind).show(Extent::of(errors).map_or(0.0, |e| e.peak()));
    format!("{} ({}{error})", axis.name, if explained { "largest tracking error " } else { "" })
}

/// Every axis by name, in the order in which the runs have them.
fn axes<'a>(page: &Page<'a>) -> Vec<Axis<'a>> {
    let mut axes: Vec<Axis> = Vec::new();
    let is_same = |a: &AxisTrace, b: &AxisTrace| a.name == b.name && a.kind == b.kind;
    for (i, run) in page.runs.iter().enumerate() {
        for trace in &run.recording.axes {
            let entry = (i, run.recording.time.as_slice(), trace);
            match axes.iter_mut().find(|a| is_same(a.traces[0].2, trace)) {
                Some(axis) => axis.traces.push(entry),
                None => axes.push(Axis { name: axis_name(&trace.name), traces: vec![entry] }),
            }
        }
    }
    axes
}

/// A joint's name as machinists write it: one letter is a capital.
pub(super) fn axis_name(name: &str) -> String {
    if name.chars().count() == 1 { capital(name) } else { name.to_owned() }
}

/// Setpoints as a pale band, positions on it.
fn position(page: &mut Page, axis: &Axis, time: Extent) {
    let mut series: Vec<TimeSeries> = Vec::new();
    for &(_, time, trace) in &axis.traces {
        let class = "setpoint".to_owned();
        // Runs of the same motion have one setpoint.
        if !series.iter().any(|s| s.time == time && s.values == trace.psec) {
            series.push(TimeSeries { label: "setpoint (PSEC)".to_owned(), class, time, values: &trace.psec });
        }
    }
    let setpoints = series.len();
    for &(run, time, trace) in &axis.traces {
        let one = run_series(page, run, time, &trace.position);
        let label = if page.is_comparison() { one.label.clone() } else { "position (SP)".to_owned() };
        series.push(TimeSeries { label, ..one });
    }
    let mut legend = legend(&series);
    legend.drain(1..setpoints.max(1));
    let unit = DisplayUnit::position(axis.traces[0].2.kind);
    let caption = Caption { title: "Setpoint and position".to_owned(), note: String::new(), legend };
    let plot = TimePlot { quantity: "Position", unit, from_zero: false, time, series, at_least: None };
    let title = format!("{} axis: setpoint and position", axis.name);
    page.html.figure("strip", &caption, &title, |id, title| plot.draw(id, title));
}

/// The current of each run with its parts, all at one scale.
fn currents(page: &mut Page, axis: &Axis, time: Extent) {
    let parts: [(&str, &str, Signal); 3] = [
        ("friction", "part friction", |t| &t.friction_current),
        ("gravity", "part gravity", |t| &t.gravity_current),
        ("load", "part load", |t| &t.load_current),
    ];
    let all: [Signal; 2] = [|t| &t.current, |t| &t.current_setpoint];
    let all = all.into_iter().chain(parts.map(|(_, _, signal)| signal));
    let range =
        all.flat_map(|signal| axis.traces.iter().map(move |(_, _, t)| Extent::of(signal(t).iter().copied())));
    let range = range.fold(None, Extent::join);
    for &(run, times, trace) in &axis.traces {
        let line = |label: &str, class: String, signal: Signal| TimeSeries {
            label: label.to_owned(),
            class,
            time: times,
            values: signal(trace),
        };
        let mut series = vec![
            line("setpoint", "setpoint".to_owned(), |t| &t.current_setpoint),
            line("motor current (SMC)", format!("line solid {}", run_class(run)), |t| &t.current),
        ];
        let (taking, none): (Vec<_>, Vec<_>) =
            parts.into_iter().partition(|(_, _, signal)| peak(signal(trace)) > NO_CURRENT);
        series.extend(taking.into_iter().map(|(label, class, signal)| line(label, class.to_owned(), signal)));
        let none: Vec<String> = none.into_iter().map(|(label, ..)| label.to_owned()).collect();
        let note = match none.as_slice() {
            [] => String::new(),
            [one] => format!("{one} takes none"),
            several => format!("{} take none", listed(several)),
        };
        let caption = Caption { title: page.caption_for_run("Current", run), note, legend: legend(&series) };
        let plot = TimePlot {
            quantity: "Current",
            unit: DisplayUnit::AMPERE,
            from_zero: true,
            time,
            series,
            at_least: range,
        };
        let title = page.caption_for_run(&format!("{} axis: current and its parts", axis.name), run);
        page.html.figure("strip", &caption, &title, |id, title| plot.draw(id, title));
    }
}
