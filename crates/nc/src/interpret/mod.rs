//! Interpreter of part programs: RS-274/NGC text to motions of the axes.

mod error;

use std::io::{BufRead, Seek};

pub use error::ProgramError;

use crate::motion::{AXIS_COUNT, Coordinates, ProgramStep};

/// Options of the interpreter.
#[derive(Debug, Clone, Default)]
pub struct InterpreterOptions {
    /// Axis positions at the program start, m and rad.
    pub start: Coordinates,
    /// Work offsets G54 to G59.3, m and rad.
    pub work_offsets: [[f64; AXIS_COUNT]; 9],
    /// M codes that are accepted without effect.
    pub ignored_m_codes: Vec<u32>,
}

/// Interpreter of one program: an iterator over its steps, in memory independent of the program's length.
///
/// The first error ends the iteration.
#[derive(Debug)]
pub struct Interpreter<R> {
    source: R,
    name: String,
    options: InterpreterOptions,
}

impl<R: BufRead + Seek> Interpreter<R> {
    /// Creates the interpreter of the program in `source`; `name` is the file in messages.
    pub fn new(source: R, name: &str, options: InterpreterOptions) -> Self {
        Self { source, name: name.to_owned(), options }
    }
}

impl<R: BufRead + Seek> Iterator for Interpreter<R> {
    type Item = Result<ProgramStep, ProgramError>;

    fn next(&mut self) -> Option<Self::Item> {
        let _ = (&mut self.source, &self.options);
        let reason = "not supported yet".to_owned();
        Some(Err(ProgramError { name: self.name.clone(), line: 1, reason }))
    }
}
