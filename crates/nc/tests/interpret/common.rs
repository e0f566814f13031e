//! Programs as texts.

use std::io::Cursor;

use virtual_axes_nc::interpret::{
    Dialect, InterpretationReport, Interpreter, InterpreterOptions, ProgramError,
};
use virtual_axes_nc::motion::{Coordinates, ProgramEvent, ProgramMotion, ProgramStep};

/// Returns the steps of a program.
pub fn steps(text: &str, options: InterpreterOptions) -> Result<Vec<ProgramStep>, ProgramError> {
    Interpreter::new(Cursor::new(text), "part.nc", options).collect()
}

/// Returns the motions of a valid program.
pub fn motions(text: &str, options: InterpreterOptions) -> Vec<ProgramMotion> {
    let steps = steps(text, options).unwrap_or_else(|error| panic!("{error}"));
    let motion = |step| match step {
        ProgramStep::Motion(motion) => Some(motion),
        ProgramStep::Event { .. } => None,
    };
    steps.into_iter().filter_map(motion).collect()
}

/// Returns the events of a valid program with their lines.
pub fn events(text: &str, options: InterpreterOptions) -> Vec<(usize, ProgramEvent)> {
    let steps = steps(text, options).unwrap_or_else(|error| panic!("{error}"));
    let event = |step| match step {
        ProgramStep::Event { line, event } => Some((line, event)),
        ProgramStep::Motion(_) => None,
    };
    steps.into_iter().filter_map(event).collect()
}

/// Returns the error of an invalid program of LinuxCNC.
pub fn error(text: &str) -> String {
    let options = InterpreterOptions { dialect: Some(Dialect::LinuxCnc), ..InterpreterOptions::default() };
    match steps(text, options) {
        Ok(steps) => panic!("{text:?} gives {} steps", steps.len()),
        Err(error) => error.to_string(),
    }
}

/// Returns the report of a program with all its errors at once.
pub fn report(text: &str, dialect: Dialect) -> InterpretationReport {
    let options = InterpreterOptions {
        dialect: Some(dialect),
        reports_all_errors: true,
        ..InterpreterOptions::default()
    };
    let mut interpreter = Interpreter::new(Cursor::new(text), "part.nc", options);
    assert!(interpreter.by_ref().all(|step| step.is_ok()), "{text}");
    interpreter.report().clone()
}

/// Returns X, Y and Z, mm.
pub fn millimeters(coordinates: &Coordinates) -> [f64; 3] {
    [0, 1, 2].map(|axis| coordinates[axis] * 1e3)
}
