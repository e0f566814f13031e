//! Sections of the axes: positions, errors, velocities, currents.

use crate::assess::AxisTrace;

use super::page::{Caption, Page, run_class};
use super::scale::{Extent, Unit};
use super::text::{capital, listed};
use super::time_plot::{Series, TimePlot};

/// Runs whose errors are smaller than the largest by this factor are shown once more, larger.
pub(super) const COMPARABLE: f64 = 8.0;
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
        page.paragraph("Nothing was recorded.");
        return;
    };
    let (moving, standing): (Vec<_>, Vec<_>) =
        axes.into_iter().partition(|axis| axis.traces.iter().any(|(_, _, trace)| trace.moves));
    for axis in &moving {
        page.open_section("axis", &format!("{} axis", axis.name));
        let kind = axis.traces[0].2.kind;
        position(page, axis, time);
        let velocity =
            Strip { title: "Velocity", note: "", quantity: "Velocity", unit: Unit::velocity(kind) };
        strip(page, axis, time, &velocity, |t| &t.velocity);
        error(page, axis, time, "Tracking error", "PSEC − SP, with the pure delay", |t| &t.tracking_error);
        let note = "PSEC delayed by α − SP, what the controller is asked to follow";
        error(page, axis, time, "Synchronised tracking error", note, |t| &t.synchronized_tracking_error);
        currents(page, axis, time);
        page.close_section();
    }
    if !standing.is_empty() {
        let held: Vec<String> = standing.iter().enumerate().map(|(i, axis)| held(axis, i == 0)).collect();
        let verb = if held.len() == 1 { "stands" } else { "stand" };
        page.open_section("standing", "Axes that stand still");
        page.paragraph(&format!("{} {verb} still.", listed(&held)));
        page.close_section();
    }
}

/// An axis that stands still, and how far it is from its set-point at most.
fn held(axis: &Axis, explained: bool) -> String {
    let errors = axis.traces.iter().flat_map(|(_, _, t)| t.tracking_error.iter().copied());
    let error = Unit::error(axis.traces[0].2.kind).show(Extent::of(errors).map_or(0.0, |e| e.peak()));
    format!("{} ({}{error})", axis.name, if explained { "largest tracking error " } else { "" })
}

/// Every axis by name, in the order in which the runs have them.
fn axes<'a>(page: &Page<'a>) -> Vec<Axis<'a>> {
    let mut axes: Vec<Axis> = Vec::new();
    for (i, run) in page.runs.iter().enumerate() {
        for trace in &run.recording.axes {
            let name = axis_name(&trace.name);
            let entry = (i, run.recording.time.as_slice(), trace);
            match axes.iter_mut().find(|a| a.name == name && a.traces[0].2.kind == trace.kind) {
                Some(axis) => axis.traces.push(entry),
                None => axes.push(Axis { name, traces: vec![entry] }),
            }
        }
    }
    axes
}

/// A joint's name as machinists write it: one letter is a capital.
pub(super) fn axis_name(name: &str) -> String {
    if name.chars().count() == 1 { capital(name) } else { name.to_owned() }
}

/// Time that the runs take, s, the same for all plots.
pub(super) fn time(page: &Page) -> Option<Extent> {
    Extent::of(page.runs.iter().flat_map(|run| run.recording.time.iter().copied()))
}

/// What a strip shows.
struct Strip {
    title: &'static str,
    note: &'static str,
    quantity: &'static str,
    unit: Unit,
}

/// One signal of all runs.
fn strip(page: &mut Page, axis: &Axis, time: Extent, strip: &Strip, signal: Signal) {
    let every: Vec<usize> = (0..axis.traces.len()).collect();
    strip_of(page, axis, time, strip, signal, &every);
}

/// One signal of the runs at `places` of the axis.
fn strip_of(page: &mut Page, axis: &Axis, time: Extent, strip: &Strip, signal: Signal, places: &[usize]) {
    let traces = places.iter().filter_map(|&place| axis.traces.get(place));
    let series = traces.map(|&(run, time, trace)| run_series(page, run, time, signal(trace)));
    let series: Vec<Series> = series.collect();
    over_time(page, &axis.name, time, strip, series);
}

/// A figure of signals over time, with a legend where runs must be told apart.
pub(super) fn over_time_of(
    page: &mut Page,
    [title, note]: [&'static str; 2],
    quantity: &'static str,
    unit: Unit,
    time: Extent,
    series: Vec<Series>,
) {
    over_time(page, "", time, &Strip { title, note, quantity, unit }, series);
}

fn over_time(page: &mut Page, axis: &str, time: Extent, strip: &Strip, series: Vec<Series>) {
    let Strip { title, note, quantity, unit } = *strip;
    let legend = if page.is_comparison() { legend(&series) } else { Vec::new() };
    let caption = Caption { title: title.to_owned(), note: note.to_owned(), legend };
    let plot = TimePlot { quantity, unit, from_zero: true, time, series, at_least: None };
    let title =
        if axis.is_empty() { title.to_owned() } else { format!("{axis} axis: {}", title.to_lowercase()) };
    page.figure("strip", &caption, &title, |id, title| plot.draw(id, title));
}

fn legend(series: &[Series]) -> Vec<(String, String)> {
    series.iter().map(|s| (s.class.clone(), s.label.clone())).collect()
}

/// A run's signal, in the run's style.
pub(super) fn run_series<'a>(page: &Page, run: usize, time: &'a [f64], values: &'a [f64]) -> Series<'a> {
    let label = page.runs.get(run).map_or("", |run| run.title).to_owned();
    Series { label, class: format!("line {}", run_class(run)), time, values }
}

/// Set-points as a pale band, positions on it.
fn position(page: &mut Page, axis: &Axis, time: Extent) {
    let mut series: Vec<Series> = Vec::new();
    for &(_, time, trace) in &axis.traces {
        let class = "setpoint".to_owned();
        // Runs of the same motion have one set-point.
        if !series.iter().any(|s| s.time == time && s.values == trace.psec) {
            series.push(Series { label: "set-point (PSEC)".to_owned(), class, time, values: &trace.psec });
        }
    }
    let setpoints = series.len();
    for &(run, time, trace) in &axis.traces {
        let one = run_series(page, run, time, &trace.position);
        let label = if page.is_comparison() { one.label.clone() } else { "position (SP)".to_owned() };
        series.push(Series { label, ..one });
    }
    let mut legend = legend(&series);
    legend.drain(1..setpoints.max(1));
    let unit = Unit::position(axis.traces[0].2.kind);
    let caption = Caption { title: "Set-point and position".to_owned(), note: String::new(), legend };
    let plot = TimePlot { quantity: "Position", unit, from_zero: false, time, series, at_least: None };
    let title = format!("{} axis: set-point and position", axis.name);
    page.figure("strip", &caption, &title, |id, title| plot.draw(id, title));
}

/// An error of all runs; those that are much smaller than the largest once more on their own scale.
fn error(
    page: &mut Page,
    axis: &Axis,
    time: Extent,
    title: &'static str,
    note: &'static str,
    signal: Signal,
) {
    let whole = Strip { title, note, quantity: "Error", unit: Unit::error(axis.traces[0].2.kind) };
    strip(page, axis, time, &whole, signal);
    let peaks = axis.traces.iter().map(|(_, _, t)| peak(signal(t)));
    let small = smaller(&peaks.collect::<Vec<_>>());
    if !small.is_empty() {
        let detail = Strip { note: "enlarged: without the runs of larger error", ..whole };
        strip_of(page, axis, time, &detail, signal, &small);
    }
}

/// Places of the values that are much smaller than the largest.
pub(super) fn smaller(peaks: &[f64]) -> Vec<usize> {
    let largest = peaks.iter().copied().fold(0.0, f64::max);
    (0..peaks.len()).filter(|&i| peaks[i] * COMPARABLE < largest).collect()
}

/// Largest magnitude of what can be drawn.
pub(super) fn peak(values: &[f64]) -> f64 {
    Extent::of(values.iter().copied()).map_or(0.0, |e| e.peak())
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
        let line = |label: &str, class: String, signal: Signal| Series {
            label: label.to_owned(),
            class,
            time: times,
            values: signal(trace),
        };
        let mut series = vec![
            line("set-point", "setpoint".to_owned(), |t| &t.current_setpoint),
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
        let caption = Caption { title: page.of_run("Current", run), note, legend: legend(&series) };
        let plot = TimePlot {
            quantity: "Current",
            unit: Unit::AMPERE,
            from_zero: true,
            time,
            series,
            at_least: range,
        };
        let title = page.of_run(&format!("{} axis: current and its parts", axis.name), run);
        page.figure("strip", &caption, &title, |id, title| plot.draw(id, title));
    }
}
