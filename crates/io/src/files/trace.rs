//! Writing of simulation traces as CSV or MCAP, selected by the file extension.

use std::io;
use std::path::Path;

use super::output::{OutputFile, is_device_or_pipe};
use super::{TraceCsvWriter, TraceMcapWriter};
use virtual_axes_core::machine::AxisSample;
use virtual_axes_core::units::Nanoseconds;

/// Writer of a trace. Dropping it before [`finish`](Self::finish) leaves no file.
pub trait TraceWriter {
    /// Adds a row with one sample per joint at `time`, ns, later than the previous row.
    ///
    /// # Errors
    /// Returns the errors of the output.
    fn row(&mut self, time: Nanoseconds, samples: &[AxisSample]) -> io::Result<()>;

    /// Completes the file.
    ///
    /// # Errors
    /// Returns the errors of the output.
    fn finish(self: Box<Self>) -> io::Result<()>;
}

/// Creates a trace of `joints` in the format of the extension of `path`: `.csv` or `.mcap`. The format for a
/// device or a pipe without an extension is CSV.
///
/// # Errors
/// Returns the errors of the output, and an error for an unknown extension.
pub fn trace_writer(path: &Path, joints: &[String]) -> io::Result<Box<dyn TraceWriter>> {
    match extension(path, &["csv", "mcap"])? {
        "mcap" => Ok(Box::new(TraceMcapWriter::new(OutputFile::create(path)?, joints)?)),
        _ => Ok(Box::new(TraceCsvWriter::new(OutputFile::create(path)?, joints)?)),
    }
}

impl TraceWriter for TraceCsvWriter<OutputFile> {
    fn row(&mut self, time: Nanoseconds, samples: &[AxisSample]) -> io::Result<()> {
        TraceCsvWriter::row(self, time, samples)
    }

    fn finish(self: Box<Self>) -> io::Result<()> {
        TraceCsvWriter::finish(*self)?.finish()
    }
}

impl TraceWriter for TraceMcapWriter<OutputFile> {
    fn row(&mut self, time: Nanoseconds, samples: &[AxisSample]) -> io::Result<()> {
        TraceMcapWriter::row(self, time, samples)
    }

    fn finish(self: Box<Self>) -> io::Result<()> {
        TraceMcapWriter::finish(*self)?.finish()
    }
}

/// Returns the extension of `path` if it is in `known`, or the first one for a device or pipe without extension.
pub(super) fn extension(path: &Path, known: &[&'static str]) -> io::Result<&'static str> {
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
