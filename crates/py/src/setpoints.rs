//! Setpoints from scenarios and part programs.

use std::sync::Arc;

use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use virtual_axes_core::path::Program;
use virtual_axes_core::scenario::Scenario as CoreScenario;
use virtual_axes_core::simulation::joint_limits;
use virtual_axes_core::trial::{GridSource, ProgramSource, SourceError};
use virtual_axes_nc::builtin::{BuiltinProgram, ProgramReader, open_program};
use virtual_axes_nc::interpret::{Interpreter, InterpreterOptions};
use virtual_axes_nc::plan::{FeedPlanError, PartProgramPlanner, PlanOptions};

use crate::convert::{check_signals, value_error};
use crate::machine::PyMachine;

/// Rows between two looks at signals.
const ROWS_PER_CHECK: usize = 500;

/// Function that creates an object again, and its arguments: a name and an option.
type Recreation<'py, T> = (Bound<'py, PyAny>, (String, T));

/// Machine of the package, which holds the native one.
#[derive(FromPyObject)]
struct NativeMachine<'py> {
    native: PyRef<'py, PyMachine>,
}

/// Setpoints in memory, row after row.
pub struct Rows {
    /// Machine indices of the joints.
    pub joints: Vec<usize>,
    pub values: Vec<f64>,
}

impl Rows {
    fn read(mut source: impl GridSource) -> PyResult<Self> {
        let joints = source.joints().to_vec();
        let (mut row, mut values, mut count) = (vec![0.0; joints.len()], Vec::new(), 0_usize);
        while source.next(&mut row).map_err(value_error)? {
            values.extend_from_slice(&row);
            count += 1;
            if count.is_multiple_of(ROWS_PER_CHECK) {
                check_signals()?;
            }
        }
        Ok(Rows { joints, values })
    }

    fn into_array<'py>(self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let columns = self.joints.len();
        let rows = self.values.len() / columns.max(1);
        PyArray1::from_vec(py, self.values).reshape([rows, columns])
    }
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
    CoreScenario::builtin_names().collect()
}

/// Returns the names of the built-in part programs.
#[pyfunction]
pub fn nc_program_names() -> Vec<&'static str> {
    BuiltinProgram::names().collect()
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
        if BuiltinProgram::find(name_or_path).is_some() {
            return Err(value_error(format!("{name_or_path}: is a part program; load it with nc_program")));
        }
        Ok(PyScenario { scenario: CoreScenario::load(name_or_path).map_err(value_error)?, feed })
    }

    #[getter]
    fn name(&self) -> &str {
        self.scenario.name()
    }

    #[getter]
    fn description(&self) -> &str {
        self.scenario.description()
    }

    fn psec<'py>(&self, py: Python<'py>, machine: NativeMachine<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let machine: &PyMachine = &machine.native;
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
    /// Feed override, 1 for 100 %.
    feed_override: f64,
}

/// Setpoints of a planner.
struct PlannedRows {
    planner: PartProgramPlanner<Interpreter<ProgramReader>>,
    path: String,
    feed_override: f64,
}

impl GridSource for PlannedRows {
    fn joints(&self) -> &[usize] {
        self.planner.joints()
    }

    fn next(&mut self, row: &mut [f64]) -> Result<bool, SourceError> {
        let setpoint = self.planner.next_setpoint(self.feed_override).map_err(|error| match error {
            // The interpreter's error names the file.
            FeedPlanError::Step(error) => error,
            error => format!("{}: {error}", self.path).into(),
        })?;
        let Some(setpoint) = setpoint else { return Ok(false) };
        row.copy_from_slice(setpoint.psec());
        Ok(true)
    }
}

impl PartProgram {
    pub fn rows(&self, machine: &PyMachine) -> PyResult<Rows> {
        let failed = |error: &dyn std::fmt::Display| value_error(format!("{}: {error}", self.path));
        let file = open_program(&self.path).map_err(|error| failed(&error))?;
        let options = InterpreterOptions::for_machine(&machine.config);
        let steps = Interpreter::new(file, &self.path, options);
        let planner = PartProgramPlanner::new(steps, &machine.config, PlanOptions::default())
            .map_err(|error| failed(&error))?;
        Rows::read(PlannedRows { planner, path: self.path.clone(), feed_override: self.feed_override })
    }
}

#[pymethods]
impl PartProgram {
    #[staticmethod]
    #[pyo3(signature = (name_or_path, feed_override = 1.0))]
    fn load(name_or_path: String, feed_override: f64) -> PyResult<Self> {
        if !(feed_override > 0.0 && feed_override <= 2.0) {
            return Err(value_error(format!("feed_override {feed_override}: must be above 0 and at most 2")));
        }
        Ok(PartProgram { path: name_or_path, feed_override })
    }

    #[getter]
    fn path(&self) -> &str {
        &self.path
    }

    fn psec<'py>(&self, py: Python<'py>, machine: NativeMachine<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let machine: &PyMachine = &machine.native;
        py.detach(|| self.rows(machine))?.into_array(py)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Recreation<'py, f64>> {
        let this = slf.get();
        Ok((slf.get_type().getattr("load")?, (this.path.clone(), this.feed_override)))
    }

    fn __repr__(&self) -> String {
        format!("PartProgram({:?})", self.path)
    }
}
