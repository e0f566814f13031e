//! Words of a line with literal numbers, which are replaced in its text.

use std::fmt::Write;

/// Letters of words of a line whose points and feed are changed.
const LETTERS: &str = "NGXYZABCUVWIJKRFP";
/// G codes in tenths beside which a line is changed: motions at feed and modes.
const CODES: [u32; 16] = [10, 20, 30, 170, 180, 190, 200, 210, 610, 611, 640, 900, 910, 901, 911, 940];

/// Word of a line.
#[derive(Debug, Clone, Copy)]
struct Word {
    letter: char,
    /// First byte of the letter, first and last byte + 1 of the number.
    start: usize,
    number: usize,
    end: usize,
    decimals: usize,
}

/// Line whose words all have literal numbers.
#[derive(Debug, Clone)]
pub(super) struct WordLine {
    text: String,
    words: Vec<Word>,
}

impl WordLine {
    /// Reads a line; `None` if it has anything but words of motions at feed with literal numbers and comments.
    pub fn read(text: &str) -> Option<Self> {
        let line = Self::literal(text)?;
        let is_repeated = |index: usize, word: &Word| {
            word.letter != 'G' && line.words[..index].iter().any(|before| before.letter == word.letter)
        };
        let is_code = |word: &Word| {
            word.letter != 'G'
                || line.number(word).is_some_and(|code| CODES.contains(&((code * 10.0).round() as u32)))
        };
        let is_read = |(index, word): (usize, &Word)| {
            LETTERS.contains(word.letter) && !is_repeated(index, word) && is_code(word)
        };
        (!line.words.is_empty() && line.words.iter().enumerate().all(is_read)).then_some(line)
    }

    /// Returns letters and numbers of a line; `None` if it has anything but words with literal numbers and comments.
    pub fn literal_words(text: &str) -> Option<Vec<(char, f64)>> {
        let line = Self::literal(text)?;
        line.words.iter().map(|word| Some((word.letter, line.number(word)?))).collect()
    }

    fn literal(text: &str) -> Option<Self> {
        let bytes = text.as_bytes();
        let (mut words, mut at): (Vec<Word>, usize) = (Vec::new(), 0);
        while let Some(&byte) = bytes.get(at) {
            match byte {
                b' ' | b'\t' => at += 1,
                b';' => break,
                b'(' => at += text[at..].find(')')? + 1,
                b'a'..=b'z' | b'A'..=b'Z' => {
                    let letter = char::from(byte.to_ascii_uppercase());
                    let number = at + 1 + text[at + 1..].len() - text[at + 1..].trim_start_matches(' ').len();
                    let length = text[number..].find(|c: char| !matches!(c, '0'..='9' | '.' | '+' | '-'));
                    let end = length.map_or(text.len(), |length| number + length);
                    text[number..end].parse::<f64>().ok()?;
                    let decimals = text[number..end].split_once('.').map_or(0, |(_, digits)| digits.len());
                    words.push(Word { letter, start: at, number, end, decimals });
                    at = end;
                }
                _ => return None,
            }
        }
        Some(Self { text: text.to_owned(), words })
    }

    fn number(&self, word: &Word) -> Option<f64> {
        self.text[word.number..word.end].parse().ok()
    }

    /// Returns true for a line without words: blank, or a comment.
    pub fn is_comment(text: &str) -> bool {
        let text = text.trim();
        text.is_empty()
            || text.starts_with(';')
            || (text.starts_with('(') && text.find(')') == Some(text.len() - 1))
    }

    /// Returns the F word of a line that changes the feed without a motion, such as `G1 F1800`.
    pub fn feed_alone(text: &str) -> Option<f64> {
        let line = Self::read(text)?;
        let is_plain = |word: &Word| match word.letter {
            'G' => line.text[word.number..word.end].parse() == Ok(1.0),
            letter => "NF".contains(letter),
        };
        line.value('F').filter(|_| line.words.iter().all(is_plain))
    }

    /// Returns true if the line has a word.
    pub fn has(&self, letter: char) -> bool {
        self.words.iter().any(|word| word.letter == letter)
    }

    /// Returns the number of decimals of a word; 0 without it.
    pub fn decimals(&self, letter: char) -> usize {
        self.words.iter().find(|word| word.letter == letter).map_or(0, |word| word.decimals)
    }

    /// Returns the number of a word.
    pub fn value(&self, letter: char) -> Option<f64> {
        self.number(self.words.iter().find(|word| word.letter == letter)?)
    }

    /// Returns the text with other numbers: words that the line has are replaced, the others follow the last word of an axis.
    pub fn with(&self, numbers: &[(char, String)]) -> String {
        let after = self.words.iter().rposition(|word| "XYZABCUVW".contains(word.letter));
        let after = after.or(self.words.iter().rposition(|word| word.letter == 'G'));
        let after = after.unwrap_or(self.words.len() - 1);
        let has_spaces = self.words.windows(2).any(|pair| pair[1].start > pair[0].end);
        let mut out = String::new();
        let mut copied = 0;
        for (index, word) in self.words.iter().enumerate() {
            if let Some((_, number)) = numbers.iter().find(|(letter, _)| *letter == word.letter) {
                out += &self.text[copied..word.number];
                out += number;
                copied = word.end;
            }
            if index == after {
                out += &self.text[copied..word.end];
                copied = word.end;
                for (letter, number) in numbers.iter().filter(|(letter, _)| !self.has(*letter)) {
                    let space = if has_spaces || self.words.len() == 1 { " " } else { "" };
                    let _ = write!(out, "{space}{letter}{number}");
                }
            }
        }
        out + &self.text[copied..]
    }
}

/// Formats a number with decimals, without zeros at the end but one.
pub(super) fn number(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    let text = if text.contains('.') { text.trim_end_matches('0').to_owned() } else { text };
    let text = if text.ends_with('.') { text + "0" } else { text };
    if text == "-0.0" { "0.0".to_owned() } else { text }
}

/// Rounds a number to decimals.
pub(super) fn rounded(value: f64, decimals: usize) -> f64 {
    let scale = 10_f64.powi(decimals as i32);
    (value * scale).round() / scale
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_replace_those_of_the_words_and_missing_words_follow_the_last_axis() {
        let of = |text: &str, numbers: &[(char, &str)]| {
            let numbers: Vec<_> = numbers.iter().map(|(letter, n)| (*letter, (*n).to_owned())).collect();
            WordLine::read(text).map(|line| line.with(&numbers))
        };
        let changed = of("N10 G1 X1.5 (to X2) F100 ; end", &[('X', "1.6"), ('Y', "0.1"), ('F', "90.0")]);
        assert_eq!(changed.as_deref(), Some("N10 G1 X1.6 Y0.1 (to X2) F90.0 ; end"));
        assert_eq!(of("G1X1Y2F3", &[('Z', "4.0")]).as_deref(), Some("G1X1Y2Z4.0F3"));
        assert_eq!(of("g2 i-5", &[('X', "1.0"), ('I', "-5.1")]).as_deref(), Some("g2 X1.0 i-5.1"));
        assert_eq!(of("X 1.0", &[('X', "2.0")]).as_deref(), Some("X 2.0"));
        let left =
            ["X#1", "X[1+2]", "G4 P1", "G38.2 X1", "M3", "X1 X2", "", "G0 X1", "T1", "G1 X1 M8", "(", "é"];
        for text in left {
            assert!(WordLine::read(text).is_none(), "{text}");
        }
        assert_eq!([number(1.0, 4), number(-0.00001, 4), number(2.5, 1)], ["1.0", "0.0", "2.5"]);
    }
}
