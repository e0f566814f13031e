//! Recorded signals as NumPy arrays.

use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use virtual_axes_core::assess::PathDeviations;
use virtual_axes_core::kinematics::Kinematics;
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

/// Signals of the tool in the workpiece frame: contour error, orientation error, path of the tip and of its setpoints, feed.
pub const TOOL_SIGNALS: [&str; 5] =
    ["contour_error", "orientation_error", "tool_path", "tool_setpoint", "feed"];

/// Time over which the path of the tip is differentiated on either side, s.
const FEED_STEP: f64 = 1e-5;

/// Pose of the tool over time.
pub struct ToolSignals {
    kinematics: Kinematics,
    path: Vec<f64>,
    setpoint: Vec<f64>,
    feed: Vec<f64>,
}

impl ToolSignals {
    pub fn new(kinematics: Kinematics) -> Self {
        ToolSignals { kinematics, path: Vec::new(), setpoint: Vec::new(), feed: Vec::new() }
    }

    /// Adds the pose of the tool.
    pub fn push(&mut self, machine: &Machine) {
        let tip = |value: &dyn Fn(&AxisSample) -> f64| {
            let joints: Vec<f64> = machine.axes().iter().map(|axis| value(axis.sample())).collect();
            self.kinematics.forward(&joints).tip
        };
        let moved = |time: f64| tip(&|sample| sample.position + time * sample.velocity);
        let step = moved(FEED_STEP) - moved(-FEED_STEP);
        self.feed.push(step.norm() / (2.0 * FEED_STEP));
        self.path.extend(tip(&|sample| sample.position).iter());
        self.setpoint.extend(tip(&|sample| sample.psec).iter());
    }
}

/// Deviations of the tool from its path over time.
#[derive(Debug, Default)]
pub struct ToolDeviations {
    contour: Vec<f64>,
    orientation: Vec<f64>,
}

impl ToolDeviations {
    /// Adds the deviations of a position cycle: those of every tick, or the largest.
    pub fn push(&mut self, found: &PathDeviations, every_tick: bool) {
        for (column, values) in
            [(&mut self.contour, &found.distance), (&mut self.orientation, &found.orientation)]
        {
            match every_tick {
                true => column.extend_from_slice(values),
                false => column.push(values.iter().copied().fold(0.0, f64::max)),
            }
        }
    }

    /// Returns the signals of the tool by name, (times,) or (times, 3).
    pub fn into_dict<'py>(
        self,
        py: Python<'py>,
        tool: ToolSignals,
        has_orientation: bool,
    ) -> PyResult<Bound<'py, PyDict>> {
        let (found, rows) = (PyDict::new(py), tool.feed.len());
        let [contour, orientation, path, setpoint, feed] = TOOL_SIGNALS;
        found.set_item(contour, PyArray1::from_vec(py, self.contour))?;
        if has_orientation {
            found.set_item(orientation, PyArray1::from_vec(py, self.orientation))?;
        }
        for (name, column) in [(path, tool.path), (setpoint, tool.setpoint)] {
            found.set_item(name, PyArray1::from_vec(py, column).reshape([rows, 3])?)?;
        }
        found.set_item(feed, PyArray1::from_vec(py, tool.feed))?;
        Ok(found)
    }
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
