//! Statements of a block: label, definitions, flow, settings, calls, and the words of a motion.

use super::super::error::Outcome;
use super::super::state::State;
use super::call::Invocation;
use super::coordinates::FrameOperation;
use super::execute::{accept, reject};
use super::index::{ProgramLines, label};
use super::scanner::BlockScanner;
use super::structures::JumpTarget;
use super::system::set_system;
use super::value::{ProgramValue, axis_of};
use super::words::Words;
use super::{Sinumerik, keywords};
use crate::motion::ProgramEvent;

/// Addresses of several letters that have a meaning here or a remedy.
const ADDRESSES: [&str; 43] = [
    "CR", "AR", "AP", "RP", "RPL", "TURN", "RND", "RNDM", "CHF", "CHR", "ANG", "ADIS", "ADISPOS", "CTOL",
    "OTOL", "OFFN", "A2", "B2", "C2", "A3", "B3", "C3", "A4", "B4", "C4", "A5", "B5", "C5", "I1", "J1", "K1",
    "LEAD", "TILT", "THETA", "A6", "B6", "C6", "FB", "FP", "DISR", "DISCL", "FAD", "DISC",
];

/// Returns true for a letter with digits, which is no name of a subprogram: `M30`, not `L30`.
fn is_address(name: &str) -> bool {
    let digits = name.get(1..).unwrap_or_default();
    !name.starts_with('L') && !digits.is_empty() && digits.bytes().all(|digit| digit.is_ascii_digit())
}

impl Sinumerik {
    /// Executes a block.
    pub(super) fn execute_block(
        &mut self,
        scanner: &mut BlockScanner<'_>,
        state: &mut State,
        lines: &mut dyn ProgramLines,
    ) -> Outcome<()> {
        label(scanner);
        if scanner.peek() == Some(b'(') {
            scanner.take_rest();
        }
        let keyword = scanner.peek_name();
        if keyword == "PROC" {
            return self.procedure(scanner, state, lines);
        }
        if !self.arguments.is_empty() {
            let name = self.calls.last().map_or("", |call| call.name.as_str());
            return Err(format!("{name} is called with values and has no PROC {name}(…) in its first line"));
        }
        match keyword {
            "DEF" => {
                scanner.advance(keyword.len());
                return self.define(scanner, state);
            }
            "DEFINE" => {
                scanner.advance(keyword.len());
                return self.macros.define(scanner);
            }
            "EXTERN" => return Ok(()),
            "REDEF" | "ID" | "IDS" | "WHEN" | "WHENEVER" | "EVERY" | "FROM" | "DO" => {
                // Synchronized actions run beside the motions.
                scanner.take_rest();
                let name = if keyword == "REDEF" { keyword } else { "synchronized action" };
                accept(name, state);
                return Ok(());
            }
            _ => {}
        }
        if self.flow_statement(scanner, state, lines)? {
            return Ok(());
        }
        self.words(scanner, state, lines)
    }

    /// Executes PROC, which begins a subprogram and ends the program in front of it.
    fn procedure(
        &mut self,
        scanner: &mut BlockScanner<'_>,
        state: &mut State,
        lines: &mut dyn ProgramLines,
    ) -> Outcome<()> {
        let mut ahead = scanner.clone();
        ahead.skip_name("PROC");
        let is_called = self
            .calls
            .iter()
            .rev()
            .find(|call| !call.is_section())
            .is_some_and(|call| call.name == ahead.peek_name() && call.is_entry(self.place));
        if !is_called && self.has_statement {
            return self.return_or_end(state, lines);
        }
        scanner.skip_name("PROC");
        self.start_procedure(scanner, state)
    }

    pub(super) fn return_or_end(&mut self, state: &mut State, lines: &mut dyn ProgramLines) -> Outcome<()> {
        self.blocks.clear();
        if self.return_from_call(state, lines)? { Ok(()) } else { state.end() }
    }

    /// Reads the words of a block and executes them.
    fn words(
        &mut self,
        scanner: &mut BlockScanner<'_>,
        state: &mut State,
        lines: &mut dyn ProgramLines,
    ) -> Outcome<()> {
        let mut words = Words::default();
        let mut jump: Option<JumpTarget> = None;
        let mut invocation: Option<Invocation> = None;
        let mut frame: Option<FrameOperation> = None;
        let mut is_modal = false;
        while let Some(byte) = scanner.peek() {
            // Post-processors write remarks in parentheses.
            if byte == b'(' {
                scanner.advance(1);
                scanner.skip_parentheses()?;
                continue;
            }
            if let Some(target) = self.jump_target(scanner, state)? {
                jump = Some(target);
                continue;
            }
            let name = scanner.peek_name();
            if name.is_empty() {
                let rest = scanner.rest();
                return Err(match byte {
                    b'@' => format!(
                        "{rest}: commands @ of Sinumerik 810 to 880 are not supported: program IF, GOTOF and R=…"
                    ),
                    _ => format!("{rest}: a word is required, a letter with a value"),
                });
            }
            let mut ahead = scanner.clone();
            ahead.advance(name.len());
            let follows = ahead.peek();
            let is_assignment = match follows {
                Some(b'=') => ahead.skip_assignment(),
                Some(b'[') => true,
                _ => false,
            };
            if is_assignment && (!is_word_chain(name) || self.variables.is_defined(name)) {
                self.assignment(scanner, &mut words, state)?;
                continue;
            }
            // A remark may follow a word: `M0 (CHECK)`.
            if (follows != Some(b'(') || is_address(name)) && words.read_letter(scanner)? {
                continue;
            }
            scanner.advance(name.len());
            match name {
                "MCALL" => is_modal = true,
                "MSG" => self.message(scanner, state)?,
                "CALL" if scanner.peek_name() == "BLOCK" => {
                    return Err(
                        "CALL BLOCK … TO … is not supported: program REPEAT with the labels, as in REPEAT A1 A2"
                            .to_owned(),
                    );
                }
                "CALL" | "EXTCALL" | "PCALL" => {
                    invocation = Some(self.indirect_call(name, scanner, state)?);
                }
                "TRANS" | "ATRANS" | "ROT" | "AROT" | "SCALE" | "ASCALE" | "MIRROR" | "AMIRROR" => {
                    frame = FrameOperation::from_name(name);
                }
                "TRAORI" => {
                    if scanner.peek() == Some(b'(') {
                        scanner.arguments(&self.scope(state))?;
                    }
                    words.keywords.push(name.to_owned());
                }
                _ if keywords::is_accepted(name) => {
                    if scanner.skip("(") {
                        scanner.skip_parentheses()?;
                    }
                    accept(name, state);
                }
                _ if is_keyword(name) => words.keywords.push(name.to_owned()),
                _ if keywords::remedy(name).is_some() => {
                    if scanner.skip("(") {
                        scanner.skip_parentheses()?;
                    }
                    reject(name, keywords::remedy(name).unwrap_or_default(), state)?;
                }
                _ if invocation.is_none() => invocation = Some(self.invocation(name, scanner, state, lines)?),
                _ => return Err(format!("{name}: two calls in one block: program them in two blocks")),
            }
        }
        if is_modal && invocation.is_none() {
            self.modal_call = None;
            // MCALL L20.
            if let Some(number) = words.integer("L")? {
                let name = format!("L{number}");
                match self.has_subprogram(&name, state, lines)? {
                    true => invocation = Some(Invocation { name, arguments: Vec::new() }),
                    false => self.accept_absent(&name, state)?,
                }
            }
        }
        let times = match invocation {
            Some(_) => words.integer("P")?.unwrap_or(1),
            None => 1,
        };
        self.execute(&mut words, frame, state, lines)?;
        if let Some(invocation) = invocation {
            self.invoke(invocation, times, is_modal, state, lines)?;
        }
        jump.map_or(Ok(()), |target| self.jump(&target, lines))
    }

    /// Reads `NAME=value` and `NAME[…]=value`: a word of the block, or a setting that takes effect at once.
    fn assignment(
        &mut self,
        scanner: &mut BlockScanner<'_>,
        words: &mut Words,
        state: &mut State,
    ) -> Outcome<()> {
        let name = scanner.name()?.to_owned();
        let indices = scanner.indices(&self.scope(state))?;
        if !scanner.skip_assignment() {
            return Err(format!("{}: = is required behind {name}", scanner.rest()));
        }
        if name.starts_with('$') {
            let value = scanner.value(&self.scope(state))?;
            if !set_system(&name, &indices, value, &mut self.modes, state)? {
                accept(&name, state);
            }
            return Ok(());
        }
        let is_variable =
            self.variables.is_defined(&name) || self.variables.reference(&name, &indices)?.is_some();
        let is_letter = name.len() == 1 && name != "R";
        let is_numbered = name.len() > 1 && name[1..].bytes().all(|byte| byte.is_ascii_digit());
        let is_axis = axis_of(&name).is_some();
        if is_variable && (!is_axis || !indices.is_empty()) {
            self.assign_value(&name, indices, scanner, state)?;
            return Ok(());
        }
        if is_letter || is_axis || is_numbered || ADDRESSES.contains(&name.as_str()) {
            let value = Words::read_value(scanner, &self.scope(state))?;
            return words.add(&name, indices.into_iter().next(), value);
        }
        if keywords::is_accepted(&name) {
            Words::read_value(scanner, &self.scope(state))?;
            accept(&name, state);
            return Ok(());
        }
        if let Some(remedy) = keywords::remedy(&name) {
            Words::read_value(scanner, &self.scope(state))?;
            return reject(&name, remedy, state);
        }
        if self.assign_value(&name, indices, scanner, state)? {
            accept(&format!("{name} without DEF"), state);
        }
        Ok(())
    }

    /// Executes `MSG("text")`; the text may be an expression.
    fn message(&mut self, scanner: &mut BlockScanner<'_>, state: &mut State) -> Outcome<()> {
        let mut ahead = scanner.clone();
        let text = match ahead.arguments(&self.scope(state)) {
            Ok(values) => {
                *scanner = ahead;
                values.into_iter().next().flatten().map(ProgramValue::text)
            }
            // Without quotes the text is that in the parentheses.
            Err(_) => {
                let rest = String::from_utf8_lossy(scanner.take_rest()).into_owned();
                Some(rest.trim().trim_start_matches('(').trim_end_matches(')').trim_matches('"').to_owned())
            }
        };
        if let Some(text) = text.filter(|text| !text.is_empty()) {
            state.push_event(ProgramEvent::Message(virtual_axes_core::text::escaped(&text)));
        }
        Ok(())
    }
}

/// Returns true for words without blanks before the address of a setting: G1X in `G1X=5`.
fn is_word_chain(name: &str) -> bool {
    let mut rest = name.as_bytes();
    let mut has_word = false;
    while let [b'A'..=b'Z', digits @ ..] = rest {
        let count = digits.iter().take_while(|byte| byte.is_ascii_digit()).count();
        if count == 0 {
            return has_word && digits.is_empty();
        }
        has_word = true;
        rest = &digits[count..];
    }
    false
}

/// Returns true for a keyword that `execute` takes.
fn is_keyword(name: &str) -> bool {
    matches!(
        name,
        "SUPA"
            | "CIP"
            | "NORM"
            | "KONT"
            | "CT"
            | "RET"
            | "ENDPROC"
            | "TRAFOOF"
            | "ORIAXES"
            | "ORIVECT"
            | "ORIPLANE"
            | "ORIMKS"
            | "ORIWKS"
            | "ORIEULER"
            | "ORIRPY"
            | "ORIRPY2"
    )
}
