//! Words of one block: G and M codes, axes, addresses with values, and keywords.

use virtual_axes_core::units::Rounded;

use super::super::error::Outcome;
use super::super::limits::MAX_CODES;
use super::super::parameters::integer;
use super::expression::Names;
use super::scanner::BlockScanner;
use super::value::{ProgramValue, axis_of};
use crate::motion::AXIS_COUNT;

/// Most words of one kind in a block.
const MAX_WORDS: usize = 4 * MAX_CODES;
/// Addresses with a number behind the letters that are no axes and no spindle.
const NUMBERED: [&str; 18] = [
    "A2", "B2", "C2", "A3", "B3", "C3", "A4", "B4", "C4", "A5", "B5", "C5", "A6", "B6", "C6", "I1", "J1",
    "K1",
];

/// Way to the coordinate of a word.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Approach {
    /// By G90 or G91.
    Modal,
    /// AC: absolute.
    Absolute,
    /// IC: from the start of the block.
    Incremental,
    /// DC: rotary axis on the shortest way.
    Shortest,
    /// ACP: rotary axis in positive direction.
    Positive,
    /// ACN: rotary axis in negative direction.
    Negative,
}

/// Approaches by their names.
const APPROACHES: [(&str, Approach); 5] = [
    ("AC", Approach::Absolute),
    ("IC", Approach::Incremental),
    ("DC", Approach::Shortest),
    ("ACP", Approach::Positive),
    ("ACN", Approach::Negative),
];

/// Value of a word, in units of the program.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct WordValue {
    pub value: ProgramValue,
    pub approach: Approach,
}

/// Word with the name of its address.
#[derive(Debug)]
struct Word {
    address: String,
    /// Number behind the letter, or index: 2 in `S2=1000`, X in `FA[X]=100`.
    index: Option<ProgramValue>,
    value: WordValue,
}

/// Words of one block, which are taken by what they belong to.
#[derive(Debug, Default)]
pub(super) struct Words {
    pub g: Vec<u32>,
    /// M codes of the main spindle.
    pub m: Vec<u32>,
    /// Names without value, in their order.
    pub keywords: Vec<String>,
    /// Axis words, not yet scaled.
    pub axes: [Option<(f64, Approach)>; AXIS_COUNT],
    words: Vec<Word>,
}

impl Words {
    /// Reads a word of a letter and a number, as X10 or G1, if it follows.
    pub(super) fn read_letter(&mut self, scanner: &mut BlockScanner<'_>) -> Outcome<bool> {
        let name = scanner.peek_name();
        let bytes = name.as_bytes();
        let is_letter =
            bytes.first().is_some_and(u8::is_ascii_uppercase) && bytes.get(1).is_none_or(u8::is_ascii_digit);
        if !is_letter {
            return Ok(false);
        }
        let mut ahead = scanner.clone();
        ahead.advance(1);
        if !ahead.has_number() {
            return Ok(false);
        }
        let negative = ahead.skip("-");
        if !negative {
            ahead.skip("+");
        }
        let variable = ahead.peek_name();
        if variable.starts_with('R') {
            let (letter, sign) = (&name[..1], if negative { "-" } else { "" });
            return Err(format!("word {letter}: an expression requires =, as in {letter}={sign}{variable}"));
        }
        let number = ahead.number().map_err(|reason| format!("word {}: {reason}", &name[..1]))?;
        let value = if negative { -number } else { number };
        *scanner = ahead;
        self.add(
            &name[..1],
            None,
            WordValue { value: ProgramValue::Number(value), approach: Approach::Modal },
        )?;
        Ok(true)
    }

    /// Reads the value behind `=`: an expression, or one in AC, IC, DC, ACP, ACN.
    pub(super) fn read_value(scanner: &mut BlockScanner<'_>, names: &dyn Names) -> Outcome<WordValue> {
        let name = scanner.peek_name();
        let approach = APPROACHES.iter().find(|(known, _)| *known == name);
        if let Some((name, approach)) = approach {
            let mut ahead = scanner.clone();
            ahead.advance(name.len());
            if ahead.peek() == Some(b'(') {
                *scanner = ahead;
                scanner.require("(")?;
                let value = scanner.value(names)?;
                scanner.require(")")?;
                return Ok(WordValue { value, approach: *approach });
            }
        }
        if matches!(name, "CAC" | "CIC" | "CDC" | "CACP" | "CACN") {
            return Err(format!(
                "{name}: coded positions are not supported; program the coordinate with AC or IC"
            ));
        }
        Ok(WordValue { value: scanner.value(names)?, approach: Approach::Modal })
    }

    /// Adds a word with an address of one or more letters.
    pub(super) fn add(
        &mut self,
        address: &str,
        index: Option<ProgramValue>,
        value: WordValue,
    ) -> Outcome<()> {
        if self.words.len() + self.g.len() + self.m.len() >= MAX_WORDS {
            return Err(format!("more than {MAX_WORDS} words in one block"));
        }
        let (address, index) = split(address, index);
        let is_main = index.as_ref().is_none_or(|index| matches!(index, ProgramValue::Number(0.0 | 1.0)));
        if index.is_none()
            && let Some(axis) = axis_of(address)
        {
            let number = value.value.number().map_err(|reason| format!("word {address}: {reason}"))?;
            if self.axes[axis].replace((number, value.approach)).is_some() {
                return Err(format!("two words {address} in one block"));
            }
            return Ok(());
        }
        match address {
            "G" => self.g.push(code("G", value)?),
            "M" if is_main => self.m.push(code("M", value)?),
            _ => {
                let is_same = |word: &Word| word.address == address && word.index == index;
                // Several H functions may stand in one block.
                if address != "H" && self.words.iter().any(is_same) {
                    return Err(format!("two words {address} in one block"));
                }
                self.words.push(Word { address: address.to_owned(), index, value });
            }
        }
        Ok(())
    }

    /// Returns the value of an address without index or of the main spindle, which then counts as used.
    pub(super) fn take(&mut self, address: &str) -> Option<WordValue> {
        let is_main = |word: &Word| match &word.index {
            None => true,
            Some(ProgramValue::Number(number)) => *number == 1.0,
            Some(_) => false,
        };
        let found = self.words.iter().position(|word| word.address == address && is_main(word))?;
        Some(self.words.swap_remove(found).value)
    }

    /// Returns the number of an address, which then counts as used.
    pub(super) fn number(&mut self, address: &str) -> Outcome<Option<f64>> {
        let Some(word) = self.take(address) else { return Ok(None) };
        word.value.number().map(Some).map_err(|reason| format!("word {address}: {reason}"))
    }

    /// Returns the number of an address that must be 0 or positive, which then counts as used.
    pub(super) fn positive(&mut self, address: &str, largest: f64) -> Outcome<Option<f64>> {
        match self.number(address)? {
            Some(value) if !(0.0..=largest).contains(&value) => Err(format!(
                "word {address}: {} is invalid, must be between 0 and {largest:e}",
                Rounded(value)
            )),
            value => Ok(value),
        }
    }

    /// Returns the integer of an address, which then counts as used.
    pub(super) fn integer(&mut self, address: &str) -> Outcome<Option<u32>> {
        let Some(value) = self.number(address)? else { return Ok(None) };
        let required =
            || format!("word {address}: {} is invalid, an integer from 0 is required", Rounded(value));
        integer(value).map(Some).ok_or_else(required)
    }

    /// Returns true if an address has a word.
    pub(super) fn has(&self, address: &str) -> bool {
        self.words.iter().any(|word| word.address == address)
    }

    /// Returns true if an axis has a word.
    pub(super) fn has_axis(&self) -> bool {
        self.axes.iter().any(Option::is_some)
    }

    /// Returns true if the block has a keyword, which then counts as used.
    pub(super) fn take_keyword(&mut self, keyword: &str) -> bool {
        let found = self.keywords.iter().position(|word| word == keyword);
        found.map(|found| self.keywords.remove(found)).is_some()
    }

    /// Returns true if the block has a G code, which then counts as used.
    pub(super) fn take_g(&mut self, code: u32) -> bool {
        let found = self.g.iter().position(|found| *found == code);
        found.map(|found| self.g.remove(found)).is_some()
    }

    /// Returns the first G code of a group, which then counts as used.
    ///
    /// # Errors
    ///
    /// Two different codes of the group.
    pub(super) fn take_group(&mut self, group: &[u32]) -> Outcome<Option<u32>> {
        self.take_any(|code| group.contains(code))
    }

    /// Returns the first G code of a group, as [`take_group`](Self::take_group) does.
    pub(super) fn take_any(&mut self, is_of_group: impl Fn(&u32) -> bool) -> Outcome<Option<u32>> {
        let mut found = None;
        for &code in self.g.iter().filter(|code| is_of_group(code)) {
            match found {
                Some(other) if other != code => {
                    return Err(format!("G{other} and G{code} exclude each other in one block"));
                }
                _ => found = Some(code),
            }
        }
        self.g.retain(|code| !is_of_group(code));
        Ok(found)
    }

    /// Returns the addresses that nothing has used.
    pub(super) fn rest(&self) -> impl Iterator<Item = &str> {
        self.words.iter().map(|word| word.address.as_str())
    }
}

/// Separates the number of a spindle from the letter: S2, M1, T1.
fn split(address: &str, index: Option<ProgramValue>) -> (&str, Option<ProgramValue>) {
    let number = |rest: &str| rest.parse::<u32>().ok().map(|number| ProgramValue::Number(f64::from(number)));
    match (address.split_at_checked(1), index) {
        (Some((letter, rest)), None) if !rest.is_empty() && !NUMBERED.contains(&address) => {
            match number(rest).filter(|_| axis_of(address).is_none()) {
                Some(index) => (letter, Some(index)),
                None => (address, None),
            }
        }
        (_, index) => (address, index),
    }
}

fn code(letter: &str, value: WordValue) -> Outcome<u32> {
    let number = value.value.number().map_err(|reason| format!("word {letter}: {reason}"))?;
    integer(number).filter(|code| *code < 100_000).ok_or_else(|| format!("{letter}{number} is not a code"))
}
