//! Calls of a block: cycles, patterns of positions and subprograms, once or at each position (MCALL).

use super::super::error::Outcome;
use super::super::parameters::integer;
use super::super::state::State;
use super::Sinumerik;
use super::call::{Invocation, ModalCall};
use super::calls::subprogram_name;
use super::cycles::DrillingCycle;
use super::execute::reject;
use super::index::ProgramLines;
use super::modes::PathMode;
use super::patterns::pattern;
use super::scanner::BlockScanner;
use super::value::ProgramValue;

/// Most motions of a pattern in one block.
const MAX_STEPS: usize = 50_000;

impl Sinumerik {
    /// Reads `CALL "NAME"`, `EXTCALL("path/NAME")`, `PCALL path(…)`.
    pub(super) fn indirect_call(
        &mut self,
        keyword: &str,
        scanner: &mut BlockScanner<'_>,
        state: &State,
    ) -> Outcome<Invocation> {
        let name = match scanner.peek() {
            Some(b'/') => {
                let mut path = String::new();
                while scanner.skip("/") {
                    path = scanner.name()?.to_owned();
                }
                path
            }
            _ => scanner.value(&self.scope(state)).map_err(|reason| format!("{keyword}: {reason}"))?.text(),
        };
        let name = subprogram_name(&name);
        let arguments = self.call_arguments(scanner, state)?;
        Ok(Invocation { name, arguments })
    }

    /// Reads the call of a cycle or subprogram by its name.
    pub(super) fn invocation(
        &mut self,
        name: &str,
        scanner: &mut BlockScanner<'_>,
        state: &mut State,
        lines: &mut dyn ProgramLines,
    ) -> Outcome<Invocation> {
        let is_known = is_cycle(name) || self.has_subprogram(name, state, lines)?;
        if !is_known {
            // Values of an unknown call may have names of its machine.
            if scanner.skip("(") {
                scanner.skip_parentheses()?;
            }
            self.accept_absent(name, state)?;
            return Ok(Invocation { name: String::new(), arguments: Vec::new() });
        }
        let arguments = self.call_arguments(scanner, state).map_err(|reason| format!("{name}: {reason}"))?;
        Ok(Invocation { name: name.to_owned(), arguments })
    }

    /// Takes the call of a subprogram that the program lacks as a tool change, by its name, or as ignored.
    ///
    /// # Errors
    ///
    /// Any other subprogram.
    pub(super) fn accept_absent(&mut self, name: &str, state: &mut State) -> Outcome<()> {
        if is_tool_change(name) {
            state.assume(format!("{name}: the tool change of the machine builder, as M6"));
            self.changes_tool = true;
            return Ok(());
        }
        if state.options.ignored.has_name(name) {
            state.note_without_effect(name.to_owned());
            return Ok(());
        }
        let remedy = format!(
            "neither a word of the control nor a subprogram: add %_N_{name}_SPF to this file, or {name}.SPF beside it, \
             or skip it with --ignore {name}"
        );
        reject(name, &remedy, state)
    }

    /// Executes a call, or stores it for the next motions (MCALL).
    pub(super) fn invoke(
        &mut self,
        invocation: Invocation,
        times: u32,
        is_modal: bool,
        state: &mut State,
        lines: &mut dyn ProgramLines,
    ) -> Outcome<()> {
        let name = invocation.name.as_str();
        if name.is_empty() {
            return Ok(());
        }
        let values = invocation.values();
        if let Some(cycle) = DrillingCycle::new(name, &values, state)? {
            if is_modal {
                self.modal_call = Some(ModalCall::Drilling(cycle));
                return Ok(());
            }
            return cycle.drill(state);
        }
        if let Some(points) = pattern(name, &values, state)? {
            let Some(call) = self.modal_call.clone() else {
                return Err(format!(
                    "{name} requires a modal cycle: program MCALL CYCLE81(…) in a block before"
                ));
            };
            let ModalCall::Drilling(cycle) = call else {
                return Err(format!(
                    "{name} with MCALL of a subprogram is not supported: program its positions"
                ));
            };
            let [first, second, _] = state.modal.plane.axes();
            for point in points {
                let mut end = state.programmed();
                [end[first], end[second]] = point;
                state.rapid_to(&end)?;
                cycle.drill(state)?;
                if state.steps.len() > MAX_STEPS {
                    return Err(format!("{name}: more than {MAX_STEPS} motions in one block"));
                }
            }
            return Ok(());
        }
        match name {
            "CYCLE800" => return self.swivel(&values, state),
            "CYCLE832" => return self.set_tolerance(&values, state),
            _ => {}
        }
        if is_modal {
            self.modal_call = Some(ModalCall::Subprogram(invocation));
            return Ok(());
        }
        self.call(invocation, times, state, lines)
    }

    /// Repeats the modal call behind a motion.
    pub(super) fn repeat_modal_call(
        &mut self,
        state: &mut State,
        lines: &mut dyn ProgramLines,
    ) -> Outcome<()> {
        match self.modal_call.clone() {
            None => Ok(()),
            Some(ModalCall::Drilling(cycle)) => cycle.drill(state),
            // The motions of the subprogram itself do not call it again.
            Some(ModalCall::Subprogram(invocation)) => {
                if self.calls.iter().any(|call| call.name == invocation.name) {
                    return Ok(());
                }
                self.call(invocation, 1, state, lines)
            }
        }
    }

    /// Executes CYCLE832: tolerances of contour and orientation, in mm and degrees.
    fn set_tolerance(&mut self, values: &[Option<ProgramValue>], state: &mut State) -> Outcome<()> {
        let number = |index: usize| match values.get(index) {
            Some(Some(ProgramValue::Number(value))) => Some(*value),
            _ => None,
        };
        let tolerance = number(0).filter(|tolerance| *tolerance > 0.0);
        let mode = integer(number(1).unwrap_or(0.0).abs()).unwrap_or(0);
        // The third value is the orientation tolerance if the tens digit of the mode says so.
        let has_orientation = (mode / 10) % 10 == 1 && mode < 100;
        self.modes.tolerance = tolerance.map(|tolerance| tolerance * state.modal.length);
        let rotary = number(2).filter(|tolerance| has_orientation && *tolerance > 0.0);
        self.modes.rotary_tolerance = rotary.map(f64::to_radians);
        self.modes.path = match tolerance {
            Some(_) => PathMode::Tolerance,
            None => PathMode::Initial,
        };
        self.modes.update_path_control(state);
        Ok(())
    }
}

/// Returns true for names that machine builders give to the subprogram of the tool change.
fn is_tool_change(name: &str) -> bool {
    matches!(
        name,
        "L6" | "L06"
            | "L6_TC"
            | "L06_TC"
            | "TC"
            | "TCHANGE"
            | "TOOL"
            | "TOOLCHANGE"
            | "TOOL_CHANGE"
            | "TOOLCHG"
            | "WERKZEUG"
            | "WERKZEUGWECHSEL"
            | "WZW"
            | "WZWECHSEL"
    )
}

/// Returns true for a cycle that is executed.
fn is_cycle(name: &str) -> bool {
    matches!(
        name,
        "CYCLE81"
            | "CYCLE82"
            | "CYCLE83"
            | "CYCLE84"
            | "CYCLE840"
            | "CYCLE85"
            | "CYCLE86"
            | "CYCLE87"
            | "CYCLE88"
            | "CYCLE89"
            | "CYCLE800"
            | "CYCLE801"
            | "CYCLE802"
            | "CYCLE832"
            | "HOLES1"
            | "HOLES2"
    )
}
