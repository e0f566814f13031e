//! `virtual_axes bode`: frequency responses and margins of the current, velocity and position loops.

use std::error::Error;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use virtual_axes_core::config::{AxisConfig, Periods};
use virtual_axes_core::design::{ControlLoop, DesignError, FrequencyResponse, LoopMargins, LoopResponse};
use virtual_axes_core::machine::{
    NaturalFrequencies, contour_axes, contour_response, loop_response, natural_frequencies,
};
use virtual_axes_io::files::OutputFile;

use crate::design::selected_axes;
use crate::report::ReportMachine;
use crate::trial_arguments::MachineArguments;
use crate::{bode_output, bode_report, report};

/// File name of the standard output.
const STANDARD_OUTPUT: &str = "-";

/// Arguments of `virtual_axes bode`.
#[derive(Debug, clap::Args)]
pub struct BodeArguments {
    #[command(flatten)]
    machine: MachineArguments,
    /// Axes to analyze [default: all].
    #[arg(long, value_name = "AXIS[,AXIS]…", value_delimiter = ',')]
    axis: Vec<String>,
    /// Loops to analyze [default: all].
    #[arg(long = "loop", value_enum, value_name = "LOOP[,LOOP]…", value_delimiter = ',')]
    loops: Vec<LoopName>,
    /// Print only the verdict.
    #[arg(long, short, conflicts_with = "json")]
    quiet: bool,
    /// Print the figures as one JSON object.
    #[arg(long)]
    json: bool,
    /// Write the frequency responses as comma-separated values; without FILE to standard output, instead of the table.
    #[arg(long, value_name = "FILE", num_args = 0..=1, default_missing_value = STANDARD_OUTPUT)]
    csv: Option<PathBuf>,
    /// Write a report with Bode plots (.html).
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
}

/// Control loop on the command line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum LoopName {
    /// Current loop.
    Current,
    /// Velocity loop.
    Velocity,
    /// Position loop.
    Position,
    /// Position loop across a path, with the gain of cross-coupled control.
    Contour,
}

impl LoopName {
    /// Returns the name: current, velocity, position or contour.
    pub fn name(self) -> &'static str {
        match self {
            LoopName::Current => ControlLoop::Current.name(),
            LoopName::Velocity => ControlLoop::Velocity.name(),
            LoopName::Position => ControlLoop::Position.name(),
            LoopName::Contour => "contour",
        }
    }

    fn of(control_loop: ControlLoop) -> Self {
        match control_loop {
            ControlLoop::Current => LoopName::Current,
            ControlLoop::Velocity => LoopName::Velocity,
            ControlLoop::Position => LoopName::Position,
        }
    }
}

/// Loops of one axis.
#[derive(Debug)]
pub struct AxisLoops {
    /// Axis name.
    pub axis: String,
    /// Natural frequencies of an elastic axis.
    pub natural_frequencies: Option<NaturalFrequencies>,
    /// Loops from the innermost to the outermost.
    pub loops: Vec<AnalyzedLoop>,
}

/// One loop of an axis.
#[derive(Debug)]
pub struct AnalyzedLoop {
    /// Loop.
    pub control_loop: LoopName,
    /// Cycle, s.
    pub period: f64,
    /// Margins, or an error with the unstable pole.
    pub margins: Result<LoopMargins, DesignError>,
    /// Frequency in Hz and magnitude of the resonance peak of the closed loop.
    pub peak: Option<(f64, f64)>,
    /// Sampled response.
    pub response: FrequencyResponse,
}

/// Runs the command and returns a table, JSON or comma-separated values.
pub fn run(arguments: &BodeArguments) -> Result<String, Box<dyn Error>> {
    check_outputs(arguments)?;
    let config = arguments.machine.parameters()?.machine_config()?;
    let gain = config.contour_gain();
    let coupled: Vec<&str> = contour_axes(gain, config.axes().iter())
        .into_iter()
        .filter_map(|index| config.axes().get(index).map(AxisConfig::name))
        .collect();
    let selected = selected_axes(config.axes(), &arguments.axis)?;
    let has_contour = selected.iter().any(|axis| coupled.contains(&axis.name()));
    if arguments.loops == [LoopName::Contour] && !has_contour {
        return Err(match coupled.is_empty() {
            true => "--loop contour: cross-coupled control is off; set contour_control.gain above 0".into(),
            false => format!("--loop contour: only {} have this loop", coupled.join(", ")).into(),
        });
    }
    let mut axes = Vec::new();
    for axis in selected {
        let gain = coupled.contains(&axis.name()).then_some(gain);
        let loops = analyze((axis, gain), &config.periods(), &arguments.loops)
            .map_err(|error| format!("axis {}: {error}", axis.name()))?;
        axes.push(loops);
    }
    if let Some(page) = &arguments.report {
        let machine =
            ReportMachine { title: config.name().to_owned(), source: arguments.machine.name().to_owned() };
        bode_report::write(page, &machine, &axes)?;
    }
    match &arguments.csv {
        Some(path) if path.as_os_str() == STANDARD_OUTPUT => return Ok(bode_output::csv(&axes)),
        Some(path) => write(path, &bode_output::csv(&axes))?,
        None => {}
    }
    Ok(if arguments.json {
        format!("{:#}\n", bode_output::object(config.name(), &axes))
    } else if arguments.quiet {
        bode_output::verdict(&axes)
    } else {
        bode_output::text(&axes)
    })
}

/// Rejects output files that cannot be written beside each other or that are the machine file.
fn check_outputs(arguments: &BodeArguments) -> Result<(), String> {
    for output in [&arguments.csv, &arguments.report].into_iter().flatten() {
        arguments.machine.must_not_be(output)?;
    }
    if let Some(page) = &arguments.report {
        report::check_name(page)?;
    }
    match (&arguments.csv, &arguments.report) {
        (Some(csv), Some(page)) if csv == page => {
            Err(format!("{}: is given for both --csv and --report; use different files", page.display()))
        }
        (Some(csv), _) if csv.as_os_str() == STANDARD_OUTPUT && (arguments.json || arguments.quiet) => {
            let other = if arguments.json { "--json" } else { "--quiet" };
            Err(format!("--csv and {other} both print to standard output; give --csv a file"))
        }
        _ => Ok(()),
    }
}

/// Analyzes the selected loops of an axis; `contour_gain` is the gain of cross-coupled control, 1/s, if it acts on the axis.
fn analyze(
    (axis, contour_gain): (&AxisConfig, Option<f64>),
    periods: &Periods,
    selected: &[LoopName],
) -> Result<AxisLoops, Box<dyn Error>> {
    let is_selected = |name: LoopName| selected.is_empty() || selected.contains(&name);
    let mut loops = Vec::new();
    for control_loop in ControlLoop::ALL {
        let name = LoopName::of(control_loop);
        if is_selected(name) {
            loops.push(analyzed(name, &loop_response(axis, periods, control_loop)?));
        }
    }
    if let Some(gain) = contour_gain.filter(|_| is_selected(LoopName::Contour)) {
        loops.push(analyzed(LoopName::Contour, &contour_response(axis, periods, gain)?));
    }
    Ok(AxisLoops { axis: axis.name().to_owned(), natural_frequencies: natural_frequencies(axis), loops })
}

fn analyzed(control_loop: LoopName, model: &LoopResponse) -> AnalyzedLoop {
    let margins = model.margins();
    // The response of an unstable loop has no peak that could be measured.
    let peak = margins.as_ref().ok().and_then(|_| model.resonance_peak());
    AnalyzedLoop { control_loop, period: model.period(), margins, peak, response: model.sample() }
}

/// Writes the file atomically.
fn write(path: &Path, text: &str) -> io::Result<()> {
    let mut file = OutputFile::create(path)?;
    file.write_all(text.as_bytes())?;
    file.finish()
}
