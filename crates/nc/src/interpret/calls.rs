//! Calls of subprograms and macros by number: M97, M98, M99, G65, G66, G67.

use super::codes::{Action, Codes, ModalMacro, Subprogram};
use super::dialect::Dialect;
use super::error::Outcome;
use super::line_words::LineWords;
use super::parameters::LOCALS;
use super::state::{Jump, State};

/// Variable of the first word I of a call.
const FIRST_TRIPLE: usize = 4;
/// Letters of the arguments of a macro, with the numbers of their variables.
const ARGUMENTS: [(char, usize); 21] = [
    ('A', 1),
    ('B', 2),
    ('C', 3),
    ('I', 4),
    ('J', 5),
    ('K', 6),
    ('D', 7),
    ('E', 8),
    ('F', 9),
    ('H', 11),
    ('M', 13),
    ('Q', 17),
    ('R', 18),
    ('S', 19),
    ('T', 20),
    ('U', 21),
    ('V', 22),
    ('W', 23),
    ('X', 24),
    ('Y', 25),
    ('Z', 26),
];

impl State {
    /// Requests the call of a macro: G65, or sets one to follow each motion: G66, G67. Returns true if the words of the line
    /// are its arguments.
    pub(super) fn request_macro(&mut self, block: &mut LineWords, codes: &Codes) -> Outcome<bool> {
        if codes.g.modal_macro == Some(ModalMacro::Cancel) {
            self.modal_macro = None;
        }
        let is_modal = codes.g.modal_macro == Some(ModalMacro::Call);
        if codes.g.action != Some(Action::MacroCall) && !is_modal {
            return Ok(false);
        }
        let name = if is_modal { "G66" } else { "G65" };
        let program = block.take_integer('P')?;
        let program = program.ok_or_else(|| format!("{name} requires P, the number of the macro"))?;
        let times = block.take_integer('L')?.unwrap_or(1);
        let mut arguments = Box::new([f64::NAN; LOCALS]);
        for (letter, number) in ARGUMENTS {
            arguments[number - 1] = block.take(letter).unwrap_or(f64::NAN);
        }
        set_triples(&block.triples, &mut arguments)?;
        let call = Jump::Macro { program, times, arguments };
        match is_modal {
            true => self.modal_macro = Some((call, self.calls)),
            false => self.jump = Some(call),
        }
        Ok(true)
    }

    /// Requests the macro that follows each motion.
    pub(super) fn request_modal_macro(&mut self) {
        if let Some((call, depth)) = &self.modal_macro
            && *depth == self.calls
        {
            self.jump = Some(call.clone());
        }
    }

    /// Returns the number of calls of M98: word L, or Q of Mach3.
    pub(super) fn repetitions_of_call(&self, block: &mut LineWords) -> Outcome<u32> {
        let by_q = if self.dialect == Dialect::Mach3 { block.take_integer('Q')? } else { None };
        Ok(block.take_integer('L')?.or(by_q).unwrap_or(1))
    }

    /// Requests the call of a subprogram or the return from it: M97, M98, M99.
    pub(super) fn jump(&mut self, block: &mut LineWords, codes: &Codes) -> Outcome<()> {
        let Some(code) = codes.m.subprogram else { return Ok(()) };
        self.jump = Some(match code {
            Subprogram::Call => {
                let number =
                    block.take_integer('P')?.ok_or("M98 requires P, the number of the subprogram")?;
                Jump::Call { program: number, times: self.repetitions_of_call(block)? }
            }
            Subprogram::External => match block.take_integer('P')? {
                Some(program) => Jump::Call { program, times: self.repetitions_of_call(block)? },
                // An auxiliary function of the machine builder.
                None => return Ok(()),
            },
            Subprogram::Local => {
                let number =
                    block.take_integer('P')?.ok_or("M97 requires P, the number of the line to call")?;
                Jump::Local { number, times: block.take_integer('L')?.unwrap_or(1) }
            }
            Subprogram::Return => Jump::Return { number: block.take_integer('P')? },
        });
        Ok(())
    }
}

/// Sets the variables #4 to #33 by the sets of words I, J and K of a call, if it has more than one.
fn set_triples(triples: &[(char, f64)], arguments: &mut [f64; LOCALS]) -> Outcome<()> {
    let (mut place, mut places) = (0, Vec::new());
    for (letter, value) in triples {
        let rank = usize::from(*letter as u8 - b'I');
        while place % 3 != rank {
            place += 1;
        }
        places.push((place + FIRST_TRIPLE, *value));
        place += 1;
    }
    if places.last().is_none_or(|(place, _)| *place < FIRST_TRIPLE + 3) {
        return Ok(());
    }
    for (number, value) in places {
        let argument =
            arguments.get_mut(number - 1).ok_or("a call has at most ten sets of words I, J and K")?;
        *argument = value;
    }
    Ok(())
}
