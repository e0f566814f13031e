//! A machine as an FMU.

use std::io::Write;
use std::path::PathBuf;

use pyo3::prelude::*;
use virtual_axes_fmu::fmu_archive;
use virtual_axes_io::files::OutputFile;

use crate::convert::value_error;
use crate::machine::PyMachine;

/// Writes the machine as an FMU with these libraries.
#[pyfunction]
pub fn fmu(
    py: Python<'_>,
    machine: PyRef<'_, PyMachine>,
    path: PathBuf,
    libraries: Vec<PathBuf>,
) -> PyResult<()> {
    let text = machine.parameters.to_yaml("", |_| None);
    py.detach(|| {
        let archive = fmu_archive(&text, &libraries).map_err(value_error)?;
        let mut file = OutputFile::create(&path)?;
        file.write_all(&archive)?;
        file.finish()?;
        Ok(())
    })
}
