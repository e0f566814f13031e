//! Table of the limit audit.

use virtual_axes_core::assess::{AuditedAxis, LargestUse, LimitAudit, SetpointPlace};
use virtual_axes_core::config::AxisUnits;
use virtual_axes_core::units::Rounded;
use virtual_axes_report::limit_audit::{describe, extremes, notes};
use virtual_axes_report::{Table, TableColumn};

use crate::output::text_table;

/// Headings of the table.
const HEADINGS: [&str; 9] =
    ["axis", "quantity", "unit", "largest", "limit", "ratio", "time, s", "setpoints beyond", "line"];

/// Returns a table with a row per quantity of each moving axis, and notes on limits that are not checked; empty if no axis moves.
pub fn text(audit: &LimitAudit) -> String {
    let column = |name: &str| TableColumn { name: name.to_owned(), unit: String::new(), run: None };
    let mut rows: Vec<Vec<String>> = audit.moving().flat_map(rows).collect();
    if rows.is_empty() {
        return String::new();
    }
    let line = HEADINGS.len() - 1;
    let has_lines = rows.iter().any(|row| !row[line].is_empty());
    let count = if has_lines { HEADINGS.len() } else { line };
    rows.iter_mut().for_each(|row| row.truncate(count));
    let columns = HEADINGS.into_iter().take(count).map(column).collect();
    let table = Table { caption: String::new(), columns, rows, ..Table::default() };
    let notes: String = notes(audit).iter().map(|note| text_table::wrapped_line(note)).collect();
    text_table::aligned(&table, &[0, 1, 2]) + &notes
}

fn rows(axis: &AuditedAxis) -> Vec<Vec<String>> {
    let row = |quantity: &str, unit: &str, numbers: [String; 3], place: SetpointPlace, beyond: u64| {
        let line = place.line.map_or_else(String::new, |line| line.to_string());
        let [largest, limit, ratio] = numbers;
        let head = [axis.name.clone(), quantity.to_owned(), unit.to_owned(), largest, limit, ratio];
        head.into_iter().chain([format!("{:.3}", place.time), beyond.to_string(), line]).collect()
    };
    let units = AxisUnits::for_kind(axis.kind);
    let mut rows = Vec::new();
    for (name, extreme, limit) in extremes(axis).filter(|(.., limit)| limit.is_finite()) {
        let numbers = [extreme.position, limit].map(|value| Rounded(value / units.length).to_string());
        let [position, limit] = numbers;
        rows.push(row(
            name,
            units.length_name,
            [position, limit, String::new()],
            extreme.place,
            extreme.beyond,
        ));
    }
    for largest in axis.limited() {
        let LargestUse { value, place, beyond, .. } = largest;
        let (name, size, unit) = describe(value.quantity, axis.kind);
        let numbers = [value.found / size, value.allowed / size, value.ratio()];
        rows.push(row(name, unit, numbers.map(|value| Rounded(value).to_string()), *place, *beyond));
    }
    rows
}
