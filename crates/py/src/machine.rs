//! PyMachine: immutable parameters.

use std::path::PathBuf;
use std::sync::Arc;

use pyo3::prelude::*;
use pyo3::types::PyDict;
use virtual_axes_core::config::{AxisKind, DEFAULT_MACHINE, MachineConfig, Parameters};
use virtual_axes_core::machine::MachineParameters;
use virtual_axes_core::units::seconds;

use crate::convert::{assignments, from_value, value_error};
use crate::design::{self, PyPredictionModel, PyRst};
use crate::simulate::{self, Given};
use crate::sweep::{self, SweepRow};

/// Parameters of a machine, checked: axes, drives, controllers, limits and kinematics.
#[pyclass(name = "Machine", module = "virtual_axes_py._native", frozen)]
pub struct PyMachine {
    pub parameters: Parameters,
    pub config: MachineConfig,
    pub discretized: Arc<MachineParameters>,
}

/// Returns the names of the built-in machines, the default first.
#[pyfunction]
pub fn machine_names() -> Vec<&'static str> {
    Parameters::builtin_names().collect()
}

impl PyMachine {
    pub fn new(parameters: Parameters) -> PyResult<Self> {
        let config = parameters.machine_config().map_err(value_error)?;
        let discretized = MachineParameters::new(&config).map(Arc::new).map_err(value_error)?;
        Ok(PyMachine { parameters, config, discretized })
    }

    /// Returns the index of an axis by its name.
    pub fn axis_index(&self, name: &str) -> PyResult<usize> {
        let known: Vec<&str> = self.config.axes().iter().map(|axis| axis.name()).collect();
        known
            .iter()
            .position(|known| *known == name)
            .ok_or_else(|| value_error(format!("axis {name:?} is unknown; known are {}", known.join(", "))))
    }

    /// Returns a copy with other parameters.
    pub fn changed(&self, changes: &Bound<'_, PyDict>) -> PyResult<Self> {
        let mut parameters = self.parameters.clone();
        parameters.set_all(assignments(changes)?).map_err(value_error)?;
        PyMachine::new(parameters)
    }
}

#[pymethods]
impl PyMachine {
    #[staticmethod]
    #[pyo3(signature = (name_or_path = DEFAULT_MACHINE))]
    fn load(name_or_path: &str) -> PyResult<Self> {
        PyMachine::new(Parameters::load(name_or_path).map_err(value_error)?)
    }

    #[staticmethod]
    #[pyo3(signature = (text, source = "text"))]
    fn from_yaml(text: &str, source: &str) -> PyResult<Self> {
        PyMachine::new(Parameters::from_yaml(text, source).map_err(value_error)?)
    }

    fn with_(&self, changes: &Bound<'_, PyDict>) -> PyResult<Self> {
        self.changed(changes)
    }

    fn to_yaml(&self) -> String {
        self.parameters.to_yaml("", |_| None)
    }

    #[getter]
    fn name(&self) -> &str {
        self.config.name()
    }

    #[getter]
    fn axes(&self) -> Vec<&str> {
        self.config.axes().iter().map(|axis| axis.name()).collect()
    }

    #[getter]
    fn units(&self) -> Vec<&'static str> {
        let unit = |kind| if kind == AxisKind::Linear { "m" } else { "rad" };
        self.config.axes().iter().map(|axis| unit(axis.kind())).collect()
    }

    #[getter]
    fn position_period(&self) -> f64 {
        seconds(self.config.periods().position)
    }

    #[getter]
    fn current_period(&self) -> f64 {
        seconds(self.config.periods().current)
    }

    #[getter]
    fn parameters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let found = PyDict::new(py);
        for (key, value) in self.parameters.iter() {
            found.set_item(key, from_value(py, value)?)?;
        }
        Ok(found)
    }

    #[pyo3(signature = (psec, signals, every_tick, figures))]
    fn simulate<'py>(
        &self,
        py: Python<'py>,
        psec: Given<'py>,
        signals: Vec<String>,
        every_tick: bool,
        figures: &str,
    ) -> PyResult<(Bound<'py, PyDict>, String, usize)> {
        simulate::simulate(py, self, &psec, &signals, every_tick, figures)
    }

    /// Writes a trace of the motion, a row per position cycle.
    fn write_trace<'py>(&self, py: Python<'py>, psec: Given<'py>, path: PathBuf) -> PyResult<()> {
        simulate::write_trace(py, self, &psec, &path)
    }

    /// Returns the page of the motion as HTML.
    fn report<'py>(
        &self,
        py: Python<'py>,
        psec: Given<'py>,
        title: &str,
        description: &str,
    ) -> PyResult<String> {
        simulate::report(py, self, &psec, (title, description))
    }

    #[pyo3(signature = (variants, psec, figures, threads))]
    fn sweep<'py>(
        &self,
        py: Python<'py>,
        variants: Vec<Bound<'py, PyDict>>,
        psec: Given<'py>,
        figures: &str,
        threads: usize,
    ) -> PyResult<Vec<SweepRow>> {
        sweep::sweep(py, self, &variants, &psec, figures, threads)
    }

    fn prediction_model(&self, axis: &str) -> PyResult<PyPredictionModel> {
        design::model_of(self, axis)
    }

    fn controller(&self, axis: &str) -> PyResult<PyRst> {
        design::controller_of(self, axis)
    }

    fn frequency_response<'py>(
        &self,
        py: Python<'py>,
        axis: &str,
        control_loop: &str,
    ) -> PyResult<Bound<'py, PyDict>> {
        design::frequency_response_of(py, self, axis, control_loop)
    }

    fn __repr__(&self) -> String {
        format!("Machine({:?}, axes {})", self.config.name(), self.axes().join(", "))
    }

    fn __eq__(&self, other: &PyMachine) -> bool {
        self.parameters.iter().eq(other.parameters.iter())
    }
}
