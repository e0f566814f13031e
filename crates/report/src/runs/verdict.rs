//! The result of runs in one line each, with which text output and reports begin.

use virtual_axes_core::trial::Figures;
use virtual_axes_core::units::MICROMETER;

use super::figure::{self, Figure, percent};
use super::{SimulatedRun, table};

/// Share of blending that is not mentioned, m.
const LEAST_BLENDING: f64 = 0.05 * MICROMETER;

/// Returns the verdict of a single run, or a line for each further run that compares it with the first one.
pub fn lines(runs: &[SimulatedRun]) -> Vec<String> {
    match runs {
        [] => Vec::new(),
        [run] => vec![single(run)],
        [first, others @ ..] => others.iter().map(|run| compared(first, run)).collect(),
    }
}

fn single(run: &SimulatedRun) -> String {
    let figures = &run.outcome.figures;
    let main = main_figure(run);
    let contour = run.path_figures(false);
    let text = match contour.get(1) {
        _ if figures.axes.iter().all(|axis| !axis.moves) => "no axis moves".to_owned(),
        Some(rms) if main.subject.is_empty() => {
            format!("contour error {} µm max, {} µm RMS", main.text(), rms.text()) + &of_motions(run)
        }
        _ => format!("{} {} {}", without_max(&main), main.text(), main.unit),
    };
    text + &warnings(run)
}

/// Returns the kind of motion of a contour error, its shares, and the error at rapid traverse.
fn of_motions(run: &SimulatedRun) -> String {
    let Some(program) = &run.part_program else { return String::new() };
    let (cuts, rapids) = (program.figures.cuts, program.figures.rapids);
    let mut text = if cuts.is_some() { " at feed" } else { " at rapid traverse" }.to_owned();
    if let Some(errors) = cuts.or(rapids).filter(|errors| errors.blending > LEAST_BLENDING) {
        let [blending, drives] = [errors.blending, errors.drives].map(|error| error / MICROMETER);
        text += &format!(" (blending {blending:.1} µm, drives {drives:.1} µm)");
    }
    if let (Some(_), Some(rapids)) = (cuts, rapids) {
        text += &format!("; at rapid traverse {:.1} µm max", rapids.max / MICROMETER);
    }
    text
}

fn compared(first: &SimulatedRun, run: &SimulatedRun) -> String {
    let from = main_figure(first);
    let figures = &run.outcome.figures;
    let same = |to: &Figure| to.subject == from.subject && to.name == from.name;
    let to = run.path_figures(false).into_iter().chain(figure::of_axes(figures)).find(same);
    let to = to.unwrap_or_else(|| main_figure(run));
    let change = percent(&from, &to).map(|change| format!(", {change}")).unwrap_or_default();
    let warnings = warnings(run);
    let (title, name) = (run.title(), without_max(&to));
    format!("{title}: {name} {} → {} {}{change}{warnings}", from.text(), to.text(), to.unit)
}

fn without_max(figure: &Figure) -> String {
    figure.title().replace(", max", "")
}

/// Returns the largest contour error if several axes move the tool, else the largest delay-compensated following error.
fn main_figure(run: &SimulatedRun) -> Figure {
    let figures = &run.outcome.figures;
    let moving = figures.moving_tool_axes().count();
    let contour = run.path_figures(false).into_iter().next();
    let contour = contour.filter(|_| figures.contour.is_some_and(|contour| contour.max > 0.0));
    match (worst_axis(figures), contour) {
        (Some(worst), None) => worst,
        (Some(worst), Some(_)) if moving < 2 => worst,
        (_, Some(contour)) => contour,
        (None, None) => Figure::default(),
    }
}

/// Returns the largest delay-compensated following error of the axes.
fn worst_axis(figures: &Figures) -> Option<Figure> {
    let errors = figure::of_axes(figures).into_iter();
    errors
        .filter(|figure| figure.name == "delay-compensated following error, max")
        .max_by(|a, b| a.value.total_cmp(&b.value))
}

/// Returns warnings on loops and input, and the limits that axes reached, beginning with a semicolon; empty if there are none.
fn warnings(run: &SimulatedRun) -> String {
    let mut text = String::new();
    for warning in run.axis_warnings().iter().chain(&run.input_warnings) {
        text.push_str(&format!("; {warning}"));
    }
    for axis in &run.outcome.figures.axes {
        if axis.report.saturation_time > 0.0 {
            let time = axis.report.saturation_time;
            text.push_str(&format!(
                "; {} at a limit of speed, current or voltage for {time:.3} s",
                axis.name
            ));
        }
        if let Some(time) = table::outside(axis) {
            text.push_str(&format!("; {} outside its travel limits for {time} s", axis.name));
        }
    }
    text
}
