//! Text output of `virtual_axes identify`.

use virtual_axes_core::text::escaped;
use virtual_axes_identify::identify::summary::IdentificationSummary;
use virtual_axes_identify::recording::Finding;
use virtual_axes_report::identification::figures;

use crate::output::text_table;

/// Returns the result as text and tables.
pub fn text(found: &IdentificationSummary) -> String {
    let lines =
        |lines: Vec<String>| lines.iter().map(|line| text_table::wrapped_line(line)).collect::<String>();
    let mut parts = vec![
        text_table::wrapped_line(&figures::verdict(found)),
        format!("{}: {}\n", escaped(&found.machine), found.axis),
        text_table::text(&figures::all_recordings(found)),
        text_table::aligned(&figures::values(&found.values), &[0, 2, 5]),
    ];
    if let Some(friction) = &found.friction {
        let laws = text_table::text(&figures::friction_laws(friction, found.speed_unit));
        parts.push(text_table::wrapped_line(&figures::friction(friction)) + &laws);
        let currents = figures::friction_currents(friction, found.speed_unit);
        if !currents.rows.is_empty() {
            parts.push(text_table::text(&currents));
        }
    }
    parts.push(lines(figures::steps(found)));
    let residuals = figures::residuals(found);
    if !residuals.is_empty() {
        parts.push(text_table::text(&figures::agreement(found, &residuals)));
    }
    let baselines =
        residuals.iter().filter_map(|(name, residuals)| figures::baseline(found, name, residuals));
    parts.push(lines(baselines.collect()));
    parts.push(lines(found.findings.iter().map(Finding::line).collect()));
    parts.retain(|part| !part.is_empty());
    parts.join("\n")
}

/// Returns the result in one line.
pub fn verdict(found: &IdentificationSummary) -> String {
    figures::verdict(found) + "\n"
}

/// Returns the identified values as comma-separated values.
pub fn csv(found: &IdentificationSummary) -> String {
    text_table::csv(&figures::values(&found.values))
}
