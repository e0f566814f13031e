//! Output of `virtual_axes tune`: text, and the section of the search in the report.

use virtual_axes_core::text::escaped;
use virtual_axes_core::units::{MICROMETER, MILLISECOND};
use virtual_axes_identify::tune::{
    CostTerm, Tuning, TuningCandidate, TuningProblem, TuningResult, pareto_front,
};
use virtual_axes_report::{Chart, ChartAxis, ChartSeries, DisplayUnit, Panel, Section, SeriesStyle, Table};

use crate::output::text_table;
use crate::tune::search::{columns, row};

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

/// Returns initial and best cost, the margins of the best tuning, the contour errors at rapid traverse, which the cost does
/// not contain, and a warning on the path in one line.
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
    let rapids = |candidate: &TuningCandidate| candidate.figures.contour.and_then(|contour| contour.rapids);
    let rapids = rapids(problem.present()).zip(rapids(&found.best)).map_or(String::new(), |(from, to)| {
        let [from, to] = [from, to].map(|rapids| rapids.max / MICROMETER);
        format!("; contour error at rapid traverse {from:.2} → {to:.2} µm")
    });
    format!("cost {}: {from:.2} → {to:.2}{unit}{change}{margins}{rapids}{warning}\n", problem.cost())
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
    let title = format!(
        "{}: {} of {}, cost {}",
        escaped(problem.workload().name()),
        escaped(problem.config().name()),
        problem.joints().join(", "),
        problem.cost(),
    );
    let mut text = format!(
        "{}\n{}\n{}\n{}",
        text_table::wrapped_line(verdict(problem, found, warning).trim_end()),
        text_table::wrapped_line(&title),
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
            // The group of the only parameter of contour control is in the table above.
            let tuning = one.tuning.to_string().replace("contour_control.", "");
            rows.rows.push(candidate_row(tuning, one, problem));
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
    let columns = [("parameter", ""), ("initial", ""), ("tuned", ""), ("unit", "")];
    let row = |(key, value): (String, virtual_axes_core::config::Value)| {
        let before = problem.parameters().get(&key).map_or("–".to_owned(), |value| value.to_string());
        let unit = problem.parameters().definition(&key).map_or("", |definition| definition.unit);
        vec![key, before, value.to_string(), unit.to_owned()]
    };
    let values = tuning.values(problem.joints(), problem.parameters());
    Table { rows: values.into_iter().map(row).collect(), ..Table::new("", &columns) }
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
    let cells = |name: String, better: &TuningCandidate, worse: &TuningCandidate| {
        let margins = candidate_row(name.clone(), better, problem);
        let margin = |column: usize| margins.get(column).cloned().unwrap_or_default();
        vec![name, format!("{:.2}", better.cost), format!("{:.2}", worse.cost), margin(3), margin(4)]
    };
    let present =
        found.elsewhere.iter().map(|path| cells("initial".to_owned(), problem.present(), &path.present));
    let worst = found.contrasts.iter().take(ROWS);
    let rows = present.chain(worst.map(|c| cells(c.better.tuning.to_string(), &c.better, &c.worse)));
    Table { rows: rows.collect(), ..Table::new("", &columns) }
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
    Table { rows: std::iter::once(first).chain(others).collect(), ..Table::new("", &columns) }
}

/// Creates the section of the search: cost over modulus margin and control activity, or over the cost on another path.
pub fn search_section(problem: &TuningProblem<'_>, found: &TuningResult) -> Vec<Section> {
    let unit = problem.cost().unit(&problem.present().figures);
    let unit = if unit.is_empty() { String::new() } else { format!(" ({unit})") };
    let cost = format!("Cost: {}{unit}", problem.cost());
    let axis = |label: String| ChartAxis::new(label, DisplayUnit::NONE);
    let points = |label: &str, group, points| ChartSeries::new(label, SeriesStyle::Points(group), points);
    let chart = |title: String, note: &str, [x, y]: [String; 2], series| Chart {
        note: note.to_owned(),
        ..Chart::new(title, axis(x), vec![Panel::new(axis(y), series)])
    };
    let section = |charts| vec![Section { charts, ..Section::new("Search") }];
    if let Some(path) = found.elsewhere.first().filter(|_| !found.contrasts.is_empty()) {
        let tunings = found.contrasts.iter().map(|c| [c.better.cost, c.worse.cost]).collect();
        let name = problem.workload().name();
        return section(vec![chart(
            format!("Better on {name} and worse on {}", path.name),
            "compared with the initial tuning",
            [name, &path.name].map(|path| format!("{cost} on {path}")),
            vec![
                points("tunings", 0, tunings),
                points("initial", 1, vec![[problem.present().cost, path.present.cost]]),
                points("found", 2, vec![[found.best.cost, path.tuned.cost]]),
            ],
        )]);
    }
    let Some(search) = &found.search else { return Vec::new() };
    let activity = |c: &TuningCandidate| CostTerm::Activity.of(&c.figures, problem.config());
    let less_activity = |c: &TuningCandidate| -activity(c);
    type Measure<'a> = &'a dyn Fn(&TuningCandidate) -> f64;
    let pictures: [(&str, &str, Measure, Measure); 2] = [
        ("Cost against modulus margin", "Modulus margin", &modulus, &modulus),
        ("Cost against control activity", "Control activity (A)", &activity, &less_activity),
    ];
    let charts = pictures.map(|(title, y, measure, merit)| {
        let dearest = MAX_PLOTTED_COST * search.best.cost.max(problem.present().cost);
        let point = |c: &TuningCandidate| [c.cost, measure(c)];
        let shown = search.tried.iter().filter(|c| c.cost <= dearest);
        let front = pareto_front(&search.tried, merit).into_iter().filter(|c| c.cost <= dearest);
        chart(
            title.to_owned(),
            "all simulated tunings within the margin limits",
            [cost.clone(), y.to_owned()],
            vec![
                points("tunings", 0, shown.map(point).collect()),
                ChartSeries::new("Pareto front", SeriesStyle::Steps(0), front.map(point).collect()),
                points("initial", 1, vec![point(problem.present())]),
                points("best", 2, vec![point(&search.best)]),
            ],
        )
    });
    section(charts.to_vec())
}
