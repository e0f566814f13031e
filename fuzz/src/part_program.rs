//! Fuzz target of part programs: interpretation in each dialect, then look-ahead and feed planning.

use std::borrow::Cow;
use std::io::Cursor;

use virtual_axes_core::config::{MachineConfig, ValueSource};
use virtual_axes_core::path::LimitUse;
use virtual_axes_core::units::seconds;
use virtual_axes_nc::interpret::{Dialect, Interpreter, InterpreterOptions};
use virtual_axes_nc::motion::ProgramStep;
use virtual_axes_nc::plan::{PartProgramPlanner, PlanOptions};

use crate::{MACHINE, PARAMETERS, assert_one_line, bounded};

/// Largest number of steps that are interpreted; a program can be endless.
const MAX_STEPS: usize = 2000;
/// Largest number of steps that are planned.
const MAX_PLANNED_STEPS: usize = 40;
/// Largest number of planned position cycles; a motion can be slow.
const MAX_CYCLES: usize = 500;
/// Number of lines that a part program may repeat.
const REPEATED_LINES: u64 = 2000;
/// Start of a line with a parameter of the machine, which is a comment of the program.
const PARAMETER: &str = ";set ";
/// Relative tolerance of the limits of the axes.
const TOLERANCE: f64 = 1e-6;

/// Interprets and plans a part program on the default machine, with the parameters of its first lines.
pub fn part_program(data: &[u8]) {
    let machine = machine(data);
    bounded(data.len(), || {
        for dialect in Dialect::ALL {
            interpret(data, &machine, dialect);
        }
        plan(data, &machine);
    });
}

/// Returns the machine with the parameters in lines such as `;set x.limits.jerk_m_s3=20`; invalid ones are left out.
fn machine(data: &[u8]) -> Cow<'static, MachineConfig> {
    let lines = data.split(|byte| *byte == b'\n').map_while(|line| str::from_utf8(line).ok());
    let settings: Vec<&str> = lines.map_while(|line| line.strip_prefix(PARAMETER)).collect();
    if settings.is_empty() {
        return Cow::Borrowed(&MACHINE);
    }
    let mut parameters = PARAMETERS.clone();
    for setting in settings {
        if let Err(error) = parameters.set_text(setting, &ValueSource::named("-p")) {
            assert_one_line(&error.to_string());
        }
    }
    Cow::Owned(parameters.machine_config().expect("what is accepted is valid"))
}

/// Returns the interpreter of a program; without a dialect it is detected.
fn interpreter<'a>(
    data: &'a [u8],
    machine: &MachineConfig,
    dialect: Option<Dialect>,
) -> Interpreter<Cursor<&'a [u8]>> {
    let options = InterpreterOptions {
        dialect,
        repeated_lines: REPEATED_LINES,
        ..InterpreterOptions::for_machine(machine)
    };
    Interpreter::new(Cursor::new(data), "part.nc", options)
}

/// Interprets a program and asserts that its coordinates are finite.
fn interpret(data: &[u8], machine: &MachineConfig, dialect: Dialect) {
    for step in interpreter(data, machine, Some(dialect)).take(MAX_STEPS) {
        match step {
            Ok(ProgramStep::Motion(motion)) => {
                let mut values = motion.start.iter().chain(&motion.end);
                assert!(values.all(|value| value.is_finite()), "{motion:?}");
            }
            Ok(ProgramStep::Event { .. }) => {}
            Err(error) => {
                assert_one_line(&error.to_string());
                assert!(error.to_string().starts_with("part.nc:"), "{error}");
            }
        }
    }
}

/// Plans a program and asserts that its setpoints are within the limits of the axes.
fn plan(data: &[u8], machine: &MachineConfig) {
    let steps = interpreter(data, machine, None).take(MAX_PLANNED_STEPS);
    let mut planner = match PartProgramPlanner::new(steps, machine, PlanOptions::default()) {
        Ok(planner) => planner,
        Err(error) => return assert_one_line(&error.to_string()),
    };
    let period = seconds(machine.periods().position);
    let mut windows: Vec<Option<[f64; LimitUse::WINDOW]>> = vec![None; machine.axes().len()];
    for cycle in 0..MAX_CYCLES {
        let setpoint = match planner.next_setpoint(1.0) {
            Ok(Some(setpoint)) => setpoint,
            Ok(None) => return,
            Err(error) => return assert_one_line(&error.to_string()),
        };
        let time = cycle as f64 * period;
        for ((axis, &psec), window) in machine.axes().iter().zip(setpoint.psec()).zip(&mut windows) {
            assert!(psec.is_finite(), "line {}: {} at {psec}", setpoint.place.line, axis.name());
            let window = window.get_or_insert([psec; LimitUse::WINDOW]);
            window.rotate_left(1);
            window[LimitUse::WINDOW - 1] = psec;
            for used in LimitUse::of_setpoints(*window, time, period, axis.limits()) {
                assert!(
                    used.ratio() <= 1.0 + TOLERANCE,
                    "line {}: {}: {used:?} at {time} s",
                    setpoint.place.line,
                    axis.name()
                );
            }
        }
    }
}
