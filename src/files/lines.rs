//! Lines of a text, one at a time, each of bounded length.

use std::io::{BufRead, BufReader, Read};

/// Longest line, bytes: far more than a set-point of any machine needs.
const LONGEST: u64 = 1 << 16;
/// What some programs put before a text in UTF-8.
const BYTE_ORDER_MARK: char = '\u{feff}';

/// Lines that are not blank, with their numbers.
#[derive(Debug)]
pub(super) struct Lines<R> {
    input: BufReader<R>,
    line: String,
    number: u64,
}

impl<R: Read> Lines<R> {
    pub fn new(input: R) -> Self {
        Lines { input: BufReader::new(input), line: String::new(), number: 0 }
    }

    /// The next line that is not blank, without what ends it, and its number from 1. A line of tabs is
    /// blank.
    ///
    /// # Errors
    /// What is wrong with the file, and the line that is read.
    pub fn next(&mut self) -> Result<Option<(u64, &str)>, (u64, String)> {
        loop {
            self.line.clear();
            let read = (&mut self.input).take(LONGEST).read_line(&mut self.line);
            self.number += 1;
            let read = read.map_err(|error| (self.number, error.to_string()))?;
            if read == 0 {
                return Ok(None);
            }
            if read as u64 == LONGEST && !self.line.ends_with('\n') {
                return Err((self.number, format!("the line is longer than {LONGEST} bytes")));
            }
            if !self.line.trim_matches(BYTE_ORDER_MARK).trim().is_empty() {
                break;
            }
        }
        let line = if self.number == 1 { self.line.trim_start_matches(BYTE_ORDER_MARK) } else { &self.line };
        Ok(Some((self.number, line.trim_end_matches(['\r', '\n']))))
    }

    /// Whether the line that was read last has an end.
    pub fn is_ended(&self) -> bool {
        self.line.ends_with(['\r', '\n'])
    }
}

/// The fields of a line of CSV, without the spaces and the quotation marks around them.
pub(super) fn fields(line: &str) -> impl Iterator<Item = &str> {
    fields_between(line, ',')
}

/// The fields of a line between delimiters, likewise; one within quotation marks is part of the field.
pub(super) fn fields_between(line: &str, delimiter: char) -> impl Iterator<Item = &str> {
    let mut quoted = false;
    let split = line.split(move |c| {
        quoted ^= c == '"';
        c == delimiter && !quoted
    });
    split.map(|field| {
        let field = field.trim();
        field.strip_prefix('"').and_then(|f| f.strip_suffix('"')).map_or(field, str::trim)
    })
}
