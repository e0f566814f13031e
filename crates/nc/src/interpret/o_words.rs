//! O-words: their statements, and the calls, loops and conditions that they open.

use std::collections::{HashMap, HashSet};

use super::error::Outcome;
use super::expression::Scanner;
use super::parameters::{CallerScope, LOCALS, integer};
use super::source::Place;

/// Declares the keywords; no keyword begins a later one.
macro_rules! keywords {
    ($($keyword:ident = $name:literal),+) => {
        /// Keyword of an O-word.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub(super) enum Keyword {
            /// Number of a program or subprogram: the label alone.
            Program,
            $(#[doc = concat!("`", $name, "`.")] $keyword,)+
        }

        const KEYWORDS: &[(&str, Keyword)] = &[$(($name, Keyword::$keyword)),+];
    };
}

keywords!(
    EndSub = "endsub",
    Sub = "sub",
    Return = "return",
    Call = "call",
    Do = "do",
    While = "while",
    EndWhile = "endwhile",
    If = "if",
    ElseIf = "elseif",
    Else = "else",
    EndIf = "endif",
    Break = "break",
    Continue = "continue",
    Repeat = "repeat",
    EndRepeat = "endrepeat"
);

impl Keyword {
    /// Returns true if the keyword begins a loop or condition.
    pub(super) fn begins_block(self) -> bool {
        matches!(self, Self::If | Self::While | Self::Repeat | Self::Do)
    }

    /// Returns true if the keyword belongs to a loop or condition that has begun.
    pub(super) fn requires_block(self) -> bool {
        matches!(
            self,
            Self::ElseIf
                | Self::Else
                | Self::EndIf
                | Self::EndWhile
                | Self::EndRepeat
                | Self::Break
                | Self::Continue
        )
    }

    /// Returns the keyword as in a program.
    pub(super) fn name(self) -> &'static str {
        KEYWORDS.iter().find(|(_, keyword)| *keyword == self).map_or("", |(name, _)| name)
    }
}

/// Statement of an O-word.
#[derive(Debug)]
pub(super) struct Statement {
    /// Label in lower case: number or name.
    pub label: String,
    pub keyword: Keyword,
}

/// Calls, loops and conditions that are open.
#[derive(Debug, Default)]
pub(super) struct Flow {
    pub calls: Vec<Call>,
    /// Loops and conditions of the main program.
    pub blocks: Vec<OpenBlock>,
    /// Lines by their numbers N that a jump has required, with the first line of their program.
    pub numbered: HashMap<(Place, u32), Place>,
    /// Loops of macro B by their numbers: the line of their beginning, with the depth of calls.
    pub loops: HashMap<(usize, u32), Place>,
    /// Loops of macro B whose first line has an error, by the keys of `loops`.
    pub failed_loops: HashSet<(usize, u32)>,
    /// Labels of loops and conditions whose first line has an error.
    pub failed_labels: HashSet<String>,
    /// First line of each subprogram, once a call has required them.
    pub subprograms: Option<HashMap<String, Place>>,
}

/// Subprogram that runs.
#[derive(Debug)]
pub(super) struct Call {
    pub label: String,
    pub entry: Place,
    /// First line of the program or subprogram with the numbers of its lines.
    pub section: Place,
    pub return_to: Place,
    /// Parameters of the caller; `None` after M98, which shares them.
    pub scope: Option<CallerScope>,
    /// True if M99 returns.
    pub is_by_number: bool,
    /// Number of further runs (M98 L).
    pub runs_left: u32,
    pub blocks: Vec<OpenBlock>,
}

/// Loop or condition that is open.
#[derive(Debug)]
pub(super) struct OpenBlock {
    pub label: String,
    pub kind: BlockKind,
}

/// Kind of an open block.
#[derive(Debug, Clone, Copy)]
pub(super) enum BlockKind {
    If,
    /// Loop from its `while`.
    While(Place),
    /// Loop from the line after its `do`.
    Do(Place),
    /// Loop from the line after its `repeat`, with the number of further runs.
    Repeat(Place, u32),
}

/// Returns true if a compact line has an O-word.
pub(super) fn is_o_word(text: &[u8]) -> bool {
    text.first() == Some(&b'o')
}

impl Scanner<'_> {
    /// Reads label and keyword of an O-word.
    pub(super) fn statement(&mut self) -> Outcome<Statement> {
        let text = self.rest();
        self.skip("o");
        if self.is_okuma() {
            let label = self.rest().to_lowercase();
            return Ok(Statement { label, keyword: Keyword::Program });
        }
        let label = match self.peek() {
            Some(b'<') => self.name()?.to_owned(),
            Some(b'0'..=b'9') => self.digits()?.to_string(),
            _ => {
                let value = self.value().map_err(|reason| format!("{text}: {reason}"))?;
                integer(value)
                    .ok_or_else(|| format!("{text}: the label {value} is not an integer"))?
                    .to_string()
            }
        };
        let keyword = KEYWORDS.iter().find(|(name, _)| self.skip(name)).map(|(_, keyword)| *keyword);
        match keyword {
            Some(keyword) => Ok(Statement { label, keyword }),
            None if self.peek().is_none() => Ok(Statement { label, keyword: Keyword::Program }),
            None => {
                let known = KEYWORDS.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(" ");
                Err(format!("O{label} {}: not a keyword; supported: {known}", self.rest()))
            }
        }
    }

    fn digits(&mut self) -> Outcome<u32> {
        let mut number: u32 = 0;
        while let Some(digit @ b'0'..=b'9') = self.peek() {
            let next = number.checked_mul(10).and_then(|number| number.checked_add(u32::from(digit - b'0')));
            number = next.ok_or_else(|| format!("O{number}…: the label is too large"))?;
            self.take();
        }
        Ok(number)
    }

    /// Reads the expressions up to the end of the line, in brackets; returns their number too.
    pub(super) fn arguments(&mut self) -> Outcome<([f64; LOCALS], usize)> {
        let mut arguments = [0.0; LOCALS];
        let mut count = 0;
        while self.peek().is_some() {
            let value = self.bracket()?;
            *arguments.get_mut(count).ok_or_else(|| format!("more than {LOCALS} arguments"))? = value;
            count += 1;
        }
        Ok((arguments, count))
    }
}
