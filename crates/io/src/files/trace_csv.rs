//! Writing of simulation traces as CSV.

use std::io::{self, Write};

use super::PsecCsvWriter;
use virtual_axes_core::machine::AxisSample;
use virtual_axes_core::units::Nanoseconds;

/// Column name and its value in a sample.
type Signal = (&'static str, fn(&AxisSample) -> f64);

/// Signals of an axis in a trace, in column order.
const SIGNALS: [Signal; 8] = [
    ("psec", |s| s.psec),
    ("position", |s| s.position),
    ("velocity", |s| s.velocity),
    ("current", |s| s.current),
    ("current_setpoint", |s| s.current_setpoint),
    ("voltage", |s| s.voltage),
    ("friction_current", |s| s.friction_current),
    ("wind_up", |s| s.wind_up),
];

/// Writer of a trace as CSV; numbers are the shortest decimals that parse to the same value.
#[derive(Debug)]
pub struct TraceCsvWriter<W> {
    rows: PsecCsvWriter<W>,
    /// Values of a row.
    values: Vec<f64>,
}

impl<W: Write> TraceCsvWriter<W> {
    /// Creates a trace of `joints` and writes its header: `time`, then `x.psec, x.position, …` per joint.
    ///
    /// # Errors
    /// Returns the errors of the output.
    pub fn new(output: W, joints: &[String]) -> io::Result<Self> {
        let columns = joints.iter().flat_map(|joint| SIGNALS.map(|(signal, _)| format!("{joint}.{signal}")));
        let columns: Vec<_> = columns.collect();
        Ok(TraceCsvWriter { rows: PsecCsvWriter::new(output, &columns)?, values: Vec::new() })
    }

    /// Adds a row at `time`, ns. The units in the file are s, m, m/s, A, V (rad, rad/s for rotary axes).
    ///
    /// # Errors
    /// Returns the errors of the output.
    pub fn row(&mut self, time: Nanoseconds, samples: &[AxisSample]) -> io::Result<()> {
        self.values.clear();
        self.values.extend(samples.iter().flat_map(|sample| SIGNALS.map(|(_, value)| value(sample))));
        self.rows.row(time, &self.values)
    }

    /// Flushes and returns the output.
    ///
    /// # Errors
    /// Returns the errors of the output.
    pub fn finish(self) -> io::Result<W> {
        self.rows.finish()
    }
}
