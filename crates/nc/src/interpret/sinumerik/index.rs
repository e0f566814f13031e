//! Programs, subprograms and labels of a source, found in one pass over it.

use std::collections::HashMap;
use std::io::{BufRead, Seek};

use super::super::error::Outcome;
use super::super::limits::MAX_SUBPROGRAMS;
use super::super::source::{LineSource, Place};
use super::scanner::{BlockScanner, BlockText};

/// Largest number of labels in a source.
const MAX_LABELS: usize = 100_000;

/// Source of lines: the program or the file of a subprogram.
pub(super) trait ProgramLines {
    /// Reads the next line; returns false at the end.
    fn read(&mut self, line: &mut Vec<u8>) -> Outcome<bool>;
    /// Reads the next line without counting repetitions; returns false at the end.
    fn read_raw(&mut self, line: &mut Vec<u8>) -> Outcome<bool>;
    /// Returns the start of the next line.
    fn place(&self) -> Place;
    /// Continues at a place.
    fn jump(&mut self, place: Place) -> Outcome<()>;
    /// Continues at the first line.
    fn rewind(&mut self) -> Outcome<()>;
    /// Returns the number of the line that was read last, from 1.
    fn line(&self) -> usize;
}

impl<R: BufRead + Seek> ProgramLines for LineSource<R> {
    fn read(&mut self, line: &mut Vec<u8>) -> Outcome<bool> {
        LineSource::read(self, line)
    }

    fn read_raw(&mut self, line: &mut Vec<u8>) -> Outcome<bool> {
        LineSource::read_raw(self, line)
    }

    fn place(&self) -> Place {
        LineSource::place(self)
    }

    fn jump(&mut self, place: Place) -> Outcome<()> {
        LineSource::jump(self, place)
    }

    fn rewind(&mut self) -> Outcome<()> {
        LineSource::rewind(self)
    }

    fn line(&self) -> usize {
        LineSource::line(self)
    }
}

/// Program or subprogram of a source.
#[derive(Debug, Clone)]
pub(super) struct ProgramUnit {
    /// Name in upper case; empty for a program without head.
    pub name: String,
    /// First line, behind a head `%_N_NAME_MPF`.
    pub start: Place,
    /// Start of the next unit; `None` at the end of the source.
    pub end: Option<Place>,
}

impl ProgramUnit {
    fn contains(&self, place: Place) -> bool {
        self.start <= place && self.end.is_none_or(|end| place < end)
    }
}

/// Units and labels of a source.
#[derive(Debug, Default)]
pub(super) struct SourceIndex {
    units: Vec<ProgramUnit>,
    /// ProgramLines of each label, in their order.
    labels: HashMap<String, Vec<Place>>,
    /// ProgramLines of block numbers that jumps have found, by the place of the jump.
    numbers: HashMap<(Place, u64), Place>,
}

/// Direction of a jump.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Direction {
    Forward,
    Backward,
    /// Forward, then backward.
    Both,
}

impl SourceIndex {
    /// Reads the source from its start, and returns to its present place.
    pub(super) fn new(lines: &mut dyn ProgramLines) -> Outcome<Self> {
        let here = lines.place();
        lines.rewind()?;
        let mut index = Self::default();
        let mut block = BlockText::default();
        index.units.push(ProgramUnit { name: String::new(), start: lines.place(), end: None });
        loop {
            let place = lines.place();
            if !lines.read_raw(&mut block.raw)? {
                break;
            }
            index.add_line(&mut block, place, lines.place())?;
        }
        lines.jump(here)?;
        Ok(index)
    }

    fn add_line(&mut self, block: &mut BlockText, place: Place, next: Place) -> Outcome<()> {
        let head = head(&block.raw);
        let raw = block.raw.trim_ascii_start();
        let may_be_proc = block.raw.windows(4).any(|part| part.eq_ignore_ascii_case(b"PROC"));
        let is_candidate = head.is_some() || may_be_proc || raw.contains(&b':');
        if !is_candidate {
            return Ok(());
        }
        if let Some(name) = head {
            return self.add_unit(name, place, next);
        }
        if block.read().is_err() {
            return Ok(());
        }
        let mut scanner = BlockScanner::new(&block.text);
        if scanner.skip_name("PROC") {
            let name = scanner.peek_name().to_owned();
            // The line of a head that the procedure follows names it already.
            let is_named = self.units.last().is_some_and(|unit| unit.name == name);
            return if is_named { Ok(()) } else { self.add_unit(name, place, place) };
        }
        if let Some(label) = label(&mut scanner) {
            if self.labels.len() >= MAX_LABELS {
                return Err(format!("the program has more than {MAX_LABELS} labels"));
            }
            self.labels.entry(label.to_owned()).or_default().push(place);
        }
        Ok(())
    }

    fn add_unit(&mut self, name: String, place: Place, start: Place) -> Outcome<()> {
        if self.units.len() >= MAX_SUBPROGRAMS {
            return Err(format!("the file has more than {MAX_SUBPROGRAMS} subprograms"));
        }
        if let Some(last) = self.units.last_mut() {
            last.end = Some(place);
        }
        self.units.push(ProgramUnit { name, start, end: None });
        Ok(())
    }

    /// Returns the start of the subprogram with a name.
    pub(super) fn subprogram(&self, name: &str) -> Option<Place> {
        self.units.iter().find(|unit| !unit.name.is_empty() && unit.name == name).map(|unit| unit.start)
    }

    /// Returns the unit of a place.
    pub(super) fn unit(&self, place: Place) -> Option<&ProgramUnit> {
        self.units.iter().rev().find(|unit| unit.contains(place))
    }

    /// Returns the line of a label, seen from the line that begins at `from`, in the same unit.
    pub(super) fn label(&self, label: &str, from: Place, direction: Direction) -> Option<Place> {
        let unit = self.unit(from)?;
        let places = self.labels.get(label)?;
        let forward = || places.iter().find(|place| **place > from && unit.contains(**place)).copied();
        let backward =
            || places.iter().rev().find(|place| **place <= from && unit.contains(**place)).copied();
        match direction {
            Direction::Forward => forward(),
            Direction::Backward => backward(),
            Direction::Both => forward().or_else(backward),
        }
    }

    /// Returns the line of a block number, seen from the line that begins at `from`, in the same unit.
    pub(super) fn number(
        &mut self,
        lines: &mut dyn ProgramLines,
        number: u64,
        from: Place,
        direction: Direction,
    ) -> Outcome<Option<Place>> {
        if let Some(found) = self.numbers.get(&(from, number)) {
            return Ok(Some(*found));
        }
        let Some(unit) = self.unit(from).cloned() else { return Ok(None) };
        let here = lines.place();
        let mut block = BlockText::default();
        let (mut forward, mut backward) = (None, None);
        lines.jump(if direction == Direction::Forward { from } else { unit.start })?;
        loop {
            let place = lines.place();
            if unit.end.is_some_and(|end| place >= end) || !lines.read_raw(&mut block.raw)? {
                break;
            }
            if !has_number(&block.raw, number) {
                continue;
            }
            if place > from {
                forward = Some(place);
                break;
            }
            backward = Some(place);
        }
        lines.jump(here)?;
        let found = match direction {
            Direction::Forward => forward,
            Direction::Backward => backward,
            Direction::Both => forward.or(backward),
        };
        if let Some(found) = found
            && self.numbers.len() < MAX_LABELS
        {
            self.numbers.insert((from, number), found);
        }
        Ok(found)
    }
}

/// Returns the name in the head of a program: DRILL in `%_N_DRILL_SPF`.
pub(super) fn head(line: &[u8]) -> Option<String> {
    let text = line.trim_ascii().strip_prefix(b"%")?;
    let text = String::from_utf8_lossy(text).to_ascii_uppercase();
    let name = text.split([' ', ';', '(']).next().unwrap_or_default();
    let name = name.strip_prefix("_N_").unwrap_or(name);
    let name = name.strip_suffix("_MPF").or_else(|| name.strip_suffix("_SPF")).unwrap_or(name);
    (!name.is_empty()).then(|| name.to_owned())
}

/// Skips a label `NAME:` at the start of a block, and returns its name.
pub(super) fn label<'a>(scanner: &mut BlockScanner<'a>) -> Option<&'a str> {
    let name = scanner.peek_name();
    if name.is_empty() {
        return None;
    }
    let mut ahead = scanner.clone();
    ahead.advance(name.len());
    if !ahead.skip(":") {
        return None;
    }
    *scanner = ahead;
    Some(name)
}

/// Returns true if a line has a block number.
fn has_number(line: &[u8], number: u64) -> bool {
    let mut text = line.trim_ascii_start();
    if let Some(rest) = text.strip_prefix(b"/") {
        text = rest.strip_prefix(b"0").unwrap_or(rest).trim_ascii_start();
    }
    let Some((b'N' | b'n' | b':', rest)) = text.split_first() else { return false };
    let rest = rest.trim_ascii_start();
    let digits = rest.iter().take_while(|byte| byte.is_ascii_digit()).count();
    let text = String::from_utf8_lossy(&rest[..digits]);
    text.parse() == Ok(number)
}
