//! Stepwise simulation: one position cycle at a time, of one machine or of several in SIMD lanes.

use std::sync::Arc;

use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use virtual_axes_core::config::Parameters;
use virtual_axes_core::machine::{AxisSample, Machine as CoreMachine, MachineParameters, check_input};
use virtual_axes_core::units::seconds;

use crate::convert::value_error;
use crate::machine::PyMachine;

/// Machines from which on a step releases the global interpreter lock.
const RELEASING: usize = 16;
/// Most machines of a stepper.
const MOST: usize = 100_000;

/// State of a stepper: parameters as YAML, once for equal machines in a row with their number, and state of the axes.
type Saved<'py> = (Vec<(String, usize)>, Bound<'py, PyBytes>);

/// Function that creates an object again, and its arguments.
type Recreation<'py> = (Bound<'py, PyAny>, Saved<'py>);

/// Parameters of a machine of a stepper.
type Variant = (Arc<Parameters>, Arc<MachineParameters>);

/// Simulation of one or several equal machines, stepped by position cycles.
#[pyclass(module = "virtual_axes_py._native")]
#[derive(Clone)]
pub struct Stepper {
    /// Parameters of each machine.
    parameters: Vec<Variant>,
    machine: CoreMachine,
    /// Axes of one machine.
    axes: usize,
    machines: usize,
}

/// State of a [`Stepper`] to return to.
#[pyclass(module = "virtual_axes_py._native", frozen)]
pub struct StepperState(Stepper);

/// Returns the machines side by side.
fn concatenated(machines: &[Variant]) -> PyResult<Arc<MachineParameters>> {
    match machines {
        [(_, one)] => return Ok(Arc::clone(one)),
        all if (1..=MOST).contains(&all.len()) => {}
        all => return Err(value_error(format!("machines {}: must be from 1 to {MOST}", all.len()))),
    }
    let all: Vec<Arc<MachineParameters>> = machines.iter().map(|(_, one)| Arc::clone(one)).collect();
    MachineParameters::concatenate(&all)
        .map(Arc::new)
        .ok_or_else(|| value_error("the machines of a stepper need equal periods"))
}

/// Returns the parameters of a machine with the axes of the others.
fn variant(machine: &PyMachine, axes: usize) -> PyResult<Variant> {
    let found = machine.config.axes().len();
    if found != axes {
        return Err(value_error(format!(
            "the machine {} has {found} axes; it needs {axes}",
            machine.config.name()
        )));
    }
    Ok((Arc::new(machine.parameters.clone()), Arc::clone(&machine.discretized)))
}

impl Stepper {
    /// Returns the arguments of [`Self::from_bytes`].
    fn to_bytes<'py>(&self, py: Python<'py>) -> Saved<'py> {
        let equal = self.parameters.chunk_by(|(_, one), (_, other)| Arc::ptr_eq(one, other));
        let texts = equal.filter_map(|rows| Some((rows.first()?.0.to_yaml("", |_| None), rows.len())));
        (texts.collect(), PyBytes::new(py, &self.machine.state_bytes()))
    }

    /// Creates a stepper from parameters as YAML with the numbers of machines, and their state.
    fn from_bytes(texts: &[(String, usize)], state: &[u8]) -> PyResult<Self> {
        let (mut parameters, mut axes) = (Vec::new(), None);
        for (text, count) in texts {
            let machine = PyMachine::new(Parameters::from_yaml(text, "state").map_err(value_error)?)?;
            let axes = *axes.get_or_insert(machine.config.axes().len());
            let one = variant(&machine, axes)?;
            parameters.extend(std::iter::repeat_n(one, (*count).min(MOST + 1)));
        }
        let machine =
            CoreMachine::from_state_bytes(concatenated(&parameters)?, state).map_err(value_error)?;
        Ok(Stepper { machine, axes: axes.unwrap_or(0), machines: parameters.len(), parameters })
    }

    /// Returns the values of an array with one value per axis of each machine.
    fn values(&self, name: &str, array: &PyReadonlyArrayDyn<'_, f64>) -> PyResult<Vec<f64>> {
        let shape = array.shape();
        let is_fitting = shape == [self.machines, self.axes] || (self.machines == 1 && shape == [self.axes]);
        if !is_fitting {
            let needed = match self.machines {
                1 => format!("({},)", self.axes),
                machines => format!("({machines}, {})", self.axes),
            };
            return Err(PyValueError::new_err(format!("{name} has the shape {shape:?}; it needs {needed}")));
        }
        let values: Vec<f64> = array.as_array().iter().copied().collect();
        for (index, &value) in values.iter().enumerate() {
            check_input(value).map_err(|error| value_error(format!("{name}: value {index} is {error}")))?;
        }
        Ok(values)
    }

    /// Returns an array (axes) of one machine, (machines, axes) of several.
    fn array<'py>(&self, py: Python<'py>, of: impl Fn(usize) -> f64) -> PyResult<Bound<'py, PyAny>> {
        let array = PyArray1::from_iter(py, (0..self.machine.axis_count()).map(of));
        if self.machines == 1 {
            return Ok(array.into_any());
        }
        let array: Bound<'py, PyArray2<f64>> = array.reshape([self.machines, self.axes])?;
        Ok(array.into_any())
    }

    fn of_samples<'py>(
        &self,
        py: Python<'py>,
        of: impl Fn(&AxisSample) -> f64,
    ) -> PyResult<Bound<'py, PyAny>> {
        self.array(py, |axis| of(self.machine.axis(axis).sample()))
    }
}

#[pymethods]
impl Stepper {
    #[new]
    fn new(machines: Vec<PyRef<'_, PyMachine>>) -> PyResult<Self> {
        let axes = machines.first().map_or(0, |machine| machine.config.axes().len());
        let mut parameters: Vec<Variant> = Vec::with_capacity(machines.len());
        for machine in &machines {
            let same = parameters.last().filter(|(_, last)| Arc::ptr_eq(last, &machine.discretized)).cloned();
            parameters.push(same.map_or_else(|| variant(machine, axes), Ok)?);
        }
        let machine = CoreMachine::new(concatenated(&parameters)?);
        Ok(Stepper { machine, axes, machines: parameters.len(), parameters })
    }

    #[staticmethod]
    fn load(parameters: Vec<(String, usize)>, state: &[u8]) -> PyResult<Self> {
        Stepper::from_bytes(&parameters, state)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Recreation<'py>> {
        Ok((slf.get_type().getattr("load")?, slf.borrow().to_bytes(slf.py())))
    }

    #[pyo3(signature = (psec, preview = None))]
    fn step<'py>(
        &mut self,
        py: Python<'py>,
        psec: PyReadonlyArrayDyn<'py, f64>,
        preview: Option<PyReadonlyArrayDyn<'py, f64>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let psec = self.values("psec", &psec)?;
        let preview = match &preview {
            None => Vec::new(),
            Some(array) => {
                let (shape, values) = (array.shape(), array.as_array());
                let is_fitting = match *shape {
                    [rows, _] => rows == self.machine.axis_count(),
                    [machines, axes, _] => (machines, axes) == (self.machines, self.axes),
                    _ => false,
                };
                if !is_fitting {
                    let needed = match self.machines {
                        1 => format!("({}, cycles)", self.axes),
                        machines => format!("({machines}, {}, cycles)", self.axes),
                    };
                    return Err(value_error(format!("preview has the shape {shape:?}; it needs {needed}")));
                }
                for &value in &values {
                    check_input(value)
                        .map_err(|error| value_error(format!("preview has the value {error}")))?;
                }
                values.iter().copied().collect()
            }
        };
        let machine = &mut self.machine;
        if self.machines >= RELEASING {
            py.detach(|| machine.advance(&psec, &preview));
        } else {
            machine.advance(&psec, &preview);
        }
        self.position(py)
    }

    #[pyo3(signature = (position = None, only = None))]
    fn reset(
        &mut self,
        position: Option<PyReadonlyArrayDyn<'_, f64>>,
        only: Option<Vec<usize>>,
    ) -> PyResult<()> {
        let position = match &position {
            Some(array) => self.values("position", array)?,
            None => vec![0.0; self.machine.axis_count()],
        };
        let Some(only) = only else {
            self.machine.reset(&position);
            return Ok(());
        };
        if let Some(index) = only.iter().find(|&&index| index >= self.machines) {
            return Err(value_error(format!("machine {index}: must be below {}", self.machines)));
        }
        for axis in only.into_iter().flat_map(|index| index * self.axes..(index + 1) * self.axes) {
            self.machine.reset_axis(axis, position[axis]);
        }
        Ok(())
    }

    fn set_load(&mut self, load: PyReadonlyArrayDyn<'_, f64>) -> PyResult<()> {
        let loads = self.values("load", &load)?;
        loads.into_iter().enumerate().for_each(|(axis, load)| self.machine.set_load(axis, load));
        Ok(())
    }

    fn set_velocity_offset(&mut self, offset: PyReadonlyArrayDyn<'_, f64>) -> PyResult<()> {
        let offsets = self.values("offset", &offset)?;
        offsets
            .into_iter()
            .enumerate()
            .for_each(|(axis, offset)| self.machine.set_velocity_offset(axis, offset));
        Ok(())
    }

    /// Gives the machines with these indices the parameters of another one.
    fn set_machines(&mut self, machines: Vec<PyRef<'_, PyMachine>>, only: Vec<usize>) -> PyResult<()> {
        let mut parameters = self.parameters.clone();
        for (index, machine) in only.into_iter().zip(&machines) {
            let count = self.machines;
            let Some(slot) = parameters.get_mut(index) else {
                return Err(value_error(format!("machine {index}: must be below {count}")));
            };
            *slot = variant(machine, self.axes)?;
        }
        self.machine.update_parameters(concatenated(&parameters)?).map_err(value_error)?;
        self.parameters = parameters;
        Ok(())
    }

    fn save(&self) -> StepperState {
        StepperState(self.clone())
    }

    fn restore(&mut self, state: &StepperState) -> PyResult<()> {
        let StepperState(saved) = state;
        if (saved.machines, saved.axes) != (self.machines, self.axes) {
            return Err(value_error("the state is that of another number of machines or axes"));
        }
        if saved.machine.periods() != self.machine.periods() {
            return Err(value_error("the state is that of a machine with other periods"));
        }
        self.clone_from(saved);
        Ok(())
    }

    #[getter]
    fn position<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.array(py, |axis| self.machine.motion_at_end(axis)[0])
    }

    #[getter]
    fn velocity<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.array(py, |axis| self.machine.motion_at_end(axis)[1])
    }

    #[getter]
    fn current<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.array(py, |axis| self.machine.motion_at_end(axis)[2])
    }

    #[getter]
    fn peak_current<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.array(py, |axis| self.machine.activity(axis).peak_current)
    }

    #[getter]
    fn following_error<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.of_samples(py, AxisSample::following_error)
    }

    #[getter]
    fn velocity_setpoint<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.of_samples(py, |sample| sample.velocity_setpoint)
    }

    /// Positions at each tick of the last position cycle.
    fn tick_positions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let (axes, ticks) = (self.machine.axis_count(), self.machine.ticks_per_period());
        let mut positions = vec![0.0; axes * ticks];
        positions.chunks_mut(ticks).enumerate().for_each(|(axis, row)| self.machine.positions(axis, row));
        positions.into_pyarray(py).reshape([axes, ticks])
    }

    #[getter]
    fn time(&self) -> f64 {
        seconds(self.machine.time())
    }

    #[getter]
    fn machines(&self) -> usize {
        self.machines
    }

    #[getter]
    fn preview_length(&self) -> usize {
        self.machine.preview_length()
    }
}

#[pymethods]
impl StepperState {
    #[staticmethod]
    fn load(parameters: Vec<(String, usize)>, state: &[u8]) -> PyResult<Self> {
        Stepper::from_bytes(&parameters, state).map(StepperState)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Recreation<'py>> {
        Ok((slf.get_type().getattr("load")?, slf.get().0.to_bytes(slf.py())))
    }
}
