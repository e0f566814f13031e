//! Sections of errors and axes: contour error, feed, circles, and the signals of each axis over time.

use virtual_axes_core::assess::{AxisTrace, CircleTrace, SignalRecording, ToolTrace};

use super::chart::{Band, BandClass, Chart, ChartAxis, ChartForm, ChartSeries, Panel, SeriesStyle};
use super::document::Section;
use super::extent::peak;
use super::html::LINE_STYLES;
use super::text::{axis_name, listed, rounded};
use super::tool_path::ToolPath;
use super::unit::DisplayUnit;

/// Peak below which a component of the current is not plotted, A.
const NEGLIGIBLE_CURRENT: f64 = 1e-3;
/// Orientation error below which it is not plotted, rad: 0.01 mdeg.
const NEGLIGIBLE_ORIENTATION_ERROR: f64 = 1.7e-7;
/// Maximum number of circles that are plotted; the table of figures contains all circles.
const MOST_CIRCLES: usize = 6;
/// Difference of radii below which circles are equal, m.
const SAME_RADIUS: f64 = 1e-6;

/// One run of a report.
#[derive(Debug, Clone)]
pub struct ReportRun<'a> {
    /// Name that distinguishes the run from the others, for example its controller.
    pub title: &'a str,
    /// Names and values: machine, controller, changed parameters. Values with equal names share a row.
    pub facts: Vec<(String, String)>,
    /// Signals to plot.
    pub recording: &'a SignalRecording,
    /// Path of a part program with its lines and feeds.
    pub program: Option<&'a ToolPath>,
}

/// Accessor of one signal of an axis.
type Signal = fn(&AxisTrace) -> &[f64];

/// An axis with its traces in the runs that contain it, each with the index of its run.
type Axis<'a> = (&'a AxisTrace, Vec<(usize, &'a AxisTrace)>);

/// Returns a chart over the time of the runs.
fn over_time(title: impl Into<String>, panels: Vec<Panel>) -> Chart {
    let form = ChartForm::RunTime;
    Chart { form, ..Chart::new(title, ChartAxis::new("Time", DisplayUnit::SECOND), panels) }
}

/// Returns a panel that includes 0.
fn panel(quantity: impl Into<String>, unit: DisplayUnit, series: Vec<ChartSeries>) -> Panel {
    Panel::new(ChartAxis::new(quantity, unit).with_zero(), series)
}

/// Returns a signal of a run over its time.
fn signal(runs: &[ReportRun], run: usize, label: &str, style: SeriesStyle, values: &[f64]) -> ChartSeries {
    ChartSeries::from_xy(label, style, &runs[run].recording.time, values).of_run(run)
}

/// Returns a text with the title of the run if there are several runs.
fn for_run(runs: &[ReportRun], run: usize, text: &str) -> String {
    if runs.len() > 1 { format!("{text}, {}", runs[run].title) } else { text.to_owned() }
}

/// Returns the section of contour error, orientation error, feed and circles.
pub(super) fn errors(runs: &[ReportRun]) -> Option<Section> {
    let of_runs = |values: fn(&ToolTrace) -> &[f64]| -> Vec<ChartSeries> {
        let tools = runs.iter().enumerate().filter_map(|(i, run)| Some((i, run.recording.tool.as_ref()?)));
        let series = |(i, tool)| signal(runs, i, runs[i].title, SeriesStyle::Line(i), values(tool));
        tools.map(series).filter(|series| !series.points.is_empty()).collect()
    };
    let orientation = of_runs(|tool| &tool.orientation_error);
    let turns =
        orientation.iter().any(|s| peak(s.points.iter().map(|p| p[1])) > NEGLIGIBLE_ORIENTATION_ERROR);
    let programs: Vec<(usize, &ToolPath)> =
        runs.iter().enumerate().filter_map(|(i, run)| Some((i, run.program?))).collect();
    let path_errors = match programs.is_empty() {
        true => of_runs(|tool| &tool.contour_error),
        false => programs.iter().map(|&(i, program)| program.errors(i, runs[i].title)).collect(),
    };
    let feeds = programs.iter().flat_map(|&(i, program)| program.feeds(i, runs[i].title)).collect();
    let panels = vec![
        panel("Contour error", DisplayUnit::MICROMETER, path_errors),
        panel("Orientation error", DisplayUnit::MILLIDEGREE, if turns { orientation } else { Vec::new() }),
        panel("Feed", DisplayUnit::METER_PER_MINUTE, feeds),
    ];
    let panels: Vec<Panel> = panels.into_iter().filter(|panel| !panel.series.is_empty()).collect();
    let mut section = Section::new("Errors of the tool");
    if !panels.is_empty() {
        let (title, note) = match programs.is_empty() {
            true => ("Errors", "distance of the tool tip from the path"),
            false => (
                "Errors and feed",
                "contour error: distance of the tool tip from the programmed path; feed: speed of the tip",
            ),
        };
        section.charts.push(Chart { note: note.to_owned(), ..over_time(title, panels) });
    }
    let mut circles = circles(runs);
    if circles.len() > MOST_CIRCLES {
        section.paragraphs.push(format!("{} more circles are not plotted.", circles.len() - MOST_CIRCLES));
        circles.truncate(MOST_CIRCLES);
    }
    section.charts.extend(circles);
    (!section.charts.is_empty()).then_some(section)
}

/// Returns a chart for each distinct circle of the runs.
fn circles(runs: &[ReportRun]) -> Vec<Chart> {
    let all = runs.iter().enumerate().flat_map(|(i, run)| run.recording.circles.iter().map(move |c| (i, c)));
    let mut distinct: Vec<Vec<(usize, &CircleTrace)>> = Vec::new();
    for (run, circle) in all {
        let is_same = |other: &CircleTrace| {
            other.plane == circle.plane && (other.radius - circle.radius).abs() < SAME_RADIUS
        };
        match distinct.iter_mut().find(|group| is_same(group[0].1)) {
            Some(group) => group.push((run, circle)),
            None => distinct.push(vec![(run, circle)]),
        }
    }
    let chart = |group: &Vec<(usize, &CircleTrace)>| {
        let circle = group[0].1;
        let series = group.iter().map(|&(run, circle)| {
            let direction = if circle.counterclockwise { "counterclockwise" } else { "clockwise" };
            let label = for_run(runs, run, direction);
            let style =
                SeriesStyle::Line(if runs.len() > 1 { run } else { usize::from(!circle.counterclockwise) });
            ChartSeries::from_xy(label, style, &circle.angle, &circle.deviation).of_run(run)
        });
        let axes = circle.plane.clone().map(|name| axis_name(&name));
        let radius = rounded(circle.radius / DisplayUnit::MILLIMETER.size);
        let title = format!("{}–{} circle, R {radius}\u{a0}mm", axes[0], axes[1]);
        let x = ChartAxis::new("Angle", DisplayUnit::DEGREE);
        let panels = vec![panel("Radial deviation", DisplayUnit::MICROMETER, series.collect())];
        let note = "radial deviation magnified; the bold ring is the nominal radius".to_owned();
        Chart { note, form: ChartForm::Circle(axes), ..Chart::new(title, x, panels) }
    };
    distinct.iter().map(chart).collect()
}

/// Returns a section for each axis that moves in any run, and one about the stationary axes.
pub(super) fn sections(runs: &[ReportRun]) -> Vec<Section> {
    if runs.iter().all(|run| run.recording.time.is_empty()) {
        let paragraphs = vec!["Nothing was recorded.".to_owned()];
        return vec![Section { paragraphs, ..Section::default() }];
    }
    let mut axes: Vec<Axis> = Vec::new();
    let traces = runs.iter().enumerate().flat_map(|(i, run)| run.recording.axes.iter().map(move |t| (i, t)));
    for (run, trace) in traces {
        match axes.iter_mut().find(|(axis, _)| axis.name == trace.name && axis.kind == trace.kind) {
            Some((_, traces)) => traces.push((run, trace)),
            None => axes.push((trace, vec![(run, trace)])),
        }
    }
    let (moving, at_rest): (Vec<Axis>, Vec<Axis>) =
        axes.into_iter().partition(|(_, traces)| traces.iter().any(|(_, trace)| trace.moves));
    let mut sections: Vec<Section> = moving.iter().map(|axis| of_axis(runs, axis)).collect();
    let names: Vec<String> = at_rest.iter().map(stationary).collect();
    if !names.is_empty() {
        let verb = if names.len() == 1 { "is" } else { "are" };
        let text = format!("{} {verb} stationary; in parentheses: largest following error.", listed(&names));
        sections.push(Section { paragraphs: vec![text], ..Section::new("Stationary axes") });
    }
    sections
}

/// Returns the name of a stationary axis with its largest following error.
fn stationary((axis, traces): &Axis) -> String {
    let error = peak(traces.iter().flat_map(|(_, trace)| trace.following_error.iter().copied()));
    format!("{} ({})", axis_name(&axis.name), DisplayUnit::error(axis.kind).format(error))
}

fn of_axis(runs: &[ReportRun], (axis, traces): &Axis) -> Section {
    let of_runs = |values: Signal| -> Vec<ChartSeries> {
        let series = |&(run, trace): &(usize, &AxisTrace)| {
            signal(runs, run, runs[run].title, SeriesStyle::Line(run), values(trace))
        };
        traces.iter().map(series).collect()
    };
    let mut positions: Vec<ChartSeries> = Vec::new();
    for &(run, trace) in traces {
        let setpoint = signal(runs, run, "setpoint", SeriesStyle::Commanded, &trace.psec);
        // Runs of the same motion share one setpoint line.
        if !positions.iter().any(|other| other.points == setpoint.points) {
            positions.push(ChartSeries { run: None, ..setpoint });
        }
    }
    positions.extend(of_runs(|t| &t.position));
    let error = DisplayUnit::error(axis.kind);
    let position = ChartAxis::new("Position", DisplayUnit::position(axis.kind));
    let mut panels = vec![
        Panel::new(position, positions),
        panel("Velocity", DisplayUnit::velocity(axis.kind), of_runs(|t| &t.velocity)),
        panel("Following error", error, of_runs(|t| &t.following_error)),
        panel("Delay-compensated error", error, of_runs(|t| &t.delay_compensated_following_error)),
    ];
    panels.extend(traces.iter().map(|(run, trace)| current(runs, *run, trace)));
    let name = axis_name(&axis.name);
    let title = format!("{name} axis");
    let note = "following error: PSEC − SP, with the delay α or compensated for it".to_owned();
    let at_limit = traces.iter().flat_map(|(run, trace)| ranges(&runs[*run].recording.time, trace));
    let bands = at_limit.map(|[from, to]| Band::new(BandClass::AtLimit, from, to)).collect();
    Section { charts: vec![Chart { note, bands, ..over_time(title.clone(), panels) }], ..Section::new(title) }
}

/// Returns the panel of the current of a run with its components.
fn current(runs: &[ReportRun], run: usize, trace: &AxisTrace) -> Panel {
    let line = |label: &str, style, values: &[f64]| signal(runs, run, label, style, values);
    let mut series = vec![
        line("setpoint", SeriesStyle::Commanded, &trace.current_setpoint),
        line(runs[run].title, SeriesStyle::Line(run), &trace.current),
    ];
    let parts = [
        ("friction", &trace.friction_current),
        ("gravity", &trace.gravity_current),
        ("load", &trace.load_current),
    ];
    for (i, (label, values)) in parts.into_iter().enumerate() {
        if peak(values.iter().copied()) > NEGLIGIBLE_CURRENT {
            series.push(line(label, SeriesStyle::Line(LINE_STYLES - 1 - i), values));
        }
    }
    panel(for_run(runs, run, "Current"), DisplayUnit::AMPERE, series)
}

/// Returns a sentence for each axis and run that reached a limit.
pub(super) fn limits(runs: &[ReportRun]) -> Vec<String> {
    let axes =
        runs.iter().enumerate().flat_map(|(i, run)| run.recording.axes.iter().map(move |axis| (i, axis)));
    let sentence = |(run, axis): (usize, &AxisTrace)| {
        let found = ranges(&runs[run].recording.time, axis);
        let [first, _] = found.first()?;
        let times = if found.len() == 1 { "once".to_owned() } else { format!("{} times", found.len()) };
        let name = for_run(runs, run, &axis_name(&axis.name));
        Some(format!(
            "{name}: at a limit of speed, current or voltage {times}, first at {first:.3} s; the plots of the axis are \
             shaded there."
        ))
    };
    axes.filter_map(sentence).collect()
}

/// Returns the time ranges in which an axis is at a limit, s: begin and end.
fn ranges(time: &[f64], axis: &AxisTrace) -> Vec<[f64; 2]> {
    let mut found: Vec<[f64; 2]> = Vec::new();
    let ends = time.iter().skip(1).chain(time.last());
    let mut was_limited = false;
    for ((&begin, &end), &share) in time.iter().zip(ends).zip(&axis.saturation) {
        let is_limited = share > 0.0;
        match found.last_mut() {
            Some(range) if is_limited && was_limited => range[1] = end,
            _ if is_limited => found.push([begin, end]),
            _ => {}
        }
        was_limited = is_limited;
    }
    found
}
