//! Lines of a program, with bounded memory and a bounded number of repetitions.

use std::io::{BufRead, Read, Seek, SeekFrom};

use super::error::Outcome;
use super::limits::{MAX_IDLE_LINES, MAX_LINE};

/// Start of a line in the source.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Place {
    /// Bytes before the line.
    offset: u64,
    /// Number of lines before the line.
    lines: usize,
}

/// Source of lines.
#[derive(Debug)]
pub(super) struct LineSource<R> {
    reader: R,
    next: Place,
    /// End of the farthest line that was read, bytes.
    farthest: u64,
    /// Number of lines that jumps may repeat, in all and from now on.
    repeated_lines: u64,
    repeats_left: u64,
    /// Number of lines repeated since the last step of the program.
    idle_lines: u64,
    /// True after the first line with text.
    has_text: bool,
}

impl<R: BufRead + Seek> LineSource<R> {
    pub(super) fn new(reader: R, repeated_lines: u64) -> Self {
        let next = Place { offset: 0, lines: 0 };
        Self {
            reader,
            next,
            farthest: 0,
            repeated_lines,
            repeats_left: repeated_lines,
            idle_lines: 0,
            has_text: false,
        }
    }

    /// Returns the number of the line that was read last, from 1.
    pub(super) fn line(&self) -> usize {
        self.next.lines.max(1)
    }

    /// Returns the start of the next line.
    pub(super) fn place(&self) -> Place {
        self.next
    }

    /// Continues at `place`.
    pub(super) fn jump(&mut self, place: Place) -> Outcome<()> {
        self.reader.seek(SeekFrom::Start(place.offset)).map_err(|error| error.to_string())?;
        self.next = place;
        Ok(())
    }

    /// Continues at the first line.
    pub(super) fn rewind(&mut self) -> Outcome<()> {
        self.has_text = false;
        self.jump(Place { offset: 0, lines: 0 })
    }

    /// Reads the next line into `line`, without its end; returns false at the end of the program.
    ///
    /// # Errors
    ///
    /// A line that is too long, too many repeated lines, or an error of the operating system.
    pub(super) fn read(&mut self, line: &mut Vec<u8>) -> Outcome<bool> {
        if !self.read_raw(line)? {
            return Ok(false);
        }
        if self.next.offset > self.farthest {
            self.farthest = self.next.offset;
            return Ok(true);
        }
        self.idle_lines += 1;
        if self.idle_lines > MAX_IDLE_LINES {
            return Err(format!("endless loop: {MAX_IDLE_LINES} repeated lines without motion or event"));
        }
        if self.repeats_left == 0 {
            return Err(format!(
                "endless loop: the loops of the program repeat more than {} lines",
                self.repeated_lines
            ));
        }
        self.repeats_left -= 1;
        Ok(true)
    }

    /// Counts the repeated lines without a step from 0.
    pub(super) fn reset_idle_lines(&mut self) {
        self.idle_lines = 0;
    }

    /// Reads the next line without counting repetitions; returns false at the end of the program.
    pub(super) fn read_raw(&mut self, line: &mut Vec<u8>) -> Outcome<bool> {
        loop {
            line.clear();
            let limit = MAX_LINE as u64 + 2;
            let read = self
                .reader
                .by_ref()
                .take(limit)
                .read_until(b'\n', line)
                .map_err(|error| error.to_string())?;
            if read == 0 {
                return Ok(false);
            }
            let is_first = self.next.offset == 0;
            self.next = Place { offset: self.next.offset + read as u64, lines: self.next.lines + 1 };
            while matches!(line.last(), Some(b'\n' | b'\r')) {
                line.pop();
            }
            if line.len() > MAX_LINE {
                return Err(format!("the line is longer than {MAX_LINE} bytes"));
            }
            if is_first && line.starts_with("\u{feff}".as_bytes()) {
                line.drain(..3);
            }
            let text = line.trim_ascii();
            // A percent sign encloses the program: before its first line with text, and after its last.
            if let Some(rest) = text.strip_prefix(b"%") {
                if !is_comment(rest) {
                    return Err("% encloses the program and is alone on its line".to_owned());
                }
                if self.has_text {
                    return Ok(false);
                }
                self.has_text = true;
                continue;
            }
            self.has_text |= !is_comment(text);
            return Ok(true);
        }
    }
}

/// Returns true if a line, or its rest, has nothing but comments.
fn is_comment(text: &[u8]) -> bool {
    let text = text.trim_ascii();
    match text.first() {
        None | Some(b';') => true,
        Some(b'(') => match text.iter().position(|byte| *byte == b')') {
            Some(end) => is_comment(&text[end + 1..]),
            None => false,
        },
        Some(_) => false,
    }
}
