//! Traces as CSV: a row per position instant.

use std::io::{self, Write};

use super::number;
use virtual_axes_core::machine::AxisSample;
use virtual_axes_core::units::{Nanoseconds, seconds};

/// Name of a column, and what stands in it.
type Signal = (&'static str, fn(&AxisSample) -> f64);

/// The signals of an axis in a trace, in the order of the columns.
const SIGNALS: [Signal; 7] = [
    ("psec", |s| s.psec),
    ("position", |s| s.position),
    ("velocity", |s| s.velocity),
    ("current", |s| s.current),
    ("current_setpoint", |s| s.current_setpoint),
    ("voltage", |s| s.voltage),
    ("friction_current", |s| s.friction_current),
];

/// Writes a trace; numbers are as short as they can be read back exactly.
#[derive(Debug)]
pub struct TraceCsv<W> {
    output: W,
    /// A row as text.
    row: Vec<u8>,
}

impl<W: Write> TraceCsv<W> {
    /// Begins a trace of `joints` with its header: `time`, then `x.psec, x.position, …` per joint.
    ///
    /// # Errors
    /// Those of the output.
    pub fn new(mut output: W, joints: &[String]) -> io::Result<Self> {
        output.write_all(b"time")?;
        for joint in joints {
            for (signal, _) in SIGNALS {
                write!(output, ",{joint}.{signal}")?;
            }
        }
        output.write_all(b"\n")?;
        Ok(TraceCsv { output, row: Vec::new() })
    }

    /// Adds a row at `time` ns: s, m, m/s, A, V (rad and rad/s on rotary axes).
    ///
    /// # Errors
    /// Those of the output.
    pub fn row(&mut self, time: Nanoseconds, samples: &[AxisSample]) -> io::Result<()> {
        self.row.clear();
        number::push(&mut self.row, seconds(time));
        for sample in samples {
            for (_, value) in SIGNALS {
                self.row.push(b',');
                number::push(&mut self.row, value(sample));
            }
        }
        self.row.push(b'\n');
        self.output.write_all(&self.row)
    }

    /// Hands everything over and gives the output back.
    ///
    /// # Errors
    /// Those of the output.
    pub fn finish(mut self) -> io::Result<W> {
        self.output.flush()?;
        Ok(self.output)
    }
}
