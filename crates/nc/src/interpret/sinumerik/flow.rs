//! Jumps, conditions and loops: GOTO, IF, FOR, WHILE, REPEAT, LOOP, CASE.

use super::super::error::Outcome;
use super::super::limits::{MAX_BLOCKS, MAX_RESTARTS};
use super::super::source::Place;
use super::super::state::State;
use super::Sinumerik;
use super::index::{Direction, ProgramLines};
use super::scanner::BlockScanner;
use super::structures::{JumpDirection, JumpTarget, OpenStructure, SkipEnd, StructureKind, skip_to};
use super::system::NameScope;
use super::value::ProgramValue;

impl Sinumerik {
    /// Executes a statement of the flow, if the block begins with its keyword.
    pub(super) fn flow_statement(
        &mut self,
        scanner: &mut BlockScanner<'_>,
        state: &State,
        lines: &mut dyn ProgramLines,
    ) -> Outcome<bool> {
        let keyword = scanner.peek_name();
        match keyword {
            "IF" => {
                scanner.advance(keyword.len());
                let value = scanner.number_value(&self.scope(state));
                if value.is_err() && !scanner.rest().contains("GOTO") {
                    // Its ENDIF is no further error.
                    self.open(StructureKind::If, lines)?;
                }
                let is_true = value? != 0.0;
                if let Some(target) = self.jump_target(scanner, state)? {
                    if is_true {
                        self.jump(&target, lines)?;
                    }
                } else {
                    self.open(StructureKind::If, lines)?;
                    if !is_true {
                        self.skip_structure(lines, true)?;
                    }
                }
            }
            "ELSE" => {
                self.innermost(|kind| matches!(kind, StructureKind::If), "ELSE")?;
                scanner.advance(keyword.len());
                self.skip_structure(lines, false)?;
            }
            "ENDIF" | "ENDLOOP" | "ENDFOR" | "ENDWHILE" => {
                scanner.advance(keyword.len());
                self.innermost(|kind| kind.end() == keyword, keyword)?;
                self.end_block(state, lines)?;
            }
            "LOOP" => {
                scanner.advance(keyword.len());
                self.open(StructureKind::Loop, lines)?;
            }
            "FOR" => {
                scanner.advance(keyword.len());
                let depth = self.blocks.len();
                let started = self.start_for(scanner, state, lines);
                if started.is_err() && self.blocks.len() == depth {
                    // Its ENDFOR is no further error.
                    self.open(StructureKind::Failed("ENDFOR"), lines)?;
                }
                started?;
            }
            "WHILE" => {
                scanner.advance(keyword.len());
                let value = scanner.number_value(&self.scope(state));
                if value.is_err() {
                    self.open(StructureKind::Failed("ENDWHILE"), lines)?;
                }
                let is_true = value? != 0.0;
                self.open(StructureKind::While, lines)?;
                if !is_true {
                    self.skip_structure(lines, false)?;
                }
            }
            "UNTIL" => {
                scanner.advance(keyword.len());
                let value = scanner.number_value(&self.scope(state));
                self.innermost(|kind| matches!(kind, StructureKind::Repeat), "UNTIL")?;
                if value.is_err() {
                    self.blocks.pop();
                }
                let is_true = value? != 0.0;
                match self.blocks.last() {
                    Some(open) if !is_true => lines.jump(open.body)?,
                    _ => drop(self.blocks.pop()),
                }
            }
            "REPEAT" | "REPEATB" => {
                scanner.advance(keyword.len());
                match scanner.peek() {
                    None => self.open(StructureKind::Repeat, lines)?,
                    Some(_) => self.repeat_section(scanner, state, lines, keyword == "REPEATB")?,
                }
            }
            "CASE" => {
                scanner.advance(keyword.len());
                self.case(scanner, state, lines)?;
            }
            _ => return Ok(false),
        }
        match scanner.peek() {
            None => Ok(true),
            Some(_) => Err(format!("{}: nothing is allowed behind {keyword} and its values", scanner.rest())),
        }
    }

    pub(super) fn scope<'a>(&'a self, state: &'a State) -> NameScope<'a> {
        NameScope { variables: &self.variables, modes: &self.modes, state }
    }

    fn open(&mut self, kind: StructureKind, lines: &dyn ProgramLines) -> Outcome<()> {
        if self.blocks.len() >= MAX_BLOCKS {
            return Err(format!("structures are nested more than {MAX_BLOCKS} levels deep"));
        }
        self.blocks.push(OpenStructure { kind, opening: self.place, body: lines.place() });
        Ok(())
    }

    /// Rejects a keyword whose structure is not the innermost one.
    fn innermost(&self, belongs: impl Fn(&StructureKind) -> bool, keyword: &str) -> Outcome<()> {
        match self.blocks.last() {
            Some(open) if belongs(&open.kind) => Ok(()),
            Some(open) => Err(format!("{keyword} within a structure that {} ends", open.kind.end())),
            None => Err(format!("{keyword} without the start of its structure")),
        }
    }

    /// Continues behind the end of the innermost structure, or behind its ELSE.
    fn skip_structure(&mut self, lines: &mut dyn ProgramLines, stops_at_else: bool) -> Outcome<()> {
        let Some(end) = self.blocks.last().map(|open| open.kind.end()) else { return Ok(()) };
        let line = lines.line();
        match skip_to(lines, end, stops_at_else, &self.macros)? {
            Some(SkipEnd::Else) => {}
            Some(SkipEnd::End) => drop(self.blocks.pop()),
            None => return Err(format!("{end} is missing for the structure that line {line} opens")),
        }
        Ok(())
    }

    fn end_block(&mut self, state: &State, lines: &mut dyn ProgramLines) -> Outcome<()> {
        let Some(open) = self.blocks.last() else { return Ok(()) };
        let (opening, body) = (open.opening, open.body);
        match &open.kind {
            StructureKind::Loop => lines.jump(body),
            StructureKind::While => {
                self.blocks.pop();
                lines.jump(opening)
            }
            StructureKind::For(name, indices, last) => {
                let (name, indices, last) = (name.clone(), indices.clone(), *last);
                let next = self.scope(state).number(&name, &indices)? + 1.0;
                self.variables.set(&name, &indices, ProgramValue::Number(next))?;
                match next <= last {
                    true => lines.jump(body)?,
                    false => drop(self.blocks.pop()),
                }
                Ok(())
            }
            StructureKind::If | StructureKind::Repeat | StructureKind::Failed(_) => {
                self.blocks.pop();
                Ok(())
            }
        }
    }

    fn start_for(
        &mut self,
        scanner: &mut BlockScanner<'_>,
        state: &State,
        lines: &mut dyn ProgramLines,
    ) -> Outcome<()> {
        let name = scanner.name()?.to_owned();
        let indices = scanner.indices(&self.scope(state))?;
        scanner.require("=")?;
        let first = scanner.number_value(&self.scope(state))?;
        if !scanner.skip_name("TO") {
            return Err(format!("{}: FOR requires TO, as in FOR R1=1 TO 10", scanner.rest()));
        }
        let last = scanner.number_value(&self.scope(state))?;
        self.variables.set(&name, &indices, ProgramValue::Number(first))?;
        self.open(StructureKind::For(name, indices, last), lines)?;
        if first > last { self.skip_structure(lines, false) } else { Ok(()) }
    }

    /// Executes `CASE (e) OF 1 GOTOF A 2 GOTOF B DEFAULT GOTOF C`.
    fn case(
        &mut self,
        scanner: &mut BlockScanner<'_>,
        state: &State,
        lines: &mut dyn ProgramLines,
    ) -> Outcome<()> {
        let value = scanner.number_value(&self.scope(state))?;
        if !scanner.skip_name("OF") {
            return Err(format!(
                "{}: CASE requires OF, as in CASE(R1) OF 1 GOTOF A DEFAULT GOTOF B",
                scanner.rest()
            ));
        }
        let mut found: Option<JumpTarget> = None;
        while scanner.peek().is_some() {
            let is_taken = match scanner.skip_name("DEFAULT") {
                true => true,
                false => scanner.number_value(&self.scope(state))? == value,
            };
            let target = self.jump_target(scanner, state)?;
            let target = target.ok_or_else(|| format!("{}: CASE requires GOTOF or GOTOB", scanner.rest()))?;
            if is_taken && found.is_none() {
                found = Some(target);
            }
        }
        found.map_or(Ok(()), |target| self.jump(&target, lines))
    }

    /// Skips GOTO with its target, if it follows.
    pub(super) fn jump_target(
        &self,
        scanner: &mut BlockScanner<'_>,
        state: &State,
    ) -> Outcome<Option<JumpTarget>> {
        let keyword = scanner.peek_name();
        let direction = match keyword {
            "GOTO" => JumpDirection::To(Direction::Both),
            "GOTOF" => JumpDirection::To(Direction::Forward),
            "GOTOB" => JumpDirection::To(Direction::Backward),
            "GOTOC" => JumpDirection::Optional,
            "GOTOS" => JumpDirection::Start,
            _ => return Ok(None),
        };
        scanner.advance(keyword.len());
        if direction == JumpDirection::Start {
            return Ok(Some(JumpTarget { name: String::new(), direction }));
        }
        // The target is a name, or an expression with a string.
        let mut ahead = scanner.clone();
        let name = ahead.peek_name();
        ahead.advance(name.len());
        let is_name = !name.is_empty() && !self.variables.is_defined(name) && !ahead.skip("<<");
        let name = match is_name {
            true => scanner.name()?.to_owned(),
            false => match scanner.value(&self.scope(state))? {
                ProgramValue::Number(number) => format!("N{number}"),
                value => value.text().to_ascii_uppercase(),
            },
        };
        Ok(Some(JumpTarget { name, direction }))
    }

    /// Continues at the target of a jump.
    pub(super) fn jump(&mut self, target: &JumpTarget, lines: &mut dyn ProgramLines) -> Outcome<()> {
        let from = self.place;
        let direction = match target.direction {
            JumpDirection::To(direction) => direction,
            JumpDirection::Optional => Direction::Both,
            JumpDirection::Start => {
                self.restarts += 1;
                if self.restarts > MAX_RESTARTS {
                    return Err(format!(
                        "GOTOS has started the program again {MAX_RESTARTS} times, without an end: program M30 in its place \
                         for one run"
                    ));
                }
                self.blocks.clear();
                let start = self.index(lines)?.unit(from).map(|unit| unit.start);
                return start.map_or(Ok(()), |start| lines.jump(start));
            }
        };
        let found = self.find(&target.name, from, direction, lines)?;
        let Some(found) = found else {
            if target.direction == JumpDirection::Optional {
                return Ok(());
            }
            let where_ = match direction {
                Direction::Forward => "behind this block",
                Direction::Backward => "in front of this block",
                Direction::Both => "in this program",
            };
            return Err(format!("no label and no block number {} {where_}", target.name));
        };
        self.leave_blocks(found, lines)?;
        lines.jump(found)
    }

    /// Returns the line of a label or block number.
    pub(super) fn find(
        &mut self,
        name: &str,
        from: Place,
        direction: Direction,
        lines: &mut dyn ProgramLines,
    ) -> Outcome<Option<Place>> {
        if let Some(found) = self.index(lines)?.label(name, from, direction) {
            return Ok(Some(found));
        }
        let digits = name.strip_prefix('N').unwrap_or(name);
        match digits.parse() {
            Ok(number) => self.index(lines)?.number(lines, number, from, direction),
            Err(_) => Ok(None),
        }
    }

    /// Ends the open structures that a jump leaves.
    fn leave_blocks(&mut self, target: Place, lines: &mut dyn ProgramLines) -> Outcome<()> {
        while let Some(open) = self.blocks.last() {
            let (opening, end) = (open.opening, open.kind.end());
            if target > opening {
                let here = lines.place();
                lines.jump(open.body)?;
                let is_closed = skip_to(lines, end, false, &self.macros)?.is_some();
                let behind = lines.place();
                lines.jump(here)?;
                if !is_closed || target < behind {
                    break;
                }
            }
            self.blocks.pop();
        }
        Ok(())
    }
}
