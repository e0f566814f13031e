//! Start of a program at a later line.

use crate::interpret::{InterpreterOptions, TipTransform};
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
}

/// Steps of a program from a line on: earlier motions and events are left out, and a rapid traverse leads from the
/// position of the axes to the start of the first motion, with tool center point control to all axis positions there.
#[derive(Debug)]
pub struct StartLine<I> {
    steps: I,
    line: usize,
    position: Coordinates,
    transform: Option<TipTransform>,
    last: usize,
    has_started: bool,
    ahead: Option<ProgramStep>,
}

impl<I> StartLine<I> {
    /// Creates the steps of a program from `line` on, for the axes and the machine of the interpreter's `options`. With a
    /// line of 0 or 1 they are those of the program.
    pub fn new(steps: I, line: usize, options: &InterpreterOptions) -> Self {
        let (position, transform) = (options.start, options.kinematics.clone());
        Self { steps, line, position, transform, last: 0, has_started: line <= 1, ahead: None }
    }

    fn start(&mut self, motion: ProgramMotion) -> ProgramStep {
        self.has_started = true;
        let transform = self.transform.as_ref();
        let start = transform.map(|transform| transform.positions(&motion.start, motion.tcp_length));
        let approach = ProgramMotion {
            line: motion.line,
            kind: MotionKind::Rapid,
            start: self.position,
            // Without kinematics the interpreter rejects tool center point control.
            end: start.unwrap_or(motion.start),
            feed: Feed::Rapid,
            path_control: PathControl::ExactStop,
            tcp_length: None,
        };
        self.ahead = Some(ProgramStep::Motion(motion));
        ProgramStep::Motion(approach)
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
                ProgramStep::Motion(motion) if motion.line >= self.line => {
                    return Some(Ok(self.start(motion)));
                }
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
    use virtual_axes_core::config::Parameters;

    use crate::interpret::Interpreter;
    use crate::plan::{PartProgramPlanner, PlanOptions};

    fn steps(program: &str, line: usize) -> Vec<Result<ProgramStep, String>> {
        let mut position = [0.0; 9];
        position[0] = 0.25;
        let options = InterpreterOptions { start: position, ..InterpreterOptions::default() };
        let interpreter = Interpreter::new(Cursor::new(program.to_owned()), "part.nc", options.clone());
        StartLine::new(interpreter, line, &options).map(|step| step.map_err(|e| e.to_string())).collect()
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
    fn a_line_after_the_last_motion_is_rejected() {
        let error = steps(PROGRAM, 6).pop().unwrap().unwrap_err();
        assert_eq!(error, "start line 6 is after the last motion, in line 5");
    }

    #[test]
    fn a_start_in_tool_center_point_control_joins_the_planned_path() {
        let machine = Parameters::embedded_default().unwrap().machine_config().unwrap();
        let program = "G21 G90 G43.4 H1 G61.1\nG1 X10 Y5 A20 C30 F3000\nG1 X30 A10 C90\nG1 Y20\nG49\nM2\n";
        let planned = |line: usize| {
            let options =
                InterpreterOptions::for_machine(&machine).starting_at(&[0.05, -0.02, 0.01, 0.1, -0.3]);
            let interpreter = Interpreter::new(Cursor::new(program), "part.nc", options.clone());
            let steps = StartLine::new(interpreter, line, &options);
            let mut planner = PartProgramPlanner::new(steps, &machine, PlanOptions::default()).unwrap();
            let mut found = Vec::new();
            while let Some(setpoint) = planner.next_setpoint(1.0).unwrap() {
                found.push((setpoint.place.line, setpoint.psec().to_vec()));
            }
            found
        };
        let (all, part) = (planned(0), planned(3));
        let distance = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        // No step where the approach meets the path.
        let velocity = |axis: usize| machine.axes()[axis].limits().velocity * 0.006;
        for pair in part.windows(2) {
            (0..5).for_each(|axis| {
                assert!((pair[1].1[axis] - pair[0].1[axis]).abs() <= 1.000_001 * velocity(axis))
            });
        }
        let start = all.iter().rfind(|(line, _)| *line == 2).map(|(_, psec)| psec.clone()).unwrap();
        let nearest = part.iter().map(|(_, psec)| distance(psec, &start)).fold(f64::INFINITY, f64::min);
        assert!(nearest < 1e-5, "{nearest}");
        assert!(distance(&all[all.len() - 1].1, &part[part.len() - 1].1) < 1e-12);
        assert!(part.iter().all(|(line, _)| *line != 2));
    }
}
