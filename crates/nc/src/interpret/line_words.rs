//! Words of one line.

use virtual_axes_core::units::Rounded;

use super::codes::{Motion, g_name};
use super::dialect::Dialect;
use super::error::Outcome;
use super::expression::{Scanner, Target};
use super::limits::{MAX_CODES, MAX_RATE};
use super::parameters::integer;
use super::state::State;
use crate::motion::AXIS_LETTERS;

/// Number of letters.
const LETTERS: usize = 26;

/// Words and parameter settings of one line.
#[derive(Debug, Default)]
pub(super) struct LineWords {
    values: [f64; LETTERS],
    /// Bit of each letter with a word.
    given: u32,
    /// Bit of each letter with a word that no code has used yet.
    unused: u32,
    /// G codes, in tenths.
    pub g: Vec<u16>,
    /// M codes, without the ignored ones.
    pub m: Vec<u32>,
    /// Names of ignored codes, whose words have no effect.
    pub ignored: Vec<String>,
    /// True if the line has an ignored code.
    pub is_ignored_line: bool,
    /// True if an ignored code takes the axis words of its line, as a G code does.
    takes_axes: bool,
    /// Corner `,R` or `,C` with its value.
    pub corner: Option<(char, f64)>,
    /// Polar coordinates `@` (radius) and `^` (angle) of LinuxCNC.
    pub polar: [Option<f64>; 2],
    /// Bit of each letter whose number has a decimal point.
    points: u32,
    /// True if letters are arguments of a macro: G65, G66.
    is_macro: bool,
    /// Words I, J and K in their order.
    pub triples: Vec<(char, f64)>,
    /// First of two words T.
    pub first_tool: Option<f64>,
    /// Letter of a word without effect, whose variable, the number, has no value.
    pub vacant: Option<(char, usize)>,
    /// Error of a word that the line is executed without, if the interpreter continues after errors.
    pub rejected: Option<String>,
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
    pub(super) fn read(&mut self, text: &[u8], state: &State) -> Outcome<()> {
        (self.given, self.unused, self.points, self.corner, self.is_macro) = (0, 0, 0, None, false);
        (self.polar, self.vacant, self.first_tool, self.rejected) = ([None; 2], None, None, None);
        self.triples.clear();
        self.g.clear();
        self.m.clear();
        self.settings.clear();
        self.ignored.clear();
        (self.is_ignored_line, self.takes_axes) = (false, false);
        let mut scanner = Scanner::new(text, state);
        while let Some(byte) = scanner.peek() {
            match byte {
                b'#' => self.read_setting(&mut scanner)?,
                b'a'..=b'z' => self.read_word(&mut scanner, state)?,
                b'@' | b'^' if state.dialect == Dialect::LinuxCnc => {
                    scanner.take();
                    self.polar[usize::from(byte == b'^')] = Some(scanner.value()?);
                }
                // Number of a spindle.
                b'$' if state.dialect == Dialect::LinuxCnc => {
                    scanner.take();
                    scanner.value()?;
                }
                b',' if state.dialect.has_macro_b() => self.read_corner(&mut scanner)?,
                // An optional rest of the line, executed as optional lines are.
                b'/' if state.dialect.has_macro_b() && !state.options.skips_optional_lines => {
                    scanner.take();
                    if scanner.peek().is_some_and(|switch| switch.is_ascii_digit()) {
                        scanner.take();
                    }
                }
                b'/' if state.dialect != Dialect::LinuxCnc => break,
                _ => return Err(format!("{}: a word is required, a letter with a value", scanner.rest())),
            }
        }
        Ok(())
    }

    fn read_setting(&mut self, scanner: &mut Scanner<'_>) -> Outcome<()> {
        let target = match scanner.target()? {
            Target::Number(number) => Setting::Number(number),
            Target::Name(name) => Setting::Name(name.to_owned()),
        };
        if !scanner.skip("=") {
            return Err(format!("{}: a parameter setting requires =", scanner.found()));
        }
        let value = scanner.setting_value()?;
        require_count(self.settings.len(), "parameter settings")?;
        self.settings.push((target, value));
        Ok(())
    }

    /// Reads `,R5` or `,C2`.
    fn read_corner(&mut self, scanner: &mut Scanner<'_>) -> Outcome<()> {
        let text = scanner.rest();
        scanner.take();
        let letter = scanner.take().map(|letter| char::from(letter.to_ascii_uppercase()));
        let letter = letter.filter(|letter| matches!(letter, 'R' | 'C'));
        let letter = letter.ok_or_else(|| format!("{text}: only ,R and ,C are supported after a comma"))?;
        self.corner = Some((letter, scanner.value()?));
        Ok(())
    }

    fn read_word(&mut self, scanner: &mut Scanner<'_>, state: &State) -> Outcome<()> {
        let ignored = &state.options.ignored;
        let word = scanner.rest();
        let letter = scanner.take().unwrap_or_default();
        // I of M3 and M5 in Marlin follows the motion.
        let alone: &[u8] = if state.dialect == Dialect::Marlin { b"xyzabci" } else { b"xyzabc" };
        if state.dialect != Dialect::LinuxCnc && alone.contains(&letter) && scanner.has_no_value() {
            // A letter alone, as in G28 X.
            self.given |= 1 << index(letter);
            return Ok(());
        }
        let value = scanner
            .word_value()
            .map_err(|reason| format!("word {}: {reason}", char::from(letter.to_ascii_uppercase())))?;
        // A word with a parameter without value has no effect.
        let Some(value) = value else {
            self.vacant = Some((letter.to_ascii_uppercase().into(), state.vacant.take()));
            return Ok(());
        };
        match letter {
            b'g' => {
                require_count(self.g.len(), "G codes")?;
                let code = integer(value * 10.0)
                    .and_then(|code| u16::try_from(code).ok())
                    .filter(|code| *code < 10_000);
                let code = code.ok_or_else(|| format!("G{} is not a G code", Rounded(value)))?;
                if ignored.has_g(code) {
                    self.ignored.push(g_name(code));
                    self.takes_axes = true;
                } else {
                    self.is_macro |= state.dialect.has_macro_b() && matches!(code, 650 | 660);
                    self.g.push(code);
                }
            }
            b'm' if !self.is_macro => {
                let code = integer(value).ok_or_else(|| format!("M{} is not an M code", Rounded(value)))?;
                require_count(self.m.len() + self.ignored.len(), "M codes")?;
                if ignored.has_m(code) {
                    self.ignored.push(format!("M{code}"));
                    self.takes_axes |= state.dialect == Dialect::Marlin;
                } else {
                    self.m.push(code);
                }
            }
            b'n' if state.dialect == Dialect::LinuxCnc => {
                return Err("word N: the line number stands at the start of the line".to_owned());
            }
            // O of M3 in Marlin is the power of a laser.
            b'o' if state.dialect != Dialect::Marlin || self.m.is_empty() => {
                return Err(format!("{word}: an O-word stands at the start of the line"));
            }
            // The position of an extruder that G92 sets, beside G90 and G91, and its settings.
            b'e' if state.dialect == Dialect::Marlin
                && (self.g.iter().any(|code| matches!(code, 900 | 910 | 920))
                    || !self.m.is_empty()
                    || !self.ignored.is_empty()) =>
            {
                self.given |= 1 << index(letter);
            }
            // Analog outputs of LinuxCNC have the word E.
            b'e' if !state.dialect.has_macro_b() && !self.m.iter().any(|code| matches!(code, 66..=68)) => {
                self.rejected = Some(
                    "word E: the letter E is not supported, the extruder of a printer or the work offset of \
                     Fadal format 1; numbers have no exponent"
                        .to_owned(),
                );
            }
            _ => {
                let bit = 1 << index(letter);
                if self.unused & bit != 0 && matches!(state.dialect, Dialect::LinuxCnc | Dialect::Grbl) {
                    return Err(format!("two words {} in one line", char::from(letter.to_ascii_uppercase())));
                }
                if letter == b't' && self.unused & bit != 0 {
                    self.first_tool = self.first_tool.or(Some(self.values[index(letter)]));
                }
                if matches!(letter, b'i' | b'j' | b'k') && state.dialect.has_macro_b() {
                    require_count(self.triples.len(), "words I, J and K")?;
                    self.triples.push((letter.to_ascii_uppercase().into(), value));
                }
                self.given |= bit;
                self.unused |= bit;
                self.points |= if scanner.has_point() { bit } else { 0 };
                self.values[index(letter)] = value;
            }
        }
        Ok(())
    }

    /// Returns true if the number of a word has a decimal point. `letter` is in upper case.
    pub(super) fn has_point(&self, letter: char) -> bool {
        self.points & (1 << index(letter as u8)) != 0
    }

    /// Returns true if the line has a word, used or not. `letter` is in upper case.
    pub(super) fn was_given(&self, letter: char) -> bool {
        self.given & (1 << index(letter as u8)) != 0
    }

    /// Marks words as used. Letters are in upper case.
    pub(super) fn skip(&mut self, letters: &str) {
        for letter in letters.chars() {
            self.take(letter);
        }
    }

    /// Returns the value of a word, which then counts as used. `letter` is in upper case.
    pub(super) fn take(&mut self, letter: char) -> Option<f64> {
        let value = self.get(letter);
        self.unused &= !(1 << index(letter as u8));
        value
    }

    /// Removes the fraction of a word. `letter` is in upper case.
    pub(super) fn truncate(&mut self, letter: char) {
        let value = &mut self.values[index(letter as u8)];
        *value = value.trunc();
    }

    /// Returns the value of a word that must be 0 or positive, which then counts as used.
    pub(super) fn take_rate(&mut self, letter: char) -> Outcome<Option<f64>> {
        match self.take(letter) {
            Some(value) if !(0.0..=MAX_RATE).contains(&value) => Err(format!(
                "word {letter}: {} is invalid, must be between 0 and {MAX_RATE:e}",
                Rounded(value)
            )),
            value => Ok(value),
        }
    }

    /// Returns the value of a word that is not used yet. `letter` is in upper case.
    pub(super) fn get(&self, letter: char) -> Option<f64> {
        let index = index(letter as u8);
        (self.unused & (1 << index) != 0).then(|| self.values[index])
    }

    /// Returns the value of a word as an integer from 0, which then counts as used.
    pub(super) fn take_integer(&mut self, letter: char) -> Outcome<Option<u32>> {
        let Some(value) = self.take(letter) else { return Ok(None) };
        let required =
            || format!("word {letter}: {} is invalid, an integer from 0 is required", Rounded(value));
        integer(value).map(Some).ok_or_else(required)
    }

    /// Returns true if one of the letters has a word that is not used yet. Letters are in upper case.
    pub(super) fn has_any(&self, letters: &[char]) -> bool {
        letters.iter().any(|letter| self.get(*letter).is_some())
    }

    /// Returns true if an axis has a word that is not used yet.
    pub(super) fn has_axis(&self) -> bool {
        self.has_any(&AXIS_LETTERS) || self.polar != [None; 2]
    }

    /// Returns true without word, code and setting.
    pub(super) fn is_empty(&self) -> bool {
        self.unused == 0
            && self.corner.is_none()
            && self.g.is_empty()
            && self.m.is_empty()
            && self.settings.is_empty()
    }

    /// Returns true if all codes are ignored and the words belong to them: the axis words of an M code move the axes.
    pub(super) fn is_ignored(&self) -> bool {
        let takes_words = self.takes_axes || !self.has_axis();
        self.is_ignored_line && takes_words && self.g.is_empty() && self.m.is_empty()
    }

    /// Rejects words that no code has used.
    pub(super) fn require_used(&self) -> Outcome<()> {
        if self.unused == 0 || self.is_ignored_line {
            return Ok(());
        }
        let letter = char::from(b'A' + self.unused.trailing_zeros() as u8);
        let codes =
            self.g.iter().map(|code| g_name(*code)).chain(self.m.iter().map(|code| format!("M{code}")));
        let codes = codes.collect::<Vec<_>>().join(" ");
        let hint = match letter {
            'L' if codes.is_empty() => "; the subprograms of Fadal format 1 are not supported",
            'R' if self.g.contains(&Motion::Line.number()) => "; a rounded corner is ,R",
            _ => "",
        };
        let codes = if codes.is_empty() { "without a code".to_owned() } else { format!("with {codes}") };
        Err(format!(
            "word {letter} has no effect in this line {codes}: remove it, or program the code that it belongs to{hint}"
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
