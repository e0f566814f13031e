//! Program flow: subprograms, loops and conditions.

use std::collections::HashMap;
use std::io::{BufRead, Seek};

use super::Interpreter;
use super::dialect::Dialect;
use super::error::Outcome;
use super::expression::Scanner;
use super::files::subprogram_file;
use super::limits::{MAX_BLOCKS, MAX_CALLS, MAX_SUBPROGRAMS};
use super::o_words::{BlockKind, Call, Flow, Keyword, OpenBlock, Statement, is_o_word};
use super::okuma::line_name;
use super::parameters::{LOCALS, integer};
use super::source::Place;
use super::state::Jump;
use super::text::LineText;

impl<R: BufRead + Seek> Interpreter<R> {
    /// Executes the O-word of the line at `place`. Behind a loop or condition whose first line has an error, its other lines
    /// are no further errors.
    pub(super) fn execute_o_word(&mut self, place: Place) -> Outcome<()> {
        let continues = self.state.options.reports_all_errors;
        let known = continues.then(|| Scanner::new(&self.line.text, &self.state).statement().ok()).flatten();
        if let Some(Statement { label, keyword }) = &known
            && keyword.requires_block()
            && self.flow.failed_labels.contains(label)
            && self.blocks().iter().all(|block| block.label != *label)
        {
            return Ok(());
        }
        let result = self.execute_known(place);
        if let Some(Statement { label, keyword }) = known.filter(|known| known.keyword.begins_block()) {
            match &result {
                Ok(()) => drop(self.flow.failed_labels.remove(&label)),
                Err(_) => {
                    if self.blocks().last().is_some_and(|block| block.label == label)
                        && keyword == Keyword::While
                    {
                        self.close();
                    }
                    self.flow.failed_labels.insert(label);
                }
            }
        }
        result
    }

    fn execute_known(&mut self, place: Place) -> Outcome<()> {
        let (Statement { label, keyword }, arguments, count) = self.statement()?;
        let is_true = arguments[0] != 0.0;
        match keyword {
            Keyword::Program => Ok(()),
            Keyword::Sub if self.flow.calls.is_empty() => {
                self.skip_to(&label, keyword, &[Keyword::EndSub]).map(drop)
            }
            Keyword::Sub => Err(format!("O{label} sub within a subprogram")),
            Keyword::Call => self.call(&label, Some(arguments), 1),
            Keyword::EndSub | Keyword::Return => {
                self.state.returned = (count == 1).then_some(arguments[0]);
                self.end_call(&label, keyword)
            }
            Keyword::If => self.begin_if(label, is_true),
            Keyword::ElseIf | Keyword::Else => {
                self.require_block(&label, keyword, |kind| matches!(kind, BlockKind::If))?;
                self.skip_to(&label, keyword, &[Keyword::EndIf])?;
                self.close();
                Ok(())
            }
            Keyword::EndIf => {
                self.require_block(&label, keyword, |kind| matches!(kind, BlockKind::If))?;
                self.close();
                Ok(())
            }
            Keyword::Do => self.open(label, BlockKind::Do(self.source.place())),
            Keyword::While => self.while_line(label, place, is_true),
            Keyword::EndWhile => self.end_while(&label),
            Keyword::Repeat => self.begin_repeat(label, arguments[0]),
            Keyword::EndRepeat => self.end_repeat(&label),
            Keyword::Break | Keyword::Continue => self.leave(&label, keyword),
        }
    }

    /// Returns the O-word of the present line with the values of its expressions and their number.
    fn statement(&self) -> Outcome<(Statement, [f64; LOCALS], usize)> {
        let mut scanner = Scanner::new(&self.line.text, &self.state);
        let Statement { label, keyword } = scanner.statement()?;
        let (arguments, count) =
            scanner.arguments().map_err(|reason| format!("O{label} {}: {reason}", keyword.name()))?;
        let expected = match keyword {
            Keyword::While | Keyword::If | Keyword::ElseIf | Keyword::Repeat => 1..=1,
            Keyword::Call => 0..=LOCALS,
            Keyword::Return | Keyword::EndSub => 0..=1,
            _ => 0..=0,
        };
        if !expected.contains(&count) {
            return Err(format!(
                "O{label} {}: {count} expressions in brackets, expected {}",
                keyword.name(),
                expected.end()
            ));
        }
        Ok((Statement { label, keyword }, arguments, count))
    }

    /// Executes the jump that a line has requested.
    pub(super) fn execute_jump(&mut self) -> Outcome<()> {
        match self.state.jump.take() {
            None
            | Some(
                Jump::Call { times: 0, .. } | Jump::Local { times: 0, .. } | Jump::Macro { times: 0, .. },
            ) => Ok(()),
            Some(Jump::Call { program, times }) => {
                let (program, times) = self.repeated_program(program, times)?;
                self.call(&program.to_string(), None, times)
            }
            Some(Jump::Macro { program, arguments, .. })
                if is_probing(program) && self.subprogram(&program.to_string()).is_err() =>
            {
                self.state.probing_macro(program, &arguments)
            }
            Some(Jump::Macro { program, times, arguments }) => {
                self.call(&program.to_string(), Some(*arguments), times)
            }
            Some(Jump::Local { number, times }) => {
                let entry = self.numbered_line(number)?;
                let return_to = self.source.place();
                self.enter(Call {
                    label: format!("N{number}"),
                    entry,
                    section: self.section(),
                    return_to,
                    scope: None,
                    is_by_number: true,
                    runs_left: times - 1,
                    blocks: Vec::new(),
                })
            }
            Some(Jump::Named { program }) => self.call(&program, None, 1),
            Some(Jump::Goto { number }) => {
                let place = self.numbered_line(number)?;
                self.source.jump(place)
            }
            Some(Jump::Return { number }) => match self.flow.calls.last() {
                Some(call) if call.is_by_number => {
                    self.finish_call()?;
                    match number {
                        Some(number) => {
                            let place = self.numbered_line(number)?;
                            self.source.jump(place)
                        }
                        None => Ok(()),
                    }
                }
                Some(_) => Err("M99 within a subprogram of an O-word call: program endsub".to_owned()),
                None => {
                    if let Some(number) = number {
                        let place = self.numbered_line(number)?;
                        return self.source.jump(place);
                    }
                    let word = if self.state.dialect == Dialect::Okuma { "RTS" } else { "M99" };
                    self.state.assume(format!(
                        "{word} in the main program repeats it without end: the simulation ends there"
                    ));
                    self.state.end()
                }
            },
        }
    }

    /// Returns program and repetitions of M98 P: of Fanuc, digits before the last four are repetitions, if there is no
    /// program with the whole number.
    fn repeated_program(&mut self, program: u32, times: u32) -> Outcome<(u32, u32)> {
        const PROGRAMS: u32 = 10_000;
        let is_whole = self.state.dialect != Dialect::Fanuc
            || program < PROGRAMS
            || self.subprogram(&program.to_string()).is_ok();
        Ok(if is_whole { (program, times) } else { (program % PROGRAMS, program / PROGRAMS) })
    }

    /// Returns the first line of the program or subprogram that runs.
    fn section(&self) -> Place {
        self.flow.calls.last().map_or(Place::START, |call| call.section)
    }

    /// Returns the place of a line by its number N, in the program or subprogram that runs.
    fn numbered_line(&mut self, number: u32) -> Outcome<Place> {
        let section = self.section();
        if let Some(place) = self.flow.numbered.get(&(section, number)) {
            return Ok(*place);
        }
        let here = self.source.place();
        let mut line = LineText::default();
        self.source.jump(section)?;
        let mut is_first = true;
        let found = loop {
            let place = self.source.place();
            if !self.source.read_raw(&mut line.raw)? {
                break None;
            }
            if line.compact(self.state.dialect).is_err() {
                continue;
            }
            if line.number == Some(number) {
                break Some(place);
            }
            // The next program begins.
            if !is_first && is_o_word(&line.text) {
                break None;
            }
            is_first &= line.text.is_empty() || is_o_word(&line.text);
        };
        self.source.jump(here)?;
        let place =
            found.ok_or_else(|| format!("N{}: no such line in the program that runs", line_name(number)))?;
        if self.flow.numbered.len() < MAX_SUBPROGRAMS {
            self.flow.numbered.insert((section, number), place);
        }
        Ok(place)
    }

    /// Returns an error if loops, conditions or calls are open at the end of the file.
    pub(super) fn require_closed(&self) -> Outcome<()> {
        if let Some(call) = self.flow.calls.last() {
            let end = match (call.is_by_number, self.state.dialect) {
                (true, Dialect::Okuma) => "RTS",
                (true, _) => "M99",
                _ => "endsub",
            };
            return Err(format!("subprogram O{} without {end}", call.label));
        }
        match self.flow.blocks.last() {
            Some(block) => Err(format!("O{}: loop or condition without end", block.label)),
            None if self.state.spline.is_some() => Err("G5.2 without G5.3".to_owned()),
            None => Ok(()),
        }
    }

    fn blocks(&mut self) -> &mut Vec<OpenBlock> {
        match self.flow.calls.last_mut() {
            Some(call) => &mut call.blocks,
            None => &mut self.flow.blocks,
        }
    }

    fn open(&mut self, label: String, kind: BlockKind) -> Outcome<()> {
        let blocks = self.blocks();
        if blocks.len() >= MAX_BLOCKS {
            return Err(format!("O{label}: loops and conditions nested more than {MAX_BLOCKS} levels deep"));
        }
        blocks.push(OpenBlock { label, kind });
        Ok(())
    }

    fn close(&mut self) {
        self.blocks().pop();
    }

    /// Returns the kind of the innermost block, which must have the label and satisfy `is_expected`.
    fn require_block(
        &mut self,
        label: &str,
        keyword: Keyword,
        is_expected: fn(BlockKind) -> bool,
    ) -> Outcome<BlockKind> {
        match self.blocks().last() {
            Some(block) if block.label == label && is_expected(block.kind) => Ok(block.kind),
            Some(block) => {
                Err(format!("O{label} {} within O{}, which has to end first", keyword.name(), block.label))
            }
            None => Err(format!("O{label} {} without beginning", keyword.name())),
        }
    }

    fn begin_if(&mut self, label: String, is_true: bool) -> Outcome<()> {
        let mut is_true = is_true;
        while !is_true {
            let found =
                self.skip_to(&label, Keyword::If, &[Keyword::ElseIf, Keyword::Else, Keyword::EndIf])?;
            let (_, arguments, _) = self.statement()?;
            match found {
                Keyword::EndIf => return Ok(()),
                Keyword::Else => break,
                _ => is_true = arguments[0] != 0.0,
            }
        }
        self.open(label, BlockKind::If)
    }

    /// Executes `while`: the start of a loop, or the end of one that began with `do`.
    fn while_line(&mut self, label: String, place: Place, is_true: bool) -> Outcome<()> {
        let innermost = self.blocks().last().filter(|block| block.label == label).map(|block| block.kind);
        match innermost {
            Some(BlockKind::Do(start)) if is_true => self.source.jump(start),
            Some(BlockKind::Do(_)) => {
                self.close();
                Ok(())
            }
            // The loop returns to its first line.
            Some(BlockKind::While(start)) if start == place && is_true => Ok(()),
            Some(BlockKind::While(start)) if start == place => {
                self.close();
                self.skip_to(&label, Keyword::While, &[Keyword::EndWhile]).map(drop)
            }
            _ if is_true => self.open(label, BlockKind::While(place)),
            _ => self.skip_to(&label, Keyword::While, &[Keyword::EndWhile]).map(drop),
        }
    }

    fn end_while(&mut self, label: &str) -> Outcome<()> {
        match self.require_block(label, Keyword::EndWhile, |kind| matches!(kind, BlockKind::While(_)))? {
            BlockKind::While(start) => self.source.jump(start),
            _ => Ok(()),
        }
    }

    fn begin_repeat(&mut self, label: String, count: f64) -> Outcome<()> {
        let count = integer(count.round().max(0.0))
            .ok_or_else(|| format!("O{label} repeat: {count} runs are too many"))?;
        match count.checked_sub(1) {
            Some(left) => self.open(label, BlockKind::Repeat(self.source.place(), left)),
            None => self.skip_to(&label, Keyword::Repeat, &[Keyword::EndRepeat]).map(drop),
        }
    }

    fn end_repeat(&mut self, label: &str) -> Outcome<()> {
        self.require_block(label, Keyword::EndRepeat, |kind| matches!(kind, BlockKind::Repeat(..)))?;
        let Some(OpenBlock { kind: BlockKind::Repeat(start, left), .. }) = self.blocks().last_mut() else {
            return Ok(());
        };
        let start = *start;
        match left.checked_sub(1) {
            Some(next) => {
                *left = next;
                self.source.jump(start)
            }
            None => {
                self.close();
                Ok(())
            }
        }
    }

    /// Executes `break` or `continue` of the loop with the label.
    fn leave(&mut self, label: &str, keyword: Keyword) -> Outcome<()> {
        let position = self.blocks().iter().rposition(|block| block.label == label);
        let position = position.ok_or_else(|| format!("O{label} {} outside of this loop", keyword.name()))?;
        self.blocks().truncate(position + 1);
        let kind = self.blocks()[position].kind;
        let end = match kind {
            BlockKind::If => return Err(format!("O{label} {}: not a loop", keyword.name())),
            BlockKind::While(start) if keyword == Keyword::Continue => return self.source.jump(start),
            BlockKind::While(_) => Keyword::EndWhile,
            BlockKind::Repeat(..) => Keyword::EndRepeat,
            BlockKind::Do(_) => Keyword::While,
        };
        self.skip_to(label, keyword, &[end])?;
        if keyword == Keyword::Break {
            self.close();
            return Ok(());
        }
        match kind {
            BlockKind::Repeat(..) => self.end_repeat(label),
            _ => {
                let (_, arguments, _) = self.statement()?;
                self.while_line(label.to_owned(), self.source.place(), arguments[0] != 0.0)
            }
        }
    }

    /// Reads lines up to an O-word with the label and one of the keywords, and returns its keyword.
    ///
    /// # Errors
    ///
    /// The end of the program, or of the subprogram, at the line where the search began.
    fn skip_to(&mut self, label: &str, from: Keyword, ends: &[Keyword]) -> Outcome<Keyword> {
        let missing = || {
            let names: Vec<_> = ends.iter().map(|end| end.name()).collect();
            format!("O{label} {} without {}", from.name(), names.join(" or "))
        };
        loop {
            let line = self.state.line;
            let read = self.source.read(&mut self.line.raw);
            if read.is_err() {
                self.note_line();
            }
            if !read? {
                return Err(missing());
            }
            // Other lines are not executed, and may be incomplete.
            let is_executed = self.line.compact(self.state.dialect).is_ok() && !self.is_skipped(&self.line);
            if !is_executed || !is_o_word(&self.line.text) {
                continue;
            }
            let Ok(statement) = Scanner::new(&self.line.text, &self.state).statement() else { continue };
            if statement.label == label && ends.contains(&statement.keyword) {
                self.note_line();
                return Ok(statement.keyword);
            }
            if matches!(statement.keyword, Keyword::Sub | Keyword::EndSub) {
                self.state.line = line;
                return Err(missing());
            }
        }
    }

    /// Calls a subprogram with its own local parameters, or by M98 with those of the caller.
    pub(super) fn call(&mut self, label: &str, arguments: Option<[f64; LOCALS]>, times: u32) -> Outcome<()> {
        let entry = self.subprogram(label)?;
        let is_by_number = arguments.is_none() || self.state.dialect.has_macro_b();
        if self.flow.calls.len() >= MAX_CALLS {
            return Err(too_deep(label));
        }
        let return_to = self.source.place();
        let scope = arguments.map(|arguments| self.state.parameters.enter(&arguments));
        let (label, section, blocks) = (label.to_owned(), entry, Vec::new());
        let runs_left = times - 1;
        self.enter(Call { label, entry, section, return_to, scope, is_by_number, runs_left, blocks })
    }

    fn enter(&mut self, call: Call) -> Outcome<()> {
        if self.flow.calls.len() >= MAX_CALLS {
            return Err(too_deep(&call.label));
        }
        let entry = call.entry;
        self.flow.calls.push(call);
        self.state.calls = self.flow.calls.len();
        self.state.returned = None;
        self.source.jump(entry)
    }

    /// Ends the subprogram with the label, if that is the one that runs.
    fn end_call(&mut self, label: &str, keyword: Keyword) -> Outcome<()> {
        match self.flow.calls.last() {
            // As in LinuxCNC, any return ends the subprogram that runs.
            Some(call) if call.label == label || keyword == Keyword::Return => self.finish_call(),
            Some(call) => Err(format!("O{label} {} within subprogram O{}", keyword.name(), call.label)),
            None => Err(format!("O{label} {} outside of a subprogram", keyword.name())),
        }
    }

    /// Runs the subprogram again, or returns to its caller.
    fn finish_call(&mut self) -> Outcome<()> {
        let Some(call) = self.flow.calls.last_mut() else { return Ok(()) };
        call.blocks.clear();
        if let Some(left) = call.runs_left.checked_sub(1) {
            call.runs_left = left;
            let entry = call.entry;
            return self.source.jump(entry);
        }
        let return_to = call.return_to;
        if let Some(scope) = self.flow.calls.pop().and_then(|call| call.scope) {
            self.state.parameters.leave(scope);
        }
        self.state.calls = self.flow.calls.len();
        self.source.jump(return_to)
    }

    /// Returns the first line of a subprogram. The first call reads the whole file once.
    pub(super) fn subprogram(&mut self, label: &str) -> Outcome<Place> {
        if self.flow.subprograms.is_none() {
            let found = self.find_subprograms(Place::START)?;
            self.flow.subprograms = Some(found);
        }
        let known = |flow: &Flow| flow.subprograms.as_ref().and_then(|known| known.get(label)).copied();
        if let Some(place) = known(&self.flow) {
            return Ok(place);
        }
        let file = subprogram_file(&self.state.options, label)?;
        let (name, text) = file.ok_or_else(|| {
            let name = if self.state.dialect == Dialect::Okuma { &label.to_uppercase() } else { label };
            format!("O{name}: no such subprogram in this file, and no file with its name beside it")
        })?;
        let start = self.source.add_file(&name, text)?;
        let mut found = self.find_subprograms(start)?;
        // A file without the number of its program begins with its first line.
        let place = *found.entry(label.to_owned()).or_insert(start);
        let subprograms = self.flow.subprograms.get_or_insert_default();
        for (label, place) in found {
            subprograms.entry(label).or_insert(place);
        }
        Ok(place)
    }

    fn find_subprograms(&mut self, start: Place) -> Outcome<HashMap<String, Place>> {
        let here = self.source.place();
        let mut found = HashMap::new();
        let mut line = LineText::default();
        self.source.jump(start)?;
        // Subprograms may follow the percent sign at the end of the program.
        let mut is_after_end = false;
        loop {
            let before = self.source.place();
            let read = self.source.read_raw(&mut line.raw);
            if read.is_err() && is_after_end {
                break;
            }
            if read.is_err() {
                self.note_line();
            }
            if !read? {
                if self.source.place() == before {
                    break;
                }
                is_after_end = true;
                continue;
            }
            let has_o = line.raw.iter().any(|byte| byte.eq_ignore_ascii_case(&b'o'));
            if !has_o
                || line.compact(self.state.dialect).is_err()
                || self.is_skipped(&line)
                || !is_o_word(&line.text)
            {
                continue;
            }
            let Ok(statement) = Scanner::new(&line.text, &self.state).statement() else { continue };
            if !matches!(statement.keyword, Keyword::Sub | Keyword::Program) {
                continue;
            }
            if found.len() >= MAX_SUBPROGRAMS {
                return Err(format!("the file has more than {MAX_SUBPROGRAMS} subprograms"));
            }
            found.entry(statement.label).or_insert(self.source.place());
        }
        self.source.jump(here)?;
        Ok(found)
    }
}

/// Returns true for the numbers of the probing macros of Renishaw and Haas.
fn is_probing(program: u32) -> bool {
    matches!(program, 9800..=9899 | 9023 | 9995)
}

fn too_deep(label: &str) -> String {
    format!("O{label}: subprograms call each other more than {MAX_CALLS} levels deep")
}
