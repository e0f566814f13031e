//! Native programs of Sinumerik: their statements, expressions, frames and cycles on the state of the interpreter.
//!
//! A block is read word by word (`statement`, `words`, `scanner`) and its expressions are evaluated on the way
//! (`expression`); then it is executed (`execute`): `motions`, `circles` and `orientation` give the motions, `cycles` and
//! `patterns` the holes, `coordinates`, `modes` and `tilt` the frames. `flow` has jumps and loops, `calls` subprograms, and
//! `index` the places at which both continue.
//! Syntax and meaning follow the programming guides of SINUMERIK 840D sl and 828D.

mod call;
mod calls;
mod circles;
mod coordinates;
mod cycle_values;
mod cycles;
mod deep_hole;
mod execute;
mod expression;
mod flow;
mod frame;
mod functions;
mod index;
mod invocations;
mod keywords;
mod macros;
mod modes;
mod motions;
mod orientation;
mod path_control;
mod patterns;
mod procedure;
mod scanner;
mod sections;
mod soft;
mod soft_path;
mod statement;
mod structures;
mod system;
mod tapping;
mod tilt;
mod value;
mod variables;
mod words;

pub(super) use keywords::is_name_of_cycle;

use std::collections::HashSet;
use std::io::{BufRead, Seek};
use std::sync::Arc;

use self::call::{ActiveCall, Argument, ModalCall, OpenFile};
use self::index::{ProgramLines, SourceIndex, head};
use self::macros::Macros;
use self::modes::Modes;
use self::scanner::{BlockScanner, BlockText};
use self::structures::OpenStructure;
use self::variables::Variables;
use super::error::Outcome;
use super::report::FileLine;
use super::source::{LineSource, Place};
use super::state::State;
use crate::motion::Plane;

/// Front end of Sinumerik programs.
#[derive(Debug)]
pub(super) struct Sinumerik {
    block: BlockText,
    /// True if the block calls the tool change of a machine builder.
    changes_tool: bool,
    variables: Variables,
    macros: Macros,
    modes: Modes,
    /// Units and labels of the present source, once a jump or call has required them.
    index: Option<SourceIndex>,
    calls: Vec<ActiveCall>,
    /// Open structures of the present program.
    blocks: Vec<OpenStructure>,
    /// Number of starts by GOTOS.
    restarts: u32,
    /// Values of the last call, for its PROC.
    arguments: Vec<Option<Argument>>,
    /// Start of the present line.
    place: Place,
    /// File of the subprogram that runs; `None` in the program itself.
    file: Option<OpenFile>,
    /// Name of the file of the present block; `None` in the program itself.
    file_name: Option<Arc<str>>,
    /// File that the last block has called.
    next_file: Option<OpenFile>,
    /// File to which the last block has returned; the inner `None` is the program itself.
    returned_file: Option<Option<OpenFile>>,
    /// Names without subprogram.
    missing: HashSet<String>,
    /// Cycle or subprogram that each motion calls (MCALL).
    modal_call: Option<ModalCall>,
    /// ProgramUnit tangent at the end of the last motion in a plane.
    tangent: Option<(Plane, [f64; 2])>,
    /// Approach that the next motion completes.
    approach: Option<soft_path::SoftPath>,
    /// True if the block has polar coordinates.
    is_polar: bool,
    /// True behind the first statement of the program or subprogram.
    has_statement: bool,
}

impl Default for Sinumerik {
    fn default() -> Self {
        Self {
            block: BlockText::default(),
            changes_tool: false,
            variables: Variables::new(),
            macros: Macros::default(),
            modes: Modes::default(),
            index: None,
            calls: Vec::new(),
            blocks: Vec::new(),
            restarts: 0,
            arguments: Vec::new(),
            place: Place::START,
            file: None,
            file_name: None,
            next_file: None,
            returned_file: None,
            missing: HashSet::new(),
            modal_call: None,
            tangent: None,
            approach: None,
            is_polar: false,
            has_statement: false,
        }
    }
}

impl Sinumerik {
    /// Executes the next line of `source`; its motions and events are appended to the steps of `state`. The end of the
    /// source ends the program.
    pub(super) fn execute_line<R: BufRead + Seek>(
        &mut self,
        source: &mut LineSource<R>,
        state: &mut State,
    ) -> Outcome<()> {
        let mut file = self.file.take();
        self.file_name = file.as_ref().map(|file| Arc::clone(&file.name));
        let result = match &mut file {
            Some(file) => {
                let result = self.execute_next(&mut file.lines, state);
                if !state.steps.is_empty() {
                    file.lines.reset_idle_lines();
                }
                result
            }
            None => self.execute_next(source, state),
        };
        if result.is_err() {
            self.arguments.clear();
            // An interpreter that continues after errors does not repeat that of a file.
            state.has_ended |= file.as_ref().is_some_and(|file| file.lines.has_failed());
        }
        self.file = self.change_file(file);
        result
    }

    fn execute_next(&mut self, lines: &mut dyn ProgramLines, state: &mut State) -> Outcome<()> {
        self.end_section(lines)?;
        self.place = lines.place();
        let mut block = std::mem::take(&mut self.block);
        let is_line = lines.read(&mut block.raw);
        state.file = self.file_name.clone().map(|name| FileLine { name, line: lines.line() });
        if state.file.is_none() {
            state.line = lines.line();
        }
        let result = match is_line {
            Ok(true) => self.execute_text(&mut block, state, lines),
            Ok(false) => self.end_unit(state, lines),
            Err(reason) => Err(reason),
        };
        self.block = block;
        state.calls = self.calls.len();
        result
    }

    fn execute_text(
        &mut self,
        block: &mut BlockText,
        state: &mut State,
        lines: &mut dyn ProgramLines,
    ) -> Outcome<()> {
        if head(&block.raw).is_some() {
            // The head of the program itself stands at its start; another one ends it.
            let is_entry = self.calls.last().is_some_and(|call| call.is_entry(self.place));
            if is_entry || !self.has_statement {
                self.move_entry(lines.place());
                return Ok(());
            }
            return self.end_unit(state, lines);
        }
        block.read()?;
        if block.text.is_empty() || (block.skip_level.is_some() && state.options.skips_optional_lines) {
            self.move_entry(lines.place());
            return Ok(());
        }
        self.macros.expand(&mut block.text)?;
        let text = std::mem::take(&mut block.text);
        let result = self.execute_block(&mut BlockScanner::new(&text), state, lines);
        block.text = text;
        self.has_statement = true;
        result
    }

    /// Moves the start of the subprogram behind its present line, if that is the first one: PROC may follow comments.
    fn move_entry(&mut self, next: Place) {
        if let Some(call) = self.calls.last_mut()
            && call.is_entry(self.place)
            && !call.is_section()
        {
            call.entry = next;
        }
    }

    /// Returns from a subprogram at its end, or ends the program.
    fn end_unit(&mut self, state: &mut State, lines: &mut dyn ProgramLines) -> Outcome<()> {
        if !std::mem::take(&mut self.blocks).is_empty() {
            return Err(
                "the program ends within a structure: ENDIF, ENDLOOP, ENDFOR, ENDWHILE or UNTIL is missing"
                    .to_owned(),
            );
        }
        if self.return_from_call(state, lines)? { Ok(()) } else { state.end() }
    }
}
