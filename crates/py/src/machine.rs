//! Machine: immutable parameters, checked.

use std::sync::Arc;

use pyo3::prelude::*;
use pyo3::types::PyDict;
use virtual_axes_core::config::{MachineConfig, Parameters, ValueSource};
use virtual_axes_core::machine::MachineParameters;
use virtual_axes_identify::recording::StatedValues;

use crate::convert::{WITH, assignments, value_error};

/// Parameters of a machine, checked: axes, drives, controllers, limits and kinematics.
#[pyclass(name = "Machine", module = "virtual_axes_py._native", frozen)]
pub struct PyMachine {
    pub parameters: Parameters,
    pub config: MachineConfig,
    pub discretized: Arc<MachineParameters>,
    /// True for a built-in machine, of which the user has stated the values of `with_` only.
    pub is_builtin: bool,
}

/// Returns the names of the built-in machines, the default first.
#[pyfunction]
pub fn machine_names() -> Vec<&'static str> {
    virtual_axes_builtin::MACHINES.iter().map(|(name, _)| *name).collect()
}

impl PyMachine {
    pub fn new(parameters: Parameters) -> PyResult<Self> {
        let config = parameters.machine_config().map_err(value_error)?;
        let discretized = MachineParameters::new(&config).map(Arc::new).map_err(value_error)?;
        Ok(PyMachine { parameters, config, discretized, is_builtin: false })
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
        Ok(PyMachine { is_builtin: self.is_builtin, ..PyMachine::new(parameters)? })
    }

    /// Returns the values of an axis that the user has stated, against which recordings are checked.
    pub fn stated(&self, axis: &str) -> StatedValues {
        let with = ValueSource::named(WITH);
        StatedValues::new(&self.parameters, axis, |source| !self.is_builtin || *source == with)
    }
}
