//! Figures of signals over time, with all runs in one plot.

use super::html::{Caption, run_class};
use super::page::Page;
use super::scale::Extent;
use super::time_plot::{TimePlot, TimeSeries};
use super::unit::DisplayUnit;

/// Ratio of errors above which the smaller one is invisible in the same plot and has a plot of its own.
pub(super) const COMPARABLE: f64 = 8.0;

/// Title, labels and unit of a figure over time.
#[derive(Debug, Clone, Copy)]
pub(super) struct Strip {
    pub title: &'static str,
    /// Remark behind the title; can be empty.
    pub note: &'static str,
    /// Quantity of the vertical axis, without its unit.
    pub quantity: &'static str,
    pub unit: DisplayUnit,
}

/// Returns the range of time of all runs, s, which all figures of a page share.
pub(super) fn time(page: &Page) -> Option<Extent> {
    Extent::of(page.runs.iter().flat_map(|run| run.recording.time.iter().copied()))
}

/// Returns a signal of a run as a series in the style of the run.
pub(super) fn run_series<'a>(page: &Page, run: usize, time: &'a [f64], values: &'a [f64]) -> TimeSeries<'a> {
    let label = page.runs.get(run).map_or("", |run| run.title).to_owned();
    TimeSeries { label, class: format!("line {}", run_class(run)), time, values }
}

/// Returns the CSS classes and labels of series.
pub(super) fn legend(series: &[TimeSeries]) -> Vec<(String, String)> {
    series.iter().map(|s| (s.class.clone(), s.label.clone())).collect()
}

/// Returns the largest magnitude of the drawable values.
pub(super) fn peak(values: &[f64]) -> f64 {
    Extent::of(values.iter().copied()).map_or(0.0, |e| e.peak())
}

/// Returns the indices of the peaks that are much smaller than the largest.
pub(super) fn smaller(peaks: &[f64]) -> Vec<usize> {
    let largest = peaks.iter().copied().fold(0.0, f64::max);
    (0..peaks.len()).filter(|&i| peaks[i] * COMPARABLE < largest).collect()
}

/// Appends a figure of one signal of all runs. `of` is the object of the title, for example "X axis"; can be
/// empty.
pub(super) fn strip(page: &mut Page, of: &str, time: Extent, strip: Strip, series: Vec<TimeSeries>) {
    let Strip { title, note, quantity, unit } = strip;
    let legend = if page.is_comparison() { legend(&series) } else { Vec::new() };
    let caption = Caption { title: title.to_owned(), note: note.to_owned(), legend };
    let plot = TimePlot { quantity, unit, from_zero: true, time, series, at_least: None, shaded: Vec::new() };
    let title = if of.is_empty() { title.to_owned() } else { format!("{of}: {}", title.to_lowercase()) };
    page.html.figure("strip", &caption, &title, |id, title| plot.draw(id, title));
}

/// Appends a figure of one error of all runs, and a second one with only the runs of much smaller error.
pub(super) fn error_strip(page: &mut Page, of: &str, time: Extent, whole: Strip, series: Vec<TimeSeries>) {
    let small = smaller(&series.iter().map(|s| peak(s.values)).collect::<Vec<_>>());
    let small: Vec<TimeSeries> = small.into_iter().map(|i| series[i].clone()).collect();
    strip(page, of, time, whole, series);
    if !small.is_empty() {
        let detail = Strip { note: "enlarged, without the runs of larger error", ..whole };
        strip(page, of, time, detail, small);
    }
}
