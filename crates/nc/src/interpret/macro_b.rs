//! Statements of macro B: IF, WHILE, GOTO.

use std::io::{BufRead, Seek};

use super::Interpreter;
use super::dialect::Dialect;
use super::error::Outcome;
use super::expression::Scanner;
use super::limits::MAX_SUBPROGRAMS;
use super::o_words::is_o_word;
use super::okuma::{self, NamedStatement};
use super::parameters::integer;
use super::source::Place;
use super::state::Jump;

/// Program of Okuma controls that computes the work offset of a turned workpiece: CALL OO88.
const FIXTURE_OFFSET: &str = "o88";
/// Statements without effect in a simulation.
const WITHOUT_EFFECT: [&str; 5] = ["popen", "pclos", "dprnt", "bprnt", "setvn"];

impl<R: BufRead + Seek> Interpreter<R> {
    /// Executes the statement of macro B in the line at `place`; returns false if the line has words.
    pub(super) fn execute_statement(&mut self, place: Place) -> Outcome<bool> {
        if self.state.dialect == Dialect::Okuma
            && let Some(statement) = okuma::statement(&self.line.text)
        {
            return self.execute_okuma(statement).map(|()| true);
        }
        let text = &self.line.text;
        if text.starts_with(b"if") || (text.starts_with(b"[") && self.state.dialect == Dialect::Haas) {
            self.execute_if()?;
        } else if text.starts_with(b"while") || text.starts_with(b"do") {
            let begun = self.execute_loop(place);
            if begun.is_err() {
                self.note_failed_loop();
            }
            begun?;
        } else if text.starts_with(b"end") {
            let number = loop_number(&mut Scanner::new(text, &self.state), "end")?;
            let key = (self.flow.calls.len(), number);
            match self.flow.loops.get(&key) {
                Some(start) => self.source.jump(*start)?,
                None if self.flow.failed_loops.contains(&key) => {}
                None => return Err(format!("END{number} without DO{number}")),
            }
        } else if text.starts_with(b"goto") {
            let mut scanner = Scanner::new(text, &self.state);
            let number = jump_target(&mut scanner)?;
            self.go_to(number)?;
        } else if is_o_word(text) {
            return self.execute_program_number();
        } else if text.first() == Some(&b'<') {
            // Name of the program.
        } else if let Some(name) = WITHOUT_EFFECT.into_iter().find(|name| text.starts_with(name.as_bytes())) {
            self.state.note_without_effect(name.to_uppercase());
        } else {
            return Ok(false);
        }
        Ok(true)
    }

    /// Executes a statement of Okuma.
    fn execute_okuma(&mut self, statement: NamedStatement) -> Outcome<()> {
        match statement {
            NamedStatement::Call(program, from) => {
                let times = self.read_arguments(from)?;
                if program == FIXTURE_OFFSET && self.subprogram(&program).is_err() {
                    return self.state.set_fixture_offset();
                }
                if times > 0 {
                    self.call(&program, None, times)?;
                }
            }
            NamedStatement::ModalCall(program, from) => {
                self.read_arguments(from)?;
                self.state.modal_macro = Some((Jump::Named { program }, self.state.calls));
            }
            NamedStatement::ModalEnd => self.state.modal_macro = None,
            NamedStatement::Return => {
                self.state.jump = Some(Jump::Return { number: None });
                self.execute_jump()?;
            }
            NamedStatement::WithoutEffect(name) => self.state.note_without_effect(name),
        }
        Ok(())
    }

    /// Sets the variables of a call, and returns its repetitions Q.
    fn read_arguments(&mut self, from: usize) -> Outcome<u32> {
        self.block.read(self.line.text.get(from..).unwrap_or_default(), &self.state)?;
        self.state.set_parameters(&mut self.block)?;
        let times = self.block.take_integer('Q')?;
        self.block.require_used()?;
        Ok(times.unwrap_or(1))
    }

    /// Executes `IF [condition] GOTO n` or `IF [condition] THEN words`; Haas has THEN, and IF before M99, as options.
    fn execute_if(&mut self) -> Outcome<()> {
        let mut scanner = Scanner::new(&self.line.text, &self.state);
        scanner.skip("if");
        let is_true = is_true(scanner.bracket()?);
        // The target of a jump that is not made can be a variable without value.
        if scanner.starts_with("goto") {
            return match is_true {
                true => jump_target(&mut scanner).and_then(|number| self.go_to(number)),
                false => Ok(()),
            };
        }
        if !scanner.skip("then") && self.state.dialect != Dialect::Haas {
            return Err(format!("{}: IF requires GOTO or THEN", scanner.found()));
        }
        if scanner.peek().is_none() {
            return Err("IF THEN requires its words in the same line".to_owned());
        }
        let rest = scanner.position();
        if !is_true {
            return Ok(());
        }
        if scanner.starts_with("goto") {
            let number = jump_target(&mut scanner)?;
            return self.go_to(number);
        }
        self.execute_words(rest)
    }

    /// Executes the words after the number of a program: `O1000 G21`.
    fn execute_program_number(&mut self) -> Outcome<bool> {
        if self.state.dialect == Dialect::Okuma {
            return Ok(true);
        }
        let text = &self.line.text;
        let end = text.iter().skip(1).position(|byte| !byte.is_ascii_digit());
        match end.map(|end| end + 1) {
            None if text.len() > 1 => Ok(true),
            Some(1) if text.get(1) == Some(&b'<') => Ok(true),
            None | Some(1) => {
                let text = String::from_utf8_lossy(text).to_uppercase();
                Err(format!("{text}: O requires the number of the program"))
            }
            Some(end) => self.execute_words(end).map(|()| true),
        }
    }

    /// Executes `WHILE [condition] DOn` or `DOn`.
    fn execute_loop(&mut self, place: Place) -> Outcome<()> {
        let mut scanner = Scanner::new(&self.line.text, &self.state);
        let is_true = if scanner.skip("while") { is_true(scanner.bracket()?) } else { true };
        let number = loop_number(&mut scanner, "do")?;
        self.begin_loop(place, number, is_true)
    }

    /// Notes the number of a loop whose first line has an error: its END is no further error.
    fn note_failed_loop(&mut self) {
        let text = String::from_utf8_lossy(&self.line.text);
        let digits = text.rsplit_once("do").map_or("", |(_, rest)| rest);
        let end = digits.find(|digit: char| !digit.is_ascii_digit()).unwrap_or(digits.len());
        if let Ok(number) = digits[..end].parse() {
            let key = (self.flow.calls.len(), number);
            self.flow.loops.remove(&key);
            self.flow.failed_loops.insert(key);
        }
    }

    fn go_to(&mut self, number: u32) -> Outcome<()> {
        self.state.jump = Some(Jump::Goto { number });
        self.execute_jump()
    }

    /// Begins a loop, or skips it.
    fn begin_loop(&mut self, place: Place, number: u32, is_true: bool) -> Outcome<()> {
        if is_true {
            if self.flow.loops.len() >= MAX_SUBPROGRAMS {
                self.flow.loops.clear();
            }
            self.flow.failed_loops.remove(&(self.flow.calls.len(), number));
            self.flow.loops.insert((self.flow.calls.len(), number), place);
            return Ok(());
        }
        loop {
            let read = self.source.read(&mut self.line.raw);
            if !read? {
                return Err(format!("WHILE DO{number} without END{number}"));
            }
            if self.line.compact(self.state.dialect).is_err() || !self.line.text.starts_with(b"end") {
                continue;
            }
            let found = loop_number(&mut Scanner::new(&self.line.text, &self.state), "end");
            if found == Ok(number) {
                return Ok(());
            }
        }
    }
}

/// Returns true for a condition that is not 0.
fn is_true(value: f64) -> bool {
    value != 0.0 && !value.is_nan()
}

/// Reads the number of a loop after its keyword.
fn loop_number(scanner: &mut Scanner<'_>, keyword: &str) -> Outcome<u32> {
    let text = scanner.found();
    let number = if scanner.skip(keyword) { integer(scanner.value()?) } else { None };
    let keyword = keyword.to_uppercase();
    let number = number.ok_or_else(|| format!("{text}: {keyword} requires its number, as in {keyword}1"))?;
    match scanner.peek() {
        None => Ok(number),
        Some(_) => Err(format!(
            "{}: a line ends after {keyword}{number}: move the rest to a line of its own",
            scanner.rest()
        )),
    }
}

/// Reads the number of a line after GOTO.
fn jump_target(scanner: &mut Scanner<'_>) -> Outcome<u32> {
    scanner.skip("goto");
    let value = scanner.value()?;
    integer(value).ok_or_else(|| format!("GOTO {value}: the number of a line is an integer"))
}
