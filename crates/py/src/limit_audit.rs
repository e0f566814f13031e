//! Limit audit of setpoints.

use pyo3::prelude::*;
use virtual_axes_core::assess::LimitAudit;
use virtual_axes_core::trial::GridSource;
use virtual_axes_core::units::{Nanoseconds, seconds};
use virtual_axes_report::limit_audit;

use crate::convert::value_error;
use crate::machine::PyMachine;
use crate::tuning::NamedPath;

/// Returns the audit of a path as JSON, as `virtual_axes check --json` prints it, and a sentence on the largest excess.
#[pyfunction]
pub fn check(
    py: Python<'_>,
    machine: PyRef<'_, PyMachine>,
    path: NamedPath<'_>,
) -> PyResult<(String, Option<String>)> {
    let machine: &PyMachine = &machine;
    let prepared = path.2.prepare(py, machine)?;
    let name = path.0.as_str();
    py.detach(|| {
        let (config, mut source) = (&machine.config, prepared.rows.source());
        let (joints, period) = (source.joints().to_vec(), config.periods().position);
        let (mut row, mut psec) = (vec![0.0; joints.len()], vec![0.0; config.axes().len()]);
        let mut audit = LimitAudit::new(config);
        let mut count: Nanoseconds = 0;
        while source.next(&mut row).map_err(value_error)? {
            joints.iter().zip(&row).for_each(|(&joint, &position)| psec[joint] = position);
            audit.add(count * period, None, psec.iter().copied());
            count += 1;
        }
        audit.finish();
        let duration = seconds((count - 1).max(0) * period);
        let json = limit_audit::json(&audit, name, config.name(), duration).to_string();
        Ok((json, limit_audit::excess(&audit)))
    })
}
