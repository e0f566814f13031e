//! Interpreter of part programs: RS-274/NGC text to motions of the axes.
//!
//! Syntax and meaning of the words are those of LinuxCNC, with tool center point control (G43.4) and subprograms by
//! number (M98, M99) as on other controls; docs/reference/part-programs.md has the list. A program is read line by
//! line, loops and subprograms by jumps in the source: memory does not depend on the length of the program. Depth of
//! calls and expressions, length of lines and number of repeated lines are bounded.

mod arcs;
mod codes;
mod cycles;
mod error;
mod execute;
mod expression;
mod flow;
mod limits;
mod line_words;
mod moves;
mod o_words;
mod offsets;
mod options;
mod parameters;
mod source;
mod spline;
mod state;
mod text;

use std::collections::BTreeMap;
use std::io::{BufRead, Seek};

pub use error::ProgramError;
pub use options::{InterpreterOptions, TipTransform, WORK_OFFSET_COUNT};

use self::error::Outcome;
use self::flow::Flow;
use self::line_words::LineWords;
use self::o_words::is_o_word;
use self::source::LineSource;
use self::state::State;
use self::text::LineText;
use crate::motion::ProgramStep;

/// Interpreter of one program: an iterator over its steps, in memory independent of the program's length.
///
/// The last step is [`End`](crate::motion::ProgramEvent::End). The first error ends the iteration.
#[derive(Debug)]
pub struct Interpreter<R> {
    name: String,
    source: LineSource<R>,
    line: LineText,
    block: LineWords,
    state: State,
    flow: Flow,
    ignored: BTreeMap<u32, IgnoredCode>,
}

/// Occurrences of an ignored M code in the lines executed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct IgnoredCode {
    /// Number of executed lines with the code.
    pub count: u64,
    /// First source line with the code, from 1.
    pub first_line: usize,
}

impl<R: BufRead + Seek> Interpreter<R> {
    /// Creates the interpreter of the program in `source`, from its start; `name` is the file in messages.
    pub fn new(source: R, name: &str, options: InterpreterOptions) -> Self {
        Self {
            name: name.to_owned(),
            source: LineSource::new(source, options.repeated_lines),
            line: LineText::default(),
            block: LineWords::default(),
            state: State::new(options),
            flow: Flow::default(),
            ignored: BTreeMap::new(),
        }
    }

    /// Returns the source line that was read last, from 1.
    pub fn line(&self) -> usize {
        self.source.line()
    }

    /// Returns the ignored M codes of the lines executed so far.
    pub fn ignored_codes(&self) -> &BTreeMap<u32, IgnoredCode> {
        &self.ignored
    }

    /// Returns true for an optional line that the options skip.
    fn is_skipped(&self, line: &LineText) -> bool {
        line.is_optional && self.state.options.skips_optional_lines
    }

    /// Executes the next line.
    fn execute_line(&mut self) -> Outcome<()> {
        let place = self.source.place();
        let is_line = self.source.read(&mut self.line.raw);
        self.state.line = self.source.line();
        if !is_line? {
            self.require_closed()?;
            self.state.end();
            return Ok(());
        }
        self.line.compact()?;
        if self.is_skipped(&self.line) {
            return Ok(());
        }
        if let Some(message) = self.line.message.take() {
            self.state.push_event(crate::motion::ProgramEvent::Message(message));
        }
        if is_o_word(&self.line.text) {
            return self.execute_o_word(place);
        }
        self.block.read(&self.line.text, &self.state, &self.state.options.ignored_m_codes)?;
        for &code in &self.block.ignored {
            let first = IgnoredCode { count: 0, first_line: self.state.line };
            self.ignored.entry(code).or_insert(first).count += 1;
        }
        self.state.execute(&mut self.block)?;
        self.execute_jump()
    }
}

impl<R: BufRead + Seek> Iterator for Interpreter<R> {
    type Item = Result<ProgramStep, ProgramError>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            if let Some(step) = self.state.steps.pop_front() {
                self.source.reset_idle_lines();
                return Some(Ok(step));
            }
            if self.state.has_ended {
                return None;
            }
            if let Err(reason) = self.execute_line() {
                self.state.steps.clear();
                self.state.has_ended = true;
                return Some(Err(ProgramError { name: self.name.clone(), line: self.state.line, reason }));
            }
        }
    }
}
