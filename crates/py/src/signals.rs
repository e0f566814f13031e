//! Recorded signals as NumPy arrays.

use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use virtual_axes_core::machine::{AxisSample, Machine};
use virtual_axes_core::units::{Nanoseconds, seconds};

/// Name and value of a signal.
type Signal = (&'static str, fn(&AxisSample) -> f64);

/// Signals of an axis.
pub const SIGNALS: [Signal; 15] = [
    ("psec", |s| s.psec),
    ("delayed_psec", |s| s.delayed_psec),
    ("position", |s| s.position),
    ("velocity", |s| s.velocity),
    ("current", |s| s.current),
    ("current_setpoint", |s| s.current_setpoint),
    ("voltage", |s| s.voltage),
    ("velocity_setpoint", |s| s.velocity_setpoint),
    ("velocity_feedforward", |s| s.velocity_feedforward),
    ("torque_feedforward", |s| s.torque_feedforward),
    ("friction_current", |s| s.friction_current),
    ("gravity_current", |s| s.gravity_current),
    ("load_current", |s| s.load_current),
    ("effort", |s| s.effort),
    ("wind_up", |s| s.wind_up),
];

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
        let index =
            |name: &String| SIGNALS.iter().position(|(known, _)| known == name).ok_or_else(|| name.clone());
        let columns =
            names.iter().map(|name| Ok((index(name)?, Vec::new()))).collect::<Result<_, String>>()?;
        Ok(SignalTable { time: Vec::new(), columns })
    }

    /// Adds the samples of all axes.
    pub fn push(&mut self, time: Nanoseconds, machine: &Machine) {
        self.time.push(seconds(time));
        for axis in machine.axes() {
            let sample = axis.sample();
            self.columns.iter_mut().for_each(|(index, column)| column.push(SIGNALS[*index].1(sample)));
        }
    }

    /// Returns `time` and an array (rows, axes) for each signal.
    pub fn into_dict<'py>(self, py: Python<'py>, axes: usize) -> PyResult<Bound<'py, PyDict>> {
        let (found, rows) = (PyDict::new(py), self.time.len());
        found.set_item("time", PyArray1::from_vec(py, self.time))?;
        for (index, column) in self.columns {
            let array: Bound<'py, PyArray2<f64>> = PyArray1::from_vec(py, column).reshape([rows, axes])?;
            found.set_item(SIGNALS[index].0, array)?;
        }
        Ok(found)
    }
}
