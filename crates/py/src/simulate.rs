//! Complete runs: setpoints in, signals and figures out.

use std::ffi::CString;
use std::io;
use std::path::Path;
use std::sync::Arc;

use numpy::{PyArray1, PyReadonlyArray2};
use pyo3::exceptions::{PyUserWarning, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use virtual_axes_builtin::PROGRAMS;
use virtual_axes_core::assess::{CircleTrace, PathDeviations};
use virtual_axes_core::config::MachineConfig;
use virtual_axes_core::kinematics::Kinematics;
use virtual_axes_core::machine::check_input;
use virtual_axes_core::path::Program;
use virtual_axes_core::trial::{
    self, Figures, Measures, RunOptions, SetpointSource, Tick, Trial, TrialError, TrialOutcome,
};
use virtual_axes_io::files::{figures_json, part_program_json, trace_writer};
use virtual_axes_nc::offline::{LineErrors, ProgramFigures, ProgramTrack, line_texts};
use virtual_axes_report::ToolPath;
use virtual_axes_report::runs::{
    ProgramReport, SimulatedRun, SimulationPage, axis_warnings, controller_name,
};

use crate::convert::{check_signals, value_error};
use crate::machine::PyMachine;
use crate::setpoints::{PartProgram, PyScenario, Rows};
use crate::signals::{SIGNALS, SignalTable, TOOL_SIGNALS, ToolDeviations, ToolSignals};

/// Position cycles between two looks at signals.
const CYCLES_PER_CHECK: u64 = 5_000;

/// Returns the choice of figures by its name.
pub fn measures(name: &str) -> PyResult<Measures> {
    match name {
        "all" => Ok(Measures::ALL),
        "contour" => Ok(Measures::WITHOUT_CIRCLES),
        "axes" => Ok(Measures::AXES),
        other => Err(value_error(format!("figures {other:?}: must be \"all\", \"contour\" or \"axes\""))),
    }
}

/// Setpoints of a run as given by the caller.
#[derive(FromPyObject)]
pub enum Given<'py> {
    /// Rows × axes, m or rad.
    #[pyo3(transparent)]
    Array(PyReadonlyArray2<'py, f64>),
    #[pyo3(transparent)]
    Scenario(PyRef<'py, PyScenario>),
    #[pyo3(transparent)]
    PartProgram(PyRef<'py, PartProgram>),
}

/// Setpoints, of a scenario with its path, of a part program with its lines.
pub struct Prepared {
    pub rows: Rows,
    pub program: Option<Arc<Program>>,
    /// Lines of the setpoints, and the file that contains them.
    pub part: Option<(ProgramTrack, String)>,
}

impl Given<'_> {
    /// Plans or copies the setpoints.
    pub fn prepare(&self, py: Python<'_>, machine: &PyMachine) -> PyResult<Prepared> {
        match self {
            Given::Array(array) => {
                let (axes, columns) = (machine.config.axes().len(), array.as_array().ncols());
                if columns != axes {
                    let names: Vec<&str> = machine.config.axes().iter().map(|axis| axis.name()).collect();
                    let needed =
                        format!("psec has {columns} columns; it needs one per axis: {}", names.join(", "));
                    return Err(PyValueError::new_err(needed));
                }
                if array.as_array().nrows() == 0 {
                    return Err(PyValueError::new_err("psec has no setpoints; it needs at least one row"));
                }
                let values = array.as_array().iter().copied().collect();
                let rows = Rows { joints: (0..axes).collect(), values, rapid: Vec::new() };
                Ok(Prepared { rows, program: None, part: None })
            }
            Given::Scenario(scenario) => {
                let scenario: &PyScenario = scenario;
                py.detach(|| {
                    let program = scenario.program(machine)?;
                    Ok(Prepared {
                        rows: scenario.rows(machine, Arc::clone(&program))?,
                        program: Some(program),
                        part: None,
                    })
                })
            }
            Given::PartProgram(part) => {
                let part: &PartProgram = part;
                let (rows, track) = py.detach(|| part.rows(machine))?;
                part.warn(py, &track, 2)?;
                Ok(Prepared { rows, program: None, part: Some((track, part.path().to_owned())) })
            }
        }
    }
}

/// Callback of a trial that ends it when a signal arrives.
pub struct SignalCheck {
    cycles: u64,
    interrupt: Option<PyErr>,
}

impl SignalCheck {
    pub fn new() -> Self {
        SignalCheck { cycles: 0, interrupt: None }
    }

    pub fn cycle(&mut self) -> io::Result<()> {
        self.cycles += 1;
        if self.cycles.is_multiple_of(CYCLES_PER_CHECK)
            && let Err(error) = check_signals()
        {
            self.interrupt = Some(error);
            return Err(io::Error::other("interrupted"));
        }
        Ok(())
    }

    /// Returns the exception of a failed trial.
    pub fn error(self, error: TrialError) -> PyErr {
        self.interrupt.unwrap_or_else(|| PyValueError::new_err(error.to_string()))
    }
}

impl Prepared {
    /// Returns the trial of a variant `config` of a machine.
    pub fn trial<'m>(
        &self,
        machine: &PyMachine,
        config: &'m MachineConfig,
        measures: Measures,
        record: bool,
    ) -> Trial<'m> {
        let node = machine.parameters.node_config();
        Trial {
            machine: config,
            program: self.program.clone(),
            allow_nonzero_end_velocity: node.allow_nonzero_velocity_at_trajectory_end,
            record,
            measures,
        }
    }

    pub fn source(&self) -> SetpointSource<'_> {
        SetpointSource::Grid(Box::new(self.rows.source()))
    }
}

/// Signals of a run.
struct Recorded {
    signals: SignalTable,
    tool: Option<(ToolSignals, ToolDeviations)>,
}

/// Returns the outcome and, with contour errors, the figures of a part program.
fn run(
    machine: &PyMachine,
    prepared: &mut Prepared,
    (measures, every_tick): (Measures, bool),
    loads: &[f64],
    recorded: &mut Recorded,
) -> PyResult<(TrialOutcome, Option<ProgramFigures>)> {
    let Recorded { signals: table, tool } = recorded;
    let (mut tool, mut deviations) =
        tool.as_mut().map_or((None, None), |(tool, deviations)| (Some(tool), Some(deviations)));
    let part = prepared.part.take().filter(|_| measures.contour);
    let mut part = part.map(|(track, name)| (LineErrors::new(&machine.config), track, name));
    let (trial, source) = (prepared.trial(machine, &machine.config, measures, false), prepared.source());
    let mut signals = SignalCheck::new();
    let callback = |tick: Tick<'_>| {
        table.push(tick.time, tick.machine);
        if let Some(tool) = &mut tool {
            tool.push(tick.machine);
        }
        if let Some((lines, track, _)) = &mut part {
            lines.add(&tick, track);
        }
        if tick.position_instant { signals.cycle() } else { Ok(()) }
    };
    let mut on_deviations = |found: &PathDeviations| {
        if let Some(table) = &mut deviations {
            table.push(found, every_tick);
        }
    };
    let options =
        RunOptions { every_tick, loads, on_deviations: Some(&mut on_deviations), ..RunOptions::default() };
    let outcome = trial::run_with_options(&trial, source, options, callback);
    let outcome = outcome.map_err(|error| signals.error(error))?;
    let part = part.map(|(lines, track, name)| lines.finish(&name, PROGRAMS, &track, |_| {}));
    Ok((outcome, part.transpose()?))
}

/// Choice of signals and figures of a run.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct RecordOptions {
    signals: Vec<String>,
    /// True to record the signals of the tool, if contour errors are evaluated.
    tool: bool,
    every_tick: bool,
    figures: String,
}

/// Signals of the axes, signals of the tool, figures as JSON, and number of setpoints.
pub type Simulated<'py> = (Bound<'py, PyDict>, Bound<'py, PyDict>, String, usize);

/// Returns loads as rows of all axes, N or N·m.
fn load_rows(machine: &PyMachine, loads: Option<PyReadonlyArray2<'_, f64>>) -> PyResult<Vec<f64>> {
    let Some(loads) = loads else { return Ok(Vec::new()) };
    let (axes, columns) = (machine.config.axes().len(), loads.as_array().ncols());
    if columns != axes {
        return Err(value_error(format!("loads have {columns} columns; they need {axes}, one per axis")));
    }
    let values: Vec<f64> = loads.as_array().iter().copied().collect();
    for (index, &value) in values.iter().enumerate() {
        let axis = machine.config.axes()[index % axes].name();
        check_input(value)
            .map_err(|error| value_error(format!("loads: row {} of {axis} is {error}", index / axes)))?;
    }
    Ok(values)
}

/// Returns the signals and figures of a run.
pub fn simulate<'py>(
    py: Python<'py>,
    machine: &PyMachine,
    psec: &Given<'py>,
    loads: Option<PyReadonlyArray2<'py, f64>>,
    options: &RecordOptions,
) -> PyResult<Simulated<'py>> {
    let measures = measures(&options.figures)?;
    let signals = SignalTable::new(&options.signals).map_err(|name| {
        let known: Vec<&str> = SIGNALS.iter().map(|(name, _)| *name).chain(TOOL_SIGNALS).collect();
        value_error(format!("signal {name:?} is unknown; known are {}", known.join(", ")))
    })?;
    let loads = load_rows(machine, loads)?;
    let kinematics = Kinematics::new(&machine.config);
    let has_orientation = kinematics.has_rotary_axis();
    let has_tool = options.tool && measures.contour && kinematics.has_linear_axis();
    let tool = has_tool.then(|| (ToolSignals::new(kinematics), ToolDeviations::default()));
    let mut recorded = Recorded { signals, tool };
    let mut prepared = psec.prepare(py, machine)?;
    let (outcome, part) =
        py.detach(|| run(machine, &mut prepared, (measures, options.every_tick), &loads, &mut recorded))?;
    warn_of_loops(py, &machine.config, &outcome.figures)?;
    let mut json = figures_json(&outcome.figures);
    if let Some(part) = part {
        json.insert("part_program".to_owned(), part_program_json(&part));
    }
    let json = serde_json::Value::Object(json).to_string();
    let setpoints = prepared.rows.values.len() / prepared.rows.joints.len().max(1);
    let tool = match recorded.tool {
        Some((tool, deviations)) => deviations.into_dict(py, tool, has_orientation)?,
        None => PyDict::new(py),
    };
    Ok((recorded.signals.into_dict(py, machine.config.axes().len())?, tool, json, setpoints))
}

/// Warns of loops of moving axes without control or stability, as the command does.
fn warn_of_loops(py: Python<'_>, config: &MachineConfig, figures: &Figures) -> PyResult<()> {
    for (axis, _) in config.axes().iter().zip(&figures.axes).filter(|(_, figures)| figures.moves) {
        for warning in axis_warnings::loops(axis, &config.periods()) {
            PyErr::warn(
                py,
                &py.get_type::<PyUserWarning>(),
                &CString::new(warning).map_err(value_error)?,
                2,
            )?;
        }
    }
    Ok(())
}

/// Simulates setpoints again and writes the trace of `virtual_axes run --trace`, a row per position cycle.
pub fn write_trace(
    py: Python<'_>,
    machine: &PyMachine,
    (psec, loads): (&Given<'_>, Option<PyReadonlyArray2<'_, f64>>),
    path: &Path,
) -> PyResult<()> {
    let loads = load_rows(machine, loads)?;
    let prepared = psec.prepare(py, machine)?;
    let names: Vec<String> = machine.config.axes().iter().map(|axis| axis.name().to_owned()).collect();
    py.detach(|| {
        let mut writer = trace_writer(path, &names)?;
        let (mut signals, mut samples) = (SignalCheck::new(), Vec::new());
        let callback = |tick: Tick<'_>| {
            signals.cycle()?;
            samples.clear();
            samples.extend(tick.machine.axes().iter().map(|axis| *axis.sample()));
            writer.row(tick.time, &samples)
        };
        let trial = prepared.trial(machine, &machine.config, Measures::AXES, false);
        let options = RunOptions { loads: &loads, ..RunOptions::default() };
        trial::run_with_options(&trial, prepared.source(), options, callback)
            .map_err(|error| signals.error(error))?;
        Ok(writer.finish()?)
    })
}

/// Simulates setpoints again and returns the page of `virtual_axes run --report` as HTML. `title` and `description` are
/// those of the setpoints.
pub fn report(
    py: Python<'_>,
    machine: &PyMachine,
    (psec, loads): (&Given<'_>, Option<PyReadonlyArray2<'_, f64>>),
    (title, description): (&str, &str),
) -> PyResult<String> {
    let loads = load_rows(machine, loads)?;
    let mut prepared = psec.prepare(py, machine)?;
    py.detach(|| {
        let mut signals = SignalCheck::new();
        let mut part =
            prepared.part.take().map(|(track, name)| (LineErrors::new(&machine.config), track, name));
        let mut path = ToolPath::default();
        let callback = |tick: Tick<'_>| {
            if let Some((lines, track, _)) = &mut part {
                lines.add(&tick, track).iter().for_each(|cycle| path.add(cycle));
            }
            if tick.position_instant { signals.cycle() } else { Ok(()) }
        };
        let trial = prepared.trial(machine, &machine.config, Measures::ALL, true);
        let options = RunOptions { loads: &loads, ..RunOptions::default() };
        let outcome = trial::run_with_options(&trial, prepared.source(), options, callback)
            .map_err(|error| signals.error(error))?;
        let part_program = match part {
            Some((lines, track, name)) => {
                let figures = lines.finish(&name, PROGRAMS, &track, |cycle| path.add(cycle))?;
                path.texts = line_texts(&name, PROGRAMS, &path.lines())?;
                Some(ProgramReport::new(figures, path))
            }
            None => None,
        };
        let run = SimulatedRun {
            controller: controller_name(&machine.parameters),
            changes: Vec::new(),
            shared_changes: 0,
            machine: machine.config.clone(),
            input_warnings: Vec::new(),
            input_notes: Vec::new(),
            part_program,
            outcome,
        };
        let program = format!("virtual_axes_py {}", env!("CARGO_PKG_VERSION"));
        let page = SimulationPage {
            title,
            description,
            machine: machine.config.name(),
            runs: std::slice::from_ref(&run),
            sections: Vec::new(),
            provenance: vec![("program".to_owned(), program)],
        };
        let mut text = Vec::new();
        page.write(&mut text)?;
        String::from_utf8(text).map_err(value_error)
    })
}

/// Simulates setpoints again and returns the circles at constant feed: `plane`, `radius` (m), `counterclockwise`, and the
/// arrays `angle` (rad) and `deviation` (m).
pub fn circles<'py>(
    py: Python<'py>,
    machine: &PyMachine,
    psec: &Given<'py>,
    loads: Option<PyReadonlyArray2<'py, f64>>,
) -> PyResult<Vec<Bound<'py, PyDict>>> {
    let loads = load_rows(machine, loads)?;
    let prepared = psec.prepare(py, machine)?;
    let outcome = py.detach(|| {
        let mut signals = SignalCheck::new();
        let trial = prepared.trial(machine, &machine.config, Measures::ALL, true);
        let options = RunOptions { loads: &loads, ..RunOptions::default() };
        trial::run_with_options(&trial, prepared.source(), options, |_| signals.cycle())
            .map_err(|error| signals.error(error))
    })?;
    let traces = outcome.recording.map(|recording| recording.circles).unwrap_or_default();
    let dictionary = |trace: CircleTrace| {
        let found = PyDict::new(py);
        found.set_item("plane", trace.plane.to_vec())?;
        found.set_item("radius", trace.radius)?;
        found.set_item("counterclockwise", trace.counterclockwise)?;
        found.set_item("angle", PyArray1::from_vec(py, trace.angle))?;
        found.set_item("deviation", PyArray1::from_vec(py, trace.deviation))?;
        Ok(found)
    };
    traces.into_iter().map(dictionary).collect()
}
