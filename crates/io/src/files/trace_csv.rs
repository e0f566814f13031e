//! Writing of simulation traces as CSV.

use std::io::{self, Write};

use super::decimal;
use virtual_axes_core::machine::AxisSample;
use virtual_axes_core::units::{Nanoseconds, seconds};

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
    output: W,
    /// Buffer of a row.
    row: Vec<u8>,
}

impl<W: Write> TraceCsvWriter<W> {
    /// Creates a trace of `joints` and writes its header: `time`, then `x.psec, x.position, …` per joint.
    ///
    /// # Errors
    /// Returns the errors of the output.
    pub fn new(mut output: W, joints: &[String]) -> io::Result<Self> {
        output.write_all(b"time")?;
        for joint in joints {
            for (signal, _) in SIGNALS {
                write!(output, ",{joint}.{signal}")?;
            }
        }
        output.write_all(b"\n")?;
        Ok(TraceCsvWriter { output, row: Vec::new() })
    }

    /// Adds a row at `time`, ns. The units in the file are s, m, m/s, A, V (rad, rad/s for rotary axes).
    ///
    /// # Errors
    /// Returns the errors of the output.
    pub fn row(&mut self, time: Nanoseconds, samples: &[AxisSample]) -> io::Result<()> {
        self.row.clear();
        decimal::push(&mut self.row, seconds(time));
        for sample in samples {
            for (_, value) in SIGNALS {
                self.row.push(b',');
                decimal::push(&mut self.row, value(sample));
            }
        }
        self.row.push(b'\n');
        self.output.write_all(&self.row)
    }

    /// Flushes and returns the output.
    ///
    /// # Errors
    /// Returns the errors of the output.
    pub fn finish(mut self) -> io::Result<W> {
        self.output.flush()?;
        Ok(self.output)
    }
}
