//! Tables of figures for the terminal and for reports.

use virtual_axes_core::config::AxisKind;
use virtual_axes_core::trial::{AxisFigures, Figures, Reference};
use virtual_axes_core::units::{DEGREE, MILLIMETER};
use virtual_axes_report::{Table, TableColumn};

/// Micrometer, m.
pub const MICROMETER: f64 = 1e-6;
/// Millidegree, rad.
pub const MILLIDEGREE: f64 = 1e-3 * DEGREE;

/// Reason for a missing contour error.
pub const NO_CONTOUR: &str = "no linear joint is named x, y or z";

/// Returns symbol, ASCII name and size in SI units of the unit of an axis's errors.
pub fn scale(kind: AxisKind) -> (&'static str, &'static str, f64) {
    match kind {
        AxisKind::Linear => ("µm", "um", MICROMETER),
        AxisKind::Rotary => ("mdeg", "mdeg", MILLIDEGREE),
    }
}

/// Formats a table for the terminal with the first column aligned left, the others right.
pub fn text(table: &Table) -> String {
    aligned(table, &[0])
}

/// Formats a table for the terminal with the columns `left` aligned left, the others right.
pub fn aligned(table: &Table, left: &[usize]) -> String {
    let header: Vec<String> = table.columns.iter().map(heading).collect();
    let all = || std::iter::once(&header).chain(&table.rows);
    let width = |column: usize| all().filter_map(|row| row.get(column)).map(|c| c.chars().count()).max();
    let mut text = String::new();
    for row in all() {
        let mut line = String::new();
        for (column, cell) in row.iter().enumerate() {
            let pad = " ".repeat(width(column).unwrap_or(0) - cell.chars().count());
            if column > 0 {
                line.push_str("  ");
            }
            let parts = if left.contains(&column) { [cell.as_str(), &pad] } else { [pad.as_str(), cell] };
            line.extend(parts);
        }
        text.push_str(line.trim_end());
        text.push('\n');
    }
    text
}

fn heading(column: &TableColumn) -> String {
    match column.unit.as_str() {
        "" => column.name.clone(),
        unit => format!("{}, {unit}", column.name),
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
        ("peak current", "A"),
        ("saturated", "s"),
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
        row.push(format!("{:.2}", r.peak_current));
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
    let no_contour = figures.contour.is_none().then(|| format!("no contour error: {NO_CONTOUR}"));
    stationary.into_iter().chain(outside).chain(extrapolated).chain(no_contour).chain(more(figures)).collect()
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

/// Returns true for the largest and for the RMS contour error if its printed value changes when the overshoot
/// at the ends of the path is excluded.
pub fn overshoots(figures: &Figures) -> [bool; 2] {
    let differ = |a: f64, b: f64| signed(a / MICROMETER) != signed(b / MICROMETER);
    figures
        .contour
        .map_or([false; 2], |c| [differ(c.max, c.max_within_ends), differ(c.rms, c.rms_within_ends)])
}

/// Creates the table of contour error, orientation error, circles and corners. `ends` adds the largest and
/// the RMS contour error without the overshoot at the ends of the path.
pub fn path(figures: &Figures, ends: [bool; 2]) -> Table {
    let mut table = table("Path", &[("path error", ""), ("value", ""), ("unit", "")]);
    let mut add = |name: String, value: f64, unit: &str, scale: f64| {
        table.rows.push(vec![name, signed(value / scale), unit.to_owned()]);
    };
    if let Some(contour) = &figures.contour {
        let reference = match contour.reference {
            Reference::Path => "",
            Reference::Setpoints => " (from the polyline of setpoints)",
        };
        let parts = [
            ("contour error, max", contour.max, contour.max_within_ends, ends[0]),
            ("contour error, RMS", contour.rms, contour.rms_within_ends, ends[1]),
        ];
        for (name, whole, within_ends, differ) in parts {
            add(format!("{name}{reference}"), whole, "µm", MICROMETER);
            if differ {
                add(format!("{name}, without overshoot at the path ends"), within_ends, "µm", MICROMETER);
            }
        }
    }
    if let Some(orientation) = &figures.orientation
        && orientation.max > 0.0
    {
        add("orientation error, max".to_owned(), orientation.max, "mdeg", MILLIDEGREE);
        add("orientation error, RMS".to_owned(), orientation.rms, "mdeg", MILLIDEGREE);
    }
    for circle in &figures.circles {
        let plane = circle.plane.join("–");
        let direction = if circle.counterclockwise { "counterclockwise" } else { "clockwise" };
        let name = format!("circle R {} mm in {plane}, {direction}", millimeters(circle.radius));
        add(format!("{name}: radial deviation, mean"), circle.mean, "µm", MICROMETER);
        add(format!("{name}: radial deviation, min"), circle.min, "µm", MICROMETER);
        add(format!("{name}: radial deviation, max"), circle.max, "µm", MICROMETER);
        if let Some(deviation) = circle.circular_deviation {
            add(format!("{name}: circular deviation G"), deviation, "µm", MICROMETER);
        }
    }
    for pair in &figures.bidirectional {
        add("both directions: circular deviation G(b)".to_owned(), pair.circular_deviation, "µm", MICROMETER);
        let mean = pair.mean_radial_deviation;
        add("both directions: mean radial deviation D".to_owned(), mean, "µm", MICROMETER);
    }
    for corner in &figures.corners {
        let name =
            format!("corner after move {}, {:.0}°: contour error, max", corner.index, corner.turn / DEGREE);
        add(name, corner.max_contour_error, "µm", MICROMETER);
    }
    table
}

fn signed(value: f64) -> String {
    // Avoids "-0.0".
    let text = format!("{value:.1}");
    if text == "-0.0" { "0.0".to_owned() } else { text }
}

fn millimeters(value: f64) -> String {
    // Rounded to 1 µm, so that 0.15 m is 150 and not 150.00000000000003.
    format!("{}", (value / MILLIMETER * 1e3).round() / 1e3)
}
