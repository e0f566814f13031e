//! Simulation of many variants of a machine on the same setpoints.

use std::sync::atomic::AtomicBool;

use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;
use virtual_axes_core::config::MachineConfig;
use virtual_axes_core::trial::{self, Figures, Measures, Trial, TrialError};
use virtual_axes_io::files::figures_json;

use crate::convert::{check_stopped, interruptible, value_error};
use crate::machine::PyMachine;
use crate::simulate::{Given, Prepared, measures};

/// Variants simulated as the lanes of one machine.
const BATCH: usize = 32;
/// Largest number of threads.
const MOST_THREADS: usize = 1024;

/// Figures of a variant, or the reason why it cannot be simulated.
type Outcome = Result<Figures, String>;

struct Sweep<'a> {
    base: &'a PyMachine,
    prepared: &'a Prepared,
    measures: Measures,
    stopped: &'a AtomicBool,
}

impl Sweep<'_> {
    fn trial<'t>(&self, machine: &'t MachineConfig) -> Trial<'t> {
        self.prepared.trial(self.base, machine, self.measures, false)
    }

    /// Returns the axes that differ in a batch that can run as lanes beside each other; `None` if a variant differs in
    /// more than axes, or in delays, or if axes depend on each other.
    fn own_axes(&self, batch: &[MachineConfig]) -> Option<Vec<usize>> {
        let base = &self.base.config;
        let has_independent_axes =
            |machine: &MachineConfig| machine.contour_gain() == 0.0 && !machine.has_coupled_axes();
        let is_alike = has_independent_axes(base)
            && batch.iter().all(|variant| {
                let pairs = variant.axes().iter().zip(base.axes());
                variant.axes().len() == base.axes().len()
                    && has_independent_axes(variant)
                    && variant.periods() == base.periods()
                    && variant.kinematics() == base.kinematics()
                    && pairs
                        .into_iter()
                        .all(|(axis, base)| axis.delays == base.delays && axis.limits == base.limits)
            });
        let differs =
            |index: &usize| batch.iter().any(|variant| variant.axes()[*index] != base.axes()[*index]);
        is_alike.then(|| (0..base.axes().len()).filter(differs).collect())
    }

    fn run(&self, batch: &[MachineConfig]) -> Vec<Outcome> {
        let go_on = || check_stopped(self.stopped);
        if let Some(own) = self.own_axes(batch).filter(|own| !own.is_empty()) {
            let trial = self.trial(&self.base.config);
            if let Ok(figures) = trial::run_variants(&trial, self.prepared.source(), batch, &own, go_on) {
                return figures.into_iter().map(Ok).collect();
            }
        }
        let one = |machine: &MachineConfig| -> Result<Figures, TrialError> {
            Ok(trial::run(&self.trial(machine), self.prepared.source(), |_| go_on())?.figures)
        };
        batch.iter().map(|machine| one(machine).map_err(|error| error.to_string())).collect()
    }
}

/// Figures as JSON, or the reason of a failure.
pub type SweepRow = (Option<String>, Option<String>);

fn collected(outcomes: Vec<Outcome>) -> Vec<SweepRow> {
    let json = |figures: &Figures| serde_json::Value::Object(figures_json(figures)).to_string();
    outcomes
        .into_iter()
        .map(|outcome| match outcome {
            Ok(figures) => (Some(json(&figures)), None),
            Err(reason) => (None, Some(reason)),
        })
        .collect()
}

/// Returns figures as JSON or the reason of a failure for each variant, a dictionary of parameters.
pub fn sweep<'py>(
    py: Python<'py>,
    base: &PyMachine,
    variants: &[Bound<'py, PyDict>],
    psec: &Given<'py>,
    figures: &str,
    threads: usize,
) -> PyResult<Vec<SweepRow>> {
    let measures = measures(figures)?;
    if !(1..=MOST_THREADS).contains(&threads) {
        return Err(value_error(format!("threads {threads}: must be from 1 to {MOST_THREADS}")));
    }
    let prepared = psec.prepare(py, base)?;
    let configs: Vec<Result<MachineConfig, String>> = variants
        .iter()
        .map(|changes| match base.changed(changes) {
            Ok(machine) => Ok(Ok(machine.config)),
            // A wrong type is a mistake of the caller; a value out of range is a result of the study.
            Err(error) if error.is_instance_of::<pyo3::exceptions::PyValueError>(py) => {
                Ok(Err(error.value(py).to_string()))
            }
            Err(error) => Err(error),
        })
        .collect::<PyResult<_>>()?;
    let stopped = AtomicBool::new(false);
    let outcomes = interruptible(py, (&stopped, Some(threads)), || {
        let sweep = Sweep { base, prepared: &prepared, measures, stopped: &stopped };
        let valid: Vec<MachineConfig> =
            configs.iter().filter_map(|config| config.as_ref().ok().cloned()).collect();
        let batches: Vec<&[MachineConfig]> = valid.chunks(BATCH).collect();
        let found: Vec<Outcome> = batches.par_iter().flat_map_iter(|batch| sweep.run(batch)).collect();
        let mut found = found.into_iter();
        let of_variant = |config: &Result<MachineConfig, String>| match config {
            Ok(_) => found.next().unwrap_or_else(|| Err("not simulated".to_owned())),
            Err(reason) => Err(reason.clone()),
        };
        Ok::<_, PyErr>(configs.iter().map(of_variant).collect::<Vec<Outcome>>())
    })?;
    if outcomes.len() != variants.len() {
        return Err(value_error("a variant has no result"));
    }
    Ok(collected(outcomes))
}
