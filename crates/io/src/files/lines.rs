//! Streaming line reader with a maximum line length, and a splitter of CSV fields.

use std::io::{ErrorKind, Read};

use memchr::memchr;
use virtual_axes_core::encoding::TextReader;

/// Maximum length of a line, bytes.
const MAX_LINE_BYTES: usize = 1 << 16;
/// Size of the read buffer, bytes: few system calls, and within the processor cache.
const BUFFER_BYTES: usize = 4 * MAX_LINE_BYTES;
/// Byte order mark within a text, as of joined files.
const BYTE_ORDER_MARK: char = '\u{feff}';
/// Error message for bytes that are not UTF-8.
const NOT_UTF8: &str = "stream did not contain valid UTF-8";

/// Reader of the lines of a text in any encoding that are not blank, with their numbers.
#[derive(Debug)]
pub(super) struct Lines<R> {
    input: TextReader<R>,
    buffer: Vec<u8>,
    /// Start of the next line in `buffer`.
    begin: usize,
    /// End of the bytes read into `buffer`.
    end: usize,
    number: u64,
    /// True if the last line read ends with a line break.
    ended: bool,
}

impl<R: Read> Lines<R> {
    pub fn new(input: R) -> Self {
        Lines {
            input: TextReader::new(input),
            buffer: vec![0; BUFFER_BYTES],
            begin: 0,
            end: 0,
            number: 0,
            ended: false,
        }
    }

    /// Returns the next line that is not blank, without its line break, and its number from 1. Lines of white
    /// space are blank.
    ///
    /// # Errors
    /// Returns the line number and the reason if the line is too long or cannot be read.
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
            let line = &self.buffer[begin..begin + length];
            // A line that begins with a digit or a letter is not blank.
            if !line[0].is_ascii_graphic() {
                let text = str::from_utf8(line).map_err(|_| (number, NOT_UTF8.to_owned()))?;
                if text.trim_matches(BYTE_ORDER_MARK).trim().is_empty() {
                    continue;
                }
            }
            let bare = bare_length(line);
            self.ended = bare < length;
            let text = str::from_utf8(&self.buffer[begin..begin + bare])
                .map_err(|_| (number, NOT_UTF8.to_owned()))?;
            return Ok(Some((number, text)));
        }
    }

    /// Reads until the buffer holds a complete line at `begin`, and returns its length with its line break; 0 at
    /// the end of the file.
    fn fill(&mut self) -> Result<usize, String> {
        let mut searched = 0;
        loop {
            let there = &self.buffer[self.begin..self.end];
            let within = &there[..there.len().min(MAX_LINE_BYTES)];
            if let Some(index) = memchr(b'\n', &within[searched..]) {
                return Ok(searched + index + 1);
            }
            if within.len() == MAX_LINE_BYTES {
                return Err(format!("the line is longer than {MAX_LINE_BYTES} bytes"));
            }
            searched = within.len();
            if self.begin > 0 {
                self.buffer.copy_within(self.begin..self.end, 0);
                (self.begin, self.end) = (0, self.end - self.begin);
            }
            match self.input.read(&mut self.buffer[self.end..]) {
                Ok(0) => return Ok(searched),
                Ok(read) => self.end += read,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(error.to_string()),
            }
        }
    }

    /// Returns true if the last line read ends with a line break.
    pub fn is_ended(&self) -> bool {
        self.ended
    }
}

/// Returns the length of a line without its line break.
fn bare_length(line: &[u8]) -> usize {
    line.len() - line.iter().rev().take_while(|byte| matches!(byte, b'\r' | b'\n')).count()
}

/// Splits a comma-separated line into fields, without surrounding spaces and quotation marks.
pub(super) fn fields(line: &str) -> Fields<'_> {
    fields_between(line, ',')
}

/// Splits a line at a delimiter into fields, without surrounding spaces and quotation marks. A delimiter within
/// quotation marks belongs to the field. Several blanks are one delimiter.
pub(super) fn fields_between(line: &str, delimiter: char) -> Fields<'_> {
    let line = if delimiter == ' ' { line.trim() } else { line };
    let plain = u8::try_from(delimiter).ok().filter(u8::is_ascii);
    let plain = plain.filter(|_| memchr(b'"', line.as_bytes()).is_none());
    Fields { rest: Some(line), delimiter, plain }
}

/// Iterator over the fields of a line.
#[derive(Debug, Clone)]
pub(super) struct Fields<'a> {
    /// Rest of the line; `None` after the last field.
    rest: Option<&'a str>,
    delimiter: char,
    /// Delimiter as a byte, if it is ASCII and the line has no quotation marks.
    plain: Option<u8>,
}

impl Fields<'_> {
    /// Returns the end of the first field of `rest`; `None` if `rest` is the last field.
    fn end(&self, rest: &str) -> Option<usize> {
        if let Some(delimiter) = self.plain {
            // Fields are too short for memchr.
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
                let after = &rest[end + self.delimiter.len_utf8()..];
                self.rest = Some(if self.delimiter == ' ' { after.trim_start() } else { after });
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

    /// Reader that returns a few bytes per call.
    struct ShortReads<'a>(&'a [u8], usize);

    impl Read for ShortReads<'_> {
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
    fn blank_lines_are_skipped_and_lines_have_numbers_and_no_line_break() {
        let text = "\u{feff}a,b\r\n\r\n \t\n\u{feff}\n1\n\nlast";
        let wanted = [(1, "a,b"), (5, "1"), (7, "last")].map(|(n, text)| (n, text.to_owned()));
        for step in [1, 3, 1000] {
            assert_eq!(all(ShortReads(text.as_bytes(), step)), (wanted.to_vec(), false));
        }
        assert!(all("1\r".as_bytes()).1 && all("1\n\n".as_bytes()).1);
    }

    #[test]
    fn a_line_longer_than_the_maximum_is_rejected() {
        let line = "1".repeat(MAX_LINE_BYTES - 1) + "\n";
        let text = "0\n".to_owned() + &line.repeat(9);
        assert_eq!(all(text.as_bytes()).0.len(), 10);
        let mut lines =
            Lines::new(ShortReads(b"0\n", 1).chain(std::io::repeat(b'1').take(MAX_LINE_BYTES as u64)));
        assert_eq!(lines.next(), Ok(Some((1, "0"))));
        assert_eq!(lines.next(), Err((2, format!("the line is longer than {MAX_LINE_BYTES} bytes"))));
    }

    proptest! {
        #[test]
        fn fields_are_split_at_delimiters_outside_quotation_marks(
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
        fn several_blanks_are_one_delimiter(words in prop::collection::vec("[a0.]{1,3}", 1..6), blanks in 1usize..4) {
            let line = " ".to_owned() + &words.join(&" ".repeat(blanks)) + "  ";
            prop_assert_eq!(fields_between(&line, ' ').collect::<Vec<_>>(), words);
        }

        #[test]
        fn lines_do_not_depend_on_the_sizes_of_reads(text in "[a\r\n \t]{0,60}", step in 1usize..9) {
            let wanted: Vec<(u64, String)> = text
                .split_inclusive('\n')
                .zip(1..)
                .filter(|(line, _)| !line.trim().is_empty())
                .map(|(line, number)| (number, line.trim_end_matches(['\r', '\n']).to_owned()))
                .collect();
            prop_assert_eq!(all(ShortReads(text.as_bytes(), step)).0, wanted);
        }
    }
}
