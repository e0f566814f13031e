//! Tuning of controllers for a path.

use std::io;
use std::sync::atomic::AtomicBool;

use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use serde_json::Value;
use virtual_axes_core::design::LearningTuning;
use virtual_axes_core::trial::SetpointSource;
use virtual_axes_core::units::MILLISECOND;
use virtual_axes_identify::learn::LearningOptions;
use virtual_axes_identify::tune::{
    Cost, MarginLimits, Progress, TuningProblem, TuningResult, TuningSearch, Workload, analyze_robustness,
};
use virtual_axes_io::files::{learning_json, robustness_json, tuning_json};
use virtual_axes_report::runs::controller_name;

use crate::convert::{check_stopped, interruptible, value_error};
use crate::machine::PyMachine;
use crate::simulate::Given;

/// Path with its name and description.
pub type NamedPath<'py> = (String, String, Given<'py>);

/// Options of the search, a dictionary.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct TuneOptions {
    controller: String,
    contrast: bool,
    cost: String,
    modulus_margin: Option<f64>,
    delay_margin_ms: Option<f64>,
    seed: u64,
    designs: Option<usize>,
}

impl TuneOptions {
    fn search(&self) -> PyResult<TuningSearch> {
        match self.controller.as_str() {
            "gpc" if self.contrast => Ok(TuningSearch::Contrast),
            "gpc" => Ok(TuningSearch::Gpc(self.designs)),
            "cascade" => Ok(TuningSearch::Cascade(self.seed)),
            "contour" => Ok(TuningSearch::ContourGain),
            other => Err(value_error(format!("controller {other:?}: must be gpc, cascade or contour"))),
        }
    }

    fn limits(&self) -> PyResult<MarginLimits> {
        let within = |name: &str, value: Option<f64>, most: f64| match value {
            Some(value) if !(0.0..=most).contains(&value) => {
                Err(value_error(format!("{name} {value}: must be in 0 … {most}")))
            }
            value => Ok(value),
        };
        let default = if self.contrast { MarginLimits::STABLE } else { MarginLimits::default() };
        let delay = within("delay_margin_ms", self.delay_margin_ms, 1000.0)?;
        Ok(MarginLimits {
            modulus: within("modulus_margin", self.modulus_margin, 1.0)?.unwrap_or(default.modulus),
            delay: delay.map_or(default.delay, |milliseconds| milliseconds * MILLISECOND),
        })
    }
}

/// Progress of a search that ends when the flag is set.
struct StopFlag<'a>(&'a AtomicBool);

impl Progress for StopFlag<'_> {
    fn check_interrupt(&self) -> io::Result<()> {
        check_stopped(self.0)
    }
}

fn workload(py: Python<'_>, machine: &PyMachine, (name, _, psec): &NamedPath<'_>) -> PyResult<Workload> {
    let prepared = psec.prepare(py, machine)?;
    let source = SetpointSource::Grid(Box::new(prepared.rows.source()));
    Workload::read(name, prepared.program, source, || Ok(())).map_err(value_error)
}

/// Returns the result as JSON, as `virtual_axes tune --json` prints it, and the machine with the best tuning.
#[pyfunction]
#[pyo3(signature = (machine, path, also, options))]
pub fn tune(
    py: Python<'_>,
    machine: PyRef<'_, PyMachine>,
    path: NamedPath<'_>,
    also: Vec<NamedPath<'_>>,
    options: TuneOptions,
) -> PyResult<(String, PyMachine)> {
    let machine: &PyMachine = &machine;
    let (search, limits) = (options.search()?, options.limits()?);
    let cost: Cost = options.cost.parse().map_err(value_error)?;
    let first = workload(py, machine, &path)?;
    let others = also.iter().map(|one| workload(py, machine, one)).collect::<PyResult<Vec<Workload>>>()?;
    let (name, description) = (path.0.as_str(), path.1.as_str());
    let stopped = AtomicBool::new(false);
    let run = || -> PyResult<(String, PyMachine)> {
        let progress = StopFlag(&stopped);
        let problem = TuningProblem::new(&machine.parameters, &first, &cost, &progress)
            .map_err(|error| named(name, &error))?;
        let found =
            TuningResult::find(&problem, search, &others, &limits).map_err(|error| named(name, &error))?;
        let Some(found) = found else {
            let names: Vec<&str> = others.iter().map(Workload::name).collect();
            return Err(value_error(format!(
                "{name}: no tuning of the grid is better than the initial tuning here and worse on {}",
                names.join(", ")
            )));
        };
        let json = tuning_json((name, description), search, &limits, options.seed, &problem, &found);
        let tuned = found.best.tuning.apply(problem.parameters(), problem.joints()).map_err(value_error)?;
        Ok((Value::Object(json).to_string(), PyMachine::new(tuned)?))
    };
    interruptible(py, (&stopped, None), run)
}

/// Returns a failure of a search with the name of the path.
fn named(name: &str, error: &dyn std::fmt::Display) -> PyErr {
    value_error(format!("{name}: {error}"))
}

/// Returns the result as JSON, as `virtual_axes robustness --json` prints it.
#[pyfunction]
pub fn robustness(
    py: Python<'_>,
    machine: PyRef<'_, PyMachine>,
    path: NamedPath<'_>,
    by: f64,
    cost: &str,
) -> PyResult<String> {
    /// Larger deviations would reduce the inertia to a value that cannot be simulated.
    const MOST: f64 = 0.8;
    if !(0.0..=MOST).contains(&by) {
        return Err(value_error(format!("by {by}: must be in 0 … {MOST}, relative to the nominal value")));
    }
    let machine: &PyMachine = &machine;
    let cost: Cost = cost.parse().map_err(value_error)?;
    let setpoints = workload(py, machine, &path)?;
    let (name, description) = (path.0.as_str(), path.1.as_str());
    let stopped = AtomicBool::new(false);
    interruptible(py, (&stopped, None), || {
        let found = analyze_robustness(&machine.parameters, &setpoints, &cost, by, &StopFlag(&stopped))
            .map_err(|error| named(name, &error))?;
        let controller = controller_name(&machine.parameters);
        let of_machine = (&machine.config, controller.as_str());
        Ok(robustness_json((name, description), of_machine, (&cost, by), &found).to_string())
    })
}

/// Options of the learning, a dictionary.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct LearnOptions {
    iterations: usize,
    bandwidth_hz: Option<f64>,
    gain: f64,
    encoder_step_um: f64,
    acceleration_excess: f64,
}

/// Relative deviation of the plants for which the convergence condition is computed.
const LEARNING_DEVIATION: f64 = 0.3;

/// Returns the result as JSON, as `virtual_axes learn --json` prints it, and the setpoints of the best run.
#[pyfunction]
pub fn learn<'py>(
    py: Python<'py>,
    machine: PyRef<'py, PyMachine>,
    path: NamedPath<'py>,
    options: LearnOptions,
) -> PyResult<(String, Bound<'py, PyArray2<f64>>)> {
    let LearnOptions { iterations, bandwidth_hz, gain, encoder_step_um, acceleration_excess } = options;
    let options = LearningOptions {
        iterations,
        tuning: LearningTuning { gain, bandwidth: bandwidth_hz },
        encoder_step: encoder_step_um * 1e-6,
        acceleration_excess,
        deviation: LEARNING_DEVIATION,
    };
    let machine: &PyMachine = &machine;
    let setpoints = workload(py, machine, &path)?;
    let (name, description) = (path.0.as_str(), path.1.as_str());
    let allow = machine.parameters.node_config().allow_nonzero_velocity_at_trajectory_end;
    let stopped = AtomicBool::new(false);
    let (json, psec) = interruptible(py, (&stopped, None), || {
        let progress = StopFlag(&stopped);
        let found = virtual_axes_identify::learn::learn(
            &machine.config,
            &setpoints,
            &options,
            allow,
            false,
            &progress,
        )
        .map_err(|error| named(name, &error))?;
        let controller = controller_name(&machine.parameters);
        let of_machine = (&machine.config, controller.as_str());
        Ok((learning_json((name, description), of_machine, &options, &found, &[]).to_string(), found.psec))
    })?;
    let axes = machine.config.axes().len();
    let rows = psec.len() / axes.max(1);
    Ok((json, PyArray1::from_vec(py, psec).reshape([rows, axes])?))
}
