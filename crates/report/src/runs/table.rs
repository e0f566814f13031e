//! Tables of figures for the terminal and for reports.

use virtual_axes_core::config::AxisKind;
use virtual_axes_core::trial::{AxisFigures, Figures};
use virtual_axes_core::units::{MICROMETER, MILLIDEGREE, Rounded};

use super::SimulatedRun;
use super::figure::{self, Figure};
use crate::{Table, TableColumn};

/// Reason for a missing contour error.
pub const NO_CONTOUR: &str = "no linear joint is named x, y or z";

/// Returns symbol, ASCII name and size in SI units of the unit of an axis's errors.
pub fn scale(kind: AxisKind) -> (&'static str, &'static str, f64) {
    match kind {
        AxisKind::Linear => ("µm", "um", MICROMETER),
        AxisKind::Rotary => ("mdeg", "mdeg", MILLIDEGREE),
    }
}

fn table(caption: &str, columns: &[(&str, &str)]) -> Table {
    let columns = columns.iter().map(|&(name, unit)| TableColumn::new(name, unit)).collect();
    Table { caption: caption.to_owned(), columns, rows: Vec::new() }
}

/// Creates the table of following errors, currents and saturation of the moving axes, or of all axes if none
/// moves.
pub fn axes(figures: &Figures) -> Table {
    let columns = [
        ("axis", ""),
        ("unit", ""),
        ("following error max", ""),
        ("RMS", ""),
        ("delay-compensated max", ""),
        ("RMS", ""),
        ("peak current of limit", "A"),
        ("time at a limit", "s"),
        ("activity", "A"),
    ];
    let mut table = table("Axes", &columns);
    let none_moves = figures.axes.iter().all(|axis| !axis.moves);
    for axis in figures.axes.iter().filter(|axis| axis.moves || none_moves) {
        let (unit, _, scale) = scale(axis.kind);
        let r = &axis.report;
        let errors = [
            r.max_following_error,
            r.rms_following_error,
            r.max_delay_compensated_following_error,
            r.rms_delay_compensated_following_error,
        ];
        let mut row = vec![axis.name.clone(), unit.to_owned()];
        row.extend(errors.iter().map(|error| format!("{:.1}", error / scale)));
        row.push(format!("{:.2} of {}", r.peak_current, Rounded(axis.max_current)));
        row.push(format!("{:.3}", r.saturation_time));
        row.push(format!("{:.3}", r.control_activity));
        table.rows.push(row);
    }
    table
}

/// Returns remarks on the axes, one per line.
pub fn remarks(figures: &Figures) -> Vec<String> {
    let names = |is_listed: fn(&AxisFigures) -> bool| {
        let names: Vec<&str> =
            figures.axes.iter().filter(|a| is_listed(a)).map(|a| a.name.as_str()).collect();
        (!names.is_empty()).then(|| names.join(", "))
    };
    let stationary = names(|axis| !axis.moves).map(|names| format!("stationary: {names}"));
    let extrapolated = names(|axis| axis.friction_extrapolated)
        .map(|names| format!("friction law extrapolated beyond its fitted velocities: {names}"));
    let outside = figures.axes.iter().filter_map(|axis| {
        Some(format!("{} was outside its travel limits for {} s", axis.name, outside(axis)?))
    });
    let overshoot = names(|axis| axis.report.peak_current > axis.max_current).map(|names| {
        format!(
            "the current limit bounds the setpoint of the current loop; the current overshoots it: {names}"
        )
    });
    let no_contour = figures.contour.is_none().then(|| format!("no contour error: {NO_CONTOUR}"));
    stationary
        .into_iter()
        .chain(outside)
        .chain(overshoot)
        .chain(extrapolated)
        .chain(no_contour)
        .chain(more(figures))
        .collect()
}

/// Returns the time that an axis was outside its travel limits, s; `None` if it was always inside.
pub fn outside(axis: &AxisFigures) -> Option<String> {
    (axis.outside_travel_limits_time > 0.0).then(|| format!("{:.3}", axis.outside_travel_limits_time))
}

/// Returns remarks on circles and corners without figures, one per line.
pub fn more(figures: &Figures) -> impl Iterator<Item = String> {
    let line = |count: usize, listed: usize, feature: &str| {
        (count > 0)
            .then(|| format!("{count} more {feature} without figures; only the first {listed} are evaluated"))
    };
    let circles = line(figures.more_circles, figures.circles.len(), "circles");
    let corners = line(figures.more_corners, figures.corners.len(), "corners");
    circles.into_iter().chain(corners)
}

/// Creates the table of contour error, orientation error, circles and corners.
pub fn path(figures: &Figures) -> Table {
    let mut table = table("Path", &[("path error", ""), ("value", ""), ("unit", "")]);
    let figures =
        figure::of_path(figures, figure::overshoots(figures)).into_iter().chain(figure::of_circles(figures));
    for figure in figures {
        table.rows.push(vec![figure.title(), figure.text(), figure.unit.to_owned()]);
    }
    table
}

/// Creates tables with a row per figure and a column per run: path, circular tests, and axes. From the second run on, a
/// cell has the difference from the first run.
pub fn comparison(runs: &[SimulatedRun]) -> [Table; 3] {
    // The tables of all runs have equal rows.
    let ends = runs.iter().any(|run| figure::overshoots(&run.outcome.figures));
    let axes: Vec<_> = runs.iter().map(|run| figure::of_axes(&run.outcome.figures)).collect();
    let path: Vec<_> = runs.iter().map(|run| figure::of_path(&run.outcome.figures, ends)).collect();
    let circles: Vec<_> = runs.iter().map(|run| figure::of_circles(&run.outcome.figures)).collect();
    [
        columns_of("Path", runs, &path),
        columns_of("Circular tests (ISO 230-4)", runs, &circles),
        columns_of("Axes", runs, &axes),
    ]
}

fn columns_of(caption: &str, runs: &[SimulatedRun], figures: &[Vec<Figure>]) -> Table {
    let mut table = table(caption, &[("figure", ""), ("unit", "")]);
    match runs {
        [_] => table.columns.push(TableColumn::new("value", "")),
        _ => {
            table.columns.extend(runs.iter().enumerate().map(|(i, run)| TableColumn::of_run(run.title(), i)))
        }
    }
    let Some((first, others)) = figures.split_first() else { return table };
    let mut subject = "";
    for (row, base) in first.iter().enumerate() {
        // The figures of an axis, circle or corner stand below its name.
        if base.subject != subject {
            table.rows.push(vec![base.subject.clone()]);
            subject = &base.subject;
        }
        let name = if base.subject.is_empty() { base.name.clone() } else { format!("– {}", base.name) };
        let mut cells = vec![name, base.unit.to_owned(), base.text()];
        let same = |run: &Vec<Figure>| run.get(row).map(|figure| figure.compared_text(base));
        cells.extend(others.iter().map(|run| same(run).unwrap_or_default()));
        table.rows.push(cells);
    }
    table
}

/// Returns the explanation of the differences in [`comparison`].
pub fn comparison_note(runs: &[SimulatedRun]) -> Option<String> {
    let first = runs.first().filter(|_| runs.len() > 1)?;
    Some(format!(
        "in parentheses: difference from {} in percent, of signed figures in their unit",
        first.title()
    ))
}

/// Returns the definition of the reversal spikes, for runs with circles.
pub fn spike_note(runs: &[SimulatedRun]) -> Option<String> {
    let has_circle = runs.iter().any(|run| !run.outcome.figures.circles.is_empty());
    has_circle.then(|| {
        "reversal spike: the radial deviation within 20° of a reversal that differs most from the mean, minus the mean"
            .to_owned()
    })
}

/// Sampling of the contour errors and radial deviations.
pub const SAMPLING: &str =
    "errors are evaluated at every current cycle; a trace or message has one sample per position cycle";
