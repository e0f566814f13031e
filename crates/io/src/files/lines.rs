//! Lines of a text, one at a time, each of bounded length, and the fields of a line.

use std::io::{ErrorKind, Read};

use memchr::memchr;

/// Longest line, bytes: far more than a setpoint of any machine needs.
const LONGEST: usize = 1 << 16;
/// Bytes that are held: reading has few calls then, and stays within a processor's cache.
const HELD: usize = 4 * LONGEST;
/// What some programs put before a text in UTF-8.
const BYTE_ORDER_MARK: char = '\u{feff}';
/// What is said of bytes that are no text.
const NOT_TEXT: &str = "stream did not contain valid UTF-8";

/// Lines that are not blank, with their numbers.
#[derive(Debug)]
pub(super) struct Lines<R> {
    input: R,
    held: Vec<u8>,
    /// Where the next line begins, and where what was read ends.
    begin: usize,
    end: usize,
    number: u64,
    /// Whether the line that was read last has an end.
    ended: bool,
}

impl<R: Read> Lines<R> {
    pub fn new(input: R) -> Self {
        Lines { input, held: vec![0; HELD], begin: 0, end: 0, number: 0, ended: false }
    }

    /// The next line that is not blank, without what ends it, and its number from 1. A line of tabs is
    /// blank.
    ///
    /// # Errors
    /// What is wrong with the file, and the line that is read.
    pub fn next(&mut self) -> Result<Option<(u64, &str)>, (u64, String)> {
        loop {
            self.number += 1;
            let number = self.number;
            let length = self.fill().map_err(|reason| (number, reason))?;
            if length == 0 {
                return Ok(None);
            }
            let begin = self.begin;
            self.begin += length;
            let line = &self.held[begin..begin + length];
            // A line that begins with a digit or a letter needs no further look.
            if !line[0].is_ascii_graphic() {
                let text = str::from_utf8(line).map_err(|_| (number, NOT_TEXT.to_owned()))?;
                if text.trim_matches(BYTE_ORDER_MARK).trim().is_empty() {
                    continue;
                }
            }
            let bare = bare_length(line);
            self.ended = bare < length;
            let text =
                str::from_utf8(&self.held[begin..begin + bare]).map_err(|_| (number, NOT_TEXT.to_owned()))?;
            let text = if number == 1 { text.trim_start_matches(BYTE_ORDER_MARK) } else { text };
            return Ok(Some((number, text)));
        }
    }

    /// Reads until a whole line stands at `begin`; its length with what ends it, 0 at the end of the file.
    fn fill(&mut self) -> Result<usize, String> {
        let mut searched = 0;
        loop {
            let there = &self.held[self.begin..self.end];
            let within = &there[..there.len().min(LONGEST)];
            if let Some(place) = memchr(b'\n', &within[searched..]) {
                return Ok(searched + place + 1);
            }
            if within.len() == LONGEST {
                return Err(format!("the line is longer than {LONGEST} bytes"));
            }
            searched = within.len();
            if self.begin > 0 {
                self.held.copy_within(self.begin..self.end, 0);
                (self.begin, self.end) = (0, self.end - self.begin);
            }
            match self.input.read(&mut self.held[self.end..]) {
                Ok(0) => return Ok(searched),
                Ok(read) => self.end += read,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(error.to_string()),
            }
        }
    }

    /// Whether the line that was read last has an end.
    pub fn is_ended(&self) -> bool {
        self.ended
    }
}

/// Length of a line without what ends it.
fn bare_length(line: &[u8]) -> usize {
    line.len() - line.iter().rev().take_while(|byte| matches!(byte, b'\r' | b'\n')).count()
}

/// The fields of a line of CSV, without the spaces and the quotation marks around them.
pub(super) fn fields(line: &str) -> Fields<'_> {
    fields_between(line, ',')
}

/// The fields of a line between delimiters, likewise; one within quotation marks is part of the field.
pub(super) fn fields_between(line: &str, delimiter: char) -> Fields<'_> {
    let plain = u8::try_from(delimiter).ok().filter(u8::is_ascii);
    let plain = plain.filter(|_| memchr(b'"', line.as_bytes()).is_none());
    Fields { rest: Some(line), delimiter, plain }
}

/// Fields of a line.
#[derive(Debug, Clone)]
pub(super) struct Fields<'a> {
    /// What is left; none behind the last field.
    rest: Option<&'a str>,
    delimiter: char,
    /// The delimiter as a byte, where it is one and no field has quotation marks.
    plain: Option<u8>,
}

impl Fields<'_> {
    /// Where the next field ends in `rest`, if not with it.
    fn end(&self, rest: &str) -> Option<usize> {
        if let Some(delimiter) = self.plain {
            // Fields are too short for a search to pay.
            return rest.bytes().position(|byte| byte == delimiter);
        }
        let mut quoted = false;
        rest.find(|c| {
            quoted ^= c == '"';
            c == self.delimiter && !quoted
        })
    }
}

impl<'a> Iterator for Fields<'a> {
    type Item = &'a str;

    fn next(&mut self) -> Option<&'a str> {
        let rest = self.rest?;
        let field = match self.end(rest) {
            Some(end) => {
                self.rest = Some(&rest[end + self.delimiter.len_utf8()..]);
                &rest[..end]
            }
            None => {
                self.rest = None;
                rest
            }
        };
        let bare = |byte: Option<&u8>| byte.is_some_and(|byte| byte.is_ascii_graphic() && *byte != b'"');
        let bytes = field.as_bytes();
        if bare(bytes.first()) && bare(bytes.last()) {
            return Some(field);
        }
        let field = field.trim();
        Some(field.strip_prefix('"').and_then(|f| f.strip_suffix('"')).map_or(field, str::trim))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Hands out a few bytes at a time.
    struct Few<'a>(&'a [u8], usize);

    impl Read for Few<'_> {
        fn read(&mut self, into: &mut [u8]) -> std::io::Result<usize> {
            let count = self.1.min(self.0.len()).min(into.len());
            into[..count].copy_from_slice(&self.0[..count]);
            self.0 = &self.0[count..];
            Ok(count)
        }
    }

    fn all(input: impl Read) -> (Vec<(u64, String)>, bool) {
        let mut lines = Lines::new(input);
        let mut found = Vec::new();
        while let Some((number, text)) = lines.next().expect("text") {
            found.push((number, text.to_owned()));
        }
        let ended = lines.is_ended();
        (found, ended)
    }

    #[test]
    fn lines_are_bare_and_numbered_and_blank_ones_are_left_out() {
        let text = "\u{feff}a,b\r\n\r\n \t\n\u{feff}\n1\n\nlast";
        let wanted = [(1, "a,b"), (5, "1"), (7, "last")].map(|(n, text)| (n, text.to_owned()));
        for step in [1, 3, 1000] {
            assert_eq!(all(Few(text.as_bytes(), step)), (wanted.to_vec(), false));
        }
        assert!(all("1\r".as_bytes()).1 && all("1\n\n".as_bytes()).1);
    }

    #[test]
    fn the_longest_line_is_read_and_one_byte_more_is_not() {
        let line = "1".repeat(LONGEST - 1) + "\n";
        let text = "0\n".to_owned() + &line.repeat(9);
        assert_eq!(all(text.as_bytes()).0.len(), 10);
        let mut lines = Lines::new(Few(b"0\n", 1).chain(std::io::repeat(b'1').take(LONGEST as u64)));
        assert_eq!(lines.next(), Ok(Some((1, "0"))));
        assert_eq!(lines.next(), Err((2, format!("the line is longer than {LONGEST} bytes"))));
    }

    proptest! {
        #[test]
        fn fields_are_split_where_no_quotation_mark_is_open(
            text in "[a;, \"\u{e9}0-9.]{0,30}", delimiter in prop::sample::select(vec![',', ';', '\u{e9}'])
        ) {
            let mut quoted = false;
            let split = text.split(|c| {
                quoted ^= c == '"';
                c == delimiter && !quoted
            });
            let wanted: Vec<&str> = split
                .map(str::trim)
                .map(|f| f.strip_prefix('"').and_then(|f| f.strip_suffix('"')).map_or(f, str::trim))
                .collect();
            prop_assert_eq!(fields_between(&text, delimiter).collect::<Vec<_>>(), wanted);
        }

        #[test]
        fn lines_are_those_of_the_text_however_it_arrives(text in "[a\r\n \t]{0,60}", step in 1usize..9) {
            let wanted: Vec<(u64, String)> = text
                .split_inclusive('\n')
                .zip(1..)
                .filter(|(line, _)| !line.trim().is_empty())
                .map(|(line, number)| (number, line.trim_end_matches(['\r', '\n']).to_owned()))
                .collect();
            prop_assert_eq!(all(Few(text.as_bytes(), step)).0, wanted);
        }
    }
}
