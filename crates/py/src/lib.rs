//! Native part of the Python package `virtual_axes_py`: machines, simulations, steppers, controller
//! design, identification and tuning.
//!
//! The package `python/virtual_axes_py` wraps these classes and documents them for users. All lengths are in m, angles in
//! rad, times in s. Functions that take long release the global interpreter lock.

#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used))]

mod contour;
mod convert;
mod design;
mod fmu;
mod identification;
mod limit_audit;
mod machine;
mod machine_methods;
mod setpoints;
mod signals;
mod simulate;
mod stepper;
mod sweep;
mod tuning;

use pyo3::prelude::*;

#[pymodule]
mod _native {
    use pyo3::prelude::*;

    #[pymodule_export]
    use super::contour::ContourTrackers;
    #[pymodule_export]
    use super::design::{PyPredictionModel, PyRst};
    #[pymodule_export]
    use super::fmu::fmu;
    #[pymodule_export]
    use super::identification::{PyIdentification, identify};
    #[pymodule_export]
    use super::limit_audit::check;
    #[pymodule_export]
    use super::machine::{PyMachine, machine_names};
    #[pymodule_export]
    use super::setpoints::{PartProgram, PyScenario, nc_program_names, scenario_names};
    #[pymodule_export]
    use super::stepper::{Stepper, StepperState};
    #[pymodule_export]
    use super::tuning::{learn, robustness, tune};

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
