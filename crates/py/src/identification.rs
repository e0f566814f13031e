//! Identification of the parameters of an axis from recordings.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

use numpy::PyReadonlyArray1;
use pyo3::prelude::*;
use virtual_axes_core::config::{AxisConfig, Periods};
use virtual_axes_core::units::MILLISECOND;
use virtual_axes_identify::identify::{
    AxisIdentification, AxisRecordings, Breakaway, ConditionedRecording, FeedforwardMode,
    IdentificationOptions, RefinementScope,
};
use virtual_axes_identify::recording::{Conditioning, Finding, PsecShift, RawRecording, StatedValues};
use virtual_axes_io::files::{
    Columns, RecordingFormat, RecordingOptions, read_recording, read_recording_stream,
};
use virtual_axes_report::IdentificationPage;

use crate::convert::{check_stopped, interruptible, value_error};
use crate::machine::PyMachine;
use crate::setpoints::csv;

/// Recording as given by the caller.
#[derive(FromPyObject)]
pub enum GivenRecording<'py> {
    /// File.
    #[pyo3(transparent)]
    File(PathBuf),
    /// Channels by name.
    #[pyo3(transparent)]
    Channels(BTreeMap<String, PyReadonlyArray1<'py, f64>>),
    /// Names and values of the columns of a table, read as CSV.
    Table(Vec<String>, Vec<PyReadonlyArray1<'py, f64>>),
}

/// Recording to read or to condition.
enum Source {
    File(PathBuf),
    Raw(Box<RawRecording>),
    /// Name and text of a table as CSV.
    Table(String, String),
}

/// Shift of the setpoints in time.
#[derive(FromPyObject)]
enum Shift {
    #[pyo3(transparent)]
    Milliseconds(f64),
    #[pyo3(transparent)]
    Name(String),
}

/// Options of the identification, a dictionary.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct IdentifyOptions {
    column: Vec<String>,
    columns: Option<PathBuf>,
    topic: Vec<String>,
    joint: Option<String>,
    format: Option<String>,
    rate_hz: Option<f64>,
    cutoff_hz: Option<f64>,
    current_lag_ms: Option<f64>,
    trace_filter_hz: Option<f64>,
    psec_shift: Option<Shift>,
    feedforward: Vec<String>,
    validate_feedforward: Vec<String>,
    refine: Option<Vec<String>>,
    free_i0: bool,
    presliding: bool,
}

impl GivenRecording<'_> {
    fn source(&self, number: usize) -> PyResult<Source> {
        let channels = match self {
            GivenRecording::File(path) => return Ok(Source::File(path.clone())),
            GivenRecording::Table(names, columns) => {
                return Ok(Source::Table(format!("recording {number}"), csv(names, columns)?));
            }
            GivenRecording::Channels(channels) => channels,
        };
        let mut raw = RawRecording { name: format!("recording {number}"), ..RawRecording::default() };
        for (name, values) in channels {
            let values = values.as_array().to_vec();
            match name.as_str() {
                "time" => raw.time = values,
                "psec" => raw.psec = Some(values),
                "position" => raw.position = Some(values),
                "velocity" => raw.velocity = Some(values),
                "current" => raw.current = Some(values),
                "torque" => raw.torque = Some(values),
                "velocity_feedforward" => raw.velocity_feedforward = Some(values),
                "torque_feedforward" => raw.torque_feedforward = Some(values),
                "motor_position" => raw.motor_position = Some(values),
                other => return Err(value_error(format!("channel {other:?} is unknown"))),
            }
        }
        Ok(Source::Raw(Box::new(raw)))
    }
}

/// Returns the feedforward mode of a name.
fn mode(name: &str) -> PyResult<FeedforwardMode> {
    let found = FeedforwardMode::ALL.into_iter().find(|mode| mode.name() == name);
    found.ok_or_else(|| value_error(format!("feedforward {name:?}: must be off, velocity or both")))
}

/// Returns the active feedforward of each of `count` recordings from one value for all or one for each.
fn modes(given: &[String], count: usize, option: &str) -> PyResult<Vec<Option<FeedforwardMode>>> {
    match given {
        [] => Ok(vec![None; count]),
        [one] => Ok(vec![Some(mode(one)?); count]),
        all if all.len() == count => all.iter().map(|name| mode(name).map(Some)).collect(),
        all => Err(value_error(format!(
            "{option}: {} values for {count} recordings; give one value for all, or one for each",
            all.len()
        ))),
    }
}

/// Returns the parameters that the refinement adjusts; all without a choice.
fn scope(groups: Option<&Vec<String>>) -> PyResult<RefinementScope> {
    let Some(groups) = groups else { return Ok(RefinementScope::ALL) };
    let mut scope = RefinementScope { position_cycle: !groups.is_empty(), ..RefinementScope::NONE };
    for group in groups {
        match group.as_str() {
            "inertia" => scope.inertia = true,
            "friction" => scope.friction = true,
            "gravity" => scope.gravity = true,
            "feedforward" => scope.feedforward = true,
            "gain" => scope.gain = true,
            other => {
                return Err(value_error(format!(
                    "refine {other:?}: must be inertia, friction, gravity, feedforward or gain"
                )));
            }
        }
    }
    Ok(scope)
}

impl IdentifyOptions {
    fn reading(&self) -> PyResult<RecordingOptions> {
        let format = self.format.as_deref().map(str::parse).transpose().map_err(value_error)?;
        Ok(RecordingOptions {
            columns: Columns::read(self.columns.as_deref(), &self.column, "column").map_err(value_error)?,
            topics: self.topic.clone(),
            joint: self.joint.clone(),
            format,
            rate_hz: self.rate_hz,
        })
    }

    fn conditioning(&self, stated: StatedValues) -> PyResult<Conditioning> {
        /// Largest shift, ms.
        const LARGEST: f64 = 1000.0;
        let psec_shift = match &self.psec_shift {
            None => PsecShift::default(),
            Some(Shift::Name(name)) if name == "auto" => PsecShift::Auto,
            Some(Shift::Milliseconds(value)) if value.abs() <= LARGEST => PsecShift::By(value * MILLISECOND),
            Some(_) => {
                return Err(value_error(format!(
                    "psec_shift: must be \"auto\", or a time from -{LARGEST} to {LARGEST} ms"
                )));
            }
        };
        Ok(Conditioning {
            cutoff: self.cutoff_hz,
            // A lag of the current cannot be told from presliding.
            current_lag: self
                .current_lag_ms
                .or(self.presliding.then_some(0.0))
                .map(|milliseconds| milliseconds * MILLISECOND),
            psec_shift,
            trace_filter: self.trace_filter_hz,
            stated,
        })
    }
}

/// Reads a recording of an axis, unless it was given by its channels.
fn raw(
    source: &Source,
    axis: &AxisConfig,
    reading: &RecordingOptions,
) -> PyResult<(RawRecording, Vec<Finding>)> {
    match source {
        Source::File(path) => read_recording(path, axis, reading).map_err(value_error),
        Source::Raw(raw) => Ok((raw.as_ref().clone(), Vec::new())),
        Source::Table(name, text) => {
            let reading = RecordingOptions { format: Some(RecordingFormat::Csv), ..reading.clone() };
            read_recording_stream(text.as_bytes(), name, axis, &reading).map_err(value_error)
        }
    }
}

/// Reads and conditions recordings of an axis.
fn conditioned(
    sources: &[Source],
    (axis, periods): (&AxisConfig, &Periods),
    (reading, conditioning): (&RecordingOptions, &Conditioning),
    modes: &[Option<FeedforwardMode>],
) -> PyResult<Vec<ConditionedRecording>> {
    let mut found = Vec::new();
    for (source, mode) in sources.iter().zip(modes) {
        let (raw, findings) = raw(source, axis, reading)?;
        let one = ConditionedRecording::new((&raw, findings), (axis, periods), conditioning, *mode);
        found.push(one.map_err(value_error)?);
    }
    Ok(found)
}

/// Identified parameters of an axis with findings and agreement.
#[pyclass(name = "Identification", module = "virtual_axes_py._native", frozen)]
pub struct PyIdentification {
    found: AxisIdentification,
    periods: Periods,
}

/// Identifies an axis of a machine from recordings.
#[pyfunction]
#[pyo3(signature = (machine, axis, recordings, transmissions, validations, options))]
pub fn identify(
    py: Python<'_>,
    machine: PyRef<'_, PyMachine>,
    axis: &str,
    recordings: Vec<GivenRecording<'_>>,
    transmissions: Vec<GivenRecording<'_>>,
    validations: Vec<GivenRecording<'_>>,
    options: IdentifyOptions,
) -> PyResult<PyIdentification> {
    let machine: &PyMachine = &machine;
    let index = machine.axis_index(axis)?;
    let stated = machine.stated(axis);
    let sources = |given: &[GivenRecording<'_>]| -> PyResult<Vec<Source>> {
        given.iter().enumerate().map(|(index, one)| one.source(index + 1)).collect()
    };
    let (files, both, others) = (sources(&recordings)?, sources(&transmissions)?, sources(&validations)?);
    if files.is_empty() && both.is_empty() {
        return Err(value_error("recordings: are empty; give at least one, or one for the transmission"));
    }
    let of_files = modes(&options.feedforward, files.len(), "feedforward")?;
    let for_others = match (options.validate_feedforward.as_slice(), options.feedforward.as_slice()) {
        ([], [one]) => std::slice::from_ref(one),
        (given, _) => given,
    };
    let of_others = modes(for_others, others.len(), "validate_feedforward")?;
    let reading = (&options.reading()?, &options.conditioning(stated)?);
    let i0 = if options.free_i0 { Breakaway::Freed } else { Breakaway::Held };
    let refine = scope(options.refine.as_ref())?;
    let chosen = IdentificationOptions { i0, refine, presliding: options.presliding, stated };
    let periods = machine.config.periods();
    let axis = (&machine.config.axes()[index], &periods);
    let stopped = AtomicBool::new(false);
    let found = interruptible(py, (&stopped, None), || {
        let recordings = conditioned(&files, axis, reading, &of_files)?;
        let others = conditioned(&others, axis, reading, &of_others)?;
        let start = |_: &str| check_stopped(&stopped);
        let transmission = both.iter().map(|source| {
            ConditionedRecording::of_both_encoders(raw(source, axis.0, reading.0)?, axis, reading.1)
                .map_err(value_error)
        });
        let transmission = transmission.collect::<PyResult<Vec<_>>>()?;
        let recordings = AxisRecordings { identification: recordings, transmission, validation: others };
        AxisIdentification::new((&machine.parameters, index), recordings, &chosen, start).map_err(value_error)
    })?;
    Ok(PyIdentification { found, periods })
}

#[pymethods]
impl PyIdentification {
    /// Returns the summary as JSON, as `virtual_axes identify --json` prints it.
    fn json(&self) -> PyResult<String> {
        serde_json::to_string_pretty(&self.found.summary).map_err(value_error)
    }

    /// Returns the findings, one line each.
    fn findings(&self) -> Vec<String> {
        self.found.summary.findings.iter().map(Finding::line).collect()
    }

    /// Returns the machine with the identified values.
    fn machine(&self) -> PyResult<PyMachine> {
        PyMachine::new(self.found.identified.clone())
    }

    /// Returns the page of `virtual_axes identify --report`.
    fn report(&self, py: Python<'_>) -> PyResult<String> {
        py.detach(|| {
            let page = IdentificationPage { found: &self.found, periods: self.periods };
            let mut text = Vec::new();
            page.document().write(&mut text).map_err(value_error)?;
            String::from_utf8(text).map_err(value_error)
        })
    }
}
