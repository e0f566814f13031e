//! Traces: what the axes did, row by row, in the format that the file's extension names.

use std::io;
use std::path::Path;

use super::output::{OutputFile, is_in_place};
use super::{TraceCsv, TraceMcap};
use virtual_axes_core::machine::AxisSample;
use virtual_axes_core::units::Nanoseconds;

/// A trace that is being written. Dropped before [`finish`](Self::finish), it leaves no file behind.
pub trait TraceWriter {
    /// Adds a row at `time` (ns), later than the one before; one sample per joint.
    ///
    /// # Errors
    /// Those of the output.
    fn row(&mut self, time: Nanoseconds, samples: &[AxisSample]) -> io::Result<()>;

    /// Makes the file whole.
    ///
    /// # Errors
    /// Those of the output.
    fn finish(self: Box<Self>) -> io::Result<()>;
}

/// Begins a trace of `joints` in the format that the extension of `path` names: `.csv` or `.mcap`. A
/// device or a pipe without an extension gets CSV.
///
/// # Errors
/// An unknown extension; those of the output.
pub fn trace_writer(path: &Path, joints: &[String]) -> io::Result<Box<dyn TraceWriter>> {
    match extension(path, &["csv", "mcap"])? {
        "mcap" => Ok(Box::new(TraceMcap::new(OutputFile::create(path)?, joints)?)),
        _ => Ok(Box::new(TraceCsv::new(OutputFile::create(path)?, joints)?)),
    }
}

impl TraceWriter for TraceCsv<OutputFile> {
    fn row(&mut self, time: Nanoseconds, samples: &[AxisSample]) -> io::Result<()> {
        TraceCsv::row(self, time, samples)
    }

    fn finish(self: Box<Self>) -> io::Result<()> {
        TraceCsv::finish(*self)?.finish()
    }
}

impl TraceWriter for TraceMcap<OutputFile> {
    fn row(&mut self, time: Nanoseconds, samples: &[AxisSample]) -> io::Result<()> {
        TraceMcap::row(self, time, samples)
    }

    fn finish(self: Box<Self>) -> io::Result<()> {
        TraceMcap::finish(*self)?.finish()
    }
}

/// The extension of `path` among `known`; the first of them for a device or a pipe that has none.
pub(super) fn extension(path: &Path, known: &[&'static str]) -> io::Result<&'static str> {
    let found = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    if let Some(extension) = known.iter().find(|e| **e == found) {
        return Ok(extension);
    }
    if let [first, ..] = known
        && found.is_empty()
        && is_in_place(path)
    {
        return Ok(first);
    }
    let known: Vec<String> = known.iter().map(|e| format!(".{e}")).collect();
    let text = format!("{}: its extension must say what to write: {}", path.display(), known.join(", "));
    Err(io::Error::new(io::ErrorKind::InvalidInput, text))
}
