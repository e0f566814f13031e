//! `virtual_axes tune`: the controllers' tuning that suits a path best.

use std::error::Error;
use std::path::{Path, PathBuf};

use virtual_axes_core::config::Parameters;
use virtual_axes_core::units::MILLISECOND;
use virtual_axes_identify::tune::{
    TuningProblem, TuningCandidate, Contrast, Cost, Workload, MarginLimits, SearchResult, TuneError, Tuning, contrast, fine_grid,
    tune_cascade, tune_gpc, tune_gpc_from,
};

use crate::input::{Input, must_not_replace};
use crate::progress::Runs;
use crate::run::Run;
use crate::search::{course, named};
use crate::subject::Subject;
use crate::{machine_file, report, tune_output as output, variant};

/// Controllers that can be tuned.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Tunable {
    /// N1, N2, Nu and λ of a predictive controller.
    Gpc,
    /// Kp and feedforward of the cascade.
    Cascade,
}

/// Most designs of a grid: an hour's work.
const MOST_DESIGNS: u64 = 1_000_000;

/// What to tune.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    subject: Subject,
    /// Controller to tune; that of the machine if it is not given.
    #[arg(long, value_enum)]
    controller: Option<Tunable>,
    /// What to make small: terms with weights, contour, contour-rms, tracking, rms, current, activity.
    #[arg(long, default_value = "contour", value_name = "TERM=WEIGHT[,…]")]
    cost: Cost,
    /// Smallest modulus margin of the worst axis; 0.5, or with --contrast 0, if it is not given.
    #[arg(long, allow_negative_numbers = true, value_parser = modulus_margin)]
    modulus_margin: Option<f64>,
    /// Smallest delay margin of the worst axis, ms; 5, or with --contrast 0, if it is not given.
    #[arg(long, allow_negative_numbers = true, value_parser = delay_margin)]
    delay_margin_ms: Option<f64>,
    /// Seed of the starts of the search of the cascade's gains; 1 if it is not given.
    #[arg(long, allow_negative_numbers = true)]
    seed: Option<u64>,
    /// Designs of predictive controllers in the first grid, at least: more of λ between its first and its last.
    #[arg(long, allow_negative_numbers = true, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=MOST_DESIGNS))]
    designs: Option<u64>,
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

impl Arguments {
    fn seed(&self) -> u64 {
        self.seed.unwrap_or(1)
    }
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
pub struct Elsewhere {
    /// Of the path.
    pub name: String,
    /// The machine as it is, there.
    pub present: TuningCandidate,
    /// The tuning, there.
    pub tuned: TuningCandidate,
}

/// What the command has found.
pub struct Found {
    /// The tuning, on the path.
    pub best: TuningCandidate,
    /// What the pictures show: every tuning that was run and keeps the limits, the cheapest first.
    pub search: Option<SearchResult>,
    /// Tunings that are better here and worse on the other path, the worst first.
    pub contrasts: Vec<Contrast>,
    /// The other paths.
    pub elsewhere: Vec<Elsewhere>,
}

/// Runs it; the text is tables, or JSON.
pub fn run(arguments: &Arguments) -> Result<String, Box<dyn Error>> {
    let machine = arguments.subject.machine()?;
    let parameters = variant::parameters(&machine, None, &arguments.subject.set, &[])?;
    let tunable = arguments.controller.map_or_else(|| tunable(&parameters), Ok)?;
    if arguments.contrast && tunable != Tunable::Gpc {
        return Err("--contrast: is for --controller gpc".into());
    }
    if arguments.designs.is_some() && (arguments.contrast || tunable != Tunable::Gpc) {
        return Err("--designs: is for --controller gpc without --contrast".into());
    }
    if arguments.seed.is_some() && tunable != Tunable::Cascade {
        return Err("--seed: is for --controller cascade, the search of gpc has none".into());
    }
    if arguments.contrast && arguments.also.len() > 1 {
        return Err(format!("--contrast: takes one --also path, not {}", arguments.also.len()).into());
    }
    let input = arguments.subject.input()?;
    check_outputs(arguments, &input)?;
    let config = variant::checked(&parameters, &machine, &arguments.subject.machine)?;
    let path = course(&input, &config, arguments.subject.feed)?;
    let others = arguments.also.iter().map(|name| Input::open(name, None)).collect::<Result<Vec<_>, _>>()?;
    let paths = others.iter().map(|other| course(other, &config, None)).collect::<Result<Vec<_>, _>>()?;
    let limits = limits(arguments);

    let progress = Runs::new();
    let found = TuningProblem::new(&parameters, &path, &arguments.cost, &progress)
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
        report::write(page, shown, bench.config().name(), &runs, &output::scatters(&bench, &found))?;
    }
    if arguments.json {
        return Ok(format!(
            "{:#}\n",
            output::object(&input, tunable, &limits, arguments.seed(), &bench, &found)
        ));
    }
    Ok(output::text(&bench, &found))
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
        arguments.subject.machine_must_not_be(output)?;
        arguments.also.iter().try_for_each(|path| must_not_replace(output, Path::new(path)))?;
    }
    if let (Some(out), Some(report)) = (&arguments.out, &arguments.report)
        && out == report
    {
        return Err(format!("{}: given for the machine and for the report", out.display()).into());
    }
    if let Some(out) = &arguments.out {
        machine_file::check_name(out)?;
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
    bench: &TuningProblem<'_>,
    paths: &[Workload],
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
        Tunable::Gpc => match arguments.designs.and_then(|designs| usize::try_from(designs).ok()) {
            Some(designs) => tune_gpc_from(bench, limits, fine_grid(designs))?,
            None => tune_gpc(bench, limits)?,
        },
        Tunable::Cascade => tune_cascade(bench, limits, arguments.seed())?,
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

/// The machine with the tuning; it stands under its name only when it is whole.
fn write_machine(
    path: &Path,
    arguments: &Arguments,
    bench: &TuningProblem<'_>,
    found: &Found,
) -> Result<(), Box<dyn Error>> {
    let best = &found.best;
    let tuned = best.tuning.apply(bench.parameters(), bench.joints())?;
    let unit = bench.cost().unit(&best.figures);
    let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
    let feed = arguments.subject.feed.map_or(String::new(), |feed| format!(" at feed {feed}"));
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
        arguments.subject.machine,
    );
    let keys: Vec<String> =
        best.tuning.values(bench.joints(), bench.parameters()).into_iter().map(|(key, _)| key).collect();
    let text =
        tuned.to_yaml(&head, |key| keys.iter().any(|k| k == key).then(|| format!("tuned for {tuning}")));
    Ok(machine_file::write(path, &text)?)
}

/// The machine as it is and the tuning that was found on a path, with recordings.
fn recorded(course: &Workload, bench: &TuningProblem<'_>, found: &Found) -> Result<[Run; 2], TuneError> {
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
