//! Declarations: PROC with its parameters, DEF, and settings of variables.

use super::super::error::Outcome;
use super::super::parameters::integer;
use super::super::state::State;
use super::Sinumerik;
use super::call::SavedModes;
use super::scanner::BlockScanner;
use super::value::{Kind, ProgramValue};

/// Most dimensions of an array.
const MAX_DIMENSIONS: usize = 3;

impl Sinumerik {
    /// Executes PROC: gives the values of the call to its parameters.
    pub(super) fn start_procedure(
        &mut self,
        scanner: &mut BlockScanner<'_>,
        state: &mut State,
    ) -> Outcome<()> {
        let name = scanner.name()?.to_owned();
        let arguments = std::mem::take(&mut self.arguments);
        let mut arguments = arguments.into_iter();
        if scanner.skip("(") && !scanner.skip(")") {
            loop {
                let is_reference = scanner.skip_name("VAR");
                let kind = scanner.name()?;
                let kind =
                    Kind::from_name(kind).ok_or_else(|| format!("PROC {name}: {kind} is not a type"))?;
                if kind == Kind::Text {
                    scanner.indices(&self.scope(state))?;
                }
                let parameter = scanner.name()?.to_owned();
                if scanner.peek() == Some(b'[') {
                    skip_dimensions(scanner)?;
                }
                let default = match scanner.skip_assignment() {
                    true => Some(scanner.value(&self.scope(state))?),
                    false => None,
                };
                let argument = arguments.next().flatten();
                match argument.as_ref().and_then(|argument| argument.reference.clone()) {
                    Some(reference) if is_reference => self.variables.define_alias(&parameter, reference)?,
                    _ => {
                        self.variables.define(kind, &parameter, Vec::new())?;
                        if let Some(value) = argument.and_then(|argument| argument.value).or(default) {
                            self.variables.set(&parameter, &[], value)?;
                        }
                    }
                }
                if !scanner.skip(",") {
                    break;
                }
            }
            scanner.require(")")?;
        }
        if arguments.next().is_some() {
            return Err(format!("PROC {name}: the call has more values than the procedure has parameters"));
        }
        let attributes = String::from_utf8_lossy(scanner.take_rest()).into_owned();
        let saves = attributes.split_whitespace().any(|attribute| attribute == "SAVE");
        if let Some(call) = self.calls.last_mut().filter(|_| saves) {
            let (frame, plane) = (self.modes.frame, state.modal.plane);
            call.saved = Some(SavedModes { frame, plane, is_incremental: state.modal.is_incremental });
        }
        Ok(())
    }

    /// Executes DEF: `DEF REAL A=1, B[3,2]`, `DEF STRING[20] NAME="…"`.
    pub(super) fn define(&mut self, scanner: &mut BlockScanner<'_>, state: &State) -> Outcome<()> {
        // CHAN and NCK are ranges of global user data; SYNR and PHU are their attributes.
        while ["CHAN", "NCK", "SYNR", "SYNW", "SYNRW"].iter().any(|word| scanner.skip_name(word)) {}
        let name = scanner.name()?;
        let kind = Kind::from_name(name);
        let kind = kind.ok_or_else(|| {
            format!("DEF {name}: not a type; types: REAL INT BOOL CHAR STRING[n] AXIS FRAME")
        })?;
        if kind == Kind::Text {
            scanner.indices(&self.scope(state))?;
        }
        loop {
            let name = scanner.name()?.to_owned();
            let mut dimensions = Vec::new();
            for size in scanner.indices(&self.scope(state))? {
                let size = integer(size.number()?).filter(|size| *size > 0);
                dimensions
                    .push(size.ok_or_else(|| format!("{name}: the size of an array is 1 or more"))? as usize);
            }
            self.variables.define(kind, &name, dimensions)?;
            if scanner.skip_assignment() {
                self.assign_value(&name, Vec::new(), scanner, state)?;
            }
            if !scanner.skip(",") {
                return Ok(());
            }
        }
    }

    /// Assigns the value that follows to a variable: an expression, `SET(1,2,3)` or `REP(0)`.
    pub(super) fn assign_value(
        &mut self,
        name: &str,
        indices: Vec<ProgramValue>,
        scanner: &mut BlockScanner<'_>,
        state: &State,
    ) -> Outcome<bool> {
        let function = scanner.peek_name();
        let mut ahead = scanner.clone();
        ahead.advance(function.len());
        let has_values = ahead.peek() == Some(b'(');
        let is_list = function == "SET" || (function.is_empty() && has_values && is_list(&ahead));
        if has_values && (is_list || function == "REP") {
            *scanner = ahead;
            let values: Vec<ProgramValue> =
                scanner.arguments(&self.scope(state))?.into_iter().flatten().collect();
            if is_list {
                return self.variables.set_list(name, values).map(|()| false);
            }
            let value = values.into_iter().next().ok_or("REP requires a value")?;
            return self.variables.set(name, &[], value);
        }
        let value = scanner.value(&self.scope(state))?;
        self.variables.set(name, &indices, value)
    }
}

/// Returns true if parentheses have a comma on their own level.
fn is_list(scanner: &BlockScanner<'_>) -> bool {
    let mut ahead = scanner.clone();
    let mut depth = 0_usize;
    let text = ahead.take_rest();
    for byte in text {
        match byte {
            b'(' | b'[' => depth += 1,
            b')' | b']' if depth <= 1 => return false,
            b')' | b']' => depth -= 1,
            b',' if depth == 1 => return true,
            _ => {}
        }
    }
    false
}

/// Skips the dimensions of a parameter, which may be empty: `[3]`, `[,]`.
fn skip_dimensions(scanner: &mut BlockScanner<'_>) -> Outcome<()> {
    scanner.require("[")?;
    for _ in 0..MAX_DIMENSIONS {
        if scanner.has_number() {
            scanner.number()?;
        }
        if !scanner.skip(",") {
            break;
        }
    }
    scanner.require("]")
}
