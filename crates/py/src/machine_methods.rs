//! Methods of the class `Machine`: parameters, simulation, sweeps and controller design.

use std::path::PathBuf;

use numpy::{PyArray2, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use virtual_axes_core::config::{AxisKind, DEFAULT_MACHINE, Parameters};
use virtual_axes_core::units::seconds;

use crate::convert::{from_value, value_error};
use crate::design::{self, PyPredictionModel, PyRst};
use crate::machine::PyMachine;
use crate::setpoints;
use crate::simulate::{self, Given, RecordOptions, Simulated};
use crate::sweep::{self, SweepRow};

#[pymethods]
impl PyMachine {
    #[staticmethod]
    #[pyo3(signature = (name_or_path = DEFAULT_MACHINE))]
    fn load(name_or_path: &str) -> PyResult<Self> {
        let parameters =
            Parameters::load(name_or_path, virtual_axes_builtin::MACHINES).map_err(value_error)?;
        let is_builtin = virtual_axes_builtin::MACHINES.iter().any(|(name, _)| *name == name_or_path);
        Ok(PyMachine { is_builtin, ..PyMachine::new(parameters)? })
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

    fn simulate<'py>(
        &self,
        py: Python<'py>,
        psec: Given<'py>,
        loads: Option<PyReadonlyArray2<'py, f64>>,
        options: RecordOptions,
    ) -> PyResult<Simulated<'py>> {
        simulate::simulate(py, self, &psec, loads, &options)
    }

    /// Returns the circles of the motion: plane, radius, direction, and arrays of angle and radial deviation.
    fn circles<'py>(
        &self,
        py: Python<'py>,
        psec: Given<'py>,
        loads: Option<PyReadonlyArray2<'py, f64>>,
    ) -> PyResult<Vec<Bound<'py, PyDict>>> {
        simulate::circles(py, self, &psec, loads)
    }

    /// Returns the setpoints of a table with times as `virtual_axes run` reads them from CSV, (setpoints, axes).
    fn setpoints_over_time<'py>(
        &self,
        py: Python<'py>,
        names: Vec<String>,
        columns: Vec<PyReadonlyArray1<'py, f64>>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        setpoints::over_time(py, self, &names, &columns)
    }

    /// Writes a trace of the motion, a row per position cycle.
    fn write_trace<'py>(
        &self,
        py: Python<'py>,
        psec: Given<'py>,
        loads: Option<PyReadonlyArray2<'py, f64>>,
        path: PathBuf,
    ) -> PyResult<()> {
        simulate::write_trace(py, self, (&psec, loads), &path)
    }

    /// Returns the page of the motion as HTML.
    fn report<'py>(
        &self,
        py: Python<'py>,
        psec: Given<'py>,
        loads: Option<PyReadonlyArray2<'py, f64>>,
        title: &str,
        description: &str,
    ) -> PyResult<String> {
        simulate::report(py, self, (&psec, loads), (title, description))
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
