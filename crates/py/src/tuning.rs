//! Tuning of controllers for a path.

use std::io;
use std::sync::atomic::AtomicBool;

use pyo3::prelude::*;
use serde_json::Value;
use virtual_axes_core::trial::SetpointSource;
use virtual_axes_core::units::MILLISECOND;
use virtual_axes_identify::tune::{
    Cost, MarginLimits, Progress, TuningProblem, TuningResult, TuningSearch, Workload,
};
use virtual_axes_io::files::tuning_json;

use crate::convert::{check_stopped, interruptible, value_error};
use crate::machine::PyMachine;
use crate::simulate::Given;

/// Path with its name and description.
type NamedPath<'py> = (String, String, Given<'py>);

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
        let named = |error: &dyn std::fmt::Display| value_error(format!("{name}: {error}"));
        let progress = StopFlag(&stopped);
        let problem = TuningProblem::new(&machine.parameters, &first, &cost, &progress)
            .map_err(|error| named(&error))?;
        let found = TuningResult::find(&problem, search, &others, &limits).map_err(|error| named(&error))?;
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
