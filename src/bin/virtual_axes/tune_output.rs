//! What `virtual_axes tune` prints, and the pictures of its report.

use serde_json::{Map, Value, json};
use virtual_axes_core::units::MILLISECOND;
use virtual_axes_identify::tune::{TuningProblem, TuningCandidate, MarginLimits, CostTerm, Tuning, front};
use virtual_axes_report::{TableColumn, PointGroup, PointStyle, Scatter, Table};

use crate::input::Input;
use crate::search::{candidate, columns, row};
use crate::tune::{Found, Tunable};
use crate::{json, table};

/// Rows of a table of many tunings; `--json` has all.
const ROWS: usize = 12;
/// Points that cost more than so many times the machine as it is and the best are not in the picture: they
/// would press the others to its edge.
const PICTURED: f64 = 2.0;

fn modulus(candidate: &TuningCandidate) -> f64 {
    candidate.margins.map_or(f64::NAN, |margins| margins.modulus)
}

/// The cheapest tuning for each modulus margin.
fn pareto(found: &Found) -> Vec<&TuningCandidate> {
    found.search.as_ref().map_or_else(Vec::new, |search| front(&search.tried, modulus))
}

fn candidate_row(name: String, candidate: &TuningCandidate, bench: &TuningProblem<'_>) -> Vec<String> {
    row(name, candidate.cost, candidate.margins.as_ref(), &candidate.figures, bench.config())
}

/// As many of `all` as a table has, evenly, with both ends.
fn thinned<T>(all: &[T]) -> Vec<&T> {
    if all.len() <= ROWS {
        return all.iter().collect();
    }
    (0..ROWS).filter_map(|i| all.get(i * (all.len() - 1) / (ROWS - 1))).collect()
}

/// The result as tables.
pub fn text(bench: &TuningProblem<'_>, found: &Found) -> String {
    let columns = |first: &str| columns(first, bench.cost(), &bench.present().figures);
    let mut tunings = Table { columns: columns("tuning"), ..Table::default() };
    tunings.rows.push(candidate_row("as it is".to_owned(), bench.present(), bench));
    let name = if found.contrasts.is_empty() { "best" } else { "found" };
    tunings.rows.push(candidate_row(name.to_owned(), &found.best, bench));
    let mut text = format!(
        "{}: {} of {}, cost {}\n\n{}\n{}",
        bench.course().name(),
        bench.config().name(),
        bench.joints().join(", "),
        bench.cost(),
        table::text(&tunings),
        table::text(&values(bench, &found.best.tuning)),
    );
    if found.best.cost >= bench.present().cost {
        text.push_str("\nno tuning within these margins is better than the machine as it is\n");
    }
    if let Some(search) = &found.search {
        let front = pareto(found);
        let mut rows = Table { columns: columns("cost against modulus margin"), ..Table::default() };
        for one in thinned(&front) {
            rows.rows.push(candidate_row(one.tuning.to_string(), one, bench));
        }
        text.push_str(&format!("\n{}", table::text(&rows)));
        if front.len() > ROWS {
            text.push_str(&format!("{} more between these: --json\n", front.len() - ROWS));
        }
        text.push_str(&format!("\n{} tunings designed, {} run\n", search.designs, search.runs));
    }
    if !found.contrasts.is_empty() {
        text.push_str(&format!("\n{}", table::text(&contrasts(bench, found))));
        if found.contrasts.len() > ROWS {
            text.push_str(&format!("{} more: --json\n", found.contrasts.len() - ROWS));
        }
    }
    if !found.elsewhere.is_empty() {
        text.push_str(&format!("\n{}", table::text(&elsewhere(bench, found))));
    }
    text
}

/// The parameters that the tuning sets, before and behind.
fn values(bench: &TuningProblem<'_>, tuning: &Tuning) -> Table {
    let columns = ["parameter", "as it is", "tuned"].map(|name| TableColumn::new(name, ""));
    let row = |(key, value): (String, virtual_axes_core::config::Value)| {
        let before = bench.parameters().get(&key).map_or("–".to_owned(), |value| value.to_string());
        vec![key, before, value.to_string()]
    };
    let values = tuning.values(bench.joints(), bench.parameters());
    Table { columns: columns.to_vec(), rows: values.into_iter().map(row).collect(), ..Table::default() }
}

fn contrasts(bench: &TuningProblem<'_>, found: &Found) -> Table {
    let other = found.elsewhere.first().map_or("", |path| path.name.as_str());
    let columns = [
        ("tuning", ""),
        (bench.course().name(), bench.cost().unit(&bench.present().figures)),
        (other, found.elsewhere.first().map_or("", |path| bench.cost().unit(&path.present.figures))),
        ("modulus margin", ""),
        ("delay margin", "ms"),
    ];
    let columns = columns.map(|(name, unit)| TableColumn::new(name, unit)).to_vec();
    let cells = |name: String, better: &TuningCandidate, worse: &TuningCandidate| {
        let margins = candidate_row(name.clone(), better, bench);
        let margin = |place: usize| margins.get(place).cloned().unwrap_or_default();
        vec![name, format!("{:.2}", better.cost), format!("{:.2}", worse.cost), margin(3), margin(4)]
    };
    let present =
        found.elsewhere.iter().map(|path| cells("as it is".to_owned(), bench.present(), &path.present));
    let worst = found.contrasts.iter().take(ROWS);
    let rows = present.chain(worst.map(|c| cells(c.better.tuning.to_string(), &c.better, &c.worse)));
    Table { columns, rows: rows.collect(), ..Table::default() }
}

/// Where the tuning is better than the machine as it is, and where it is worse.
fn elsewhere(bench: &TuningProblem<'_>, found: &Found) -> Table {
    let columns = [("path", ""), ("as it is", ""), ("tuned", ""), ("unit", ""), ("the tuned one is", "")];
    let row = |name: &str, present: &TuningCandidate, tuned: &TuningCandidate| {
        let verdict = match tuned.cost.total_cmp(&present.cost) {
            std::cmp::Ordering::Less => "better",
            std::cmp::Ordering::Equal => "as good",
            std::cmp::Ordering::Greater => "worse",
        };
        let saturates = if tuned.saturated { ", saturates" } else { "" };
        vec![
            name.to_owned(),
            format!("{:.2}", present.cost),
            format!("{:.2}", tuned.cost),
            bench.cost().unit(&present.figures).to_owned(),
            format!("{verdict}{saturates}"),
        ]
    };
    let first = row(bench.course().name(), bench.present(), &found.best);
    let others = found.elsewhere.iter().map(|path| row(&path.name, &path.present, &path.tuned));
    Table {
        columns: columns.map(|(name, unit)| TableColumn::new(name, unit)).to_vec(),
        rows: std::iter::once(first).chain(others).collect(),
        ..Table::default()
    }
}

/// The result as one object.
pub fn object(
    input: &Input,
    tunable: Tunable,
    limits: &MarginLimits,
    seed: u64,
    bench: &TuningProblem<'_>,
    found: &Found,
) -> Value {
    let with_figures = |one: &TuningCandidate| {
        let mut object = candidate(one, bench.config());
        object.insert("figures".to_owned(), json::figures(&one.figures).into());
        Value::Object(object)
    };
    let plain = |one: &TuningCandidate| Value::Object(candidate(one, bench.config()));
    let mut object = Map::new();
    let mut add = |name: &str, value: Value| object.insert(name.to_owned(), value);
    add("input", json!(input.name()));
    add("description", json!(input.description()));
    add("machine", json!(bench.config().name()));
    add("controller", json!(if tunable == Tunable::Gpc { "gpc" } else { "cascade" }));
    add("tuned_axes", json!(bench.joints()));
    let terms = bench.cost().terms().iter().map(|(term, weight)| (term.name().to_owned(), json!(weight)));
    add("cost", Value::Object(terms.collect()));
    add("cost_unit", json!(bench.cost().unit(&bench.present().figures)));
    let delay = limits.delay / MILLISECOND;
    add("limits", json!({ "modulus_margin": limits.modulus, "delay_margin_ms": delay }));
    add("seed", json!(seed));
    add("present", with_figures(bench.present()));
    add("best", with_figures(&found.best));
    if let Some(search) = &found.search {
        add("designs", json!(search.designs));
        add("runs", json!(search.runs));
        add("pareto", pareto(found).into_iter().map(plain).collect());
    }
    let also = found.elsewhere.iter().map(|path| {
        json!({ "input": path.name, "present": with_figures(&path.present), "tuned": with_figures(&path.tuned) })
    });
    add("also", also.collect());
    let contrasts =
        found.contrasts.iter().map(|c| json!({ "better": plain(&c.better), "worse": plain(&c.worse) }));
    add("contrasts", contrasts.collect());
    Value::Object(object)
}

/// Cost against modulus margin and against control activity, or on one path against another.
pub fn scatters(bench: &TuningProblem<'_>, found: &Found) -> Vec<Scatter> {
    let unit = bench.cost().unit(&bench.present().figures);
    let quantity = |unit: &str| if unit.is_empty() { String::new() } else { format!(" ({unit})") };
    let cost = format!("Cost: {}{}", bench.cost(), quantity(unit));
    let group = |label: &str, style, points| PointGroup { label: label.to_owned(), style, points };
    if let Some(path) = found.elsewhere.first().filter(|_| !found.contrasts.is_empty()) {
        let points = found.contrasts.iter().map(|c| [c.better.cost, c.worse.cost]).collect();
        return vec![Scatter {
            title: format!("Better on {} and worse on {}", bench.course().name(), path.name),
            note: "than the machine as it is".to_owned(),
            x: format!("{} on {}", cost, bench.course().name()),
            y: format!("{} on {}", cost, path.name),
            groups: vec![
                group("tunings", PointStyle::Dots, points),
                group("as it is", PointStyle::Run(0), vec![[bench.present().cost, path.present.cost]]),
                group("found", PointStyle::Run(1), vec![[found.best.cost, path.tuned.cost]]),
            ],
        }];
    }
    let Some(search) = &found.search else { return Vec::new() };
    let activity = |c: &TuningCandidate| CostTerm::Activity.of(&c.figures, bench.config());
    let less_activity = |c: &TuningCandidate| -activity(c);
    type Measure<'a> = &'a dyn Fn(&TuningCandidate) -> f64;
    let pictures: [(&str, &str, Measure, Measure); 2] = [
        ("Cost against modulus margin", "Modulus margin", &modulus, &modulus),
        ("Cost against control activity", "Control activity (A)", &activity, &less_activity),
    ];
    let scatter = |(title, y, measure, merit): (&str, &str, Measure, Measure)| {
        let front = front(&search.tried, merit);
        let dearest = PICTURED * search.best.cost.max(bench.present().cost);
        let point = |c: &TuningCandidate| [c.cost, measure(c)];
        let shown = search.tried.iter().filter(|c| c.cost <= dearest);
        let front = front.into_iter().filter(|c| c.cost <= dearest);
        Scatter {
            title: title.to_owned(),
            note: "of the tunings that were run and keep the margins".to_owned(),
            x: cost.clone(),
            y: y.to_owned(),
            groups: vec![
                group("tunings", PointStyle::Dots, shown.map(point).collect()),
                group(
                    "no tuning is better in both",
                    PointStyle::Steps,
                    front.into_iter().map(point).collect(),
                ),
                group("as it is", PointStyle::Run(0), vec![point(bench.present())]),
                group("best", PointStyle::Run(1), vec![point(&search.best)]),
            ],
        }
    };
    pictures.into_iter().map(scatter).collect()
}
