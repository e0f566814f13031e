//! Statements of O-words: label, keyword and expressions.

use super::error::Outcome;
use super::expression::Scanner;
use super::parameters::{LOCALS, Variables, integer};

/// Keyword of an O-word.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Keyword {
    /// Number of a program or subprogram: the label alone.
    Program,
    Sub,
    EndSub,
    Return,
    Call,
    Do,
    While,
    EndWhile,
    If,
    ElseIf,
    Else,
    EndIf,
    Break,
    Continue,
    Repeat,
    EndRepeat,
}

/// Keywords in lower case; no keyword begins a later one.
const KEYWORDS: [(&str, Keyword); 15] = [
    ("endsub", Keyword::EndSub),
    ("sub", Keyword::Sub),
    ("return", Keyword::Return),
    ("call", Keyword::Call),
    ("do", Keyword::Do),
    ("while", Keyword::While),
    ("endwhile", Keyword::EndWhile),
    ("if", Keyword::If),
    ("elseif", Keyword::ElseIf),
    ("else", Keyword::Else),
    ("endif", Keyword::EndIf),
    ("break", Keyword::Break),
    ("continue", Keyword::Continue),
    ("repeat", Keyword::Repeat),
    ("endrepeat", Keyword::EndRepeat),
];

impl Keyword {
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

/// Returns true if a compact line has an O-word.
pub(super) fn is_o_word(text: &[u8]) -> bool {
    text.first() == Some(&b'o')
}

impl<V: Variables> Scanner<'_, V> {
    /// Reads label and keyword of an O-word.
    pub(super) fn statement(&mut self) -> Outcome<Statement> {
        let text = self.rest();
        self.skip("o");
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
        let keyword = KEYWORDS.into_iter().find(|(name, _)| self.skip(name)).map(|(_, keyword)| keyword);
        match keyword {
            Some(keyword) => Ok(Statement { label, keyword }),
            None if self.peek().is_none() => Ok(Statement { label, keyword: Keyword::Program }),
            None => {
                let known = KEYWORDS.map(|(name, _)| name).join(" ");
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
