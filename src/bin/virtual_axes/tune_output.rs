//! Output of `virtual_axes tune`: text, and scatter plots of the report.

use virtual_axes_core::text::escaped;
use virtual_axes_core::units::MILLISECOND;
use virtual_axes_identify::tune::{
    CostTerm, Tuning, TuningCandidate, TuningProblem, TuningResult, pareto_front,
};
use virtual_axes_report::{PointGroup, PointStyle, Scatter, Table, TableColumn};

use crate::search::{columns, row};
use crate::text_table;

/// Maximum number of rows of a table of tunings; the JSON output contains all.
const ROWS: usize = 6;
/// Cost above which tunings are not plotted, relative to the larger of initial and best cost.
const MAX_PLOTTED_COST: f64 = 2.0;

fn modulus(candidate: &TuningCandidate) -> f64 {
    candidate.margins.map_or(f64::NAN, |margins| margins.modulus)
}

fn candidate_row(name: String, candidate: &TuningCandidate, problem: &TuningProblem<'_>) -> Vec<String> {
    row(name, candidate.cost, candidate.margins.as_ref(), &candidate.figures, problem.config())
}

/// Selects evenly spaced rows, including the first and the last.
fn table_rows<T>(all: &[T]) -> Vec<&T> {
    if all.len() <= ROWS {
        return all.iter().collect();
    }
    (0..ROWS).filter_map(|i| all.get(i * (all.len() - 1) / (ROWS - 1))).collect()
}

/// Returns initial and best cost, the margins of the best tuning, and a warning on the path in one line.
pub fn verdict(problem: &TuningProblem<'_>, found: &TuningResult, warning: Option<&str>) -> String {
    let (from, to) = (problem.present().cost, found.best.cost);
    let unit = problem.cost().unit(&found.best.figures);
    let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
    let margins = found.best.margins.map_or(String::new(), |m| {
        format!("; modulus margin {:.3}, delay margin {:.2} ms", m.modulus, m.delay / MILLISECOND)
    });
    let change = 100.0 * (to / from - 1.0);
    let change =
        if change.is_finite() { format!(", {change:+.0} %").replace('-', "−") } else { String::new() };
    let warning = warning.map_or(String::new(), |warning| format!("; {warning}"));
    format!("cost {}: {from:.2} → {to:.2}{unit}{change}{margins}{warning}\n", problem.cost())
}

/// Creates the table of the initial and the best tuning.
fn tunings(problem: &TuningProblem<'_>, found: &TuningResult) -> Table {
    let columns = columns("tuning", problem.cost(), &problem.present().figures);
    let name = if found.contrasts.is_empty() { "best" } else { "found" };
    let rows = [("initial", problem.present()), (name, &found.best)];
    let rows = rows.map(|(name, one)| candidate_row(name.to_owned(), one, problem)).to_vec();
    Table { columns, rows, ..Table::default() }
}

/// Returns initial and best tuning and all tunings of the Pareto front as comma-separated values.
pub fn csv(problem: &TuningProblem<'_>, found: &TuningResult) -> String {
    let mut table = tunings(problem, found);
    let front = found.pareto().into_iter();
    table.rows.extend(front.map(|one| candidate_row(one.tuning.to_string(), one, problem)));
    text_table::csv(&table)
}

/// Returns the result as tables.
pub fn text(problem: &TuningProblem<'_>, found: &TuningResult, warning: Option<&str>) -> String {
    let columns = |first: &str| columns(first, problem.cost(), &problem.present().figures);
    let mut text = format!(
        "{}\n{}: {} of {}, cost {}\n\n{}\n{}",
        text_table::wrapped_line(verdict(problem, found, warning).trim_end()),
        escaped(problem.workload().name()),
        escaped(problem.config().name()),
        problem.joints().join(", "),
        problem.cost(),
        text_table::text(&tunings(problem, found)),
        text_table::text(&values(problem, &found.best.tuning)),
    );
    if found.best.cost >= problem.present().cost {
        text.push_str("\nno tuning within these margins is better than the initial tuning\n");
    }
    if let Some(search) = &found.search {
        let front = found.pareto();
        let mut rows = Table { columns: columns("cost against modulus margin"), ..Table::default() };
        for one in table_rows(&front) {
            rows.rows.push(candidate_row(one.tuning.to_string(), one, problem));
        }
        text.push_str(&format!("\n{}", text_table::text(&rows)));
        if front.len() > ROWS {
            text.push_str(&format!("{} more rows between these: use --json\n", front.len() - ROWS));
        }
        text.push_str(&format!("\n{} tunings designed, {} simulated\n", search.designs, search.runs));
    }
    if !found.contrasts.is_empty() {
        text.push_str(&format!("\n{}", text_table::text(&contrasts(problem, found))));
        if found.contrasts.len() > ROWS {
            text.push_str(&format!("{} more rows: use --json\n", found.contrasts.len() - ROWS));
        }
    }
    if !found.elsewhere.is_empty() {
        text.push_str(&format!("\n{}", text_table::text(&elsewhere(problem, found))));
    }
    text
}

/// Creates the table of tuned parameters with initial and tuned values.
fn values(problem: &TuningProblem<'_>, tuning: &Tuning) -> Table {
    let columns = ["parameter", "initial", "tuned", "unit"].map(|name| TableColumn::new(name, ""));
    let row = |(key, value): (String, virtual_axes_core::config::Value)| {
        let before = problem.parameters().get(&key).map_or("–".to_owned(), |value| value.to_string());
        let unit = problem.parameters().definition(&key).map_or("", |definition| definition.unit);
        vec![key, before, value.to_string(), unit.to_owned()]
    };
    let values = tuning.values(problem.joints(), problem.parameters());
    Table { columns: columns.to_vec(), rows: values.into_iter().map(row).collect(), ..Table::default() }
}

fn contrasts(problem: &TuningProblem<'_>, found: &TuningResult) -> Table {
    let other = found.elsewhere.first().map_or("", |path| path.name.as_str());
    let columns = [
        ("tuning", ""),
        (problem.workload().name(), problem.cost().unit(&problem.present().figures)),
        (other, found.elsewhere.first().map_or("", |path| problem.cost().unit(&path.present.figures))),
        ("modulus margin", ""),
        ("delay margin", "ms"),
    ];
    let columns = columns.map(|(name, unit)| TableColumn::new(name, unit)).to_vec();
    let cells = |name: String, better: &TuningCandidate, worse: &TuningCandidate| {
        let margins = candidate_row(name.clone(), better, problem);
        let margin = |column: usize| margins.get(column).cloned().unwrap_or_default();
        vec![name, format!("{:.2}", better.cost), format!("{:.2}", worse.cost), margin(3), margin(4)]
    };
    let present =
        found.elsewhere.iter().map(|path| cells("initial".to_owned(), problem.present(), &path.present));
    let worst = found.contrasts.iter().take(ROWS);
    let rows = present.chain(worst.map(|c| cells(c.better.tuning.to_string(), &c.better, &c.worse)));
    Table { columns, rows: rows.collect(), ..Table::default() }
}

/// Creates the table that compares initial and best tuning on all paths.
fn elsewhere(problem: &TuningProblem<'_>, found: &TuningResult) -> Table {
    let columns = [("path", ""), ("initial", ""), ("tuned", ""), ("unit", ""), ("tuned result", "")];
    let row = |name: &str, present: &TuningCandidate, tuned: &TuningCandidate| {
        let verdict = match tuned.cost.total_cmp(&present.cost) {
            std::cmp::Ordering::Less => "better",
            std::cmp::Ordering::Equal => "equal",
            std::cmp::Ordering::Greater => "worse",
        };
        let at_limit = if tuned.is_saturated { ", reaches a limit" } else { "" };
        vec![
            name.to_owned(),
            format!("{:.2}", present.cost),
            format!("{:.2}", tuned.cost),
            problem.cost().unit(&present.figures).to_owned(),
            format!("{verdict}{at_limit}"),
        ]
    };
    let first = row(problem.workload().name(), problem.present(), &found.best);
    let others = found.elsewhere.iter().map(|path| row(&path.name, &path.present, &path.tuned));
    Table {
        columns: columns.map(|(name, unit)| TableColumn::new(name, unit)).to_vec(),
        rows: std::iter::once(first).chain(others).collect(),
        ..Table::default()
    }
}

/// Creates the scatter plots: cost over modulus margin and control activity, or over the cost on another
/// path.
pub fn scatters(problem: &TuningProblem<'_>, found: &TuningResult) -> Vec<Scatter> {
    let unit = problem.cost().unit(&problem.present().figures);
    let quantity = |unit: &str| if unit.is_empty() { String::new() } else { format!(" ({unit})") };
    let cost = format!("Cost: {}{}", problem.cost(), quantity(unit));
    let group = |label: &str, style, points| PointGroup { label: label.to_owned(), style, points };
    if let Some(path) = found.elsewhere.first().filter(|_| !found.contrasts.is_empty()) {
        let points = found.contrasts.iter().map(|c| [c.better.cost, c.worse.cost]).collect();
        return vec![Scatter {
            title: format!("Better on {} and worse on {}", problem.workload().name(), path.name),
            note: "compared with the initial tuning".to_owned(),
            x: format!("{} on {}", cost, problem.workload().name()),
            y: format!("{} on {}", cost, path.name),
            groups: vec![
                group("tunings", PointStyle::Dots, points),
                group("initial", PointStyle::Run(0), vec![[problem.present().cost, path.present.cost]]),
                group("found", PointStyle::Run(1), vec![[found.best.cost, path.tuned.cost]]),
            ],
        }];
    }
    let Some(search) = &found.search else { return Vec::new() };
    let activity = |c: &TuningCandidate| CostTerm::Activity.of(&c.figures, problem.config());
    let less_activity = |c: &TuningCandidate| -activity(c);
    type Measure<'a> = &'a dyn Fn(&TuningCandidate) -> f64;
    let pictures: [(&str, &str, Measure, Measure); 2] = [
        ("Cost against modulus margin", "Modulus margin", &modulus, &modulus),
        ("Cost against control activity", "Control activity (A)", &activity, &less_activity),
    ];
    let scatter = |(title, y, measure, merit): (&str, &str, Measure, Measure)| {
        let front = pareto_front(&search.tried, merit);
        let dearest = MAX_PLOTTED_COST * search.best.cost.max(problem.present().cost);
        let point = |c: &TuningCandidate| [c.cost, measure(c)];
        let shown = search.tried.iter().filter(|c| c.cost <= dearest);
        let front = front.into_iter().filter(|c| c.cost <= dearest);
        Scatter {
            title: title.to_owned(),
            note: "all simulated tunings within the margin limits".to_owned(),
            x: cost.clone(),
            y: y.to_owned(),
            groups: vec![
                group("tunings", PointStyle::Dots, shown.map(point).collect()),
                group("Pareto front", PointStyle::Steps, front.into_iter().map(point).collect()),
                group("initial", PointStyle::Run(0), vec![point(problem.present())]),
                group("best", PointStyle::Run(1), vec![point(&search.best)]),
            ],
        }
    };
    pictures.into_iter().map(scatter).collect()
}
