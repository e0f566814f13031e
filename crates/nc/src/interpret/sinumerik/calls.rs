//! Calls of subprograms in the program and in files beside it, and the return from them.

use std::fs;
use std::io::Cursor;
use std::path::PathBuf;

use super::super::error::Outcome;
use super::super::files::{file_name, is_permitted};
use super::super::limits::{MAX_CALLS, REPEATED_LINES};
use super::super::options::InterpreterOptions;
use super::super::source::LineSource;
use super::super::state::State;
use super::Sinumerik;
use super::call::{ActiveCall, Argument, CallerSource, Invocation, OpenFile};
use super::index::{ProgramLines, SourceIndex};
use super::scanner::BlockScanner;
use super::variables::VariableReference;

/// Largest file of a subprogram, bytes.
const MAX_FILE: u64 = 64 << 20;
/// Most entries of the folder that are searched for a subprogram.
const MAX_ENTRIES: usize = 100_000;

impl Sinumerik {
    /// Returns the index of the present source, which the first use reads.
    pub(super) fn index(&mut self, lines: &mut dyn ProgramLines) -> Outcome<&mut SourceIndex> {
        match &mut self.index {
            Some(index) => Ok(index),
            index => Ok(index.insert(SourceIndex::new(lines)?)),
        }
    }

    pub(super) fn push_call(&mut self, call: ActiveCall) -> Outcome<()> {
        if self.calls.len() >= MAX_CALLS {
            return Err(format!(
                "{}: calls and sections are nested more than {MAX_CALLS} levels deep",
                call.name
            ));
        }
        self.calls.push(call);
        Ok(())
    }

    /// Skips the values of a call in parentheses.
    pub(super) fn call_arguments(
        &self,
        scanner: &mut BlockScanner<'_>,
        state: &State,
    ) -> Outcome<Vec<Option<Argument>>> {
        let mut arguments = Vec::new();
        if !scanner.skip("(") || scanner.skip(")") {
            return Ok(arguments);
        }
        let scope = self.scope(state);
        loop {
            if matches!(scanner.peek(), Some(b',' | b')')) {
                arguments.push(None);
            } else {
                let reference = self.argument_reference(scanner, state)?;
                let mut ahead = scanner.clone();
                // An array has no value of its own.
                let value = match ahead.value(&scope) {
                    Ok(value) => {
                        *scanner = ahead;
                        Some(value)
                    }
                    Err(_) if reference.is_some() => {
                        scanner.name()?;
                        None
                    }
                    Err(reason) => return Err(reason),
                };
                arguments.push(Some(Argument { value, reference }));
            }
            if arguments.len() > 127 {
                return Err("more than 127 values of a call".to_owned());
            }
            if !scanner.skip(",") {
                break;
            }
        }
        scanner.require(")")?;
        Ok(arguments)
    }

    /// Returns the variable, if the value of a call is one alone.
    fn argument_reference(
        &self,
        scanner: &BlockScanner<'_>,
        state: &State,
    ) -> Outcome<Option<VariableReference>> {
        let mut ahead = scanner.clone();
        let name = ahead.peek_name();
        if name.is_empty() {
            return Ok(None);
        }
        ahead.advance(name.len());
        let indices = ahead.indices(&self.scope(state))?;
        match ahead.peek() {
            Some(b',' | b')') => self.variables.reference(name, &indices),
            _ => Ok(None),
        }
    }

    /// Returns true if a subprogram has this name, in the present source or in a file beside the program.
    pub(super) fn has_subprogram(
        &mut self,
        name: &str,
        state: &State,
        lines: &mut dyn ProgramLines,
    ) -> Outcome<bool> {
        if self.index(lines)?.subprogram(name).is_some() {
            return Ok(true);
        }
        if self.missing.contains(name) {
            return Ok(false);
        }
        let is_found = find_file(&state.options, name).is_some();
        if !is_found {
            self.missing.insert(name.to_owned());
        }
        Ok(is_found)
    }

    /// Continues with the first line of a subprogram.
    pub(super) fn call(
        &mut self,
        invocation: Invocation,
        times: u32,
        state: &State,
        lines: &mut dyn ProgramLines,
    ) -> Outcome<()> {
        let Invocation { name, arguments } = invocation;
        let Some(runs_left) = times.checked_sub(1) else { return Ok(()) };
        let inner = self.index(lines)?.subprogram(&name);
        let (entry, caller) = match inner {
            Some(entry) => (entry, None),
            None => {
                let file = open_file(&state.options, &name)?;
                let entry = file.lines.place();
                let index = self.index.take();
                // The source of the caller is put back behind the block.
                self.next_file = Some(file);
                (entry, Some(Box::new(CallerSource { index, file: None })))
            }
        };
        let (is_file, return_to) = (caller.is_some(), lines.place());
        let blocks = std::mem::take(&mut self.blocks);
        self.push_call(ActiveCall {
            name,
            entry,
            end: None,
            return_to,
            runs_left,
            blocks,
            caller,
            arguments: arguments.clone(),
            saved: None,
        })?;
        self.variables.enter();
        self.arguments = arguments;
        if is_file { Ok(()) } else { lines.jump(entry) }
    }

    /// Starts the file of a call that the last block has made, and returns the file of the caller to its call.
    pub(super) fn change_file(&mut self, present: Option<OpenFile>) -> Option<OpenFile> {
        if let Some(next) = self.next_file.take() {
            if let Some(caller) = self.calls.iter_mut().rev().find_map(|call| call.caller.as_mut()) {
                caller.file = present;
            }
            return Some(next);
        }
        match self.returned_file.take() {
            Some(caller) => caller,
            None => present,
        }
    }

    /// Ends the section of a REPEAT that ends at the next line.
    pub(super) fn end_section(&mut self, lines: &mut dyn ProgramLines) -> Outcome<()> {
        while let Some(call) = self.calls.last() {
            if call.end != Some(lines.place()) {
                return Ok(());
            }
            self.finish_call(None, lines)?;
        }
        Ok(())
    }

    /// Runs a subprogram or section again, or returns to its caller.
    pub(super) fn finish_call(
        &mut self,
        state: Option<&mut State>,
        lines: &mut dyn ProgramLines,
    ) -> Outcome<()> {
        let Some(call) = self.calls.last_mut() else { return Ok(()) };
        self.blocks.clear();
        if let Some(left) = call.runs_left.checked_sub(1) {
            call.runs_left = left;
            if call.end.is_none() {
                self.variables.leave();
                self.variables.enter();
                self.arguments = call.arguments.clone();
            }
            let entry = call.entry;
            return lines.jump(entry);
        }
        let Some(call) = self.calls.pop() else { return Ok(()) };
        self.blocks = call.blocks;
        if call.end.is_none() {
            self.variables.leave();
        }
        if let (Some(saved), Some(state)) = (call.saved, state) {
            state.modal.is_incremental = saved.is_incremental;
            state.modal.plane = saved.plane;
            self.modes.frame = saved.frame;
            self.modes.update_frame(state)?;
        }
        match call.caller {
            Some(caller) => {
                self.index = caller.index;
                self.returned_file = Some(caller.file);
                Ok(())
            }
            None => lines.jump(call.return_to),
        }
    }

    /// Returns from the subprogram: M17, RET, or its end. Sections that it has not completed end too.
    pub(super) fn return_from_call(
        &mut self,
        state: &mut State,
        lines: &mut dyn ProgramLines,
    ) -> Outcome<bool> {
        while let Some(call) = self.calls.last_mut() {
            if call.end.is_none() {
                self.finish_call(Some(state), lines)?;
                return Ok(true);
            }
            call.runs_left = 0;
            let blocks = std::mem::take(&mut call.blocks);
            self.calls.pop();
            self.blocks = blocks;
        }
        Ok(false)
    }
}

/// Returns the name of a subprogram in a path or string: DRILL in `/_N_SPF_DIR/_N_DRILL_SPF` and `DRILL.SPF`.
pub(super) fn subprogram_name(path: &str) -> String {
    let name = path.rsplit(['/', '\\', ':']).next().unwrap_or_default().trim().to_ascii_uppercase();
    let name = name.strip_prefix("_N_").unwrap_or(&name);
    let endings = ["_SPF", "_MPF", ".SPF", ".MPF", ".NC"];
    let stem = endings.iter().find_map(|ending| name.strip_suffix(ending)).unwrap_or(name);
    stem.to_owned()
}

/// Returns the path of a subprogram in the folder of the program, by its name without regard to case.
fn find_file(options: &InterpreterOptions, name: &str) -> Option<PathBuf> {
    let entries = fs::read_dir(options.subprogram_folder.as_ref()?).ok()?;
    let mut found: Vec<_> = entries
        .take(MAX_ENTRIES)
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| {
            let file = path.file_name().and_then(|file| file.to_str()).unwrap_or_default();
            let has_ending = file.len() > name.len();
            has_ending && subprogram_name(file) == name && is_permitted(path, options)
        })
        .collect();
    found.sort();
    found.pop()
}

fn open_file(options: &InterpreterOptions, name: &str) -> Outcome<OpenFile> {
    let path = find_file(options, name);
    let path = path.ok_or_else(|| {
        format!("{name}: no such subprogram: put it into this file behind %_N_{name}_SPF, or into the file {name}.SPF beside it")
    })?;
    let failure = |error: std::io::Error| format!("{name}: {error}");
    let size = fs::metadata(&path).map_err(failure)?.len();
    if size > MAX_FILE {
        return Err(format!("{name}: the file has {size} bytes, at most {MAX_FILE} are allowed"));
    }
    let text = fs::read(&path).map_err(failure)?;
    Ok(OpenFile { name: file_name(&path).into(), lines: LineSource::new(Cursor::new(text), REPEATED_LINES) })
}
