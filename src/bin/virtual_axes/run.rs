//! `virtual_axes run`: set-points through the simulation, offline.

use std::error::Error;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use virtual_axes::assess::{AxisReport, MotionReport};
use virtual_axes::config::{AxisKind, DEFAULT_MACHINE, Parameters, Source, parse_assignment};
use virtual_axes::files::{FileKind, Input, PsecCsv, Trajectories, read_psec_yaml, trace_writer};
use virtual_axes::simulation::{Outcome, Simulation, joints};
use virtual_axes::trajectory::{Context, JointLimits, MotionId, Request, Row, Start, Trajectory};
use virtual_axes::units::{DEGREE, Nanoseconds};

/// What to run.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Set-points: CSV with the header `time,x,y,…`, in s, m and rad.
    file: PathBuf,
    /// A shipped machine or a machine file.
    #[arg(long, default_value = DEFAULT_MACHINE)]
    machine: String,
    /// A parameter, as in `x.velocity_loop.gain=4.5`; can be given several times.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Where to write a row of signals for each position instant.
    #[arg(long, value_name = "FILE.csv")]
    trace: Option<PathBuf>,
}

/// Places of the axes that moved, and the figures of the motion.
type Figures = (Vec<usize>, MotionReport);

/// Runs it; the text is the table of errors.
pub fn run(arguments: &Arguments) -> Result<String, Box<dyn Error>> {
    let mut parameters = Parameters::load(&arguments.machine)?;
    let source = Source::named("--set");
    let assignments = arguments.set.iter().map(|text| parse_assignment(text, &source));
    parameters.set_all(assignments.collect::<Result<_, _>>()?)?;
    let config = parameters.machine_config()?;
    let node = parameters.node_config();

    let name = arguments.file.display().to_string();
    let limits = joints(&config, "");
    let request = read(&arguments.file, &limits, config.periods().position)?;
    let context = Context {
        joints: &limits,
        period: config.periods().position,
        max_points: usize::MAX,
        allow_nonzero_end_velocity: node.allow_nonzero_velocity_at_trajectory_end,
    };
    let refused = |rejection| format!("{name}: {rejection}");
    let trajectory = Arc::new(Trajectory::new(request, &context).map_err(refused)?);
    let mut simulation = Simulation::new(&config, limits.clone(), 0)?;
    simulation.offer(MotionId(1), trajectory).map_err(refused)?;

    if let Some(trace) = &arguments.trace
        && fs::canonicalize(trace).is_ok_and(|t| fs::canonicalize(&arguments.file).is_ok_and(|f| f == t))
    {
        return Err(format!("{}: the trace would replace the set-points", trace.display()).into());
    }
    let report = match &arguments.trace {
        None => execute(&mut simulation, |_| Ok(()))?,
        Some(path) => traced(&mut simulation, path, &limits)?,
    };
    Ok(table(&report, &limits))
}

/// The set-points of a file, whatever it is.
fn read(path: &Path, limits: &[JointLimits], period: Nanoseconds) -> Result<Request, Box<dyn Error>> {
    let input = Input::open(path)?;
    let name = input.name().to_owned();
    match input.kind() {
        FileKind::PsecCsv => {
            let mut psec = PsecCsv::new(input.into_reader(), &name, period, limits)?;
            let names = psec.joints().iter().map(|&place| limits[place].name.clone());
            let mut request = Request::new(Start::Now, names.collect());
            let mut positions = vec![0.0; psec.joints().len()];
            while psec.next(&mut positions)? {
                let time = (psec.next_instant() - 1) * period;
                request.push(time, Row { positions: &positions, ..Row::default() })?;
            }
            Ok(request)
        }
        FileKind::PsecYaml => {
            let requests = read_psec_yaml(input.text().unwrap_or_default(), &name)?;
            Ok(requests.into_iter().next().ok_or("no trajectory")?)
        }
        FileKind::Mcap => {
            let mut trajectories = Trajectories::open(path, None)?;
            Ok(trajectories.next().ok_or("no trajectory")??.1)
        }
        kind => Err(format!("{name}: it is {kind}, not set-points").into()),
    }
}

/// Runs until the axes have settled, and shows every position instant.
fn execute(
    simulation: &mut Simulation,
    mut show: impl FnMut(&Simulation) -> std::io::Result<()>,
) -> Result<Option<Figures>, Box<dyn Error>> {
    let mut report = None;
    while simulation.is_busy() {
        simulation.step();
        show(simulation)?;
        for end in simulation.take_ends() {
            if end.outcome == Outcome::Completed {
                report = Some((end.places, end.report));
            }
        }
    }
    Ok(report)
}

/// Runs with a trace that stands under its name only when it is whole.
fn traced(
    simulation: &mut Simulation,
    path: &Path,
    limits: &[JointLimits],
) -> Result<Option<Figures>, Box<dyn Error>> {
    let names: Vec<String> = limits.iter().map(|joint| joint.name.clone()).collect();
    let mut trace = trace_writer(path, &names)?;
    let report = execute(simulation, |s| trace.row(s.time_of(s.next_instant() - 1), s.samples()))?;
    trace.finish()?;
    Ok(report)
}

/// Errors in µm or mdeg, currents in A.
fn table(report: &Option<Figures>, limits: &[JointLimits]) -> String {
    let Some((places, report)) = report else { return "the motion was not completed\n".to_owned() };
    let mut text = String::from(
        "axis  unit   tracking error      synchronised error  peak current  saturated\n\
         \u{20}             max       RMS       max       RMS       A             s\n",
    );
    for (joint, axis) in places.iter().filter_map(|&p| limits.get(p)).zip(&report.axes) {
        let (unit, scale) = match joint.kind {
            AxisKind::Linear => ("µm", 1e6),
            AxisKind::Rotary => ("mdeg", 1e3 / DEGREE),
        };
        let AxisReport { max_tracking_error: max, rms_tracking_error: rms, .. } = axis;
        let (max_s, rms_s) = (axis.max_synchronized_tracking_error, axis.rms_synchronized_tracking_error);
        // Writing to a text cannot fail.
        let _ = writeln!(
            text,
            "{:<6}{unit:<7} {:<10.1}{:<10.1}{:<10.1}{:<10.1}{:<14.2}{:.3}",
            joint.name,
            max * scale,
            rms * scale,
            max_s * scale,
            rms_s * scale,
            axis.peak_current,
            axis.saturation_time
        );
    }
    if let (Some(max), Some(rms)) = (report.max_contour_error, report.rms_contour_error) {
        let _ = writeln!(text, "contour error: max {:.1} µm, RMS {:.1} µm", max * 1e6, rms * 1e6);
    }
    text
}
