//! Contour errors of steppers against the polyline through their setpoints.

use numpy::{PyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use virtual_axes_core::assess::SetpointTracker;
use virtual_axes_core::kinematics::Kinematics;
use virtual_axes_core::simulation::contour_preview_cycles;

use crate::convert::value_error;
use crate::machine::PyMachine;

/// Nearest-point search of the tools of several equal machines.
#[pyclass(module = "virtual_axes_py._native")]
pub struct ContourTrackers {
    kinematics: Kinematics,
    axes: usize,
    /// Position cycles by which the paths are known beyond the present setpoint, as for the figures of a run.
    horizon: u32,
    trackers: Vec<SetpointTracker>,
}

impl ContourTrackers {
    /// Returns the rows of an array with one row of axes per machine.
    fn rows(&self, name: &str, array: &PyReadonlyArray2<'_, f64>) -> PyResult<Vec<f64>> {
        let (found, needed) = (array.shape(), [self.trackers.len(), self.axes]);
        if found != needed {
            return Err(value_error(format!("{name} has the shape {found:?}; it needs {needed:?}")));
        }
        Ok(array.as_array().iter().copied().collect())
    }
}

#[pymethods]
impl ContourTrackers {
    #[new]
    fn new(machine: &PyMachine, machines: usize) -> PyResult<Self> {
        let (kinematics, axes) = (Kinematics::new(&machine.config), machine.config.axes().len());
        if !kinematics.has_linear_axis() {
            return Err(value_error("a machine without linear axes has no contour error"));
        }
        let start = SetpointTracker::new(kinematics.forward(&vec![0.0; axes]));
        let horizon = contour_preview_cycles(machine.config.periods().position);
        Ok(ContourTrackers { kinematics, axes, horizon, trackers: vec![start; machines] })
    }

    #[getter]
    fn horizon(&self) -> u32 {
        self.horizon
    }

    /// Starts a new path of the machine `index` with the setpoints `psec`, (setpoints, axes); the search starts at
    /// `segment`.
    fn start(&mut self, index: usize, psec: PyReadonlyArray2<'_, f64>, segment: u64) -> PyResult<()> {
        let (found, machines) = (psec.shape(), self.trackers.len());
        if found[1] != self.axes {
            return Err(value_error(format!(
                "psec has the shape {found:?}; it needs (setpoints, {})",
                self.axes
            )));
        }
        let psec: Vec<f64> = psec.as_array().iter().copied().collect();
        let Some(tracker) = self.trackers.get_mut(index) else {
            return Err(value_error(format!("machine {index}: must be below {machines}")));
        };
        let mut poses = psec.chunks(self.axes).map(|joints| self.kinematics.forward(joints));
        let Some(start) = poses.next() else { return Err(value_error("psec has no setpoints")) };
        *tracker = SetpointTracker::new(start);
        poses.for_each(|pose| tracker.push(pose, false));
        tracker.search_from(segment);
        Ok(())
    }

    /// Returns the segments from which the next searches start.
    fn segments(&self) -> Vec<u64> {
        self.trackers.iter().map(SetpointTracker::last_nearest).collect()
    }

    /// Adds a setpoint to each path.
    fn push(&mut self, psec: PyReadonlyArray2<'_, f64>) -> PyResult<()> {
        let psec = self.rows("psec", &psec)?;
        for (tracker, joints) in self.trackers.iter_mut().zip(psec.chunks(self.axes)) {
            tracker.push(self.kinematics.forward(joints), false);
        }
        Ok(())
    }

    /// Returns the distances of the tools at `position` from their paths, m.
    fn distances<'py>(
        &mut self,
        py: Python<'py>,
        position: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let position = self.rows("position", &position)?;
        let tools = self.trackers.iter_mut().zip(position.chunks(self.axes));
        let distances =
            tools.map(|(tracker, joints)| tracker.nearest(&self.kinematics.forward(joints)).distance);
        Ok(PyArray1::from_vec(py, distances.collect()))
    }
}
