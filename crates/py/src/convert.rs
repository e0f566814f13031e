//! Conversion of parameter values and errors between Python and the libraries.

use std::error::Error;

use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyList};
use virtual_axes_core::config::{Assignment, Value, ValueSource};

/// Returns a `ValueError` with the text of an error.
pub fn value_error(error: impl Into<Box<dyn Error + Send + Sync>>) -> PyErr {
    PyValueError::new_err(error.into().to_string())
}

/// Returns `KeyboardInterrupt` or another exception of a signal handler, if a signal has arrived.
pub fn check_signals() -> Result<(), PyErr> {
    Python::attach(|py| py.check_signals())
}

/// Converts a dictionary of parameters to assignments.
pub fn assignments(changes: &Bound<'_, PyDict>) -> PyResult<Vec<Assignment>> {
    let source = ValueSource::named("with_");
    let assignment = |(key, value): (Bound<'_, PyAny>, Bound<'_, PyAny>)| {
        let key: String =
            key.extract().map_err(|_| PyTypeError::new_err("the key of a parameter is a str"))?;
        let value = to_value(&value).map_err(|_| {
            let kind = value.get_type();
            PyTypeError::new_err(format!("{key}: {kind} is no bool, int, float, str or list of one of these"))
        })?;
        Ok(Assignment { key, value, source: source.clone() })
    };
    changes.iter().map(assignment).collect()
}

fn to_value(value: &Bound<'_, PyAny>) -> PyResult<Value> {
    // A bool is an int in Python too.
    if value.is_instance_of::<PyBool>() {
        return Ok(Value::Bool(value.extract()?));
    }
    if let Ok(integer) = value.extract::<i64>() {
        return Ok(Value::Integer(integer));
    }
    if let Ok(number) = value.extract::<f64>() {
        return Ok(Value::Double(number));
    }
    if let Ok(text) = value.extract::<String>() {
        return Ok(Value::Text(text));
    }
    let is_flags =
        value.try_iter()?.next().transpose()?.is_some_and(|first| first.is_instance_of::<PyBool>());
    if is_flags {
        return Ok(Value::BoolList(value.extract()?));
    }
    if let Ok(integers) = value.extract::<Vec<i64>>() {
        return Ok(Value::IntegerList(integers));
    }
    if let Ok(numbers) = value.extract::<Vec<f64>>() {
        return Ok(Value::DoubleList(numbers));
    }
    Ok(Value::TextList(value.extract()?))
}

/// Converts a parameter value to Python.
pub fn from_value<'py>(py: Python<'py>, value: Value) -> PyResult<Bound<'py, PyAny>> {
    Ok(match value {
        Value::Bool(flag) => PyBool::new(py, flag).to_owned().into_any(),
        Value::Integer(integer) => integer.into_pyobject(py)?.into_any(),
        Value::Double(number) => number.into_pyobject(py)?.into_any(),
        Value::Text(text) => text.into_pyobject(py)?.into_any(),
        Value::BoolList(flags) => PyList::new(py, flags)?.into_any(),
        Value::IntegerList(integers) => PyList::new(py, integers)?.into_any(),
        Value::DoubleList(numbers) => PyList::new(py, numbers)?.into_any(),
        Value::TextList(texts) => PyList::new(py, texts)?.into_any(),
    })
}
