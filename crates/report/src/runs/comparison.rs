//! Tables that compare runs.

use super::SimulatedRun;
use super::figure::{self, Figure};
use crate::{Table, TableColumn};

/// Creates tables with a row per figure and a column per run: path, circular tests, and axes. From the second run on, a
/// cell has the difference from the first run.
pub fn tables(runs: &[SimulatedRun]) -> [Table; 3] {
    // The tables of all runs have equal rows.
    let ends = runs.iter().any(|run| figure::overshoots(&run.outcome.figures));
    let axes: Vec<_> = runs.iter().map(|run| figure::of_axes(&run.outcome.figures)).collect();
    let path: Vec<_> = runs.iter().map(|run| run.path_figures(ends)).collect();
    let circles: Vec<_> = runs.iter().map(|run| figure::of_circles(&run.outcome.figures)).collect();
    [
        columns_of("Path", runs, &path),
        columns_of("Circular tests (ISO 230-4)", runs, &circles),
        columns_of("Axes", runs, &axes),
    ]
}

/// Creates the table of energy and power, as [`tables`].
pub fn energy(runs: &[SimulatedRun]) -> Table {
    let figures: Vec<_> = runs.iter().map(|run| figure::of_energy(&run.outcome.figures)).collect();
    columns_of("Energy", runs, &figures)
}

fn columns_of(caption: &str, runs: &[SimulatedRun], figures: &[Vec<Figure>]) -> Table {
    let mut table = Table::new(caption, &[("figure", ""), ("unit", "")]);
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

/// Returns the explanation of the differences in [`tables`].
pub fn note(runs: &[SimulatedRun]) -> Option<String> {
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
