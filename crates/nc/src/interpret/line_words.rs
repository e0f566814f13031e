//! Words of one line.

use super::codes::g_name;
use super::error::Outcome;
use super::expression::{Scanner, Target};
use super::limits::MAX_CODES;
use super::parameters::{Variables, integer};
use crate::motion::AXIS_LETTERS;

/// Number of letters.
const LETTERS: usize = 26;

/// Words and parameter settings of one line.
#[derive(Debug, Default)]
pub(super) struct LineWords {
    values: [f64; LETTERS],
    /// Bit of each letter with a word that no code has used yet.
    unused: u32,
    /// G codes, in tenths.
    pub g: Vec<u16>,
    /// M codes, without the ignored ones.
    pub m: Vec<u32>,
    /// Ignored M codes, whose words have no effect.
    pub ignored: Vec<u32>,
    /// Parameter settings, in their order.
    pub settings: Vec<(Setting, f64)>,
}

/// Parameter set by a line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Setting {
    /// Number.
    Number(usize),
    /// Name.
    Name(String),
}

impl LineWords {
    /// Reads a compact line.
    pub(super) fn read<V: Variables>(&mut self, text: &[u8], variables: &V, ignored: &[u32]) -> Outcome<()> {
        self.unused = 0;
        self.g.clear();
        self.m.clear();
        self.settings.clear();
        self.ignored.clear();
        let mut scanner = Scanner::new(text, variables);
        while let Some(byte) = scanner.peek() {
            match byte {
                b'#' => self.read_setting(&mut scanner)?,
                b'a'..=b'z' => self.read_word(&mut scanner, ignored)?,
                _ => return Err(format!("{}: a word is required, a letter with a value", scanner.rest())),
            }
        }
        Ok(())
    }

    fn read_setting<V: Variables>(&mut self, scanner: &mut Scanner<'_, V>) -> Outcome<()> {
        let target = match scanner.target()? {
            Target::Number(number) => Setting::Number(number),
            Target::Name(name) => Setting::Name(name.to_owned()),
        };
        if !scanner.skip("=") {
            return Err(format!("{}: a parameter setting requires =", scanner.found()));
        }
        let value = scanner.value()?;
        require_count(self.settings.len(), "parameter settings")?;
        self.settings.push((target, value));
        Ok(())
    }

    fn read_word<V: Variables>(&mut self, scanner: &mut Scanner<'_, V>, ignored: &[u32]) -> Outcome<()> {
        let word = scanner.rest();
        let letter = scanner.take().unwrap_or_default();
        let value = scanner
            .value()
            .map_err(|reason| format!("word {}: {reason}", char::from(letter.to_ascii_uppercase())))?;
        match letter {
            b'g' => {
                require_count(self.g.len(), "G codes")?;
                let code = integer(value * 10.0)
                    .and_then(|code| u16::try_from(code).ok())
                    .filter(|code| *code < 10_000);
                self.g.push(code.ok_or_else(|| format!("G{value} is not a G code"))?);
            }
            b'm' => {
                let code = integer(value).ok_or_else(|| format!("M{value} is not an M code"))?;
                require_count(self.m.len() + self.ignored.len(), "M codes")?;
                let codes = if ignored.contains(&code) { &mut self.ignored } else { &mut self.m };
                codes.push(code);
            }
            b'n' => return Err("word N: the line number stands at the start of the line".to_owned()),
            b'o' => return Err(format!("{word}: an O-word stands at the start of the line")),
            b'e' => return Err(format!("{word}: the letter E is not supported; numbers have no exponent")),
            _ => {
                let bit = 1 << index(letter);
                if self.unused & bit != 0 {
                    return Err(format!("two words {} in one line", char::from(letter.to_ascii_uppercase())));
                }
                self.unused |= bit;
                self.values[index(letter)] = value;
            }
        }
        Ok(())
    }

    /// Returns the value of a word, which then counts as used. `letter` is in upper case.
    pub(super) fn take(&mut self, letter: char) -> Option<f64> {
        let value = self.get(letter);
        self.unused &= !(1 << index(letter as u8));
        value
    }

    /// Returns the value of a word that is not used yet. `letter` is in upper case.
    pub(super) fn get(&self, letter: char) -> Option<f64> {
        let index = index(letter as u8);
        (self.unused & (1 << index) != 0).then(|| self.values[index])
    }

    /// Returns the value of a word as an integer from 0, which then counts as used.
    pub(super) fn take_integer(&mut self, letter: char) -> Outcome<Option<u32>> {
        let Some(value) = self.take(letter) else { return Ok(None) };
        let required = || format!("word {letter}: {value} is invalid, an integer from 0 is required");
        integer(value).map(Some).ok_or_else(required)
    }

    /// Returns true if one of the letters has a word that is not used yet. Letters are in upper case.
    pub(super) fn has_any(&self, letters: &[char]) -> bool {
        letters.iter().any(|letter| self.get(*letter).is_some())
    }

    /// Returns true if an axis has a word that is not used yet.
    pub(super) fn has_axis(&self) -> bool {
        self.has_any(&AXIS_LETTERS)
    }

    /// Returns true without word, code and setting.
    pub(super) fn is_empty(&self) -> bool {
        self.unused == 0 && self.g.is_empty() && self.m.is_empty() && self.settings.is_empty()
    }

    /// Returns true if all codes are ignored: then the words belong to them.
    pub(super) fn is_ignored(&self) -> bool {
        !self.ignored.is_empty() && self.g.is_empty() && self.m.is_empty()
    }

    /// Rejects words that no code has used.
    pub(super) fn require_used(&self) -> Outcome<()> {
        if self.unused == 0 || !self.ignored.is_empty() {
            return Ok(());
        }
        let letter = char::from(b'A' + self.unused.trailing_zeros() as u8);
        let codes =
            self.g.iter().map(|code| g_name(*code)).chain(self.m.iter().map(|code| format!("M{code}")));
        let codes = codes.collect::<Vec<_>>().join(" ");
        let codes = if codes.is_empty() { "without a code".to_owned() } else { format!("with {codes}") };
        Err(format!(
            "word {letter} has no effect in this line {codes}: remove it, or program the code that it belongs to"
        ))
    }
}

fn index(letter: u8) -> usize {
    usize::from(letter.to_ascii_lowercase() - b'a')
}

fn require_count(count: usize, what: &str) -> Outcome<()> {
    match count < MAX_CODES {
        true => Ok(()),
        false => Err(format!("more than {MAX_CODES} {what} in one line")),
    }
}
