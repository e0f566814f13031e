//! Fuzz target of native Sinumerik programs: interpretation up to the first error, and with all errors.

use std::io::Cursor;

use virtual_axes_nc::interpret::{Dialect, Interpreter, InterpreterOptions};
use virtual_axes_nc::motion::ProgramStep;

use crate::{MACHINE, assert_one_line, bounded};

/// Largest number of steps that are interpreted; a program can be endless.
const MAX_STEPS: usize = 2000;
/// Number of lines that a program may repeat.
const REPEATED_LINES: u64 = 2000;

/// Interprets a native program on the default machine, and asserts that its coordinates are finite.
pub fn sinumerik_program(data: &[u8]) {
    bounded(data.len(), || {
        for reports_all_errors in [false, true] {
            let options = InterpreterOptions {
                dialect: Some(Dialect::Sinumerik),
                repeated_lines: REPEATED_LINES,
                reports_all_errors,
                ..InterpreterOptions::for_machine(&MACHINE)
            };
            let mut steps = Interpreter::new(Cursor::new(data), "part.mpf", options);
            for step in steps.by_ref().take(MAX_STEPS) {
                match step {
                    Ok(ProgramStep::Motion(motion)) => {
                        let mut values = motion.start.iter().chain(&motion.end);
                        assert!(values.all(|value| value.is_finite()), "{motion:?}");
                    }
                    Ok(ProgramStep::Event { .. }) => {}
                    Err(error) => {
                        assert_one_line(&error.to_string());
                        assert!(error.to_string().starts_with("part.mpf:"), "{error}");
                    }
                }
            }
            steps.report().errors.keys().for_each(|error| assert_one_line(error));
        }
    });
}
