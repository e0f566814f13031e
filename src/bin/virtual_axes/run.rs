//! `virtual_axes run`: set-points through the simulation, offline.

use std::error::Error;
use std::fmt::Write as _;
use std::fs::{self, File};
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use virtual_axes::assess::{AxisReport, MotionReport};
use virtual_axes::config::{AxisKind, DEFAULT_MACHINE, Parameters, Source, parse_assignment};
use virtual_axes::files::{TraceCsv, read_psec};
use virtual_axes::simulation::{Outcome, Simulation, joints};
use virtual_axes::trajectory::{Context, JointLimits, MotionId, Trajectory};
use virtual_axes::units::DEGREE;

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
    let file = File::open(&arguments.file).map_err(|error| format!("{name}: {error}"))?;
    let request = read_psec(file, &name)?;
    let limits = joints(&config, "");
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
    let failed = |error: std::io::Error| format!("{}: {error}", path.display());
    let names: Vec<String> = limits.iter().map(|joint| joint.name.clone()).collect();
    // Where there is something already, links are followed; a device or a pipe is written to as it is.
    let target = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    let in_place = fs::metadata(&target).is_ok_and(|m| !m.is_file());
    let partial = if in_place { target.clone() } else { partial_name(&target) };
    let file = if in_place {
        File::options().write(true).open(&partial)
    } else {
        File::options().write(true).create_new(true).open(&partial)
    };
    let file = BufWriter::new(file.map_err(failed)?);
    let written = (|| -> Result<_, Box<dyn Error>> {
        let mut trace = TraceCsv::new(file, &names).map_err(failed)?;
        let report = execute(simulation, |s| trace.row(s.time_of(s.next_instant() - 1), s.samples()))
            .map_err(|error| format!("{}: {error}", path.display()))?;
        trace.finish().map_err(failed)?;
        if !in_place {
            fs::rename(&partial, &target).map_err(failed)?;
        }
        Ok(report)
    })();
    if written.is_err() && !in_place {
        // It was made here, and is of no use to anybody.
        let _ = fs::remove_file(&partial);
    }
    written
}

/// A name beside `target` that no other run uses.
fn partial_name(target: &Path) -> PathBuf {
    let name = target.file_name().unwrap_or_default().to_string_lossy();
    target.with_file_name(format!(".{name}.{}.partial", std::process::id()))
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
