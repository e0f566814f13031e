//! Controller design: prediction model, RST controllers, poles and margins.

use num_complex::Complex64;
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use virtual_axes_core::config::AxisConfig;
use virtual_axes_core::control::Rst as CoreRst;
use virtual_axes_core::design::{
    self, ControlLoop, ControlWeight, GpcTuning, PidTuning, PolePlacement, PredictionModel as CoreModel,
    continuous_phases, magnitudes_db,
};
use virtual_axes_core::machine::{
    contour_axes, contour_response, design_controller, loop_response, prediction_model,
};
use virtual_axes_core::units::{DEGREE, Rounded};

use crate::convert::value_error;
use crate::machine::PyMachine;

/// Class that creates an object again, and its arguments.
type Recreation<'py, T> = (Bound<'py, PyAny>, T);

/// Arguments of a controller: R, S, T and the exponent of the first coefficient of T.
type Coefficients = (Vec<f64>, Vec<f64>, Vec<f64>, i64);

/// Arrays of a frequency response by name.
const RESPONSE: [&str; 5] = ["frequency_hz", "open_db", "open_deg", "closed_db", "closed_deg"];

/// Discrete transfer function from Ω* to θ of an axis, `A(q⁻¹) θ = B(q⁻¹) Ω*`.
#[pyclass(name = "PredictionModel", module = "virtual_axes_py._native", frozen)]
pub struct PyPredictionModel {
    model: CoreModel,
}

/// Position controller in RST form, `S Ω* = T θ* − R θ`.
#[pyclass(name = "Rst", module = "virtual_axes_py._native", frozen)]
pub struct PyRst {
    rst: CoreRst,
}

#[pymethods]
impl PyPredictionModel {
    #[new]
    fn new(a: Vec<f64>, b: Vec<f64>, period: f64) -> PyResult<Self> {
        Ok(PyPredictionModel { model: CoreModel::new(a, b, period).map_err(value_error)? })
    }

    #[getter]
    fn a(&self) -> Vec<f64> {
        self.model.a().to_vec()
    }

    #[getter]
    fn b(&self) -> Vec<f64> {
        self.model.b().to_vec()
    }

    #[getter]
    fn period(&self) -> f64 {
        self.model.period()
    }

    #[pyo3(signature = (n1, n2, nu, weight, is_relative))]
    fn gpc(&self, n1: usize, n2: usize, nu: usize, weight: f64, is_relative: bool) -> PyResult<PyRst> {
        let weight =
            if is_relative { ControlWeight::Relative(weight) } else { ControlWeight::Absolute(weight) };
        let rst = design::gpc(&self.model, &GpcTuning { n1, n2, nu, weight }).map_err(value_error)?;
        Ok(PyRst { rst })
    }

    fn pid(
        &self,
        gain: f64,
        integral_time: f64,
        derivative_time: f64,
        filter_time: f64,
        velocity_feedforward: f64,
    ) -> PyResult<PyRst> {
        let period = self.model.period();
        let rst = if integral_time.is_infinite() && derivative_time == 0.0 {
            design::p_controller(gain, velocity_feedforward, period)
        } else {
            let tuning =
                PidTuning { gain, integral_time, derivative_time, filter_time, velocity_feedforward };
            design::pid_controller(&tuning, period)
        };
        Ok(PyRst { rst: rst.map_err(value_error)? })
    }

    fn place_poles(
        &self,
        poles: Vec<Complex64>,
        integrator: bool,
        velocity_feedforward: f64,
    ) -> PyResult<PyRst> {
        let wanted = PolePlacement { poles, integrator, velocity_feedforward };
        Ok(PyRst { rst: design::pole_placement(&self.model, &wanted).map_err(value_error)? })
    }

    fn margins<'py>(&self, py: Python<'py>, rst: &PyRst) -> PyResult<Bound<'py, PyDict>> {
        let margins = py.detach(|| design::margins(&self.model, &rst.rst)).map_err(value_error)?;
        let found = PyDict::new(py);
        found.set_item("modulus", margins.modulus)?;
        found.set_item("phase", margins.phase)?;
        found.set_item("gain", margins.gain)?;
        found.set_item("gain_reduction", margins.gain_reduction)?;
        found.set_item("delay", margins.delay)?;
        Ok(found)
    }

    fn poles(&self, rst: &PyRst) -> PyResult<Vec<Complex64>> {
        design::poles(&self.model, &rst.rst).map_err(value_error)
    }

    fn __eq__(&self, other: &PyPredictionModel) -> bool {
        let (one, other) = (&self.model, &other.model);
        one.a() == other.a() && one.b() == other.b() && one.period() == other.period()
    }

    fn __repr__(&self) -> String {
        format!(
            "PredictionModel(a={}, b={}, period={})",
            listed(&self.a()),
            listed(&self.b()),
            Rounded(self.period())
        )
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Recreation<'py, (Vec<f64>, Vec<f64>, f64)> {
        let this = slf.get();
        (slf.get_type().into_any(), (this.a(), this.b(), this.period()))
    }
}

#[pymethods]
impl PyRst {
    #[new]
    #[pyo3(signature = (r, s, t, t_first = 0))]
    fn new(r: Vec<f64>, s: Vec<f64>, t: Vec<f64>, t_first: i64) -> PyResult<Self> {
        Ok(PyRst { rst: CoreRst::new(&r, &s, &t, t_first).map_err(value_error)? })
    }

    #[getter]
    fn r(&self) -> Vec<f64> {
        self.rst.r().to_vec()
    }

    #[getter]
    fn s(&self) -> Vec<f64> {
        self.rst.s().to_vec()
    }

    #[getter]
    fn t(&self) -> Vec<f64> {
        self.rst.t().to_vec()
    }

    #[getter]
    fn t_first(&self) -> i64 {
        self.rst.t_first()
    }

    fn __eq__(&self, other: &PyRst) -> bool {
        let (one, other) = (&self.rst, &other.rst);
        (one.r(), one.s(), one.t(), one.t_first()) == (other.r(), other.s(), other.t(), other.t_first())
    }

    fn __repr__(&self) -> String {
        let [r, s, t] = [self.r(), self.s(), self.t()].map(|coefficients| listed(&coefficients));
        format!("Rst(r={r}, s={s}, t={t}, t_first={})", self.t_first())
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Recreation<'py, Coefficients> {
        let this = slf.get();
        (slf.get_type().into_any(), (this.r(), this.s(), this.t(), this.t_first()))
    }
}

/// Returns coefficients with 6 digits, of many the first two and their number.
fn listed(coefficients: &[f64]) -> String {
    let shown = if coefficients.len() > 3 { 2 } else { coefficients.len() };
    let mut texts: Vec<String> = coefficients[..shown].iter().map(|c| Rounded(*c).to_string()).collect();
    if shown < coefficients.len() {
        texts.push(format!("… {} in all", coefficients.len()));
    }
    format!("[{}]", texts.join(", "))
}

fn axis_of<'m>(machine: &'m PyMachine, name: &str) -> PyResult<&'m AxisConfig> {
    Ok(&machine.config.axes()[machine.axis_index(name)?])
}

/// Computes the prediction model of an axis.
pub fn model_of(machine: &PyMachine, axis: &str) -> PyResult<PyPredictionModel> {
    let axis = axis_of(machine, axis)?;
    Ok(PyPredictionModel { model: prediction_model(axis, &machine.config.periods()).map_err(value_error)? })
}

/// Computes the frequency response of a control loop of an axis, as `virtual_axes bode --csv` writes it.
pub fn frequency_response_of<'py>(
    py: Python<'py>,
    machine: &PyMachine,
    axis: &str,
    name: &str,
) -> PyResult<Bound<'py, PyDict>> {
    let axis = axis_of(machine, axis)?;
    let control_loop = ControlLoop::ALL.into_iter().find(|one| one.name() == name);
    let (periods, gain) = (machine.config.periods(), machine.config.contour_gain());
    let coupled = contour_axes(gain, machine.config.axes().iter());
    let is_coupled = coupled.iter().any(|&index| machine.config.axes()[index].name() == axis.name());
    let response = match control_loop {
        Some(control_loop) => py.detach(|| loop_response(axis, &periods, control_loop)),
        None if name != "contour" => {
            let text = format!("control_loop {name:?}: must be current, velocity, position or contour");
            return Err(value_error(text));
        }
        None if !is_coupled => {
            let text = format!("control_loop contour: cross-coupled control does not act on {}", axis.name());
            return Err(value_error(text));
        }
        None => py.detach(|| contour_response(axis, &periods, gain)),
    };
    let response = response.map(|model| model.sample());
    let response = response.map_err(|error| value_error(format!("axis {}: {error}", axis.name())))?;
    let degrees = |values: &[Complex64]| -> Vec<f64> {
        continuous_phases(values).into_iter().map(|phase| phase / DEGREE).collect()
    };
    let columns = [
        response.frequencies.clone(),
        magnitudes_db(&response.open),
        degrees(&response.open),
        magnitudes_db(&response.closed),
        degrees(&response.closed),
    ];
    let found = PyDict::new(py);
    for (name, column) in RESPONSE.into_iter().zip(columns) {
        found.set_item(name, PyArray1::from_vec(py, column))?;
    }
    Ok(found)
}

/// Designs the controller of an axis as configured.
pub fn controller_of(machine: &PyMachine, axis: &str) -> PyResult<PyRst> {
    let (axis, PyPredictionModel { model }) = (axis_of(machine, axis)?, model_of(machine, axis)?);
    Ok(PyRst { rst: design_controller(axis, &model).map_err(value_error)? })
}
