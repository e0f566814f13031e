//! Recorded signals as NumPy arrays.

use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use virtual_axes_core::machine::{AxisSample, Machine};
use virtual_axes_core::units::{Nanoseconds, seconds};

/// Signals of an axis, in the order of the columns of [`SignalTable`].
pub const NAMES: [&str; 15] = [
    "psec",
    "delayed_psec",
    "position",
    "velocity",
    "current",
    "current_setpoint",
    "voltage",
    "velocity_setpoint",
    "velocity_feedforward",
    "torque_feedforward",
    "friction_current",
    "gravity_current",
    "load_current",
    "effort",
    "wind_up",
];

fn values(sample: &AxisSample) -> [f64; NAMES.len()] {
    [
        sample.psec,
        sample.delayed_psec,
        sample.position,
        sample.velocity,
        sample.current,
        sample.current_setpoint,
        sample.voltage,
        sample.velocity_setpoint,
        sample.velocity_feedforward,
        sample.torque_feedforward,
        sample.friction_current,
        sample.gravity_current,
        sample.load_current,
        sample.effort,
        sample.wind_up,
    ]
}

/// Samples of all axes over time.
#[derive(Debug, Default)]
pub struct SignalTable {
    time: Vec<f64>,
    /// Rows of each chosen signal, one value per axis.
    columns: Vec<(usize, Vec<f64>)>,
}

impl SignalTable {
    /// Creates a table of the signals with these names; `Err` has an unknown one.
    pub fn new(names: &[String]) -> Result<Self, String> {
        let index = |name: &String| NAMES.iter().position(|known| known == name).ok_or_else(|| name.clone());
        let columns =
            names.iter().map(|name| Ok((index(name)?, Vec::new()))).collect::<Result<_, String>>()?;
        Ok(SignalTable { time: Vec::new(), columns })
    }

    /// Adds the samples of all axes.
    pub fn push(&mut self, time: Nanoseconds, machine: &Machine) {
        self.time.push(seconds(time));
        for axis in machine.axes() {
            let values = values(axis.sample());
            self.columns.iter_mut().for_each(|(index, column)| column.push(values[*index]));
        }
    }

    /// Returns `time` and an array (rows, axes) for each signal.
    pub fn into_dict<'py>(self, py: Python<'py>, axes: usize) -> PyResult<Bound<'py, PyDict>> {
        let (found, rows) = (PyDict::new(py), self.time.len());
        found.set_item("time", PyArray1::from_vec(py, self.time))?;
        for (index, column) in self.columns {
            let array: Bound<'py, PyArray2<f64>> = PyArray1::from_vec(py, column).reshape([rows, axes])?;
            found.set_item(NAMES[index], array)?;
        }
        Ok(found)
    }
}
