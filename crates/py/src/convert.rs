//! Conversion of parameter values and errors between Python and the libraries.

use std::error::Error;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread;
use std::time::Duration;

use pyo3::exceptions::{PyRuntimeError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyList};
use virtual_axes_core::config::{Assignment, Value, ValueSource};

/// Source of the values of `with_` in errors.
pub const WITH: &str = "with_";

/// Returns a `ValueError` with the text of an error.
pub fn value_error(error: impl Into<Box<dyn Error + Send + Sync>>) -> PyErr {
    PyValueError::new_err(error.into().to_string())
}

/// Returns `KeyboardInterrupt` or another exception of a signal handler, if a signal has arrived.
pub fn check_signals() -> Result<(), PyErr> {
    Python::attach(|py| py.check_signals())
}

/// Runs a long calculation without the global interpreter lock, on `threads` threads or one per processor. A signal sets
/// `stopped`, which the calculation reads, and its exception is returned.
///
/// The threads end with the call: a process that is forked between two calls has lost none of them.
pub fn interruptible<T: Send>(
    py: Python<'_>,
    (stopped, threads): (&AtomicBool, Option<usize>),
    run: impl FnOnce() -> PyResult<T> + Send,
) -> PyResult<T> {
    /// Interval between two looks at signals.
    const POLL: Duration = Duration::from_millis(20);
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads.unwrap_or(0))
        .build()
        .map_err(|error| PyRuntimeError::new_err(error.to_string()))?;
    py.detach(|| {
        // Python runs signal handlers in this thread only.
        thread::scope(|scope| {
            let (running, ended) = mpsc::channel::<()>();
            let worker = scope.spawn(move || {
                let _running = running;
                pool.install(run)
            });
            let mut interrupt = None;
            while ended.recv_timeout(POLL) == Err(RecvTimeoutError::Timeout) {
                if let Err(error) = check_signals() {
                    stopped.store(true, Ordering::Relaxed);
                    interrupt = Some(error);
                }
            }
            let found = worker.join().map_err(|_| PyRuntimeError::new_err("the calculation has failed"))?;
            interrupt.map_or(found, Err)
        })
    })
}

/// Returns an error of input and output, which ends a calculation, if `stopped` is set.
pub fn check_stopped(stopped: &AtomicBool) -> std::io::Result<()> {
    let is_stopped = stopped.load(Ordering::Relaxed);
    if is_stopped { Err(std::io::Error::other("interrupted")) } else { Ok(()) }
}

/// Converts a dictionary of parameters to assignments.
pub fn assignments(changes: &Bound<'_, PyDict>) -> PyResult<Vec<Assignment>> {
    let source = ValueSource::named(WITH);
    let assignment = |(key, value): (Bound<'_, PyAny>, Bound<'_, PyAny>)| {
        let key: String =
            key.extract().map_err(|_| PyTypeError::new_err("the key of a parameter is a str"))?;
        let value = to_value(&value).map_err(|_| {
            PyTypeError::new_err(format!(
                "{key} is of type {}; it must be a bool, int, float, str or a list of one of these",
                value.get_type().name().map_or_else(|_| "unknown".to_owned(), |name| name.to_string())
            ))
        })?;
        Ok(Assignment { key, value, source: source.clone() })
    };
    changes.iter().map(assignment).collect()
}

fn to_value(value: &Bound<'_, PyAny>) -> PyResult<Value> {
    // A bool is an int in Python too; the extraction takes that of NumPy as well.
    if let Ok(flag) = value.extract::<bool>() {
        return Ok(Value::Bool(flag));
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
    let is_flags = value.try_iter()?.next().transpose()?.is_some_and(|first| first.extract::<bool>().is_ok());
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
