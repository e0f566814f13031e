//! Interpreter of part programs: RS-274/NGC text to motions of the axes.
//!
//! Syntax and meaning of the words are those of the dialect, by default LinuxCNC; docs/reference/part-programs.md has the
//! list. A program is read line by line, loops and subprograms by jumps in the source: memory does not depend on the length
//! of the program. Depth of calls and expressions, length of lines and number of repeated lines are bounded.

mod arcs;
mod calls;
mod codes;
mod contour;
mod contour_steps;
mod control_variables;
mod cycles;
mod dialect;
mod encoding;
mod error;
mod execute;
mod expression;
mod files;
mod flow;
mod foreign;
mod frame;
mod frames;
mod ignored;
mod limits;
mod line_code;
mod line_modes;
mod line_words;
mod macro_b;
mod moves;
mod o_words;
mod offsets;
mod okuma;
mod options;
mod parameters;
mod pocket;
mod report;
mod sinumerik;
mod source;
mod spline;
mod state;
mod surface;
mod text;
mod tool_offsets;
mod tools;
mod turning;
mod work_offset;

use std::collections::BTreeSet;
use std::io::{BufRead, Seek};
use std::path::Path;

use virtual_axes_core::text::escaped;

pub use dialect::{DetectedDialect, Dialect, is_g_code};
pub(crate) use encoding::read_line;
pub use error::ProgramError;
pub use ignored::{CodePattern, IgnoredCodes};
pub use limits::{ADDITIONAL_OFFSET_COUNT, WORK_OFFSET_COUNT};
pub(crate) use line_code::{code_of, has_word};
pub use line_modes::LineModes;
pub use options::{InterpreterOptions, TipTransform};
pub use report::{FileLine, InterpretationReport, OccurrenceTable, Occurrences};
pub use tools::{Tool, ToolTable};
pub use work_offset::WorkOffset;
pub use work_offset::system_name;

use self::control_variables::ALARM;
use self::error::Outcome;
use self::foreign::{ForeignWord, TEMPLATE};
use self::line_words::{LineWords, Setting};
use self::o_words::{Flow, is_o_word};
use self::parameters::LOCALS;
use self::sinumerik::Sinumerik;
use self::source::{LineSource, SourceHead};
use self::state::State;
use self::text::LineText;
use self::turning::TurningWord;
use crate::motion::{Coordinates, ProgramStep};

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
    dialect: DetectedDialect,
    /// Front end of native Sinumerik programs.
    sinumerik: Sinumerik,
    /// Line and reason of a format of another control, or of a turning program, which are not supported.
    foreign: Option<(usize, String)>,
}

impl<R: BufRead + Seek> Interpreter<R> {
    /// Creates the interpreter of the program in `source`, from its start; `name` is the file in messages. Those on the file of
    /// a subprogram have its own name.
    pub fn new(mut source: R, name: &str, mut options: InterpreterOptions) -> Self {
        let foreign = SourceHead::of(&mut source).foreign.map(|format| (1, foreign_reason(format)));
        let dialect = match options.dialect {
            Some(dialect) => DetectedDialect { dialect, evidence: None },
            None => DetectedDialect::of(&mut source, name),
        };
        let foreign = foreign.or_else(|| {
            let word = ForeignWord::of(&mut source)?;
            Some((word.line, foreign_reason(word.format)))
        });
        let turning = || TurningWord::of(&mut source, dialect.dialect).map(turning_reason);
        let foreign = foreign.or_else(turning);
        let has_given_dialect = options.dialect.replace(dialect.dialect).is_some();
        let mut state = State::new(options);
        state.has_given_dialect = has_given_dialect;
        Self {
            dialect,
            sinumerik: Sinumerik::default(),
            name: name.to_owned(),
            source: LineSource::new(source, state.options.repeated_lines),
            line: LineText::default(),
            block: LineWords::default(),
            state,
            flow: Flow::default(),
            foreign,
        }
    }

    /// Returns the source line that was read last, from 1.
    pub fn line(&self) -> usize {
        self.source.line()
    }

    /// Returns the line in the file of a subprogram that was read last; `None` in the program.
    pub fn line_of_file(&self) -> Option<&FileLine> {
        self.state.file.as_ref()
    }

    /// Returns the dialect of the program, and what it was detected from.
    pub fn dialect(&self) -> &DetectedDialect {
        &self.dialect
    }

    /// Returns words without effect, assumptions and errors of the lines executed so far.
    pub fn report(&self) -> &InterpretationReport {
        &self.state.report
    }

    /// Returns the letters of the axes that the lines executed so far move and the machine lacks.
    pub fn missing_axes(&self) -> BTreeSet<char> {
        self.state.missing_axes.borrow().clone()
    }

    /// Returns true if the motions of the last line are in machine coordinates: G28, G30, G53.
    pub fn moves_in_machine_coordinates(&self) -> bool {
        self.state.moves_in_machine_coordinates
    }

    /// Returns the index of the active work coordinate system and its axis positions at coordinate 0, m and rad.
    pub fn work_offset(&self) -> (usize, Coordinates) {
        let active = self.state.offsets.active;
        (active, self.state.options.work_offsets[active])
    }

    /// Returns the modes after the last line, and the programmed coordinates that it has reached.
    pub fn line_modes(&self) -> LineModes {
        self.state.line_modes()
    }

    /// Returns true for an optional line that the options skip.
    fn is_skipped(&self, line: &LineText) -> bool {
        line.is_optional && self.state.options.skips_optional_lines
    }

    /// Notes the line that was read last.
    fn note_line(&mut self) {
        self.state.line = self.source.line();
        self.state.file = self.source.line_of_file();
    }

    /// Executes the next line.
    fn execute_line(&mut self) -> Outcome<()> {
        if self.state.dialect == Dialect::Sinumerik {
            return self.sinumerik.execute_line(&mut self.source, &mut self.state);
        }
        let place = self.source.place();
        let is_line = self.source.read(&mut self.line.raw);
        self.note_line();
        if !is_line? {
            self.state.has_ended = true;
            self.require_closed()?;
            return self.state.end();
        }
        self.line.compact(self.state.dialect)?;
        if self.is_skipped(&self.line) {
            return Ok(());
        }
        if let Some(message) = self.line.message.take() {
            self.state.push_event(crate::motion::ProgramEvent::Message(message));
        }
        if self.state.dialect.has_macro_b() {
            if self.execute_statement(place)? {
                return Ok(());
            }
        } else if self.state.dialect.is_firmware() && self.execute_command()? {
            return Ok(());
        }
        if is_o_word(&self.line.text) && !self.state.dialect.has_macro_b() {
            return self.execute_o_word(place);
        }
        if matches!(self.state.dialect, Dialect::Mach3 | Dialect::Haas) && self.execute_call_of_file()? {
            return Ok(());
        }
        self.execute_words(0)
    }

    /// Executes the call of a file, `M98 (drill.tap) L2` of Mach3 and Haas; returns false for other lines.
    fn execute_call_of_file(&mut self) -> Outcome<bool> {
        let text = self.line.text.as_slice();
        let Some(rest) = text.strip_prefix(b"m98").filter(|rest| !rest.contains(&b'p')) else {
            return Ok(false);
        };
        let raw = String::from_utf8_lossy(&self.line.raw).into_owned();
        let name = raw.split_once('(').and_then(|(_, rest)| Some(rest.split_once(')')?.0.trim()));
        let Some(name) = name.filter(|name| !name.is_empty()) else { return Ok(false) };
        self.block.read(rest, &self.state)?;
        let times = self.state.repetitions_of_call(&mut self.block)?;
        self.block.require_used()?;
        let stem = Path::new(name).file_stem().and_then(|stem| stem.to_str()).unwrap_or(name);
        if times > 0 {
            self.call(&stem.to_lowercase(), None, times)?;
        }
        Ok(true)
    }

    /// Executes a command of grbl (`$H`, `?`), or a message of firmware for printers and routers (`M117 Drill 2`, `M0 Put
    /// tool 1`); returns false for a line of words.
    fn execute_command(&mut self) -> Outcome<bool> {
        let text = self.line.text.as_slice();
        if let Some(words) = text.strip_prefix(b"$j=").filter(|_| self.state.dialect == Dialect::Grbl) {
            return self.jog([b"g1", words].concat()).map(|()| true);
        }
        if matches!(text, [b'$', ..] | [b'?' | b'!' | b'~']) {
            let command = String::from_utf8_lossy(text).to_uppercase();
            self.state.note_without_effect(command);
            return Ok(true);
        }
        // The blank after the code, which the compact text lacks, separates it from digits of the message.
        let raw = String::from_utf8_lossy(&self.line.raw);
        let (code, message) = raw.trim().split_once(char::is_whitespace).unwrap_or((raw.trim(), ""));
        let message = message.trim();
        let is_text = message.bytes().take(2).filter(u8::is_ascii_alphabetic).count() == 2;
        match code.to_ascii_uppercase().as_str() {
            "M117" | "M118" => {}
            "M0" | "M00" if is_text => self.state.push_event(crate::motion::ProgramEvent::Stop),
            _ => return Ok(false),
        }
        self.state.push_event(crate::motion::ProgramEvent::Message(escaped(message)));
        Ok(true)
    }

    /// Executes the words of a jog of grbl, a line at feed that changes no mode.
    fn jog(&mut self, words: Vec<u8>) -> Outcome<()> {
        let modal = self.state.modal.clone();
        // A jog has a feed of its own.
        self.state.modal.feed = None;
        self.line.text = words;
        let result = self.execute_words(0);
        self.state.modal = modal;
        result
    }

    /// Executes the words of the present line from a byte on.
    fn execute_words(&mut self, from: usize) -> Outcome<()> {
        let words = self.block.read(self.line.text.get(from..).unwrap_or_default(), &self.state);
        words.map_err(|reason| self.sinumerik_cycle().unwrap_or(reason))?;
        if let Some(reason) = self.block.rejected.take() {
            self.state.reject(reason)?;
        }
        for code in self.block.ignored.drain(..) {
            self.state.note_without_effect(code);
            self.block.is_ignored_line = true;
        }
        let is_alarm = self.state.dialect.has_macro_b()
            && self.block.settings.iter().any(|(target, _)| *target == Setting::Number(ALARM));
        let result = self.state.execute(&mut self.block);
        result.map_err(|reason| if is_alarm { reason + &self.alarm_cause() } else { reason })?;
        self.execute_jump()
    }

    /// Returns the error of a line with a cycle of Sinumerik.
    fn sinumerik_cycle(&self) -> Option<String> {
        let raw = String::from_utf8_lossy(&self.line.raw).trim().to_ascii_uppercase();
        let number =
            raw.strip_prefix('N').map(|rest| rest.trim_start_matches(|digit: char| digit.is_ascii_digit()));
        let text = number.unwrap_or(&raw).trim_start();
        let text = text.strip_prefix("MCALL").unwrap_or(text).trim_start();
        let end = text.find(|letter: char| !letter.is_ascii_alphanumeric()).unwrap_or(text.len());
        let name = &text[..end];
        sinumerik::is_name_of_cycle(name)
            .then(|| format!("{name} is a cycle of Sinumerik: --dialect sinumerik"))
    }

    /// Returns the comment of the alarm in the line, and the argument that a macro lacks.
    fn alarm_cause(&self) -> String {
        let raw = String::from_utf8_lossy(&self.line.raw);
        let comment = raw.split_once('(').map(|(_, rest)| rest.split(')').next().unwrap_or_default());
        let mut cause = comment.map_or(String::new(), |comment| format!(" ({comment})"));
        let vacant = self.state.vacant.get();
        if (1..=LOCALS).contains(&vacant) && self.state.calls == 0 {
            cause += &format!("; {}", self.state.value_source(vacant));
        }
        cause
    }
}

fn foreign_reason(format: &str) -> String {
    if format == TEMPLATE {
        return format!("{format} is not supported: expand it first");
    }
    let dialects = Dialect::ALL.map(Dialect::name).join(", ");
    format!("{format} is not supported: post the program again as G code, in one of the dialects {dialects}")
}

/// Returns line and reason of the rejection of a turning program.
fn turning_reason(TurningWord { text, line }: TurningWord) -> (usize, String) {
    (line, format!("a turning program, by {text}: only programs for milling are supported"))
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
            if let Some((line, reason)) = self.foreign.take() {
                self.state.has_ended = true;
                return Some(Err(ProgramError { name: self.name.clone(), line, reason }));
            }
            if let Err(reason) = self.execute_line() {
                let reason = escaped(&reason);
                if self.state.options.reports_all_errors && !self.source.has_failed() {
                    // An interpreter that continues returns no error of a line.
                    let _ = self.state.reject(reason);
                    continue;
                }
                self.state.steps.clear();
                self.state.has_ended = true;
                let (name, line) = match &self.state.file {
                    Some(FileLine { name, line }) => (name.to_string(), *line),
                    None => (self.name.clone(), self.state.line),
                };
                return Some(Err(ProgramError { name, line, reason }));
            }
        }
    }
}
