//! Repetition of program sections: REPEAT and REPEATB with labels.

use super::super::error::Outcome;
use super::super::parameters::integer;
use super::super::source::Place;
use super::super::state::State;
use super::Sinumerik;
use super::call::ActiveCall;
use super::index::{Direction, ProgramLines};
use super::scanner::BlockScanner;

/// Label that ends the section of a REPEAT.
const SECTION_END: &str = "ENDLABEL";

impl Sinumerik {
    /// Executes REPEAT or REPEATB with labels.
    pub(super) fn repeat_section(
        &mut self,
        scanner: &mut BlockScanner<'_>,
        state: &State,
        lines: &mut dyn ProgramLines,
        is_block: bool,
    ) -> Outcome<()> {
        let mut labels = Vec::new();
        let mut times = 1;
        while scanner.peek().is_some() {
            let name = scanner.peek_name();
            if let Some(digits) =
                name.strip_prefix('P').filter(|digits| digits.bytes().all(|d| d.is_ascii_digit()))
            {
                scanner.advance(name.len());
                let count = match digits {
                    "" => {
                        scanner.require("=")?;
                        scanner.number_value(&self.scope(state))?
                    }
                    digits => digits.parse().unwrap_or(f64::INFINITY),
                };
                times = integer(count)
                    .ok_or_else(|| format!("word P: {count} repetitions, an integer from 0 is required"))?;
            } else {
                labels.push(scanner.name()?.to_owned());
            }
        }
        let [first, rest @ ..] = labels.as_slice() else { return Err("REPEAT requires a label".to_owned()) };
        let from = self.place;
        let missing = |label: &str| format!("REPEAT: no label {label} in this program");
        let start = self.find(first, from, Direction::Backward, lines)?;
        let is_behind = start.is_none();
        let start = match start {
            Some(start) => start,
            None => self.find(first, from, Direction::Forward, lines)?.ok_or_else(|| missing(first))?,
        };
        let return_to = lines.place();
        let mut line_behind = |place: Place| {
            lines.jump(place)?;
            lines.read_raw(&mut Vec::new())?;
            let behind = lines.place();
            lines.jump(return_to)?;
            Outcome::Ok(behind)
        };
        let end = match rest {
            _ if is_block => line_behind(start)?,
            [last, ..] => {
                let index = self.index.as_ref();
                let last_line = index.and_then(|index| index.label(last, start, Direction::Forward));
                line_behind(last_line.ok_or_else(|| missing(last))?)?
            }
            [] => {
                let index = self.index.as_ref();
                let end = index.and_then(|index| index.label(SECTION_END, start, Direction::Forward));
                match end {
                    Some(end) if is_behind || end < from => end,
                    _ if is_behind => {
                        return Err(format!("REPEAT {first}: {SECTION_END}: is missing behind it"));
                    }
                    _ => from,
                }
            }
        };
        let Some(runs_left) = u32::checked_sub(times, 1) else { return Ok(()) };
        let blocks = std::mem::take(&mut self.blocks);
        self.push_call(ActiveCall::section(first, start, end, return_to, runs_left, blocks))?;
        lines.jump(start)
    }
}
