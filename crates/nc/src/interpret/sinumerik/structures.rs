//! Structures and jumps as data, and the search for the end of a structure.

use super::super::error::Outcome;
use super::super::limits::MAX_BLOCKS;
use super::super::source::Place;
use super::index::{Direction, ProgramLines, label};
use super::macros::Macros;
use super::scanner::{BlockScanner, BlockText};
use super::value::ProgramValue;

/// Keywords that open a structure, with those that end it.
const STRUCTURES: [(&str, &str); 5] =
    [("IF", "ENDIF"), ("LOOP", "ENDLOOP"), ("FOR", "ENDFOR"), ("WHILE", "ENDWHILE"), ("REPEAT", "UNTIL")];

/// Structure that is open.
#[derive(Debug)]
pub(super) struct OpenStructure {
    pub kind: StructureKind,
    /// Line that opens the structure.
    pub opening: Place,
    /// Line behind it.
    pub body: Place,
}

/// Kind of an open structure.
#[derive(Debug)]
pub(super) enum StructureKind {
    If,
    Loop,
    /// Counter, its indices, and its last value.
    For(String, Vec<ProgramValue>, f64),
    While,
    Repeat,
    /// Structure whose first line has an error, with the keyword that ends it.
    Failed(&'static str),
}

impl StructureKind {
    /// Returns the keyword that ends the structure.
    pub(super) fn end(&self) -> &'static str {
        match self {
            StructureKind::If => "ENDIF",
            StructureKind::Loop => "ENDLOOP",
            StructureKind::For(..) => "ENDFOR",
            StructureKind::While => "ENDWHILE",
            StructureKind::Repeat => "UNTIL",
            StructureKind::Failed(end) => end,
        }
    }
}

/// Target of a jump.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct JumpTarget {
    /// Label, or block number as `N100`.
    pub name: String,
    pub direction: JumpDirection,
}

/// Search for the target of a jump.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum JumpDirection {
    To(Direction),
    /// GOTOC: no error without a target.
    Optional,
    /// GOTOS: start of the program.
    Start,
}

/// Place where the skipped part of a structure ends.
pub(super) enum SkipEnd {
    Else,
    End,
}

/// Reads lines up to the end of the structure that is open; `None` if it is missing.
pub(super) fn skip_to(
    lines: &mut dyn ProgramLines,
    end: &str,
    stops_at_else: bool,
    macros: &Macros,
) -> Outcome<Option<SkipEnd>> {
    let mut block = BlockText::default();
    let mut inner: Vec<&str> = Vec::new();
    while lines.read_raw(&mut block.raw)? {
        if block.read().is_err() || block.text.is_empty() {
            continue;
        }
        macros.expand(&mut block.text)?;
        let mut scanner = BlockScanner::new(&block.text);
        label(&mut scanner);
        let keyword = scanner.peek_name();
        match inner.last() {
            None if keyword == end => return Ok(Some(SkipEnd::End)),
            None if stops_at_else && keyword == "ELSE" => return Ok(Some(SkipEnd::Else)),
            Some(inner_end) if keyword == *inner_end => drop(inner.pop()),
            _ => {
                let structure = STRUCTURES.iter().find(|(opening, _)| *opening == keyword);
                if let Some((opening, inner_end)) = structure
                    && opens(opening, &mut scanner)
                {
                    inner.push(inner_end);
                    if inner.len() > MAX_BLOCKS {
                        return Err(format!("structures are nested more than {MAX_BLOCKS} levels deep"));
                    }
                }
            }
        }
    }
    Ok(None)
}

/// Returns true if a keyword begins a structure: IF without GOTO, REPEAT without label.
fn opens(keyword: &str, scanner: &mut BlockScanner<'_>) -> bool {
    scanner.advance(keyword.len());
    match keyword {
        "IF" => {
            let mut rest = scanner.clone();
            let text = String::from_utf8_lossy(rest.take_rest()).into_owned();
            !text
                .split(|character: char| !character.is_ascii_alphanumeric() && character != '_')
                .any(|word| matches!(word, "GOTO" | "GOTOF" | "GOTOB" | "GOTOC" | "GOTOS"))
        }
        "REPEAT" => scanner.peek().is_none(),
        _ => true,
    }
}
