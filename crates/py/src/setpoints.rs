//! Setpoints from scenarios and part programs.

use std::cell::RefCell;
use std::ffi::CString;
use std::path::PathBuf;
use std::sync::Arc;

use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1};
use pyo3::exceptions::{PyTypeError, PyUserWarning};
use pyo3::prelude::*;
use virtual_axes_builtin::{PROGRAMS, SCENARIOS};
use virtual_axes_core::path::Program;
use virtual_axes_core::scenario::Scenario as CoreScenario;
use virtual_axes_core::simulation::joint_limits;
use virtual_axes_core::text::{builtin_names, builtin_text};
use virtual_axes_core::trial::{GridRows, GridSource, ProgramSource};
use virtual_axes_io::files::PsecCsvReader;
use virtual_axes_nc::interpret::{IgnoredCodes, ToolTable};
use virtual_axes_nc::offline::{OverrideSchedule, PartProgramOptions, PartProgramSource, ProgramTrack};
use virtual_axes_nc::plan::PlanOptions;

use crate::convert::{check_signals, value_error};
use crate::machine::PyMachine;

/// Rows between two looks at signals.
const ROWS_PER_CHECK: usize = 500;

/// Function that creates an object again, and its arguments: a name and an option.
type Recreation<'py, T> = (Bound<'py, PyAny>, (String, T));

/// Returns the native machine of a machine of the package.
fn native<'py>(machine: &Bound<'py, PyAny>) -> PyResult<PyRef<'py, PyMachine>> {
    machine.getattr("native").and_then(|native| Ok(native.extract()?)).map_err(|_| {
        let found = machine.get_type().name().map_or_else(|_| "unknown".to_owned(), |name| name.to_string());
        PyTypeError::new_err(format!("machine is of type {found}; it must be a Machine, as of Machine.load"))
    })
}

/// Setpoints in memory, row after row.
pub struct Rows {
    /// Machine indices of the joints.
    pub joints: Vec<usize>,
    pub values: Vec<f64>,
    /// True for each row that is reached at rapid traverse.
    pub rapid: Vec<bool>,
}

/// Returns a message about a part program with the names of arguments in place of options.
fn in_python(text: &str) -> String {
    let names = ["dialect", "ignore", "work-offset", "tools", "tool-change-s", "spindle-s"];
    names
        .iter()
        .fold(text.to_owned(), |text, name| text.replace(&format!("--{name}"), &name.replace('-', "_")))
}

impl Rows {
    fn read(mut source: impl GridSource) -> PyResult<Self> {
        let joints = source.joints().to_vec();
        let (mut row, mut values, mut rapid) = (vec![0.0; joints.len()], Vec::new(), Vec::new());
        while source.next(&mut row).map_err(|error| value_error(in_python(&error.to_string())))? {
            values.extend_from_slice(&row);
            rapid.push(source.is_rapid());
            if rapid.len().is_multiple_of(ROWS_PER_CHECK) {
                check_signals()?;
            }
        }
        Ok(Rows { joints, values, rapid })
    }

    /// Returns the setpoints as a source.
    pub fn source(&self) -> GridRows<'_> {
        GridRows::new(&self.joints, &self.values).with_rapid(&self.rapid)
    }

    fn into_array<'py>(self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let columns = self.joints.len();
        let rows = self.values.len() / columns.max(1);
        PyArray1::from_vec(py, self.values).reshape([rows, columns])
    }
}

/// Returns a table as CSV; each number parses to the same bits.
pub fn csv(names: &[String], columns: &[PyReadonlyArray1<'_, f64>]) -> PyResult<String> {
    let columns: Vec<Vec<f64>> = columns.iter().map(|column| column.as_array().to_vec()).collect();
    let rows = columns.first().map_or(0, Vec::len);
    if columns.len() != names.len() || columns.iter().any(|column| column.len() != rows) {
        return Err(value_error("the columns have different lengths"));
    }
    if let Some(name) = names.iter().find(|name| name.contains([',', ';', '\t', '\n', '\r', '"'])) {
        return Err(value_error(format!(
            "column {name:?}: a name must not have separators or quotation marks"
        )));
    }
    let mut text = names.join(",");
    for row in 0..rows {
        let values: Vec<String> = columns.iter().map(|column| cell(column[row])).collect();
        text.push('\n');
        text.push_str(&values.join(","));
    }
    text.push('\n');
    Ok(text)
}

/// Returns a number as text; one that is missing is empty.
fn cell(value: f64) -> String {
    if value.is_nan() { String::new() } else { value.to_string() }
}

/// Returns the setpoints of a table with times at the position cycles, as `virtual_axes run` reads them from CSV. Limits are
/// those of the simulation, whose errors have the time.
pub fn over_time<'py>(
    py: Python<'py>,
    machine: &PyMachine,
    names: &[String],
    columns: &[PyReadonlyArray1<'py, f64>],
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let text = csv(names, columns)?;
    let rows = py.detach(|| {
        let limits = joint_limits(&machine.config.without_trajectory_limits(), "");
        let period = machine.config.periods().position;
        let mut reader = PsecCsvReader::new(text.as_bytes(), "psec", period, &limits)
            .map_err(value_error)?
            .with_start_at_first_row();
        let (joints, axes) = (reader.joints().to_vec(), machine.config.axes().len());
        let (mut row, mut values) = (vec![0.0; joints.len()], Vec::new());
        while reader.next(&mut row).map_err(value_error)? {
            let begin = values.len();
            values.resize(begin + axes, 0.0);
            joints.iter().zip(&row).for_each(|(&joint, &value)| values[begin + joint] = value);
        }
        Ok::<_, PyErr>(Rows { joints: (0..axes).collect(), values, rapid: Vec::new() })
    })?;
    rows.into_array(py)
}

/// Test motion of a scenario file, planned within the limits of a machine.
#[pyclass(name = "Scenario", module = "virtual_axes_py._native", frozen)]
pub struct PyScenario {
    scenario: CoreScenario,
    /// Feed that replaces that of the scenario, m/min.
    feed: Option<f64>,
}

/// Returns the names of the built-in scenarios.
#[pyfunction]
pub fn scenario_names() -> Vec<&'static str> {
    builtin_names(SCENARIOS).collect()
}

/// Returns the names of the built-in part programs.
#[pyfunction]
pub fn nc_program_names() -> Vec<&'static str> {
    builtin_names(PROGRAMS).collect()
}

impl PyScenario {
    pub fn program(&self, machine: &PyMachine) -> PyResult<Arc<Program>> {
        self.scenario.program(&machine.config, self.feed).map(Arc::new).map_err(value_error)
    }

    pub fn rows(&self, machine: &PyMachine, program: Arc<Program>) -> PyResult<Rows> {
        let limits = joint_limits(&machine.config, "");
        let period = machine.config.periods().position;
        Rows::read(ProgramSource::new(program, self.scenario.name(), &limits, period))
    }
}

#[pymethods]
impl PyScenario {
    #[staticmethod]
    #[pyo3(signature = (name_or_path, feed = None))]
    fn load(name_or_path: &str, feed: Option<f64>) -> PyResult<Self> {
        if builtin_text(PROGRAMS, name_or_path).is_some() {
            return Err(value_error(format!("{name_or_path}: is a part program; load it with nc_program")));
        }
        Ok(PyScenario { scenario: CoreScenario::load(name_or_path, SCENARIOS).map_err(value_error)?, feed })
    }

    #[getter]
    fn name(&self) -> &str {
        self.scenario.name()
    }

    #[getter]
    fn description(&self) -> &str {
        self.scenario.description()
    }

    fn psec<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = native)] machine: PyRef<'py, PyMachine>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let machine: &PyMachine = &machine;
        py.detach(|| self.rows(machine, self.program(machine)?))?.into_array(py)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Recreation<'py, Option<f64>>> {
        let this = slf.get();
        Ok((slf.get_type().getattr("load")?, (this.scenario.name().to_owned(), this.feed)))
    }

    fn __repr__(&self) -> String {
        format!("Scenario({:?})", self.scenario.name())
    }
}

/// Part program in G code, planned within the limits of a machine.
#[pyclass(module = "virtual_axes_py._native", frozen)]
pub struct PartProgram {
    path: String,
    arguments: ProgramArguments,
    options: PartProgramOptions,
}

/// Arguments of a part program.
#[derive(Clone, IntoPyObject, FromPyObject)]
struct ProgramArguments {
    /// Feed override, 1 for 100 %.
    #[pyo3(item)]
    feed_override: f64,
    /// G and M codes without effect.
    #[pyo3(item)]
    ignore: Vec<String>,
    /// Dialect; `None` for that of the machine, or the detected one.
    #[pyo3(item)]
    dialect: Option<String>,
    /// Work offsets, as in `G54=120,80,-350`.
    #[pyo3(item)]
    work_offset: Vec<String>,
    /// File with the tool table.
    #[pyo3(item)]
    tool_table: Option<PathBuf>,
    /// Tools in the notation of LinuxCNC.
    #[pyo3(item)]
    tools: Vec<String>,
    /// Duration of a tool change, s.
    #[pyo3(item)]
    tool_change_s: Option<f64>,
    /// Duration of a change of the spindle speed, s.
    #[pyo3(item)]
    spindle_s: Option<f64>,
    /// Bound of the chord error, m.
    #[pyo3(item)]
    chord_error: Option<f64>,
    /// Bound of the centripetal acceleration, m/s².
    #[pyo3(item)]
    centripetal_acceleration: Option<f64>,
}

impl ProgramArguments {
    fn options(&self) -> Result<PartProgramOptions, String> {
        let ProgramArguments { feed_override, ignore, chord_error, centripetal_acceleration, .. } = self;
        if !(*feed_override > 0.0 && *feed_override <= 2.0) {
            return Err(format!("feed_override {feed_override}: must be above 0 and at most 2"));
        }
        for (name, bound) in
            [("chord_error", chord_error), ("centripetal_acceleration", centripetal_acceleration)]
        {
            if let Some(bound) = bound.filter(|bound| !(*bound > 0.0 && bound.is_finite())) {
                return Err(format!("{name} {bound}: must be above 0 and finite"));
            }
        }
        for (name, time) in [("tool_change_s", self.tool_change_s), ("spindle_s", self.spindle_s)] {
            if let Some(time) = time.filter(|time| !(*time >= 0.0 && time.is_finite())) {
                return Err(format!("{name} {time}: must be at least 0 and finite"));
            }
        }
        let codes =
            ignore.iter().map(|code| code.parse().map_err(|error| format!("ignore {code:?}: {error}")));
        let offset = |text: &String| text.parse().map_err(|error| format!("work_offset {error}"));
        let default = PlanOptions::default();
        Ok(PartProgramOptions {
            schedule: OverrideSchedule::constant(*feed_override),
            ignored: IgnoredCodes::new(codes.collect::<Result<_, _>>()?),
            dialect: self.dialect.as_deref().map(str::parse).transpose()?,
            work_offsets: self.work_offset.iter().map(offset).collect::<Result<_, _>>()?,
            tools: self.tools()?,
            tool_change_time: self.tool_change_s,
            spindle_time: self.spindle_s,
            plan: PlanOptions {
                chord_error: chord_error.unwrap_or(default.chord_error),
                centripetal_acceleration: centripetal_acceleration
                    .unwrap_or(default.centripetal_acceleration),
                ..default
            },
        })
    }

    fn tools(&self) -> Result<ToolTable, String> {
        let table = match (&self.tool_table, &self.tools[..]) {
            (Some(path), _) => ToolTable::from_file(path),
            (None, []) => return Ok(ToolTable::default()),
            (None, lines) => ToolTable::parse(&lines.join("\n")),
        };
        table.map_err(|error| format!("tools: {error}"))
    }
}

impl PartProgram {
    /// Returns the setpoints with their lines.
    pub fn rows(&self, machine: &PyMachine) -> PyResult<(Rows, ProgramTrack)> {
        let track = RefCell::default();
        let source = PartProgramSource::open(&self.path, PROGRAMS, &machine.config, &self.options, &track);
        let rows = Rows::read(source.map_err(|error| value_error(in_python(&error.to_string())))?)?;
        Ok((rows, track.into_inner()))
    }

    /// Warns of words without effect; `level` is the number of the frame of Python that the warning names.
    pub fn warn(&self, py: Python<'_>, track: &ProgramTrack, level: i32) -> PyResult<()> {
        for (line, note) in track.notes() {
            let text = in_python(&format!("{}:{line}: {note}", self.path));
            let text = CString::new(text).map_err(value_error)?;
            PyErr::warn(py, &py.get_type::<PyUserWarning>(), &text, level)?;
        }
        Ok(())
    }
}

#[pymethods]
impl PartProgram {
    #[staticmethod]
    fn load(name_or_path: String, arguments: ProgramArguments) -> PyResult<Self> {
        let options = arguments.options().map_err(value_error)?;
        Ok(PartProgram { path: name_or_path, arguments, options })
    }

    #[getter]
    pub fn path(&self) -> &str {
        &self.path
    }

    fn psec<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = native)] machine: PyRef<'py, PyMachine>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let machine: &PyMachine = &machine;
        let (rows, track) = py.detach(|| self.rows(machine))?;
        self.warn(py, &track, 1)?;
        rows.into_array(py)
    }

    fn is_rapid<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = native)] machine: PyRef<'py, PyMachine>,
    ) -> PyResult<Bound<'py, PyArray1<bool>>> {
        let machine: &PyMachine = &machine;
        let (rows, _) = py.detach(|| self.rows(machine))?;
        Ok(PyArray1::from_vec(py, rows.rapid))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Recreation<'py, ProgramArguments>> {
        let this = slf.get();
        Ok((slf.get_type().getattr("load")?, (this.path.clone(), this.arguments.clone())))
    }

    fn __repr__(&self) -> String {
        format!("PartProgram({:?})", self.path)
    }
}
