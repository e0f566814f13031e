//! Tables of figures for the terminal and for reports.

use virtual_axes_core::config::AxisUnits;
use virtual_axes_core::trial::{AxisEnergy, AxisFigures, DcLinkEnergy, Figures};
use virtual_axes_core::units::Rounded;

use crate::Table;

/// Reason for a missing contour error.
pub const NO_CONTOUR: &str = "no linear joint is named x, y or z";

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
    let mut table = Table::new("Axes", &columns);
    let none_moves = figures.axes.iter().all(|axis| !axis.moves);
    for axis in figures.axes.iter().filter(|axis| axis.moves || none_moves) {
        let AxisUnits { error: scale, error_name: unit, .. } = AxisUnits::for_kind(axis.kind);
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

/// Creates the table of the energy of the axes that draw or lose any, and of the common DC link; without rows if energy was
/// not evaluated.
pub fn energy(figures: &Figures) -> Table {
    let columns = [
        ("energy", ""),
        ("input", "J"),
        ("copper loss", "J"),
        ("mechanical work", "J"),
        ("fed back", "J"),
        ("peak power", "W"),
        ("holding power", "W"),
    ];
    let mut table = Table::new("Energy", &columns);
    let axes = figures.axes.iter().filter_map(|axis| Some((axis, axis.energy?)));
    for (axis, energy) in axes.filter(|(axis, energy)| axis.moves || energy.copper_loss >= LEAST_ENERGY) {
        let AxisEnergy { input, copper_loss, mechanical_work, returned, peak_power, .. } = energy;
        let mut row = vec![axis.name.clone()];
        row.extend([input, copper_loss, mechanical_work, returned].map(unsigned_zero));
        row.push(format!("{peak_power:.0}"));
        row.push(energy.holding_power.map_or("–".to_owned(), |power| format!("{power:.2}")));
        table.rows.push(row);
    }
    if let (Some(link), [_, _, ..]) = (figures.dc_link, &table.rows[..]) {
        let DcLinkEnergy { drawn, returned, peak_power } = link;
        let none = || "–".to_owned();
        let copper: f64 =
            figures.axes.iter().filter_map(|axis| axis.energy).map(|energy| energy.copper_loss).sum();
        let work: f64 =
            figures.axes.iter().filter_map(|axis| axis.energy).map(|energy| energy.mechanical_work).sum();
        let mut row = vec!["all (DC link)".to_owned()];
        row.extend([drawn - returned, copper, work, returned].map(unsigned_zero));
        row.extend([format!("{peak_power:.0}"), none()]);
        table.rows.push(row);
    }
    table
}

/// Smallest copper loss of an axis at rest in the table, J.
const LEAST_ENERGY: f64 = 0.05;

/// Returns an energy with one decimal, without a negative zero.
fn unsigned_zero(energy: f64) -> String {
    let text = format!("{energy:.1}");
    if text == "-0.0" { "0.0".to_owned() } else { text.replace('-', "−") }
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

/// Sampling of the contour errors and radial deviations.
pub const SAMPLING: &str =
    "errors are evaluated at every current cycle; a trace or message has one sample per position cycle";
