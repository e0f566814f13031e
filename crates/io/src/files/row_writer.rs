//! Writing of setpoints and simulation traces row by row, in the format of the file extension.

use std::io;
use std::path::Path;

use super::output::{OutputFile, is_device_or_pipe};
use super::{PsecCsvWriter, PsecMcapWriter, PsecYamlWriter, TraceCsvWriter, TraceMcapWriter};
use virtual_axes_core::machine::AxisSample;
use virtual_axes_core::units::Nanoseconds;

/// Writer of rows with a value per joint: setpoints, m or rad, or samples of a trace. Dropping it before
/// [`finish`](Self::finish) leaves no file.
pub trait RowWriter<T> {
    /// Adds a row at `time`, ns from the start; the rows of a trace are in the order of time.
    ///
    /// # Errors
    /// Returns the errors of the output.
    fn row(&mut self, time: Nanoseconds, values: &[T]) -> io::Result<()>;

    /// Completes the file.
    ///
    /// # Errors
    /// Returns the errors of the output.
    fn finish(self: Box<Self>) -> io::Result<()>;
}

macro_rules! row_writers {
    ($($writer:ident of $value:ty,)*) => {$(
        impl RowWriter<$value> for $writer<OutputFile> {
            fn row(&mut self, time: Nanoseconds, values: &[$value]) -> io::Result<()> {
                $writer::row(self, time, values)
            }

            fn finish(self: Box<Self>) -> io::Result<()> {
                $writer::finish(*self)?.finish()
            }
        }
    )*};
}

row_writers! {
    PsecCsvWriter of f64,
    PsecMcapWriter of f64,
    PsecYamlWriter of f64,
    TraceCsvWriter of AxisSample,
    TraceMcapWriter of AxisSample,
}

/// Creates a setpoint file of `joints` in the format of the extension of `path`: `.csv`, `.yaml` or `.mcap`. The
/// format for a device or a pipe without an extension is CSV.
///
/// # Errors
/// Returns the errors of the output, and an error for an unknown extension.
pub fn psec_writer(path: &Path, joints: &[String]) -> io::Result<Box<dyn RowWriter<f64>>> {
    match extension(path, &["csv", "mcap", "yaml"])? {
        "mcap" => Ok(Box::new(PsecMcapWriter::new(OutputFile::create(path)?, joints)?)),
        "yaml" => Ok(Box::new(PsecYamlWriter::new(OutputFile::create(path)?, joints)?)),
        _ => Ok(Box::new(PsecCsvWriter::new(OutputFile::create(path)?, joints)?)),
    }
}

/// Creates a trace of `joints` in the format of the extension of `path`: `.csv` or `.mcap`. The format for a
/// device or a pipe without an extension is CSV.
///
/// # Errors
/// Returns the errors of the output, and an error for an unknown extension.
pub fn trace_writer(path: &Path, joints: &[String]) -> io::Result<Box<dyn RowWriter<AxisSample>>> {
    match extension(path, &["csv", "mcap"])? {
        "mcap" => Ok(Box::new(TraceMcapWriter::new(OutputFile::create(path)?, joints)?)),
        _ => Ok(Box::new(TraceCsvWriter::new(OutputFile::create(path)?, joints)?)),
    }
}

/// Returns the extension of `path` if it is in `known`, or the first one for a device or pipe without extension.
fn extension(path: &Path, known: &[&'static str]) -> io::Result<&'static str> {
    let found = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    if let Some(extension) = known.iter().find(|e| **e == found) {
        return Ok(extension);
    }
    if let [first, ..] = known
        && found.is_empty()
        && is_device_or_pipe(path)
    {
        return Ok(first);
    }
    let known: Vec<String> = known.iter().map(|e| format!(".{e}")).collect();
    let text = format!("{}: the file extension must be one of {}", path.display(), known.join(", "));
    Err(io::Error::new(io::ErrorKind::InvalidInput, text))
}
