//! Start of a program at a later line.

use crate::motion::{Coordinates, Feed, MotionKind, PathControl, ProgramMotion, ProgramStep};
use crate::plan::StepError;

/// Error of a start at a later line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum StartLineError {
    /// No motion at or after the line.
    #[error("start line {line} is after the last motion, in line {last}")]
    NoMotion {
        /// Start line.
        line: usize,
        /// Line of the last motion; 0 if there is none.
        last: usize,
    },
    /// Tool center point control at the first motion.
    #[error(
        "tool center point control (G43.4) is active at start line {line}; start before the line that selects it"
    )]
    ToolCenterPoint {
        /// Line of the first motion.
        line: usize,
    },
}

/// Steps of a program from a line on: earlier motions and events are left out, and a rapid traverse leads from the
/// position of the axes to the start of the first motion.
#[derive(Debug)]
pub struct StartLine<I> {
    steps: I,
    line: usize,
    position: Coordinates,
    last: usize,
    has_started: bool,
    ahead: Option<ProgramStep>,
}

impl<I> StartLine<I> {
    /// Creates the steps of a program from `line` on, for axes at `position`, m and rad. With a line of 0 or 1 they are
    /// those of the program.
    pub fn new(steps: I, line: usize, position: Coordinates) -> Self {
        Self { steps, line, position, last: 0, has_started: line <= 1, ahead: None }
    }

    fn start(&mut self, motion: ProgramMotion) -> Result<ProgramStep, StepError> {
        self.has_started = true;
        if motion.tcp_length.is_some() {
            return Err(StartLineError::ToolCenterPoint { line: motion.line }.into());
        }
        let approach = ProgramMotion {
            line: motion.line,
            kind: MotionKind::Rapid,
            start: self.position,
            end: motion.start,
            feed: Feed::Rapid,
            path_control: PathControl::ExactStop,
            tcp_length: None,
        };
        self.ahead = Some(ProgramStep::Motion(motion));
        Ok(ProgramStep::Motion(approach))
    }
}

impl<I, E> Iterator for StartLine<I>
where
    I: Iterator<Item = Result<ProgramStep, E>>,
    E: Into<StepError>,
{
    type Item = Result<ProgramStep, StepError>;

    fn next(&mut self) -> Option<Self::Item> {
        if let Some(step) = self.ahead.take() {
            return Some(Ok(step));
        }
        loop {
            let step = match self.steps.next() {
                Some(Ok(step)) => step,
                Some(Err(error)) => return Some(Err(error.into())),
                None if self.has_started => return None,
                None => {
                    self.has_started = true;
                    return Some(Err(StartLineError::NoMotion { line: self.line, last: self.last }.into()));
                }
            };
            match step {
                step if self.has_started => return Some(Ok(step)),
                ProgramStep::Motion(motion) if motion.line >= self.line => return Some(self.start(motion)),
                ProgramStep::Motion(motion) => self.last = motion.line,
                ProgramStep::Event { .. } => {}
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::*;
    use crate::interpret::{Interpreter, InterpreterOptions};

    fn steps(program: &str, line: usize) -> Vec<Result<ProgramStep, String>> {
        let mut position = [0.0; 9];
        position[0] = 0.25;
        let options = InterpreterOptions { start: position, ..InterpreterOptions::default() };
        let interpreter = Interpreter::new(Cursor::new(program.to_owned()), "part.nc", options);
        StartLine::new(interpreter, line, position).map(|step| step.map_err(|e| e.to_string())).collect()
    }

    const PROGRAM: &str = "G21 G90 G1 F600\nX10\nG4 P1\nX20 Y5\nX30\nM2\n";

    #[test]
    fn a_rapid_traverse_leads_to_the_first_motion() {
        let found = steps(PROGRAM, 4);
        let Ok(ProgramStep::Motion(approach)) = &found[0] else { panic!("{found:?}") };
        assert_eq!((approach.line, approach.start[0], approach.end[0]), (4, 0.25, 0.01));
        assert_eq!(approach.kind, MotionKind::Rapid);
        let Ok(ProgramStep::Motion(first)) = &found[1] else { panic!("{found:?}") };
        assert_eq!((first.line, first.start[0], first.end[0], first.end[1]), (4, 0.01, 0.02, 0.005));
        assert!(found.iter().all(|step| !matches!(step, Ok(ProgramStep::Event { line: 3, .. }))));
    }

    #[test]
    fn the_first_line_leaves_the_program_unchanged() {
        assert_eq!(steps(PROGRAM, 1), steps(PROGRAM, 0));
        let Ok(ProgramStep::Motion(first)) = &steps(PROGRAM, 0)[0] else { panic!() };
        assert_eq!((first.line, first.start[0]), (2, 0.25));
    }

    #[test]
    fn a_line_after_the_last_motion_and_one_in_tool_center_point_control_are_rejected() {
        let error = steps(PROGRAM, 6).pop().unwrap().unwrap_err();
        assert_eq!(error, "start line 6 is after the last motion, in line 5");
    }
}
