//! Sections of the axes: plots of position, following error, velocity and current.

use virtual_axes_core::assess::AxisTrace;

use super::html::{Caption, run_class};
use super::limits;
use super::page::Page;
use super::scale::Extent;
use super::strip::{Strip, error_strip, legend, peak, run_series, strip, time};
use super::text::{capital, listed};
use super::time_plot::{TimePlot, TimeSeries};
use super::unit::DisplayUnit;

/// Peak below which a component of the current is not plotted, A.
const NEGLIGIBLE_CURRENT: f64 = 1e-3;

/// Accessor of one signal of an axis.
type Signal = fn(&AxisTrace) -> &[f64];

/// An axis with its traces in all runs that contain it.
struct Axis<'a> {
    name: String,
    /// Index of the run, sample times in s, signals.
    traces: Vec<(usize, &'a [f64], &'a AxisTrace)>,
}

/// Writes a section for each axis that moves in any run, and a sentence about the stationary axes.
pub(super) fn sections(page: &mut Page) {
    let axes = axes(page);
    let Some(time) = time(page) else {
        page.html.paragraph("Nothing was recorded.");
        return;
    };
    let (moving, at_rest): (Vec<_>, Vec<_>) =
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
        let note = "PSEC − SP, including the delay α";
        let following =
            Strip { title: "Following error", note, quantity: "Error", unit: DisplayUnit::error(kind) };
        let lines = series(page, |t| &t.following_error);
        error_strip(page, &of, time, following, lines);
        let note = "PSEC delayed by α − SP";
        let compensated = Strip { title: "Delay-compensated following error", note, ..following };
        let lines = series(page, |t| &t.delay_compensated_following_error);
        error_strip(page, &of, time, compensated, lines);
        currents(page, axis, time);
        page.html.close_section();
    }
    if !at_rest.is_empty() {
        let names: Vec<String> =
            at_rest.iter().enumerate().map(|(i, axis)| stationary(axis, i == 0)).collect();
        let verb = if names.len() == 1 { "is" } else { "are" };
        page.html.open_section("standing", "Stationary axes");
        page.html.paragraph(&format!("{} {verb} stationary.", listed(&names)));
        page.html.close_section();
    }
}

/// Returns the name of a stationary axis with its largest following error.
fn stationary(axis: &Axis, explained: bool) -> String {
    let errors = axis.traces.iter().flat_map(|(_, _, t)| t.following_error.iter().copied());
    let error =
        DisplayUnit::error(axis.traces[0].2.kind).format(Extent::of(errors).map_or(0.0, |e| e.peak()));
    format!("{} ({}{error})", axis.name, if explained { "largest following error " } else { "" })
}

/// Collects the axes of all runs by name and kind, in order of first occurrence.
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

/// Returns a joint name in the notation of machine axes: a single letter becomes a capital.
pub(super) fn axis_name(name: &str) -> String {
    if name.chars().count() == 1 { capital(name) } else { name.to_owned() }
}

/// Plots setpoints as a pale band and positions above it.
fn position(page: &mut Page, axis: &Axis, time: Extent) {
    let mut series: Vec<TimeSeries> = Vec::new();
    for &(_, time, trace) in &axis.traces {
        let class = "setpoint".to_owned();
        // Runs of the same motion share one setpoint line.
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
    let plot = TimePlot {
        quantity: "Position",
        unit,
        from_zero: false,
        time,
        series,
        at_least: None,
        shaded: Vec::new(),
    };
    let title = format!("{} axis: setpoint and position", axis.name);
    page.html.figure("strip", &caption, &title, |id, title| plot.draw(id, title));
}

/// Plots the current of each run with its components, all runs at one scale.
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
        let (plotted, negligible): (Vec<_>, Vec<_>) =
            parts.into_iter().partition(|(_, _, signal)| peak(signal(trace)) > NEGLIGIBLE_CURRENT);
        series
            .extend(plotted.into_iter().map(|(label, class, signal)| line(label, class.to_owned(), signal)));
        let shaded = limits::ranges(times, trace);
        let negligible: Vec<String> = negligible.into_iter().map(|(label, ..)| label.to_owned()).collect();
        let note = match negligible.as_slice() {
            [] => String::new(),
            [one] => format!("{one} component is negligible"),
            several => format!("{} components are negligible", listed(several)),
        };
        let mut legend = legend(&series);
        if !shaded.is_empty() {
            legend.push(("band at-limit".to_owned(), "at a limit".to_owned()));
        }
        let caption = Caption { title: page.caption_for_run("Current", run), note, legend };
        let plot = TimePlot {
            quantity: "Current",
            unit: DisplayUnit::AMPERE,
            from_zero: true,
            time,
            series,
            at_least: range,
            shaded,
        };
        let title = page.caption_for_run(&format!("{} axis: current and its components", axis.name), run);
        page.html.figure("strip", &caption, &title, |id, title| plot.draw(id, title));
    }
}
