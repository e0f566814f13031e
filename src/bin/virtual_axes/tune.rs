//! `virtual_axes tune`: the controllers' tuning that suits a path best.

use std::error::Error;
use std::io::Write;
use std::path::{Path, PathBuf};

use serde_json::{Map, Value, json};
use virtual_axes::config::{DEFAULT_MACHINE, Parameters};
use virtual_axes::files::OutputFile;
use virtual_axes::report::{Column, PointGroup, PointStyle, Scatter, Table};
use virtual_axes::tune::{
    Bench, Candidate, Contrast, Cost, Course, MarginLimits, Search, Term, TuneError, Tuning, contrast, front,
    tune_cascade, tune_gpc,
};
use virtual_axes::units::MILLISECOND;

use crate::input::Input;
use crate::progress::Runs;
use crate::run::Run;
use crate::search::{candidate, columns, course, named, row};
use crate::{json, report, table, variant};

/// Rows of a table of many tunings; `--json` has all.
const ROWS: usize = 12;
/// Points that cost more than so many times the machine as it is and the best are not in the picture: they
/// would press the others to its edge.
const PICTURED: f64 = 2.0;

/// Controllers that can be tuned.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Tunable {
    /// N1, N2, Nu and λ of a predictive controller.
    Gpc,
    /// Kp and feedforward of the cascade.
    Cascade,
}

/// What to tune.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// A shipped scenario, a scenario file, or a file of set-points: CSV, MCAP or YAML as for `run`.
    #[arg(value_name = "SCENARIO|FILE")]
    input: String,
    /// A shipped machine or a machine file.
    #[arg(long, default_value = DEFAULT_MACHINE)]
    machine: String,
    /// Controller to tune; that of the machine if it is not given.
    #[arg(long, value_enum)]
    controller: Option<Tunable>,
    /// A parameter of the machine as it is, as in `x.velocity_loop.gain=4.5`; can be given several times.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Feed in the place of the scenario's, m/min (rpm for a scenario of rotary moves).
    #[arg(long, allow_negative_numbers = true)]
    feed: Option<f64>,
    /// The topic to run, if a recording has several with a JointTrajectory.
    #[arg(long)]
    topic: Option<String>,
    /// What to make small: terms with weights, contour, contour-rms, tracking, rms, current, activity.
    #[arg(long, default_value = "contour", value_name = "TERM=WEIGHT[,…]")]
    cost: Cost,
    /// Smallest modulus margin of the worst axis; 0.5, or with --contrast 0, if it is not given.
    #[arg(long, allow_negative_numbers = true, value_parser = modulus_margin)]
    modulus_margin: Option<f64>,
    /// Smallest delay margin of the worst axis, ms; 5, or with --contrast 0, if it is not given.
    #[arg(long, allow_negative_numbers = true, value_parser = delay_margin)]
    delay_margin_ms: Option<f64>,
    /// Seed of the starts of the search of the cascade's gains.
    #[arg(long, default_value_t = 1, allow_negative_numbers = true)]
    seed: u64,
    /// One more path to run the tuning that was found on; can be given several times.
    #[arg(long, value_name = "SCENARIO|FILE")]
    also: Vec<String>,
    /// Look for predictive controllers that are better than the machine as it is on SCENARIO and worse on
    /// the --also path; takes the worst of them.
    #[arg(long, requires = "also")]
    contrast: bool,
    /// Where to write the machine with the tuning that was found.
    #[arg(long, value_name = "FILE.yaml")]
    out: Option<PathBuf>,
    /// Where to write a page with the search and with plots of the tuning beside the machine as it is
    /// (with --contrast on the --also path).
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// Print the result as one JSON object.
    #[arg(long)]
    json: bool,
}

fn modulus_margin(text: &str) -> Result<f64, String> {
    within(text, 1.0)
}

fn delay_margin(text: &str) -> Result<f64, String> {
    /// A second is beyond every position loop.
    const MOST: f64 = 1000.0;
    within(text, MOST)
}

fn within(text: &str, most: f64) -> Result<f64, String> {
    let refused = || format!("must lie in 0 … {most}");
    let value: f64 = text.parse().map_err(|_| refused())?;
    if (0.0..=most).contains(&value) { Ok(value) } else { Err(refused()) }
}

/// A path beside the one that is tuned for: the machine as it is, and the tuning, there.
struct Elsewhere {
    name: String,
    present: Candidate,
    tuned: Candidate,
}

/// What the command has found.
struct Found {
    /// The tuning, on the path.
    best: Candidate,
    /// What the pictures show: every tuning that was run and keeps the limits, the cheapest first.
    search: Option<Search>,
    contrasts: Vec<Contrast>,
    elsewhere: Vec<Elsewhere>,
}

/// Runs it; the text is tables, or JSON.
pub fn run(arguments: &Arguments) -> Result<String, Box<dyn Error>> {
    let machine = Parameters::load(&arguments.machine)?;
    let parameters = variant::parameters(&machine, None, &arguments.set, &[])?;
    let tunable = arguments.controller.map_or_else(|| tunable(&parameters), Ok)?;
    if arguments.contrast && tunable != Tunable::Gpc {
        return Err("--contrast: is for --controller gpc".into());
    }
    if arguments.contrast && arguments.also.len() > 1 {
        return Err(format!("--contrast: takes one --also path, not {}", arguments.also.len()).into());
    }
    let input = Input::open(&arguments.input, arguments.topic.as_deref())?;
    check_outputs(arguments, &input)?;
    let config = parameters.machine_config()?;
    let path = course(&input, &config, arguments.feed)?;
    let others = arguments.also.iter().map(|name| Input::open(name, None)).collect::<Result<Vec<_>, _>>()?;
    let paths = others.iter().map(|other| course(other, &config, None)).collect::<Result<Vec<_>, _>>()?;
    let limits = limits(arguments);

    let progress = Runs::new();
    let found = Bench::new(&parameters, &path, &arguments.cost, &progress)
        .and_then(|bench| Ok((search(arguments, tunable, &bench, &paths, &limits)?, bench)));
    progress.finish();
    let (found, bench) = found.map_err(|error| named(&input, error))?;
    let Some(found) = found else {
        return Err(format!(
            "{}: no tuning of the grid is better than the machine as it is here and worse on {}",
            input.name(),
            arguments.also.join(", ")
        )
        .into());
    };
    if let Some(out) = &arguments.out {
        write_machine(out, arguments, &bench, &found)?;
    }
    if let Some(page) = &arguments.report {
        // A contrast is seen where the tuning is worse.
        let (shown, course) = match (others.first(), paths.first()) {
            (Some(other), Some(course)) if arguments.contrast => (other, course),
            _ => (&input, &path),
        };
        let runs = recorded(course, &bench, &found).map_err(|error| named(shown, error))?;
        report::write(page, shown, bench.config().name(), &runs, &scatters(&bench, &found))?;
    }
    if arguments.json {
        return Ok(format!("{:#}\n", object(arguments, &input, tunable, &limits, &bench, &found)));
    }
    Ok(text(arguments, &bench, &found))
}

/// The controller of the machine.
fn tunable(parameters: &Parameters) -> Result<Tunable, String> {
    match variant::controller_name(parameters).as_str() {
        "gpc" => Ok(Tunable::Gpc),
        "cascade" | "cascade-noff" => Ok(Tunable::Cascade),
        other => Err(format!("--controller: say which to tune, gpc or cascade; the machine has {other}")),
    }
}

fn limits(arguments: &Arguments) -> MarginLimits {
    let default = if arguments.contrast { MarginLimits::STABLE } else { MarginLimits::default() };
    MarginLimits {
        modulus: arguments.modulus_margin.unwrap_or(default.modulus),
        delay: arguments.delay_margin_ms.map_or(default.delay, |ms| ms * MILLISECOND),
    }
}

/// Refuses, before the work begins, what could not be written behind it.
fn check_outputs(arguments: &Arguments, input: &Input) -> Result<(), Box<dyn Error>> {
    for output in [&arguments.out, &arguments.report].into_iter().flatten() {
        input.must_not_be(output)?;
        if Path::new(&arguments.machine) == output {
            return Err(format!("{}: the output would replace the machine file", output.display()).into());
        }
    }
    if let (Some(out), Some(report)) = (&arguments.out, &arguments.report)
        && out == report
    {
        return Err(format!("{}: given for the machine and for the report", out.display()).into());
    }
    if let Some(out) = &arguments.out {
        let extension = out.extension().map(|e| e.to_string_lossy().to_lowercase());
        if !matches!(extension.as_deref(), None | Some("yaml" | "yml")) {
            return Err(format!("{}: a machine file is YAML: .yaml", out.display()).into());
        }
    }
    match &arguments.report {
        Some(page) => Ok(report::check_name(page)?),
        None => Ok(()),
    }
}

/// The tuning that was asked for; none only where no contrast is found.
fn search(
    arguments: &Arguments,
    tunable: Tunable,
    bench: &Bench<'_>,
    paths: &[Course],
    limits: &MarginLimits,
) -> Result<Option<Found>, TuneError> {
    if let (true, [path]) = (arguments.contrast, paths) {
        let (present, contrasts) = contrast(bench, path, limits)?;
        return Ok(contrasts.first().cloned().map(|worst| Found {
            best: worst.better,
            search: None,
            elsewhere: vec![Elsewhere { name: path.name().to_owned(), present, tuned: worst.worse }],
            contrasts,
        }));
    }
    let search = match tunable {
        Tunable::Gpc => tune_gpc(bench, limits)?,
        Tunable::Cascade => tune_cascade(bench, limits, arguments.seed)?,
    };
    let elsewhere = paths.iter().map(|path| {
        Ok(Elsewhere {
            name: path.name().to_owned(),
            present: bench.run_on(path, &Tuning::Present)?,
            tuned: bench.run_on(path, &search.best.tuning)?,
        })
    });
    let elsewhere = elsewhere.collect::<Result<Vec<_>, TuneError>>()?;
    Ok(Some(Found { best: search.best.clone(), search: Some(search), contrasts: Vec::new(), elsewhere }))
}

fn modulus(candidate: &Candidate) -> f64 {
    candidate.margins.map_or(f64::NAN, |margins| margins.modulus)
}

/// The cheapest tuning for each modulus margin.
fn pareto(found: &Found) -> Vec<&Candidate> {
    found.search.as_ref().map_or_else(Vec::new, |search| front(&search.tried, modulus))
}

fn candidate_row(name: String, candidate: &Candidate, bench: &Bench<'_>) -> Vec<String> {
    row(name, candidate.cost, candidate.margins.as_ref(), &candidate.figures, bench.config())
}

/// As many of `all` as a table has, evenly, with both ends.
fn thinned<T>(all: &[T]) -> Vec<&T> {
    if all.len() <= ROWS {
        return all.iter().collect();
    }
    (0..ROWS).filter_map(|i| all.get(i * (all.len() - 1) / (ROWS - 1))).collect()
}

fn text(arguments: &Arguments, bench: &Bench<'_>, found: &Found) -> String {
    let columns = |first: &str| columns(first, bench.cost(), &bench.present().figures);
    let mut tunings = Table { columns: columns("tuning"), ..Table::default() };
    tunings.rows.push(candidate_row("as it is".to_owned(), bench.present(), bench));
    let name = if arguments.contrast { "found" } else { "best" };
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
fn values(bench: &Bench<'_>, tuning: &Tuning) -> Table {
    let columns = ["parameter", "as it is", "tuned"].map(|name| Column::new(name, ""));
    let row = |(key, value): (String, virtual_axes::config::Value)| {
        let before = bench.parameters().get(&key).map_or("–".to_owned(), |value| value.to_string());
        vec![key, before, value.to_string()]
    };
    let values = tuning.values(bench.joints(), bench.parameters());
    Table { columns: columns.to_vec(), rows: values.into_iter().map(row).collect(), ..Table::default() }
}

fn contrasts(bench: &Bench<'_>, found: &Found) -> Table {
    let other = found.elsewhere.first().map_or("", |path| path.name.as_str());
    let columns = [
        ("tuning", ""),
        (bench.course().name(), bench.cost().unit(&bench.present().figures)),
        (other, found.elsewhere.first().map_or("", |path| bench.cost().unit(&path.present.figures))),
        ("modulus margin", ""),
        ("delay margin", "ms"),
    ];
    let columns = columns.map(|(name, unit)| Column::new(name, unit)).to_vec();
    let cells = |name: String, better: &Candidate, worse: &Candidate| {
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
fn elsewhere(bench: &Bench<'_>, found: &Found) -> Table {
    let columns = [("path", ""), ("as it is", ""), ("tuned", ""), ("unit", ""), ("the tuned one is", "")];
    let row = |name: &str, present: &Candidate, tuned: &Candidate| {
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
        columns: columns.map(|(name, unit)| Column::new(name, unit)).to_vec(),
        rows: std::iter::once(first).chain(others).collect(),
        ..Table::default()
    }
}

fn object(
    arguments: &Arguments,
    input: &Input,
    tunable: Tunable,
    limits: &MarginLimits,
    bench: &Bench<'_>,
    found: &Found,
) -> Value {
    let with_figures = |one: &Candidate| {
        let mut object = candidate(one, bench.config());
        object.insert("figures".to_owned(), json::figures(&one.figures).into());
        Value::Object(object)
    };
    let plain = |one: &Candidate| Value::Object(candidate(one, bench.config()));
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
    add("seed", json!(arguments.seed));
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

/// The machine with the tuning; it stands under its name only when it is whole.
fn write_machine(
    path: &Path,
    arguments: &Arguments,
    bench: &Bench<'_>,
    found: &Found,
) -> Result<(), Box<dyn Error>> {
    let best = &found.best;
    let tuned = best.tuning.apply(bench.parameters(), bench.joints())?;
    let unit = bench.cost().unit(&best.figures);
    let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
    let feed = arguments.feed.map_or(String::new(), |feed| format!(" at feed {feed}"));
    let margins = best.margins.map_or(String::new(), |m| {
        format!(", modulus margin {:.3}, delay margin {:.2} ms", m.modulus, m.delay / MILLISECOND)
    });
    let tuning = format!(
        "{}{feed}, {} = {:.2}{unit} (before {:.2}){margins}",
        bench.course().name(),
        bench.cost(),
        best.cost,
        bench.present().cost
    );
    let head = format!(
        "{}, from the machine {} by `virtual_axes tune`.\nWhere its other values come from stands there.\n\
         Tuned for {tuning}.",
        bench.config().name(),
        arguments.machine,
    );
    let keys: Vec<String> =
        best.tuning.values(bench.joints(), bench.parameters()).into_iter().map(|(key, _)| key).collect();
    let text =
        tuned.to_yaml(&head, |key| keys.iter().any(|k| k == key).then(|| format!("tuned for {tuning}")));
    let mut file = OutputFile::create(path)?;
    file.write_all(text.as_bytes())?;
    Ok(file.finish()?)
}

/// The machine as it is and the tuning that was found on a path, with recordings.
fn recorded(course: &Course, bench: &Bench<'_>, found: &Found) -> Result<[Run; 2], TuneError> {
    let run = |tuning: &Tuning| -> Result<Run, TuneError> {
        // Of the axes that are tuned.
        let controller = match tuning {
            Tuning::Present => variant::controller_name(bench.parameters()),
            Tuning::Gpc { .. } => "gpc".to_owned(),
            Tuning::Cascade(_) => "cascade".to_owned(),
        };
        let outcome = bench.record_on(course, tuning)?;
        Ok(Run { controller, changes: vec![tuning.to_string()], outcome })
    };
    Ok([run(&Tuning::Present)?, run(&found.best.tuning)?])
}

/// Cost against modulus margin and against control activity, or on one path against another.
fn scatters(bench: &Bench<'_>, found: &Found) -> Vec<Scatter> {
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
    let activity = |c: &Candidate| Term::Activity.of(&c.figures, bench.config());
    let less_activity = |c: &Candidate| -activity(c);
    type Measure<'a> = &'a dyn Fn(&Candidate) -> f64;
    let pictures: [(&str, &str, Measure, Measure); 2] = [
        ("Cost against modulus margin", "Modulus margin", &modulus, &modulus),
        ("Cost against control activity", "Control activity (A)", &activity, &less_activity),
    ];
    let scatter = |(title, y, measure, merit): (&str, &str, Measure, Measure)| {
        let front = front(&search.tried, merit);
        let dearest = PICTURED * search.best.cost.max(bench.present().cost);
        let point = |c: &Candidate| [c.cost, measure(c)];
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
