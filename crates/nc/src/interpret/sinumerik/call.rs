//! Calls as data: subprograms and sections that run, and values that are passed to them.

use std::io::Cursor;
use std::sync::Arc;

use super::super::source::{LineSource, Place};
use super::cycles::DrillingCycle;
use super::frame::AxisFrame;
use super::index::SourceIndex;
use super::structures::OpenStructure;
use super::value::ProgramValue;
use super::variables::VariableReference;
use crate::motion::Plane;

/// Subprogram or section that runs.
#[derive(Debug)]
pub(super) struct ActiveCall {
    pub name: String,
    pub entry: Place,
    /// End of a section that REPEAT runs; `None` for a subprogram.
    pub end: Option<Place>,
    pub return_to: Place,
    pub runs_left: u32,
    /// Open structures of the caller.
    pub blocks: Vec<OpenStructure>,
    /// Caller's source, if the subprogram is in another file.
    pub caller: Option<Box<CallerSource>>,
    /// Values of the call, for each run.
    pub arguments: Vec<Option<Argument>>,
    /// Modes that SAVE restores.
    pub saved: Option<SavedModes>,
}

/// Source of a caller, whose place and index wait for the return.
#[derive(Debug)]
pub(super) struct CallerSource {
    pub index: Option<SourceIndex>,
    pub file: Option<OpenFile>,
}

/// Modes that a subprogram with SAVE leaves unchanged.
#[derive(Debug)]
pub(super) struct SavedModes {
    pub frame: AxisFrame,
    pub is_incremental: bool,
    pub plane: Plane,
}

/// File of a subprogram.
#[derive(Debug)]
pub(super) struct OpenFile {
    /// Name without folder.
    pub name: Arc<str>,
    pub lines: LineSource<Cursor<Vec<u8>>>,
}

/// Value of a call.
#[derive(Debug, Clone)]
pub(super) struct Argument {
    pub value: Option<ProgramValue>,
    /// Variable that a VAR parameter refers to.
    pub reference: Option<VariableReference>,
}

/// Call of a subprogram or cycle, with its values.
#[derive(Debug, Clone)]
pub(super) struct Invocation {
    pub name: String,
    pub arguments: Vec<Option<Argument>>,
}

impl Invocation {
    /// Returns the values of a cycle.
    pub(super) fn values(&self) -> Vec<Option<ProgramValue>> {
        self.arguments.iter().map(|argument| argument.as_ref().and_then(|a| a.value.clone())).collect()
    }
}

impl ActiveCall {
    /// Creates the run of a section between two lines.
    pub(super) fn section(
        label: &str,
        entry: Place,
        end: Place,
        return_to: Place,
        runs_left: u32,
        blocks: Vec<OpenStructure>,
    ) -> Self {
        let (name, end) = (label.to_owned(), Some(end));
        Self {
            name,
            entry,
            end,
            return_to,
            runs_left,
            blocks,
            caller: None,
            arguments: Vec::new(),
            saved: None,
        }
    }
}

impl ActiveCall {
    /// Returns true for a section that REPEAT runs.
    pub(super) fn is_section(&self) -> bool {
        self.end.is_some()
    }

    /// Returns true if a line is the first one of the subprogram.
    pub(super) fn is_entry(&self, line: Place) -> bool {
        self.entry == line
    }
}

/// Call that is repeated at each position (MCALL).
#[derive(Debug, Clone)]
pub(super) enum ModalCall {
    /// Drilling cycle.
    Drilling(DrillingCycle),
    /// Subprogram.
    Subprogram(Invocation),
}
