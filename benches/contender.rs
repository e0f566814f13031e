//! This library as a program of `benches/peers/run.py`, with the same protocol as the C loop.
//!
//! ```text
//! cargo bench --bench contender -- SETPOINTS [--circle RADIUS FIRST LAST] [--machines COUNT] [--cores COUNT]
//! ```
//!
//! SETPOINTS is a text file: names of the axes, then a row of setpoints (m, rad) per position cycle. Each line `run N`
//! on standard input makes N runs; the response is a line of JSON with the seconds per run and the figures. Without
//! arguments it prints its usage.

use std::error::Error;
use std::fmt::Display;
use std::hint::black_box;
use std::io::{self, BufRead, Write};
use std::num::{NonZeroU8, NonZeroU16, NonZeroU32};
use std::ops::Range;
use std::str::FromStr;
use std::sync::Arc;
use std::time::Instant;

use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use serde_json::{Value, json};
use virtual_axes_core::assess::{AxisAssessor, AxisReport};
use virtual_axes_core::config::{Assignment, Parameters, Value as Setting, ValueSource};
use virtual_axes_core::machine::{Machine, MachineParameters};
use virtual_axes_core::units::seconds;

const USAGE: &str = "contender SETPOINTS [--circle RADIUS FIRST LAST] [--machines COUNT] [--cores COUNT]   (see benches/peers/run.py)";
const MACHINE: &str = include_str!("../config/mikron_ucp710.yaml");
const JOINTS: &str = r#"joints: ["x", "y", "z", "a", "c"]"#;
/// Relative spread of Kp over the machines of a sweep, as in scalar.c.
const POSITION_SPREAD: f64 = 0.2;
/// Relative spread of Kv over the machines of a sweep, as in scalar.c.
const VELOCITY_SPREAD: f64 = 0.1;

/// Case of a benchmark.
struct Case {
    joints: Vec<String>,
    /// Setpoints, one row per position cycle.
    rows: Vec<Vec<f64>>,
    circle: Option<Circle>,
    machines: Vec<Arc<MachineParameters>>,
    /// Number of threads; 1 uses the main thread only.
    cores: usize,
}

/// Circle about (−radius, 0) that is assessed in a window of position cycles.
struct Circle {
    radius: f64,
    window: Range<usize>,
}

/// Figures of one machine.
struct Figures {
    axes: Vec<AxisReport>,
    deviation: Option<Deviation>,
}

/// Mean, smallest and largest radial deviation, m.
struct Deviation {
    mean: f64,
    min: f64,
    max: f64,
}

/// Machines simulated side by side on a core.
const TOGETHER: usize = 16;

/// Runs machines side by side and computes their figures: the measured part.
fn run_machines(machines: &[Arc<MachineParameters>], case: &Case) -> Vec<Figures> {
    let Some(together) = MachineParameters::concatenate(machines) else { return Vec::new() };
    let axes = case.joints.len();
    let mut machine = Machine::new(Arc::new(together));
    machine.reset(&case.rows[0].repeat(machines.len()));
    let mut assessors = vec![AxisAssessor::default(); machine.axis_count()];
    let mut circles = vec![Radial::default(); machines.len()];
    let mut psec = Vec::with_capacity(machine.axis_count());
    let mut x = vec![0.0; machine.ticks_per_period()];
    let mut y = x.clone();
    let width = pulp::Arch::new();
    for (k, row) in case.rows.iter().enumerate() {
        psec.clear();
        (0..machines.len()).for_each(|_| psec.extend_from_slice(row));
        machine.advance(&psec, &[]);
        for (index, assessor) in assessors.iter_mut().enumerate() {
            assessor.observe(machine.axis(index).sample(), &machine.activity(index));
        }
        if let Some(circle) = case.circle.as_ref().filter(|circle| circle.window.contains(&k)) {
            for (index, radial) in circles.iter_mut().enumerate() {
                machine.positions(index * axes, &mut x);
                machine.positions(index * axes + 1, &mut y);
                // Uses the widest vectors of the processor, like the library.
                width.dispatch(
                    #[inline(always)]
                    || radial.push(circle.radius, &x, &y),
                );
            }
        }
    }
    let tick = seconds(machine.periods().current);
    let figures = |(assessors, radial): (&[AxisAssessor], &Radial)| Figures {
        axes: assessors.iter().map(|assessor| assessor.report(tick)).collect(),
        deviation: radial.deviation(),
    };
    assessors.chunks(axes).zip(&circles).map(figures).collect()
}

/// Ticks whose radial deviations are computed side by side.
const SIDE_BY_SIDE: usize = 8;

/// Accumulator of the radial deviation about (−radius, 0) at each tick.
#[derive(Clone)]
struct Radial {
    sum: [f64; SIDE_BY_SIDE],
    min: [f64; SIDE_BY_SIDE],
    max: [f64; SIDE_BY_SIDE],
    count: usize,
}

impl Default for Radial {
    fn default() -> Self {
        Radial {
            sum: [0.0; SIDE_BY_SIDE],
            min: [f64::INFINITY; SIDE_BY_SIDE],
            max: [f64::NEG_INFINITY; SIDE_BY_SIDE],
            count: 0,
        }
    }
}

impl Radial {
    /// Adds ticks, a multiple of [`SIDE_BY_SIDE`].
    #[inline(always)]
    fn push(&mut self, radius: f64, x: &[f64], y: &[f64]) {
        let (x, _) = x.as_chunks::<SIDE_BY_SIDE>();
        let (y, _) = y.as_chunks::<SIDE_BY_SIDE>();
        for (x, y) in x.iter().zip(y) {
            for i in 0..SIDE_BY_SIDE {
                let (u, v) = (x[i] + radius, y[i]);
                let deviation = (u * u + v * v).sqrt() - radius;
                self.sum[i] += deviation;
                self.min[i] = if deviation < self.min[i] { deviation } else { self.min[i] };
                self.max[i] = if deviation > self.max[i] { deviation } else { self.max[i] };
            }
        }
        self.count += SIDE_BY_SIDE * x.len();
    }

    fn deviation(&self) -> Option<Deviation> {
        let mean = self.sum.iter().sum::<f64>() / self.count as f64;
        let min = self.min.into_iter().fold(f64::INFINITY, f64::min);
        let max = self.max.into_iter().fold(f64::NEG_INFINITY, f64::max);
        (self.count > 0).then_some(Deviation { mean, min, max })
    }
}

/// Runs all machines of a case on the cores of the pool.
fn run_case(case: &Case, pool: Option<&ThreadPool>) -> Vec<Figures> {
    let run = |machines| run_machines(machines, case);
    match pool {
        Some(pool) => {
            pool.install(|| case.machines.par_chunks(TOGETHER).with_max_len(1).flat_map(run).collect())
        }
        None => case.machines.chunks(TOGETHER).flat_map(run).collect(),
    }
}

/// Returns the default machine reduced to `joints`, with scaled gains.
fn machine(
    joints: &[String],
    position: f64,
    velocity: f64,
) -> Result<Arc<MachineParameters>, Box<dyn Error>> {
    let quoted: Vec<String> = joints.iter().map(|joint| format!("\"{joint}\"")).collect();
    let text = MACHINE.replace(JOINTS, &format!("joints: [{}]", quoted.join(", ")));
    let text = without_sections(&text, joints);
    let mut parameters = Parameters::from_yaml(&text, "benches/contender.rs")?;
    let source = ValueSource::named("benches/contender.rs");
    let mut assignments = Vec::new();
    for joint in joints {
        for (key, factor) in [("position_loop.gain", position), ("velocity_loop.gain", velocity)] {
            let key = format!("{joint}.{key}");
            let Some(Setting::Double(gain)) = parameters.get(&key) else { return Err(key.into()) };
            assignments.push(Assignment {
                key,
                value: Setting::Double(gain * factor),
                source: source.clone(),
            });
        }
    }
    parameters.set_all(assignments)?;
    Ok(Arc::new(MachineParameters::new(&parameters.machine_config()?)?))
}

/// Removes the sections of other joints from the text of a machine.
fn without_sections(text: &str, joints: &[String]) -> String {
    let mut kept = true;
    let lines = text.lines().filter(|line| {
        let section = line.strip_prefix("    ").and_then(|rest| rest.strip_suffix(':'));
        if let Some(section) = section.filter(|section| !section.starts_with(' ')) {
            let is_joint = JOINTS.contains(&format!("\"{section}\""));
            kept = !is_joint || joints.iter().any(|joint| joint == section);
        }
        kept
    });
    lines.collect::<Vec<_>>().join("\n")
}

/// Parses the value of an option.
fn value<T: FromStr<Err: Display>>(option: &str, word: &str) -> Result<T, String> {
    word.parse().map_err(|error| format!("{option} {word}: {error}"))
}

fn read(arguments: &[String]) -> Result<Case, Box<dyn Error>> {
    let (path, options) = arguments.split_first().ok_or(USAGE)?;
    let text = std::fs::read_to_string(path).map_err(|error| format!("{path}: {error}"))?;
    let mut lines = text.lines();
    let joints: Vec<String> =
        lines.next().ok_or("no first line")?.split_whitespace().map(str::to_owned).collect();
    let number = |word: &str| word.parse::<f64>().map_err(|error| format!("{path}: {word}: {error}"));
    let rows: Vec<Vec<f64>> =
        lines.map(|line| line.split_whitespace().map(number).collect()).collect::<Result<_, _>>()?;
    if rows.is_empty() || rows.iter().any(|row| row.len() != joints.len()) {
        return Err(
            format!("{path}: each row must have one value per joint, at least one row is required").into()
        );
    }
    let (mut circle, mut count, mut cores) = (None, 1, 1);
    let mut words = options.iter();
    while let Some(word) = words.next() {
        let mut next = || words.next().ok_or_else(|| format!("{word}: value is missing; {USAGE}"));
        match word.as_str() {
            "--circle" if joints.len() >= 2 => {
                let radius = value(word, next()?)?;
                circle = Some(Circle { radius, window: value(word, next()?)?..value(word, next()?)? });
            }
            "--machines" => count = i32::from(value::<NonZeroU16>(word, next()?)?.get()),
            "--cores" => cores = usize::from(value::<NonZeroU8>(word, next()?)?.get()),
            _ => return Err(format!("unknown option {word}; {USAGE}").into()),
        }
    }
    let spread =
        |index: i32| if count > 1 { 2.0 * f64::from(index) / f64::from(count - 1) - 1.0 } else { 0.0 };
    let scaled = |index| {
        let x = spread(index);
        machine(&joints, 1.0 + POSITION_SPREAD * x, 1.0 - VELOCITY_SPREAD * x)
    };
    let machines = (0..count).map(scaled).collect::<Result<_, _>>()?;
    Ok(Case { joints, rows, circle, machines, cores })
}

fn as_json(figures: &Figures, joints: &[String]) -> Value {
    let axes: serde_json::Map<String, Value> = joints
        .iter()
        .zip(&figures.axes)
        .map(|(joint, report)| {
            let value = json!({
                "max_following_error": report.max_following_error,
                "rms_following_error": report.rms_following_error,
                "max_delay_compensated_following_error": report.max_delay_compensated_following_error,
                "rms_delay_compensated_following_error": report.rms_delay_compensated_following_error,
                "peak_current": report.peak_current,
                "saturation_time": report.saturation_time,
                "control_activity": report.control_activity,
            });
            (joint.clone(), value)
        })
        .collect();
    let mut value = json!({ "axes": axes });
    if let Some(Deviation { mean, min, max }) = figures.deviation {
        value["circle"] = json!({ "mean": mean, "min": min, "max": max });
    }
    value
}

fn serve(case: &Case) -> Result<(), Box<dyn Error>> {
    let pool =
        (case.cores > 1).then(|| ThreadPoolBuilder::new().num_threads(case.cores).build()).transpose()?;
    for line in io::stdin().lock().lines() {
        let line = line?;
        let runs = line.strip_prefix("run ").and_then(|runs| runs.trim().parse::<NonZeroU32>().ok());
        let runs = runs.ok_or_else(|| format!("{line}: must be `run N` with N ≥ 1"))?.get();
        let began = Instant::now();
        let mut figures = Vec::new();
        for _ in 0..runs {
            figures = black_box(run_case(black_box(case), pool.as_ref()));
        }
        let seconds = began.elapsed().as_secs_f64() / f64::from(runs);
        let machines: Vec<Value> = figures.iter().map(|figures| as_json(figures, &case.joints)).collect();
        println!("{}", json!({ "seconds": seconds, "machines": machines }));
        io::stdout().flush()?;
    }
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    // `cargo bench` passes --bench, `cargo test` passes --test.
    let arguments: Vec<String> =
        std::env::args().skip(1).filter(|word| word != "--bench" && word != "--test").collect();
    // Other options are for the other programs of `cargo bench`.
    if arguments.first().is_none_or(|word| word.starts_with("--")) {
        println!("{USAGE}");
        return Ok(());
    }
    serve(&read(&arguments)?)
}
