//! Section of the tool: path, circles, contour error and orientation error.

use virtual_axes_core::assess::{CircleTrace, ToolTrace};

use super::axes::axis_name;
use super::html::{Caption, run_class};
use super::page::Page;
use super::path_plot::{PathPlot, PathView, at_one_scale};
use super::polar::{DIRECTIONS, PolarPlot, range};
use super::scale::Extent;
use super::strip::{COMPARABLE, Strip, error_strip, peak, run_series, smaller, time};
use super::text::rounded;
use super::time_plot::TimeSeries;
use super::unit::DisplayUnit;

/// Maximum number of circles that are plotted; the table of figures contains all circles.
const MOST_CIRCLES: usize = 6;
/// Difference of radii below which circles are equal, m.
const SAME_RADIUS: f64 = 1e-6;
/// Orientation error below which it is not plotted, rad: 0.01 mdeg.
const NEGLIGIBLE_ORIENTATION_ERROR: f64 = 1.7e-7;

/// Writes paths, circles, and errors over time.
pub(super) fn sections(page: &mut Page) {
    let tools: Vec<(usize, &ToolTrace)> =
        page.runs.iter().enumerate().filter_map(|(i, run)| Some((i, run.recording.tool.as_ref()?))).collect();
    let circles = circles(page);
    let (drawn, left_out) = circles.split_at(circles.len().min(MOST_CIRCLES));
    if tools.is_empty() && drawn.is_empty() {
        return;
    }
    page.html.open_section("tool", "Tool in the workpiece frame");
    let has_path = paths_and_circles(page, &tools, drawn);
    if !tools.is_empty() && !has_path {
        page.html.paragraph("The path of the tool tip is a point.");
    }
    if !left_out.is_empty() {
        page.html.paragraph(&format!("{} more circles are not plotted.", left_out.len()));
    }
    if let Some(time) = time(page) {
        let note = "distance of the tool tip from the path";
        errors(page, time, ["Contour error", note], DisplayUnit::MICROMETER, &tools, |t| &t.contour_error);
        if tools.iter().any(|(_, t)| peak(&t.orientation_error) > NEGLIGIBLE_ORIENTATION_ERROR) {
            let note = "angle between the tool axis and that of the path";
            errors(page, time, ["Orientation error", note], DisplayUnit::MILLIDEGREE, &tools, |t| {
                &t.orientation_error
            });
        }
    }
    page.html.close_section();
}

/// Writes paths and circles, side by side for a single run, otherwise a row of runs for each. Returns true if
/// a path was plotted.
fn paths_and_circles(page: &mut Page, tools: &[(usize, &ToolTrace)], circles: &[Circles]) -> bool {
    if !page.is_comparison() {
        page.html.open_row(1 + circles.len());
        let has_path = paths(page, tools);
        circles.iter().for_each(|circle| polar_plots(page, circle));
        page.html.close_row();
        return has_path;
    }
    page.html.open_row(page.runs.len());
    let has_path = paths(page, tools);
    page.html.close_row();
    for circle in circles {
        page.html.open_row(page.runs.len());
        polar_plots(page, circle);
        page.html.close_row();
    }
    has_path
}

/// Writes a figure of one error of all runs over time.
fn errors(
    page: &mut Page,
    time: Extent,
    [title, note]: [&'static str; 2],
    unit: DisplayUnit,
    tools: &[(usize, &ToolTrace)],
    signal: fn(&ToolTrace) -> &[f64],
) {
    let runs = page.runs;
    let series: Vec<TimeSeries> = tools
        .iter()
        .filter_map(|&(run, tool)| Some((run, runs.get(run)?, signal(tool))))
        .map(|(run, one, values)| run_series(page, run, &one.recording.time, values))
        .collect();
    if !series.iter().all(|s| s.values.is_empty()) {
        error_strip(page, "", time, Strip { title, note, quantity: "Error", unit }, series);
    }
}

/// Writes the path of each run at one scale. Returns true if a path was plotted.
fn paths(page: &mut Page, tools: &[(usize, &ToolTrace)]) -> bool {
    let traces: Vec<&ToolTrace> = tools.iter().map(|(_, tool)| *tool).collect();
    let Some(view) = PathView::from_traces(&traces) else { return false };
    // A much smaller error has its own magnification.
    let peaks: Vec<f64> = traces.iter().map(|tool| view.error(tool)).collect();
    let largest = peaks.iter().copied().fold(0.0, f64::max);
    let magnification =
        |peak: f64| view.magnification(&traces, if peak * COMPARABLE < largest { peak } else { largest });
    let drawn: Vec<_> = tools
        .iter()
        .zip(&peaks)
        .filter_map(|(&(run, tool), &peak)| Some((run, tool, peak, view.range(tool, magnification(peak))?)))
        .collect();
    let ranges = at_one_scale(&drawn.iter().map(|(.., range)| *range).collect::<Vec<_>>());
    for (&(run, tool, peak, _), &range) in drawn.iter().zip(&ranges) {
        let class = run_class(run);
        let mut legend = vec![
            ("reference".to_owned(), "path".to_owned()),
            (format!("line solid {class}"), "tool tip".to_owned()),
            ("start".to_owned(), "start".to_owned()),
        ];
        let largest_error = traces.iter().map(|tool| self::peak(&tool.contour_error)).fold(0.0, f64::max);
        let is_other_scale = magnification(peak).value() != magnification(largest).value();
        let plot = PathPlot { view, tool, magnification: magnification(peak), range, largest_error, class };
        legend.extend(plot.error_legend());
        let scale = if is_other_scale { ", not the scale of the run with the largest error" } else { "" };
        let note = format!("{}{scale}", plot.note());
        let title = page.caption_for_run(&format!("{} path", view.name()), run);
        let caption = Caption { title: title.clone(), note, legend };
        page.html.figure("plane", &caption, &title, |id, title| plot.draw(id, title));
    }
    !drawn.is_empty()
}

/// Circles of one plane and radius, with the runs that contain them.
struct Circles<'a> {
    plane: &'a [String; 2],
    radius: f64,
    runs: Vec<(usize, Vec<&'a CircleTrace>)>,
}

/// Collects the distinct circles of all runs, in order of first occurrence.
fn circles<'a>(page: &Page<'a>) -> Vec<Circles<'a>> {
    let mut all: Vec<Circles> = Vec::new();
    for (i, run) in page.runs.iter().enumerate() {
        for circle in &run.recording.circles {
            let is_same =
                |c: &Circles| *c.plane == circle.plane && (c.radius - circle.radius).abs() < SAME_RADIUS;
            let index = all.iter().position(is_same).unwrap_or_else(|| {
                all.push(Circles { plane: &circle.plane, radius: circle.radius, runs: Vec::new() });
                all.len() - 1
            });
            match all[index].runs.last_mut() {
                Some((run, list)) if *run == i => list.push(circle),
                _ => all[index].runs.push((i, vec![circle])),
            }
        }
    }
    all
}

/// Writes a polar plot for each run, at one scale unless the deviations differ too much.
fn polar_plots(page: &mut Page, circle: &Circles) {
    let ranges: Vec<Extent> = circle.runs.iter().map(|(_, list)| range(list.iter().copied())).collect();
    let small = smaller(&ranges.iter().map(|r| r.span()).collect::<Vec<_>>());
    let common = (0..ranges.len())
        .filter(|i| !small.contains(i))
        .fold(None, |all, i| Extent::join(all, Some(ranges[i])));
    let [first, second] = circle.plane.clone().map(|name| axis_name(&name));
    let name = format!(
        "{first}–{second} circle, R {}\u{a0}mm",
        rounded(circle.radius / DisplayUnit::MILLIMETER.size)
    );
    for (i, (run, list)) in circle.runs.iter().enumerate() {
        let own = ranges[i];
        let range = if small.contains(&i) { own } else { common.unwrap_or(own) };
        let class = run_class(*run);
        let legend = DIRECTIONS
            .iter()
            .filter(|(label, _)| list.iter().any(|c| c.counterclockwise == (*label == DIRECTIONS[0].0)))
            .map(|(label, direction)| (format!("line {class} {direction}"), (*label).to_owned()))
            .collect();
        let plot = PolarPlot { circles: list.clone(), range, class };
        let title = page.caption_for_run(&name, *run);
        let caption = Caption { title: title.clone(), note: plot.note(), legend };
        page.html.figure("plane", &caption, &title, |id, title| plot.draw(id, title));
    }
}
